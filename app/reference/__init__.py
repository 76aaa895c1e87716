"""The float64 references: independent tracers that pictures are measured against, and the papers' formulas in numpy.

`photon_reference` (light tracer) and `camera_reference` (camera tracer, with the `spectral_caustic`) are compiled with
numba and share `scattering`, `sampling` and `photon_intersect`, but nothing with the shaders. `optics`, `emission`,
`glasses` and `random_numbers` are plain numpy; `metrics` says how far a picture is from its reference. The slow,
readable tracer that checks the shaders step by step is in tests/reference and shares nothing with either.
"""

"""The float64 references: independent tracers that pictures are measured against, and the papers' formulas in numpy.

`photon_reference` (light tracer) and `camera_reference` (camera tracer, with the `spectral_caustic`) are compiled with
numba and share `scattering`, `sampling` and `photon_intersect`, but nothing with the shaders. `optics`, `emission`,
`glasses` and `random_numbers` are plain numpy; `metrics` says how far a picture is from its reference. The slow,
readable tracer that checks the shaders step by step is in tests/reference and shares nothing with either.
"""
