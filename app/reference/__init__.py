"""The float64 reference: slow, readable CPU references of what the shaders compute, and the rigs that hold shaders
against them.

`optics`, `surfaces`, `tracer`, `splat`, `glasses` are plain numpy and share no code with the
shaders or with the rest of the program. `glsl_function`, `gpu_paths`, `far_field` and
`splat_rig` run the real shaders on inputs made for one question; `path_check` holds both against each other.
Tests and `spectrasplat stress` use all of them.
"""
