"""One light pass and one camera pass, one frame, and what drives it. (`api` makes the package callable as well.)"""
