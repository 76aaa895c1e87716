"""LuxCore: N grey renderings, each with the index of one wavelength, or (WAVELENGTHS 0) one with its own dispersion.

    python luxcore_peer.py FOLDER OUT.npy WAVELENGTHS SAMPLES_A_PIXEL [ENGINE]

ENGINE: `BIDIRCPU`, bidirectional path tracing. LuxCore's own dispersion is Cauchy's formula; the colours that it gives
single wavelengths are its own, not those of the CIE observer.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import neutral
import numpy as np
import pyluxcore

MAX_DEPTH = 66


def scene_of(scene: dict, glass: bool = True) -> dict[str, object]:
    """LuxCore's properties of the scene, without the glass's index."""
    camera, lamp = scene["camera"], scene["lamp"]
    albedo = [scene["albedo"]] * 3
    values: dict[str, object] = {
        "scene.camera.type": "perspective",
        "scene.camera.lookat.orig": camera["position"],
        "scene.camera.lookat.target": camera["target"],
        "scene.camera.up": [0.0, 0.0, 1.0],
        "scene.camera.fieldofview": camera["vertical_fov_deg"],
        "scene.camera.autofocus.enable": False,
        "scene.materials.grey.type": "matte",
        "scene.materials.grey.kd": albedo,
        "scene.materials.black.type": "matte",
        "scene.materials.black.kd": [0.0] * 3,
        "scene.objects.receiver.material": "grey",
        "scene.objects.receiver.shape": "receiver",
    }
    if lamp["is_area"]:
        values |= {
            "scene.materials.black.emission": [1.0] * 3,
            "scene.materials.black.emission.theta": 90.0,
            "scene.objects.lamp.material": "black",
            "scene.objects.lamp.shape": "lamp",
        }
    else:
        values |= {
            "scene.lights.lamp.type": "spot",
            "scene.lights.lamp.position": lamp["position"],
            "scene.lights.lamp.target": lamp["target"],
            "scene.lights.lamp.coneangle": lamp["half_angle_deg"],
            "scene.lights.lamp.conedeltaangle": lamp["half_angle_deg"] * 1e-4,
            "scene.lights.lamp.color": [1.0] * 3,
            "scene.lights.lamp.gain": [1.0] * 3,
        }
    if glass:
        values |= {
            "scene.materials.glass.type": "glass",
            "scene.objects.glass.material": "glass",
            "scene.objects.glass.shape": "glass",
        }
    return values


def properties(values: dict[str, object]) -> pyluxcore.Properties:
    """LuxCore's own table of `values`."""
    result = pyluxcore.Properties()
    for key, value in values.items():
        result.Set(pyluxcore.Property(key, list(value) if isinstance(value, (list, tuple)) else value))
    return result


def config_of(scene: dict, engine: str, samples: int, seed: int) -> dict[str, object]:
    """Settings of one rendering."""
    width, height = scene["size"]
    return {
        "renderengine.type": engine,
        "renderengine.seed": seed + 1,
        "sampler.type": "RANDOM",
        "path.maxdepth": MAX_DEPTH,
        "light.maxdepth": MAX_DEPTH,
        "path.russianroulette.depth": MAX_DEPTH,
        "light.russianroulette.depth": MAX_DEPTH,
        "path.clamping.variance.maxvalue": 0.0,
        "film.width": width,
        "film.height": height,
        "film.filter.type": "NONE",
        "film.imagepipelines.0.0.type": "NOP",
        "batch.haltspp": [samples, samples],
    }


def build(scene: dict, glass: bool = True) -> pyluxcore.Scene:
    """The scene, without the glass's index."""
    built = pyluxcore.Scene()
    quad = [(0, 1, 2), (0, 2, 3)]
    if glass:
        points = [tuple(map(float, p)) for p in scene["corners"].reshape(-1, 3)]
        normals = [tuple(map(float, n)) for n in scene["normals"].reshape(-1, 3)] if scene["smooth"] else None
        triangles = [(3 * k, 3 * k + 1, 3 * k + 2) for k in range(len(points) // 3)]
        built.DefineMesh("glass", points, triangles, normals, None, None, None)
    rectangles = {"receiver": neutral.receiver_corners(scene), "lamp": neutral.lamp_corners(scene)}
    for name, rectangle in rectangles.items():
        if name == "receiver" or scene["lamp"]["is_area"]:
            built.DefineMesh(name, [tuple(map(float, p)) for p in rectangle], quad, None, None, None, None)
    built.Parse(properties(scene_of(scene, glass)))
    return built


def render(
    scene: dict, built: pyluxcore.Scene, glass: dict[str, object], engine: str, samples: int, seed: int
) -> np.ndarray:
    """Linear RGB float64 (height, width, 3) of a lamp of strength 1; `glass` holds its index's properties."""
    built.Parse(properties(glass))
    session = pyluxcore.RenderSession(
        pyluxcore.RenderConfig(properties(config_of(scene, engine, samples, seed)), built)
    )
    session.Start()
    while not session.HasDone():
        time.sleep(0.005)
        session.UpdateStats()
    session.Stop()
    film = session.GetFilm()
    width, height = scene["size"]
    picture = np.zeros((height, width, 3), dtype=np.float32)
    film.GetOutputFloat(pyluxcore.FilmOutputType.RGB, picture, 0)
    return np.roll(picture[::-1], -1, axis=0).astype(float)  # its pictures lie one row below everybody else's


def glass_of(n: float, b: float = 0.0) -> dict[str, object]:
    """The glass with index n = A + B / λ² as LuxCore's properties, B in µm²."""
    white = {
        "scene.materials.glass.type": "glass",
        "scene.materials.glass.kr": [1.0] * 3,
        "scene.materials.glass.kt": [1.0] * 3,
    }
    return white | {
        "scene.materials.glass.interiorior": n,
        "scene.materials.glass.exteriorior": 1.0,
        "scene.materials.glass.cauchyb": b,
    }


def main() -> None:
    """Renders and saves X, Y, Z."""
    folder, out, count, samples = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
    engine = sys.argv[5] if len(sys.argv) > 5 else "BIDIRCPU"
    pyluxcore.Init()
    pyluxcore.SetLogHandler(lambda text: None)
    scene = neutral.load(folder)
    built = build(scene)
    if count:
        picture = neutral.accumulate(
            scene, count, lambda k, n: render(scene, built, glass_of(n), engine, samples, k).mean(axis=2)
        )
    else:
        rgb = render(scene, built, glass_of(*scene["cauchy"]), engine, samples, 0)
        white = 683.002 * np.sum(scene["cmf"], axis=0)
        picture = scene["lamp"]["strength"] * (rgb @ neutral.RGB_TO_XYZ.T) / neutral.RGB_TO_XYZ.sum(axis=1) * white
    np.save(out, picture.astype(np.float32))
    sys.stdout.flush()
    os._exit(0)  # what LuxCore 2.11 does at a process's end crashes


if __name__ == "__main__":
    main()
