"""The one kind of error a user is meant to read.

Every bad input ends as a `UserError` whose message is one clear sentence that names the
file, the key and the remedy. `spectrasplat.__main__` catches it in one place, prints it without a
traceback and exits with code 2.
"""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections.abc import Iterable


class UserError(Exception):
    """A mistake in what the user gave us, in one sentence with a way out."""

    exit_code = 2


class BrokenPictureError(UserError):
    """A picture that would be wrong, and is not written."""

    exit_code = 1


class DeviceError(UserError, RuntimeError):
    """OpenGL could not do what was asked of it."""


class OwnCallError(DeviceError):
    """OpenGL was asked for what cannot be done."""

    exit_code = 1


def own_fault(what: str) -> str:
    """A sentence: `what` went wrong by a fault of the program, and what a report of it needs."""
    return (
        f"{what}: this is a fault of SpectraSplat itself; please report it with this line, the scene and what "
        "'spectrasplat doctor' prints"
    )


def sentence_of(error: BaseException) -> str | None:
    """What running out of memory, or an error of OpenGL's, means to a user; None for anything else."""
    if isinstance(error, MemoryError):
        return "out of memory: use fewer photons, a smaller picture or a simpler mesh"
    # moderngl may not even be imported.
    if type(error).__module__.split(".")[0] in ("moderngl", "_moderngl", "mgl"):
        if str(error).startswith("cannot create"):
            return f"the device has no memory left, or was lost ({error}): use a smaller picture or fewer photons"
        return own_fault(f"OpenGL was asked wrongly ({error})")
    return None


def visible(text: str) -> str:
    """`text` with what could command a terminal (control and direction characters) written out, but for white space.

    For everything that is printed and may hold a name out of a file.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(c if c in "\n\t" or c.isprintable() else _escaped(c) for c in text)


def plain(text: str) -> str:
    """`visible` on one line."""
    return visible(" ".join(text.split()))


def _escaped(character: str) -> str:
    if unicodedata.category(character) not in ("Cc", "Cf", "Cs", "Zl", "Zp"):
        return character
    code = ord(character)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


_OTHER_WORDS = {
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
"""Words that people use for what has another name here: shapes, keys, kinds."""
_MEANT: dict[str, list[str]] = {}
"""Word without punctuation -> names that may be meant by it, the likeliest first."""
for _name, _others in _OTHER_WORDS.items():
    for _word in _others.split():
        _MEANT.setdefault(_word, []).append(_name)


def nearest_names(name: str, known: Iterable[str], count: int = 3) -> list[str]:
    """Known names that `name` may stand for, best first (case-insensitive; may be empty).

    Those that mean the same, or else those that share nearly all letters in their order, begin with it, or
    have a whole word in common with it.
    """
    word, by_folded = name.casefold(), {candidate.casefold(): candidate for candidate in known}
    if meant := [m for m in _MEANT.get("".join(filter(str.isalnum, word)), ()) if m.casefold() in by_folded]:
        return meant[:count]
    near = difflib.get_close_matches(word, by_folded, count, cutoff=0.72 if len(word) > 3 else 0.66)
    near += [each for each in by_folded if _words(word) & _words(each) or (len(word) > 2 and each.startswith(word))]
    return [by_folded[each] for each in dict.fromkeys(near)][:count]


def _words(text: str) -> set[str]:
    return {word for word in re.split(r"[\W_]+", text) if len(word) > 2 and not word.isdigit()}


def suggestion(name: str, known: Iterable[str], count: int = 3) -> str:
    """A clause ", did you mean 'a' or 'b'?", or "" when nothing is near."""
    near = nearest_names(name, known, count)
    if not near:
        return ""
    return ", did you mean " + " or ".join(f"'{n}'" for n in near) + "?"
