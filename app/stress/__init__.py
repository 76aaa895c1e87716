"""`spectrasplat stress`: stiff and extreme cases, each a sweep of severities compared with float64 within a
stated bound."""
