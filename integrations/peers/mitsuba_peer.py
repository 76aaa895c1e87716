"""Mitsuba 3: N grey renderings, each with the index of one wavelength, since its dielectrics do not disperse.

    python mitsuba_peer.py FOLDER OUT.npy WAVELENGTHS SAMPLES_A_PIXEL [INTEGRATOR [VARIANT]]

INTEGRATOR is `ptracer` (light tracing) or `path`; `llvm_ad_mono`, the default, traces grey light.
"""

from __future__ import annotations

import sys
from pathlib import Path

import mitsuba as mi
import neutral
import numpy as np

MAX_DEPTH = 66


def scene_of(scene: dict, folder: Path, integrator: str, glass: bool = True):
    """The scene as Mitsuba's dictionary; the glass's index is that of 550 nm."""
    T = mi.ScalarTransform4f
    camera, lamp = scene["camera"], scene["lamp"]
    width, height = scene["size"]
    target = np.add(lamp["position"], lamp["direction"]).tolist()
    to_lamp = T().look_at(origin=lamp["position"], target=target, up=[0, 0, 1])
    result = {
        "type": "scene",
        "integrator": {"type": integrator, "max_depth": MAX_DEPTH, "rr_depth": 1000, "hide_emitters": True},
        "camera": {
            "type": "perspective",
            "fov": camera["vertical_fov_deg"],
            "fov_axis": "y",
            "to_world": T().look_at(origin=camera["position"], target=camera["target"], up=[0, 0, 1]),
            "film": {
                "type": "hdrfilm",
                "width": width,
                "height": height,
                "pixel_format": "luminance",
                "component_format": "float32",
                "rfilter": {"type": "box"},
            },
        },
        "receiver": {
            "type": "rectangle",
            "to_world": T().scale([*(np.multiply(scene["receiver"], 0.5)), 1.0]),
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": scene["albedo"]}},
        },
    }
    if lamp["is_area"]:
        result["lamp"] = {
            "type": "rectangle",
            "to_world": to_lamp @ T().scale([*(np.multiply(lamp["size"], 0.5)), 1.0]),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 1.0}},
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}},
        }
    else:
        edge = lamp["half_angle_deg"]
        result["lamp"] = {
            "type": "spot",
            "to_world": to_lamp,
            "intensity": {"type": "rgb", "value": 1.0},
            "cutoff_angle": edge,
            "beam_width": edge * (1 - 1e-5),
        }
    if glass:
        bsdf = {"type": "dielectric", "int_ior": neutral.index(scene, 550.0), "ext_ior": 1.0}
        if scene["sphere"]:
            *centre, radius = scene["sphere"]
            result["glass"] = {"type": "sphere", "center": centre, "radius": radius, "bsdf": bsdf}
        else:
            shape = {"type": "ply", "filename": str(folder / "glass.ply"), "face_normals": not scene["smooth"]}
            result["glass"] = shape | {"bsdf": bsdf}
    return mi.load_dict(result)


def main() -> None:
    """Renders and saves X, Y, Z."""
    folder, out, count, samples = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
    integrator, variant = (*sys.argv[5:], *("ptracer", "llvm_ad_mono")[len(sys.argv) - 5 :])
    mi.set_variant(variant)
    scene = neutral.load(folder)
    loaded = scene_of(scene, folder, integrator)
    parameters = mi.traverse(loaded)
    key = next(filter(lambda name: name.endswith("bsdf.eta"), parameters.keys()))

    def render(number: int, n: float) -> np.ndarray:
        parameters[key] = n
        parameters.update()
        return np.array(mi.render(loaded, spp=samples, seed=number))[..., 0]

    np.save(out, neutral.accumulate(scene, count, render).astype(np.float32))


if __name__ == "__main__":
    main()
