"""Pictures to keep: finished renderings, screenshots, baked caustic maps, animations; how far the running one is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from imgui_bundle import imgui

from ...base.image_io import OFFERED_LINEAR, OFFERED_SHOWN, SPECTRAL_SUFFIXES
from ...base.movie import FILMS
from ...edit.requests import Animate, Bake, CancelJob, RenderPicture, Request, Screenshot
from ...edit.state import State
from ..view_model import ViewModel
from . import file_browser, keys_editor, rows, widgets

SPECTRAL_BINS = 20
_SIZES = {"viewport": "As the viewport"} | {
    f"{width}x{height}": f"{width} × {height}"
    for width, height in ((960, 540), (1280, 720), (1920, 1080), (3840, 2160))
}
_RENDER_SIZES = {"scene": "As the scene says"} | _SIZES
_MAP_SIZES = {f"{side}x{side}": f"{side} × {side}" for side in (512, 1024, 2048, 4096)}
_PHOTONS = {"250000": "250 thousand"} | {str(n * 1_000_000): f"{n} million" for n in (1, 4, 16, 64)}
_UNTIL = {"photons": "A number of photons", "time": "A time"}
_SAMPLES = {"0": "As the scene needs", "4": "4", "16": "16", "64": "64", "256": "256"}
_KINDS = {"turntable": "Turntable", "keys": "Keys"}
_KIND_TIPS = {
    "turntable": "The camera turns once about its target; photons are traced once.",
    "keys": "Parameters of the scene move from key to key.",
}
_FORMATS = {suffix: film.title for suffix, film in FILMS.items()} | {".png": "Sequence (PNG)"}


@dataclass
class _Choices:
    """What was chosen last; memory of the interface, not of the document."""

    render_size: str = "scene"
    until: str = "photons"
    render_photons: str = "4000000"
    seconds: float = 60.0
    samples: str = "0"
    caustic: bool = False
    spectral: bool = False
    with_interface: bool = False
    receiver: str = ""
    map_size: str = "1024x1024"
    map_photons: str = "4000000"
    kind: Literal["turntable", "keys"] = "turntable"
    format: str = ".mp4"
    frames: int = 120
    fps: float = 24.0
    size: str = "viewport"
    photons: str = "1000000"


@dataclass
class _Footer:
    """The part for the running export, as it was drawn last."""

    height: float = 0.0
    """Pixels, with the gap above it."""


_choices, _footer = _Choices(), _Footer()


def reset() -> None:
    """Choices as at the start."""
    vars(_choices).update(vars(_Choices()))


def draw_export(state: State, view_model: ViewModel) -> State:
    """Draw the panel's contents. The running export is shown below what scrolls: nothing moves under the mouse that
    started it."""
    idle = view_model.job is None
    imgui.begin_child("##choices", imgui.ImVec2(0, 0 if idle else -max(_footer.height, _least_footer())))
    if widgets.section("Render"):
        _render(view_model, idle)
    if widgets.section("Screenshot"):
        _screenshot(view_model)
    if widgets.section("Caustic map"):
        _bake(state, view_model, idle)
    if widgets.section("Animation"):
        state = _animation(state, view_model, idle)
    imgui.end_child()
    if not idle:
        top = imgui.get_cursor_pos_y()
        state = _running(state, view_model)
        _footer.height = imgui.get_cursor_pos_y() - top + imgui.get_style().item_spacing.y
    return state


def _running(state: State, view_model: ViewModel) -> State:
    job = view_model.job
    assert job is not None
    imgui.separator()
    imgui.text_unformatted(job.title)
    imgui.progress_bar(job.fraction, imgui.ImVec2(-1, 0), f"{100 * job.fraction:.0f} %")
    rows.explain("Export progress", "The export works in the time that the window leaves; editing does not change it.")
    widgets.hint(job.text or " ")  # a line that appears and disappears would move the button
    if job.is_stopped:
        label, tip = "Discard it", "Do not wait for what is done to become a picture: write nothing at all."
    else:
        label = "Cancel export"
        tip = (
            "Stop the export. What is done is kept: a picture is written with the light that it has by then, a movie "
            "plays up to here, a sequence keeps its frames."
        )
    return state.asking(CancelJob()) if widgets.button(label, tip=tip, width=-1) else state


def _least_footer() -> float:
    """Height of a running export whose words need one line: it is known before it was drawn."""
    style = imgui.get_style()
    lines = 2.0 * imgui.get_text_line_height_with_spacing() + 2.0 * imgui.get_frame_height_with_spacing()
    return lines + 2.0 * style.item_spacing.y + 1.0


def _choose(label: str, field: str, options: Mapping[str, str] | list[str], tip: str) -> None:
    """A row for the choice `field`."""
    setattr(_choices, field, widgets.combo(label, options, getattr(_choices, field), tip=tip))


def _switch(label: str, field: str, tip: str) -> None:
    """A row for the switch `field`."""
    setattr(_choices, field, widgets.toggle(label, getattr(_choices, field), tip=tip))


def _render(view_model: ViewModel, idle: bool) -> None:
    _choose("Size##render", "render_size", _RENDER_SIZES, "Pixels of the picture.")
    _choose("Until", "until", _UNTIL, "When the picture is finished.")
    if _choices.until == "photons":
        _choose("Photons##render", "render_photons", _PHOTONS, "Photons emitted for the picture.")
    else:
        how: dict[str, Any] = {"unit": "s", "format": "%.0f", "reset": 60.0, "logarithmic": True}
        tip = "What the whole picture may take, writing included."
        _choices.seconds = widgets.slider("Seconds", _choices.seconds, 5.0, 3600.0, tip=tip, **how)
    _choose("Samples", "samples", _SAMPLES, "Camera samples a pixel.")
    if _choices.until == "photons":
        _switch("Caustics alone too", "caustic", "Write a second file, NAME_caustic, with nothing but caustics.")
    tip = f"Write an EXR with {SPECTRAL_BINS} spectral channels (W/(m² sr) in each bin) in addition to its colours."
    _switch("Spectral bins", "spectral", tip)
    suffixes = SPECTRAL_SUFFIXES if _choices.spectral else (*OFFERED_SHOWN, *OFFERED_LINEAR)
    tip = "Choose a name, then render with the present view. How long it takes is shown while it works."
    if widgets.button("Render…", tip=tip, enabled=idle, width=-1):
        _ask("Render", suffixes, view_model, _render_request)


def _screenshot(view_model: ViewModel) -> None:
    _switch("With interface", "with_interface", "The whole window as it is on the screen (PNG).")
    suffixes = (".png",) if _choices.with_interface else (*OFFERED_SHOWN, *OFFERED_LINEAR)
    tip = "PNG: as displayed. EXR and NPY: linear Rec.709 radiance, lm/(sr unit²), without tone curve."
    if widgets.button("Save screenshot…", tip=tip, width=-1):
        _ask("Save screenshot", suffixes, view_model, lambda _, path: Screenshot(path, _choices.with_interface))


def _bake(state: State, view_model: ViewModel, idle: bool) -> None:
    names = list(dict.fromkeys(item.name for item in state.scene.objects if item.material.receives))
    if not names:
        widgets.hint("Nothing in this scene is diffuse, so nothing carries a caustic.")
        return
    if _choices.receiver not in names:
        _choices.receiver = names[0]
    _choose("Receiver", "receiver", names, "The diffuse object whose caustic is baked.")
    tip = "Size of the texture, texels. A curved receiver gets about as many in all."
    _choose("Texels", "map_size", _MAP_SIZES, tip)
    _choose("Photons##map", "map_photons", _PHOTONS, "Photons emitted for the map.")
    tip = (
        "Irradiance of the caustic, lm/unit², as EXR or NPY (linear) or PNG (to look at). A .json with it says where "
        "the texture is in the world."
    )
    if widgets.button("Bake map…", tip=tip, enabled=idle, width=-1):
        suffixes = (*OFFERED_LINEAR, *OFFERED_SHOWN)
        _ask("Bake caustic map", suffixes, view_model, _bake_request, f"_{_choices.receiver}")
    tip = "The caustic as one file for browsers, in which its dispersion can be dragged, of 100 thousand photons."
    if widgets.button("Save page…", tip=tip, enabled=idle, width=-1):
        _ask("Save page", (".html",), view_model, _page_request)


def _animation(state: State, view_model: ViewModel, idle: bool) -> State:
    _choose("Kind", "kind", _KINDS, _KIND_TIPS[_choices.kind])
    rate = widgets.whole("Frame rate", round(_choices.fps), 1, 120, unit="fps", reset=24, tip="Pictures a second.")
    _choices.fps = float(rate)
    if _choices.kind == "keys":
        state = keys_editor.draw_keys(state, view_model)
        frames = keys_editor.frame_count(state.animation, _choices.fps)
    else:
        tip = "Pictures of one turn."
        frames = max(1, widgets.whole("Frames", _choices.frames, 2, 720, reset=120, tip=tip, clamp=False))
        _choices.frames = frames
    length = f"{frames / _choices.fps:.2f} s, {frames} {'frame' if frames == 1 else 'frames'}"
    widgets.read_out("Length", length, tip="How long the animation plays.")
    _choose("Size", "size", _SIZES, "Pixels of each picture.")
    _choose("Photons##frame", "photons", _PHOTONS, "Photons of each traced frame.")
    tip = (
        "An H.264 movie, a GIF of 256 colours, an animated WebP of all colours, or a folder of numbered PNGs that "
        "can be resumed."
    )
    _choose("File", "format", _FORMATS, tip)
    can = idle and (_choices.kind == "turntable" or bool(state.animation))
    tip = "Render all pictures with the present tone curve and exposure. The viewer stays usable meanwhile."
    if widgets.button("Render animation…", tip=tip if can or not idle else "Add keys first.", enabled=can, width=-1):
        _ask("Render animation", _suffixes(_choices.format), view_model, _animation_request, f"_{_choices.kind}")
    return state


def _suffixes(chosen: str) -> tuple[str, ...]:
    """Endings that are offered, the chosen one first: that of a film decides what it becomes, as those of pictures
    do."""
    return (chosen, *(suffix for suffix in FILMS if suffix != chosen)) if chosen in FILMS else (chosen,)


def _ask(
    title: str,
    suffixes: tuple[str, ...],
    view_model: ViewModel,
    request: Callable[[State, Path], Request],
    what: str = "",
) -> None:
    """Ask for a place to save, which becomes a request."""
    proposed = file_browser.beside(view_model.path, f"{Path(view_model.title).stem}{what}", suffixes[0])
    then = lambda state, _view_model, path: state.asking(request(state, path))  # noqa: E731
    file_browser.ask(file_browser.Question(title, suffixes, proposed, then, saving=True))


def _render_request(state: State, path: Path) -> Request:
    by_time = _choices.until == "time"
    return RenderPicture(
        path,
        _size(_choices.render_size, state),
        None if by_time else int(_choices.render_photons),
        _choices.seconds if by_time else None,
        int(_choices.samples) or None,
        _choices.caustic and not by_time,
        SPECTRAL_BINS if _choices.spectral else None,
    )


def _bake_request(state: State, path: Path) -> Request:
    return Bake(path, _choices.receiver, _size(_choices.map_size, state), int(_choices.map_photons))


def _page_request(state: State, path: Path) -> Request:
    return Bake(path, _choices.receiver, state.viewport_size, 100_000)


def _animation_request(state: State, path: Path) -> Request:
    # A sequence is a folder: the name that was given, without its ending.
    target = path.with_suffix("") if _choices.format == ".png" else path
    frames = None if _choices.kind == "keys" else _choices.frames
    size = _size(_choices.size, state)
    return Animate(target, _choices.kind, frames, _choices.fps, size, int(_choices.photons))


def _size(text: str, state: State) -> tuple[int, int]:
    """Pixels of "960x540", of the viewport or of the scene's own picture."""
    if text == "viewport":
        return state.viewport_size
    if text == "scene":
        return state.scene.render.width, state.scene.render.height
    width, _, height = text.partition("x")
    return int(width), int(height)
