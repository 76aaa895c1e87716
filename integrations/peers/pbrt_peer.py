"""pbrt-v4, which disperses by itself: one rendering by stochastic progressive photon mapping or light tracing.

    python pbrt_peer.py FOLDER OUT.npy ITERATIONS PHOTONS_AN_ITERATION [INTEGRATOR]

INTEGRATOR is `sppm` or `lightpath`. The sensor is the CIE observer, so that the film holds radiance times its curves;
pbrt scales a lamp's spectrum to a luminous integral of 1, which `scale` undoes. Not run here: there was no `pbrt`.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import neutral
import numpy as np


def numbers(values: object) -> str:
    """A list of pbrt's."""
    return "[ " + " ".join(f"{value:.9g}" for value in np.ravel(np.asarray(values, dtype=float))) + " ]"


def scene_text(scene: dict, folder: Path, out: Path, integrator: str, iterations: int, photons: int) -> str:
    """The scene as a file of pbrt's."""
    camera, lamp = scene["camera"], scene["lamp"]
    width, height = scene["size"]
    nm = np.arange(380.0, 781.0, 5.0)
    scale = lamp["strength"] * np.sum(scene["cmf"], axis=0)[1]
    settings = f'"integer photonsperiteration" {photons} "float radius" 0.02' if integrator == "sppm" else ""
    index = np.column_stack([nm, [neutral.index(scene, value) for value in nm]])
    if lamp["is_area"]:
        light = f'AreaLightSource "diffuse" "spectrum L" [360 1 830 1] "float scale" {scale:.9g}\n'
        quad = f'"point3 P" {numbers(neutral.lamp_corners(scene))} "integer indices" [0 1 2 0 2 3]'
        light = f'AttributeBegin\n{light}Material "diffuse"\nShape "trianglemesh" {quad}\nAttributeEnd'
    else:
        edge = lamp["half_angle_deg"]
        light = (
            f'LightSource "spot" "spectrum I" [360 1 830 1] "float scale" {scale:.9g} '
            f'"point3 from" {numbers(lamp["position"])} '
            f'"point3 to" {numbers(lamp["target"])} "float coneangle" {edge} "float conedeltaangle" {edge * 1e-4:.9g}'
        )
    solid = f'Shape "plymesh" "string filename" "{folder / "glass.ply"}"'
    if scene["sphere"]:
        *centre, radius = scene["sphere"]
        solid = f'Translate {" ".join(map(str, centre))}\nShape "sphere" "float radius" {radius}'
    receiver = f'"point3 P" {numbers(neutral.receiver_corners(scene))} "integer indices" [0 1 2 0 2 3]'
    eye = " ".join(f"{value:.9g}" for value in (*camera["position"], *camera["target"], 0.0, 0.0, 1.0))
    return f"""Scale -1 1 1
LookAt {eye}
Camera "perspective" "float fov" {camera["vertical_fov_deg"]}
Sampler "halton" "integer pixelsamples" {iterations}
PixelFilter "box" "float xradius" 0.5 "float yradius" 0.5
Film "rgb" "integer xresolution" {width} "integer yresolution" {height} "string sensor" "cie1931"
    "string filename" "{out}"
Integrator "{integrator}" "integer maxdepth" 66 {settings}
WorldBegin
{light}
AttributeBegin
Material "diffuse" "spectrum reflectance" [360 {scene["albedo"]} 830 {scene["albedo"]}]
Shape "trianglemesh" {receiver}
AttributeEnd
AttributeBegin
Material "dielectric" "spectrum eta" {numbers(index)}
{solid}
AttributeEnd
"""


def main() -> None:
    """Renders by `pbrt` on PATH and saves X, Y, Z."""
    folder, out, iterations, photons = (
        Path(sys.argv[1]).resolve(),
        Path(sys.argv[2]).resolve(),
        *map(int, sys.argv[3:5]),
    )
    scene, film, file = neutral.load(folder), out.with_suffix(".pfm"), out.with_suffix(".pbrt")
    integrator = sys.argv[5] if len(sys.argv) > 5 else "sppm"
    file.write_text(scene_text(scene, folder, film, integrator, iterations, photons), encoding="utf-8")
    subprocess.run(["pbrt", "--quiet", str(file)], check=True)
    _, size, order, pixels = film.read_bytes().split(b"\n", 3)
    width, height = map(int, size.split())
    rgb = np.frombuffer(pixels, dtype="<f4" if float(order) < 0 else ">f4").reshape(height, width, 3)[::-1]
    np.save(out, (683.002 * (rgb @ neutral.RGB_TO_XYZ.T)).astype(np.float32))


if __name__ == "__main__":
    main()
