"""`spectrasplat stress`: stiff and extreme cases, each a sweep of severities held against float64 and a stated
bound."""
