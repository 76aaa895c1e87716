"""What used to be lost in silence: unlike surfaces in contact, beams thinner than a pixel, lights at surfaces and
lights that give none.

Each severity is held to two promises: little is lost, and what is lost is said without being asked. The second is
judged by the tally and the picture alone; the rendering's own notices are only looked at for a word.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import UserError
from ...gpu.context import Context
from ...model.geometry.primitives import box, plane
from ...model.lights import AreaLight, CollimatedLight, PointLight
from ...model.optics.glass import constant
from ...model.optics.spectrum import illuminant
from ...model.scene import Black, Diffuse, Light, Material, Mirror, Scene, SceneObject
from ...model.scene_checks import check_scene
from ...model.settings import RenderSettings
from ...render.still import RenderResult, render
from ..case import Case, Measurement
from ..rigs.probe import SMALL, energy_error, nonfinite
from ..rigs.scene_parts import BEAM, FROM_BELOW, SUN, TABLE, brighter, moved, solid, stage, turn
from .contact_cases import CONTACT

CAUSTIC = replace(SMALL, layer="caustic")
GAPS = (1e-4, 1e-5, 1e-7, 0.0)
PIXELS = (10.0, 1.0, 1e-1, 1e-2, 1e-3, 1e-6)
HEIGHTS = (1e-2, 1e-4, 1e-6, 1e-8, 0.0)
SAID_FROM = 0.01
"""Share of the light that may be lost without a word."""
GIVEN_UP = 2e-3
"""Share that may be lost where surfaces touch: rays at the rim of a sheet, and roulette."""
MOVED = 1e-3
"""By how much the share that lands may differ from gap to gap in contact: roulette."""
HALF = 0.5
"""Of a picture's light that may be lacking without a word: `render.notices` knows no better where pixels slant."""
UNLIT = 1e-6
"""Share that lands, below which a light reached nothing."""
SPECTRUM = illuminant("D65").scaled_to_luminous(10.0)
GLASS = constant(1.5, "n 1.5")


def measured(result: RenderResult, severity: float, label: str, lacking: float = 0.0) -> Measurement:
    """A rendering's measurement; `lacking`: share of the picture's light that is known not to be there."""
    tally, told = result.stats.light.tally, " ".join(result.stats.notices)
    shares = {fate: flux / tally.emitted for fate, flux in tally.ended.items()} if tally.emitted else {}
    lost = {fate: shares.get(fate, 0.0) for fate in ("lost_depth", "lost_numeric")}
    unsaid = [
        fate
        for fate, word in (("lost_depth", "given up"), ("lost_numeric", "numerics"))
        if _unsaid(lost[fate], word, told)
    ]
    if shares.get("deposited", 0.0) < UNLIT and "reaches a receiver" not in told:
        unsaid.append("a light that reached nothing")
    if lacking > HALF and not told:
        unsaid.append("a picture that lacks light")
    return Measurement(
        severity,
        label,
        nonfinite(result.rgb),
        {"unsaid": float(len(unsaid)), "given up": sum(lost.values())},
        {"unsaid": 0.0, "given up": GIVEN_UP},
        tally.imbalance if tally.emitted else None,
        dict(tally.fallbacks),
        note="; ".join(unsaid) or told,
    )


def _unsaid(share: float, word: str, told: str) -> bool:
    return share > SAID_FROM and word not in told


def _with(found: Measurement, name: str, error: float, bound: float) -> Measurement:
    return replace(found, errors=found.errors | {name: error}, bounds=found.bounds | {name: bound})


# ---- contact --------------------------------------------------------------------------------


def _coated(material: Material) -> Callable[[float], Scene]:
    """A glass block with a sheet at a distance from one of its faces."""

    def scene(gap: float) -> Scene:
        face = np.eye(4)
        face[:3, :3], face[0, 3] = turn((0.0, 1.0, 0.0), 90.0), 0.5 + gap
        return _turned(solid("block", box(), GLASS), SceneObject("sheet", plane(1.0, 1.0), material, face))

    return scene


def _boxes(material: Material) -> Callable[[float], Scene]:
    """A glass block in an opaque one that is larger by the gap."""

    def scene(gap: float) -> Scene:
        side = 1.0 + 2.0 * gap
        shell = SceneObject("shell", box((side, side, side)), material)
        other = solid("other", box((0.4, 0.4, 0.4)), GLASS, (0.0, 1.2, 0.4))
        return _turned(shell, solid("block", box(), GLASS), other)

    return scene


def _papers(gap: float) -> Scene:
    """Two diffuse sheets in one place, of different colours; a block throws its caustic on them."""
    above = np.eye(4)
    above[:3, 3] = 0.3, 0.0, gap
    paper = SceneObject("paper", plane(3.0, 3.0), Diffuse((0.9, 0.5, 0.2)), above)
    return stage(solid("block", box(), GLASS, (0.3, 0.0, 1.2)), paper)


def _turned(*items: SceneObject) -> Scene:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn((1.0, 0.4, 0.2), 28.0), (0.0, 0.0, 1.2)
    return stage(*(replace(item, object_to_world=matrix @ item.object_to_world) for item in items), lights=[SUN])


@dataclass(frozen=True)
class Contact:
    """Two unlike surfaces, at any distance."""

    name: str
    title: str
    scene: Callable[[float], Scene]


CONTACTS = (
    Contact("mirror", "A mirror on glass", _coated(Mirror((0.9, 0.9, 0.9)))),
    Contact("black", "A black sheet on glass", _coated(Black())),
    Contact("diffuse", "Paint on glass", _coated(Diffuse())),
    Contact("papers", "Two sheets of paper in one place", _papers),
    Contact("silvered-box", "A mirror box and a glass box in one place", _boxes(Mirror((0.5, 0.5, 0.5)))),
    Contact("black-box", "A black box and a glass box in one place", _boxes(Black())),
)


def measure_contact(contact: Contact, context: Context) -> Iterator[Measurement]:
    """A film of air reflects what contact does not; from `CONTACT` on nothing changes any more."""
    landed: float | None = None
    for gap in GAPS:
        result = render(contact.scene(gap), CAUSTIC, context=context)
        tally = result.stats.light.tally
        share = tally.ended["deposited"] / tally.emitted
        found = measured(result, gap, f"{gap:.0e}" if gap else "contact")
        if gap < CONTACT:
            landed = share if landed is None else landed
            found = _with(found, "landed", abs(share - landed), MOVED)
        yield found


# ---- beams ----------------------------------------------------------------------------------


def _beam(pixels: float) -> Scene:
    """One lumen straight down through a block, in a beam so many pixels wide."""
    radius = 0.5 * pixels * FROM_BELOW.vertical_extent / CAUSTIC.height
    spectrum = illuminant("D65").scaled_to_luminous(1.0 / (np.pi * radius**2))
    light = CollimatedLight("beam", spectrum, (0.3137, 0.0711, 6.0), (0.0, 0.0, -1.0), radius=radius)
    return stage(solid("block", box(), GLASS, (0.3, 0.0, 1.2)), lights=[light])


def measure_beams(context: Context) -> Iterator[Measurement]:
    """However thin, its lumen stays in the picture."""
    base: np.ndarray | None = None
    for pixels in PIXELS:
        result = render(_beam(pixels), CAUSTIC, context=context)
        picture = result.rgb.astype(float)
        base = picture if base is None else base
        lacking = 1.0 - picture.sum() / base.sum()
        found = measured(result, pixels, f"{pixels:g} pixels", lacking)
        yield _with(found, "energy", energy_error(picture, base), 3e-3)


# ---- lights at surfaces ---------------------------------------------------------------------


def _lamp_on_the_floor(height: float) -> Scene:
    ceiling = np.eye(4)
    ceiling[2, 3] = 4.0
    lamp = PointLight("lamp", SPECTRUM, position=(0.3, 0.0, height))
    block = solid("block", box(), GLASS, (0.3, 0.0, 1.2))
    return stage(block, SceneObject("ceiling", plane(8.0, 8.0), Diffuse(), ceiling), lights=[lamp])


def measure_heights(context: Context) -> Iterator[Measurement]:
    """A lamp ever nearer to the floor lights the block above it all the same."""
    landed: float | None = None
    for height in HEIGHTS:
        result = render(_lamp_on_the_floor(height), CAUSTIC, context=context)
        tally = result.stats.light.tally
        share = tally.ended["deposited"] / tally.emitted if tally.emitted else 0.0
        landed = share if landed is None else landed
        found = measured(result, height, f"{height:.0e}" if height else "on it")
        # From 1e-2 on the block's lower face is seen as before, within a hundredth of its solid angle.
        yield _with(found, "landed", abs(share - landed), 0.02)


# ---- lights that give none ------------------------------------------------------------------


def _facing_a_mirror() -> Scene:
    matrix = np.eye(4)
    matrix[2, 3] = 4.0
    return stage(SceneObject("mirror", plane(3.0, 3.0), Mirror(), matrix))


def _lit_by(*lights: Light) -> Scene:
    return stage(solid("block", box(), GLASS, (0.3, 0.0, 1.2)), lights=lights)


def _scaled(scale: float) -> Scene:
    return replace(stage(), objects=(replace(TABLE, object_to_world=np.diag([scale, scale, scale, 1.0])),))


DARK: tuple[tuple[str, Callable[[], Scene]], ...] = (
    ("a light of no power", lambda: _lit_by(replace(BEAM, spectral_power=brighter(SPECTRUM, 0.0)))),
    ("a mirror that throws all light away", _facing_a_mirror),
    ("a scene 1e16 from the origin", lambda: moved(_lit_by(BEAM), offset=(1e16, 0.0, 0.0))),
    ("a panel of radius 1e-20", lambda: _lit_by(AreaLight("panel", SPECTRUM, (0.0, 0.0, 3.0), radius=1e-20))),
    ("a scene of size 1e-30", lambda: _scaled(1e-30)),
)


def measure_dark(context: Context) -> Iterator[Measurement]:
    """Refused in a sentence, noted while loading, or told after rendering: one of them."""
    settings = RenderSettings(width=64, height=36, photons=4096, spp=4)
    for number, (label, made) in enumerate(DARK, 1):
        try:
            notes: Sequence[str] = check_scene(made(), "scene")
            result = render(made(), settings, context=context)
        except UserError as error:
            yield Measurement(number, label, 0, {"unsaid": 0.0}, {"unsaid": 0.0}, note=str(error))
            continue
        told = [*notes, *result.stats.notices]
        silent = float(not told)
        yield Measurement(
            number, label, nonfinite(result.rgb), {"unsaid": silent}, {"unsaid": 0.0}, note="; ".join(told)
        )


def _contact_case(contact: Contact) -> Case:
    return Case(
        f"contact-{contact.name}",
        f"{contact.title}, ever nearer",
        "Light bounces between surfaces in contact until it is given up; they are one interface.",
        "gap, scene units",
        lambda context: measure_contact(contact, context),
        len(GAPS),
    )


CASES: tuple[Case, ...] = (
    *(_contact_case(contact) for contact in CONTACTS),
    Case(
        "thin-beams",
        "A beam of one lumen from ten pixels to a millionth of one",
        "A window smaller than a pixel falls between camera samples; float32 cannot tell its texels apart.",
        "width, pixels",
        measure_beams,
        len(PIXELS),
    ),
    Case(
        "lamp-on-floor",
        "A point light ever nearer to the floor",
        "Photons start on the wrong side of the floor, or meet it at once.",
        "height, scene units",
        measure_heights,
        len(HEIGHTS),
    ),
    Case(
        "dark-lights",
        "Lights that give no light, and scenes that cannot be computed",
        "A black picture without a word is the worst answer.",
        "scene",
        measure_dark,
        len(DARK),
        logarithmic=False,
    ),
)
