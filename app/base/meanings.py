"""Words that people use for what has another name here: shapes, keys, kinds."""

from __future__ import annotations

_WORDS = {
    "box": "cube cuboid block brick",
    "slab": "plate pane sheet window tile",
    "plane": "rectangle quad square floor ground table wall grid",
    "disc": "disk circle",
    "sphere": "ball globe uvsphere icosphere orb",
    "ellipsoid": "egg ellipse spheroid pebble",
    "cylinder": "rod bar column",
    "dome": "hemisphere halfsphere halfball cabochon",
    "torus": "donut doughnut ring",
    "revolution": "tube pipe vase bottle bowl cup glass goblet lathe capsule",
    "polygon_prism": "hexagon hexagonalprism crystal",
    "prism": "wedge triangle triangularprism",
    "lens": "biconvex planoconvex biconcave",
    "brilliant": "gem stone roundcut roundbrilliant",
    "step_cut": "emeraldcut baguette",
    "rippled_water": "water waves ocean pool",
    "height_field": "terrain heightmap heightfield landscape",
    "mesh": "file model obj ply stl",
    "colour": "color albedo kd basecolor basecolour diffuse",
    "vertical_fov_deg": "fov fovy fieldofview angle",
    "n_d": "ior index refractiveindex nd",
    "V_d": "abbe abbenumber vd",
    "position": "location translation translate origin eye pos",
    "target": "lookat",
    "rotation_deg": "rotate euler",
    "directional": "sun parallel distant",
    "point": "lamp bulb omni",
    "spot": "spotlight",
    "glass": "dielectric transparent",
    "diffuse": "lambert lambertian matte matt",
    "mirror": "metal conductor specular",
    "diamond": "diamant diamante",
}
MEANT: dict[str, list[str]] = {}
"""Word without punctuation -> names that may be meant by it, the likeliest first."""
for _name, _words in _WORDS.items():
    for _word in _words.split():
        MEANT.setdefault(_word, []).append(_name)
