"""A caustic on one page for a browser: photons and polygons whose dispersion is still open, and what shows them."""
