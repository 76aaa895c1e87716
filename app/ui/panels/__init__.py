"""Panels: each is `draw(state, view_model) -> state`; none knows OpenGL, files or the renderer."""
