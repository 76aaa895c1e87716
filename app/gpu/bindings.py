"""Binding points of storage buffers and textures, one name for both sides."""

from __future__ import annotations

SOLIDS, PLANES, PROFILES = 3, 4, 5
PARAMETERS = 7
RAYS_IN, RAYS_OUT, OUTCOMES, PHOTON_SLOTS, INDICES, COUNTS, STATE, PHOTONS = range(8, 16)

POOL_SLOTS = PHOTON_SLOTS
"""Where rays lie in a pool, photons need no slots first."""
FLIGHTS = 16

UNIT_PLACES, UNIT_SCENE, UNIT_SPECTRA = 13, 14, 15
"""Texture units of the scene; a pass is free to use 0-12 as it likes."""
PLACES_A_ROW = 256
"""Objects of a row of the texture of places."""
IMAGE_SCENE, IMAGE_SPECTRA = 8, 9
"""Image units of the scene on llvmpipe; a pass is free to use 0-7 and those from 10 on as it likes."""

SCENE_DEFINES = {
    "BIND_SOLIDS": SOLIDS,
    "BIND_PLANES": PLANES,
    "BIND_PROFILES": PROFILES,
    "UNIT_PLACES": UNIT_PLACES,
    "PLACES_A_ROW": PLACES_A_ROW,
    "UNIT_SCENE": UNIT_SCENE,
    "UNIT_SPECTRA": UNIT_SPECTRA,
    "IMAGE_SCENE": IMAGE_SCENE,
    "IMAGE_SPECTRA": IMAGE_SPECTRA,
    "BIND_PARAMETERS": PARAMETERS,
}
"""Bindings 0-7 hold the scene; a pass is free to use 8-15 as it likes."""

LIGHT_HALF_DEFINES = SCENE_DEFINES | {
    "BIND_RAYS_IN": RAYS_IN,
    "BIND_RAYS_OUT": RAYS_OUT,
    "BIND_OUTCOMES": OUTCOMES,
    "BIND_PHOTON_SLOTS": PHOTON_SLOTS,
    "BIND_POOL_SLOTS": POOL_SLOTS,
    "BIND_INDICES": INDICES,
    "BIND_COUNTS": COUNTS,
    "BIND_STATE": STATE,
    "BIND_PHOTONS": PHOTONS,
}
