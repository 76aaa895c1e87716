"""Panels: each is `draw(state, facts) -> state`; none knows OpenGL, files or the renderer."""
