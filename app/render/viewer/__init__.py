"""The renderer that never stops: progressive light and camera halves within a time budget, for the viewer and for
animations."""
