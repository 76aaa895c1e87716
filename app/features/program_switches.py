"""Switches that a program adds to those of the scene (`Features`): which of its variants it is.

Every name that shaders test, with 1 or 0, is here or in the scene's table, and nowhere twice: what is misspelt in a
pass is found (`switched`), and what a shader tests is known to be 0 where nobody set it.
"""

from __future__ import annotations

PROGRAM_SWITCHES: dict[str, str] = {
    # emit.comp
    "LIGHT_AREA": "the light's emission domain is of places and directions",
    "LIGHT_PLANE": "… of places, all in one direction or in a small cone",
    "LIGHT_PROFILE": "… of directions, by a table of intensities",
    "THINNED_CELLS": "some cells of the domain emit only a share of their photons",
    "RANDOM_WAVELENGTH": "wavelengths are drawn at random",
    "EVEN_WAVELENGTHS": "random wavelengths follow a low-discrepancy sequence",
    "LOOPS_MAY_END": "the driver ends a loop of too many rounds",
    # environment.comp and bounce.comp
    "FOLLOWS_SPECULAR": "directions go on beyond glass and mirrors",
    # splats and beams
    "ONE_COLOUR": "no wavelength moves a splat: it is a Gaussian of one colour",
    "SMALL": "splats of about a texel",
    "SWEPT": "splats swept along their spectrum",
    "CUT": "splats of a band that was cut",
    "EDGE": "splats over an edge of their window",
    "CLIPPED": "each fragment tests the splat's rectangle",
    "FANS": "the footprint's W changes over it",
    "STILL": "a beam's polygon does not move over its band",
    "FLOAT_ATOMICS": "the device adds float32 atomically",
    "FILL": "the program that fills seams between charts",
    # camera
    "LAYER_BEAUTY": "the picture has direct light, and what is seen beyond glass and mirrors",
    "CAMERA_SPECULAR": "camera rays go on beyond glass and mirrors",
    "LISTS_SPECULAR": "what is seen directly, listing pixels that see glass or mirrors",
    "FOLLOWED": "another program follows the listed pixels",
    "HAS_DISPERSION": "camera rays may pass glass that disperses",
    "SPECTRAL_SWEEP": "camera rays carry a band along spectral columns",
    "RGB_CHANNELS": "the picture's channels are red, green and blue",
    "MAP_BINS": "caustic maps hold a spectrum that camera rays look up",
    "HAS_RECEIVERS": "something is neither glass nor mirror",
    "RECEIVER_LIGHT": "textures of indirect light are looked up on receivers",
    "VISIBLE_LIGHTS": "some light is seen itself",
    "HALTS": "a sample halts after many rounds of its loops, and another dispatch resumes it",
    "IN_MOTION": "pictures in motion",
    "DISTANCES": "what is seen first is written with its distance",
    # where data lies
    "LIGHTS_IN_STORAGE": "lights are more than a uniform block holds",
    "SOLIDS_IN_STORAGE": "solids are more than a uniform block holds",
    "SCENE_IMAGE": "scene and spectra are read as images",
    "TEXTURES_IMAGE": "pictures are read as images",
    "HAS_IMAGES": "the scene has pictures",
    "HAS_TEXTURES": "some surface has a texture",
    "HAS_ENVIRONMENT_MAP": "a picture surrounds the scene",
    # display
    "ANTIALIAS": "the picture is shrunk with a filter",
    "AS_IMAGE": "the picture is read as an image",
    "SAME_SIZE": "a pixel of the picture is one of the screen",
    "BESIDE_IS_NEXT": "the picture is not enlarged",
    "HALO": "light that the lens scatters is added",
    "SHOW_ERROR": "the difference from another picture is shown",
    "TONE_ACES": "tone mapping",
    "TONE_FALSE_COLOUR": "",
    "TONE_REINHARD": "",
    "TONE_SPECTRASPLAT": "",
    # glare.comp
    "HALVE": "stages of glare",
    "SHRINK": "",
    "SOFTEN": "",
    "SPREAD": "",
}
"""By name: what it says of the program."""
