"""Angles that were measured and published, beside those of the program's own rays and photons, as tables.

    python integrations/peers/measured_angles.py

A prism of 60° on a spectrometer: rays through it (`ss.fan`, traced by the shaders) at nine angles of incidence give
each Fraunhofer line its least deviation, and that the index, as the maker of a glass measures it. A ball of water in
light of one wavelength: photons (`ss.trace`) on a screen 10,000 radii away pile up at the angles of two rainbows.
"""

from __future__ import annotations

import numpy as np
import spectrasplat as ss

LINES_NM = {"C": 656.2725, "d": 587.5618, "F": 486.1327, "g": 435.8343}
SCHOTT = {  # n of the lines, from the catalogue's data sheets (five decimals)
    "N-BK7": (1.51432, 1.51680, 1.52238, 1.52668),
    "F2": (1.61503, 1.62004, 1.63208, 1.64202),
    "N-SF11": (1.77596, 1.78472, 1.80651, 1.82533),
}
# cos² i = (n² − 1) / k (k + 2), with the indices of water that Daimon and Masumura measured (2007).
RAINBOWS_DEG = {
    "first, red": (700.0, 42.4),
    "first, violet": (400.0, 40.6),
    "second, red": (700.0, 50.2),
    "second, violet": (400.0, 53.6),
}
APEX_DEG, DISTANCE = 60.0, 1e4


def deviations(glass: str, incidence_deg: float) -> np.ndarray:
    """Deviation of each line, degrees (4,), of a ray that meets the middle of a prism's face."""
    angle = np.radians(incidence_deg - APEX_DEG / 2)
    direction = np.array([np.cos(angle), 0.0, np.sin(angle)])
    start = np.array([-0.25, 0.0, 0.0]) - 3.0 * direction
    light = {
        "name": "slit",
        "kind": "collimated",
        "radius": 0.02,
        "position": start.tolist(),
        "direction": direction.tolist(),
    }
    prism = {"name": "prism", "shape": "prism", "apex_angle_deg": APEX_DEG, "glass": glass}
    floor = {"name": "floor", "shape": "plane", "position": [0.0, 0.0, -9.0], "material": "diffuse"}
    scene = ss.load({"objects": [prism, floor], "lights": [light]})
    fan = ss.fan(scene, "prism", light="slit", rays=1, wavelengths_nm=list(LINES_NM.values()))
    return np.degrees(np.arccos(fan.directions[0] @ direction))


def least(glass: str) -> np.ndarray:
    """Each line's least deviation, degrees (4,): the lowest point of a curve of the sixth degree through nine rays."""
    middle = np.degrees(np.arcsin(SCHOTT[glass][1] * np.sin(np.radians(APEX_DEG / 2))))
    steps = np.linspace(-3.0, 5.0, 9)
    values = np.array([deviations(glass, middle + step) for step in steps])
    fine = np.linspace(-3.0, 5.0, 8001)
    return np.array([np.polyval(np.polyfit(steps, column, 6), fine).min() for column in values.T])


def bow_deg(wavelength_nm: float, low: float, high: float, photons: int) -> float:
    """The angle from the sun's opposite, between `low` and `high`, at which most light comes back: bins of 0.05°."""
    ball = {"name": "drop", "shape": "sphere", "radius": 1.0, "glass": "water"}
    screen = {"name": "screen", "shape": "plane", "width": 4 * DISTANCE, "height": 4 * DISTANCE, "material": "diffuse"}
    screen |= {"position": [-DISTANCE, 0.0, 0.0], "z_axis": [1.0, 0.0, 0.0]}
    sun = {
        "name": "sun",
        "kind": "collimated",
        "position": [-3.0, 0.0, 0.0],
        "direction": [1.0, 0.0, 0.0],
        "radius": 1.0,
    }
    sun |= {"spectrum": {"laser": wavelength_nm}}
    landed = ss.trace(ss.load({"objects": [ball, screen], "lights": [sun]}), photons=photons)
    angle = np.degrees(np.arctan2(np.hypot(*landed.position[:, 1:].T), DISTANCE))
    edges = np.arange(low, high, 0.05)
    light, _ = np.histogram(angle, edges, weights=landed.flux_w)
    return float(edges[np.argmax(light)] + 0.025)


def main() -> None:
    """Prints both tables."""
    print("| glass | line | n, published | least deviation from it | deviation of the rays | n from that |")
    print("| --- | --- | --- | --- | --- | --- |")
    half = np.radians(APEX_DEG / 2)
    for glass, published in SCHOTT.items():
        for line, n, found in zip(LINES_NM, published, least(glass), strict=True):
            expected = 2 * np.degrees(np.arcsin(n * np.sin(half))) - APEX_DEG
            index = np.sin(np.radians(found) / 2 + half) / np.sin(half)
            print(f"| {glass} | {line} | {n:.5f} | {expected:.3f}° | {found:.3f}° | {index:.5f} |")
    print("\n| rainbow | wavelength | by Descartes' formula | photons pile up at |\n| --- | --- | --- | --- |")
    for name, (nm, angle) in RAINBOWS_DEG.items():
        print(f"| {name} | {nm:.0f} nm | {angle:.1f}° | {bow_deg(nm, angle - 2, angle + 2, 400_000):.2f}° |")


if __name__ == "__main__":
    main()
