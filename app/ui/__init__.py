"""The viewer: a document with undo, panels that are functions of a state, and the window they are drawn in."""
