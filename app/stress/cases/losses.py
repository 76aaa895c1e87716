"""What used to be lost in silence: unlike surfaces in contact, beams thinner than a pixel, lights at surfaces and
lights that give none.

Each severity has two promises: little is lost, and what is lost is reported unasked. The second is
judged by the tally and the picture alone; the rendering's own notices are only searched for a word.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

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
from ..case import Case, Held, Measured, Measurement, case, judged, measured, not_finite
from ..rigs.probe import CAUSTIC, energy_error
from ..rigs.scene_parts import BEAM, SUN, TABLE, UNDER_GLASS, at, brighter, moved, solid, stage, tilted, turn
from .contacts import CONTACT

SAID_FROM = 0.01
"""Share of the light that may be lost without a word."""
GIVEN_UP = 2e-3
"""Share that may be lost where surfaces touch: rays at the rim of a sheet, and roulette."""
HALF = 0.5
"""Of a picture's light that may be lacking without a word: `render.notices` knows no better where pixels slant."""
UNLIT = 1e-6
"""Share that lands, below which a light reached nothing."""
SPECTRUM = illuminant("D65").scaled_to_luminous(10.0)
GLASS = constant(1.5, "n 1.5")
BLOCK = solid("block", box(), GLASS)
PLACED_BLOCK = solid("block", box(), GLASS, (0.3, 0.0, 1.2))


def honest(
    result: RenderResult, severity: float, label: str, held: Held | None = None, lacking: float = 0.0
) -> Measurement:
    """A rendering's measurement; `lacking`: share of the picture's light that is known not to be there."""
    tally, notices = result.stats.light.tally, " ".join(result.stats.notices)
    shares = {fate: flux / tally.emitted for fate, flux in tally.ended.items()} if tally.emitted else {}
    words = {"lost_depth": "given up", "lost_numeric": "numerics"}
    lost = {fate: shares.get(fate, 0.0) for fate in words}
    unsaid = [fate for fate, word in words.items() if lost[fate] > SAID_FROM and word not in notices]
    if shares.get("deposited", 0.0) < UNLIT and "reaches a receiver" not in notices:
        unsaid.append("a light that reached nothing")
    if lacking > HALF and not notices:
        unsaid.append("a picture that lacks light")
    promised: Held = {"unsaid": (len(unsaid), 0.0), "given up": (sum(lost.values()), GIVEN_UP), **(held or {})}
    imbalance, counts = tally.imbalance if tally.emitted else None, dict(tally.fallbacks)
    note = "; ".join(unsaid) or notices
    return Measurement(severity, label, not_finite([result.rgb]), *judged(promised), imbalance, counts, note=note)


def landed(result: RenderResult) -> float:
    """Share of the light that landed."""
    tally = result.stats.light.tally
    return tally.ended["deposited"] / tally.emitted if tally.emitted else 0.0


# ---- contact --------------------------------------------------------------------------------


def _coated(material: Material, gap: float) -> Scene:
    """A glass block with a sheet at a distance from one of its faces."""
    face = at(0.5 + gap, 0.0, 0.0, turn((0.0, 1.0, 0.0), 90.0))
    return stage(*tilted(BLOCK, SceneObject("sheet", plane(1.0, 1.0), material, face)), lights=[SUN])


def _boxed(material: Material, gap: float) -> Scene:
    """A glass block in an opaque one that is larger by the gap."""
    side = 1.0 + 2.0 * gap
    shell = SceneObject("shell", box((side, side, side)), material)
    return stage(*tilted(shell, BLOCK, solid("other", box((0.4, 0.4, 0.4)), GLASS, (0.0, 1.2, 0.4))), lights=[SUN])


def _papers(gap: float) -> Scene:
    """Two diffuse sheets in one place, of different colours; a block's caustic falls on them."""
    paper = SceneObject("paper", plane(3.0, 3.0), Diffuse((0.9, 0.5, 0.2)), at(0.3, 0.0, gap))
    return stage(PLACED_BLOCK, paper)


def _nearer(context: Context, gaps: Sequence[float], scene: Callable[[float], Scene]) -> Measured:
    """A film of air reflects what contact does not; from `CONTACT` on nothing changes any more."""
    in_contact: float | None = None
    for gap in gaps:
        result, held = render(scene(gap), CAUSTIC, context=context), None
        if gap < CONTACT:
            in_contact = landed(result) if in_contact is None else in_contact
            # Roulette: by how much the share that lands may differ from gap to gap.
            held = {"landed": (abs(landed(result) - in_contact), 1e-3)}
        yield honest(result, gap, f"{gap:.0e}" if gap else "contact", held)


CONTACTS = tuple(
    Case(
        f"contact-{name}",
        f"{title}, ever nearer",
        "Light bounces between surfaces in contact until it is given up; they are one interface.",
        "gap, scene units",
        partial(_nearer, scene=scene),
        (1e-4, 1e-5, 1e-7, 0.0),
    )
    for name, title, scene in (
        ("mirror", "A mirror on glass", partial(_coated, Mirror((0.9, 0.9, 0.9)))),
        ("black", "A black sheet on glass", partial(_coated, Black())),
        ("diffuse", "Paint on glass", partial(_coated, Diffuse())),
        ("papers", "Two sheets of paper in one place", _papers),
        ("silvered-box", "A mirror box and a glass box in one place", partial(_boxed, Mirror((0.5, 0.5, 0.5)))),
        ("black-box", "A black box and a glass box in one place", partial(_boxed, Black())),
    )
)


# ---- light that is hard to see ------------------------------------------------------------------


@case("thin-beams", "width, pixels", (10.0, 1.0, 1e-1, 1e-2, 1e-3, 1e-6))
def thin_beams(context: Context, widths: Sequence[float]) -> Measured:
    """A beam of one lumen from ten pixels to a millionth of one

    A window smaller than a pixel falls between camera samples; float32 cannot distinguish its texels."""
    base: np.ndarray | None = None
    for pixels in widths:
        radius = 0.5 * pixels * UNDER_GLASS.vertical_extent / CAUSTIC.height
        spectrum = illuminant("D65").scaled_to_luminous(1.0 / (np.pi * radius**2))
        light = CollimatedLight("beam", spectrum, (0.3137, 0.0711, 6.0), (0.0, 0.0, -1.0), radius=radius)
        result = render(stage(PLACED_BLOCK, lights=[light]), CAUSTIC, context=context)
        picture = result.rgb.astype(float)
        base = picture if base is None else base
        held: Held = {"energy": (energy_error(picture, base), 3e-3)}
        yield honest(result, pixels, f"{pixels:g} pixels", held, lacking=1.0 - picture.sum() / base.sum())


@case("lamp-on-floor", "height, scene units", (1e-2, 1e-4, 1e-6, 1e-8, 0.0))
def lamp_on_floor(context: Context, heights: Sequence[float]) -> Measured:
    """A point light ever nearer to the floor

    Photons start on the wrong side of the floor, or meet it at once."""
    ceiling = SceneObject("ceiling", plane(8.0, 8.0), Diffuse(), at(z=4.0))
    first: float | None = None
    for height in heights:
        lamp = PointLight("lamp", SPECTRUM, position=(0.3, 0.0, height))
        result = render(stage(PLACED_BLOCK, ceiling, lights=[lamp]), CAUSTIC, context=context)
        first = landed(result) if first is None else first
        # From 1e-2 on the block's lower face is seen as before, within a hundredth of its solid angle.
        held: Held = {"landed": (abs(landed(result) - first), 0.02)}
        yield honest(result, height, f"{height:.0e}" if height else "on it", held)


def _lit_by(light: Light) -> Scene:
    return stage(PLACED_BLOCK, lights=[light])


DARK: tuple[tuple[str, Callable[[], Scene]], ...] = (
    ("a light of no power", lambda: _lit_by(replace(BEAM, spectral_power=brighter(SPECTRUM, 0.0)))),
    (
        "a mirror that reflects all light away",
        lambda: stage(SceneObject("mirror", plane(3.0, 3.0), Mirror(), at(z=4.0))),
    ),
    ("a scene 1e16 from the origin", lambda: moved(_lit_by(BEAM), offset=(1e16, 0.0, 0.0))),
    ("a panel of radius 1e-20", lambda: _lit_by(AreaLight("panel", SPECTRUM, (0.0, 0.0, 3.0), radius=1e-20))),
    ("a scene of size 1e-30", lambda: stage(table=replace(TABLE, object_to_world=np.diag([1e-30, 1e-30, 1e-30, 1.0])))),
)


@case("dark-lights", "scene", DARK)
def dark_lights(context: Context, rows: Sequence[tuple[str, Callable[[], Scene]]]) -> Measured:
    """Lights that give no light, and scenes that cannot be computed

    A black picture without a word is the worst answer: such a scene is refused in a sentence, noted while loading, or
    noted after rendering."""
    settings = RenderSettings(width=64, height=36, photons=4096, spp=4)
    for number, (label, scene) in enumerate(rows, 1):
        try:
            notes: Sequence[str] = check_scene(scene(), "scene")
            result = render(scene(), settings, context=context)
        except UserError as error:
            yield measured(number, label, {"unsaid": (0.0, 0.0)}, note=str(error))
            continue
        notes = [*notes, *result.stats.notices]
        yield measured(number, label, {"unsaid": (not notes, 0.0)}, [result.rgb], "; ".join(notes))
