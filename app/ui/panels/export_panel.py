"""Taking pictures away: screenshots, baked caustic maps, animations; how far the running one is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from imgui_bundle import imgui

from ...base.image_io import OFFERED_LINEAR, OFFERED_SHOWN, SPECTRAL_SUFFIXES
from ...base.movie import FILMS
from ...edit.requests import Animate, Bake, CancelJob, Screenshot
from ...edit.state import State
from ..view_model import ViewModel
from . import file_browser, keys_editor, render_section, rows, widgets

SIZES = {size: words for size, words in render_section.SIZES.items() if size != "scene"}
MAP_SIZES = {"512x512": "512 × 512", "1024x1024": "1024 × 1024", "2048x2048": "2048 × 2048", "4096x4096": "4096 × 4096"}
PHOTONS = render_section.PHOTONS
_KINDS = {"turntable": "Turntable", "keys": "Keys"}
_FORMATS = {suffix: film.title for suffix, film in FILMS.items()} | {".png": "Sequence (PNG)"}


@dataclass
class _Choices:
    """What was chosen last; memory of the interface, not of the document."""

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
    """Of the running export, as it was drawn last."""

    height: float = 0.0
    """Pixels, with the gap above it."""


_choices, _footer = _Choices(), _Footer()


def draw_export(state: State, view_model: ViewModel) -> State:
    """Draw the panel's contents. The running export is shown below what scrolls: nothing moves under the mouse that
    started it."""
    idle = view_model.job is None
    imgui.begin_child("##choices", imgui.ImVec2(0, 0 if idle else -max(_footer.height, _least_footer())))
    state = _sections(state, view_model, idle)
    imgui.end_child()
    if not idle:
        top = imgui.get_cursor_pos_y()
        state = _running(state, view_model)
        _footer.height = imgui.get_cursor_pos_y() - top + imgui.get_style().item_spacing.y
    return _answers(state)


def _sections(state: State, view_model: ViewModel, idle: bool) -> State:
    if widgets.section("Render"):
        state = render_section.draw_render(state, view_model, idle)
    if widgets.section("Screenshot"):
        _screenshot(view_model, idle)
    if widgets.section("Caustic map"):
        _bake(state, view_model, idle)
    if widgets.section("Animation"):
        state = _animation(state, view_model, idle)
    return state


def _running(state: State, view_model: ViewModel) -> State:
    job = view_model.job
    assert job is not None
    imgui.separator()
    imgui.text_unformatted(job.title)
    imgui.progress_bar(job.fraction, imgui.ImVec2(-1, 0), f"{100 * job.fraction:.0f} %")
    rows.explain("Export progress", "The export works in the time that the window leaves; editing does not change it.")
    widgets.hint(job.text or " ")  # a line that comes and goes would move the button
    if job.is_stopped:
        label, tip = "Discard it", "Do not wait for what is done to become a picture: write nothing at all."
    else:
        label = "Cancel export"
        tip = (
            "Stop the export. What is done is kept: a picture is written with the light that it has by then, a movie "
            "plays up to here, a sequence keeps its frames."
        )
    if widgets.button(label, tip=tip, width=-1):
        state = state.asking(CancelJob())
    return state


def _least_footer() -> float:
    """Height of a running export whose words need one line: it is known before it was drawn."""
    style = imgui.get_style()
    lines = 2.0 * imgui.get_text_line_height_with_spacing() + 2.0 * imgui.get_frame_height_with_spacing()
    return lines + 2.0 * style.item_spacing.y + 1.0


def _screenshot(view_model: ViewModel, idle: bool) -> None:
    _, _choices.spectral = widgets.toggle(
        "Spectral bins",
        _choices.spectral,
        tip="Write an EXR with 20 spectral channels (W/(m² sr) in each bin), rendered anew in the background.",
    )
    if not _choices.spectral:
        _, _choices.with_interface = widgets.toggle(
            "With interface", _choices.with_interface, tip="The whole window as it is on the screen (PNG)."
        )
    suffixes = (
        SPECTRAL_SUFFIXES
        if _choices.spectral
        else (".png",)
        if _choices.with_interface
        else (*OFFERED_SHOWN, *OFFERED_LINEAR)
    )
    tip = "PNG: as displayed. EXR and NPY: linear Rec.709 radiance, lm/(sr unit²), without tone curve."
    if widgets.button("Save screenshot…", tip=tip, enabled=idle or not _choices.spectral, width=-1):
        _ask("screenshot", "Save screenshot", suffixes, view_model)


def _bake(state: State, view_model: ViewModel, idle: bool) -> None:
    names = list(dict.fromkeys(item.name for item in state.scene.objects if item.material.receives))
    if not names:
        widgets.hint("Nothing in this scene is diffuse, so nothing carries a caustic.")
        return
    if _choices.receiver not in names:
        _choices.receiver = names[0]
    _, _choices.receiver = widgets.combo(
        "Receiver", names, _choices.receiver, tip="The diffuse object whose caustic is baked."
    )
    _, _choices.map_size = widgets.combo(
        "Texels",
        MAP_SIZES,
        _choices.map_size,
        tip="Size of the texture, texels. A curved receiver gets about as many in all.",
    )
    _, _choices.map_photons = widgets.combo(
        "Photons##map", PHOTONS, _choices.map_photons, tip="Photons emitted for the map."
    )
    tip = (
        "Irradiance of the caustic, lm/unit², as EXR or NPY (linear) or PNG (to look at). A .json beside it says "
        "where the texture lies in the world."
    )
    if widgets.button("Bake map…", tip=tip, enabled=idle, width=-1):
        _ask("bake", "Bake caustic map", (*OFFERED_LINEAR, *OFFERED_SHOWN), view_model, f"_{_choices.receiver}")


def _animation(state: State, view_model: ViewModel, idle: bool) -> State:
    kind_tips = {
        "turntable": "The camera goes once round its target; photons are traced once.",
        "keys": "Parameters of the scene move from key to key.",
    }
    _, kind = widgets.combo("Kind", _KINDS, _choices.kind, tip=kind_tips[_choices.kind])
    _choices.kind = "keys" if kind == "keys" else "turntable"
    _, _choices.fps, _ = widgets.slider(
        "Frame rate", _choices.fps, 1.0, 120.0, unit="fps", format="%.0f", reset=24.0, tip="Pictures a second."
    )
    _choices.fps = float(round(_choices.fps))
    if _choices.kind == "keys":
        state = keys_editor.draw_keys(state, view_model)
        frames = keys_editor.frame_count(state.animation, _choices.fps)
    else:
        _, count, _ = widgets.slider(
            "Frames",
            _choices.frames,
            2,
            720,
            unit="",
            format="%.0f",
            reset=120,
            tip="Pictures of one turn.",
            clamp=False,
        )
        _choices.frames = frames = max(1, round(count))
    length = f"{frames / _choices.fps:.2f} s, {frames} {'frame' if frames == 1 else 'frames'}"
    widgets.read_out("Length", length, tip="How long the animation plays.")
    _, _choices.size = widgets.combo("Size", SIZES, _choices.size, tip="Pixels of each picture.")
    _, _choices.photons = widgets.combo(
        "Photons##frame", PHOTONS, _choices.photons, tip="Photons of each traced frame."
    )
    _, _choices.format = widgets.combo(
        "File",
        _FORMATS,
        _choices.format,
        tip="An H.264 movie, a GIF of 256 colours, an animated WebP of all colours, or a folder of numbered PNGs that "
        "can be resumed.",
    )
    can = idle and (_choices.kind == "turntable" or bool(state.animation))
    tip = "Render all pictures with the present tone curve and exposure. The viewer stays usable meanwhile."
    if widgets.button("Render animation…", tip=tip if can or not idle else "Add keys first.", enabled=can, width=-1):
        _ask(
            "animate",
            "Render animation",
            _suffixes(_choices.format),
            view_model,
            f"_{_choices.kind}",
        )
    return state


def _suffixes(chosen: str) -> tuple[str, ...]:
    """Endings that are offered, the chosen one first: that of a film decides what it becomes, as those of pictures
    do."""
    return (chosen, *(suffix for suffix in FILMS if suffix != chosen)) if chosen in FILMS else (chosen,)


def _ask(identity: str, title: str, suffixes: tuple[str, ...], view_model: ViewModel, what: str = "") -> None:
    proposed = file_browser.beside(view_model.path, f"{Path(view_model.title).stem}{what}", suffixes[0])
    file_browser.ask(file_browser.Question(f"export {identity}", title, suffixes, proposed, saving=True))


def _answers(state: State) -> State:
    """Places chosen in the file dialogue become requests."""
    path = file_browser.take("export screenshot")
    if path is not None:
        state = state.asking(Screenshot(path, _choices.spectral, _choices.with_interface and not _choices.spectral))
    path = file_browser.take("export bake")
    if path is not None:
        state = state.asking(
            Bake(path, _choices.receiver, _size(_choices.map_size, (1024, 1024)), int(_choices.map_photons))
        )
    path = file_browser.take("export animate")
    if path is not None:
        # A sequence is a folder: the name that was given, without its ending.
        target = path.with_suffix("") if _choices.format == ".png" else path
        frames = None if _choices.kind == "keys" else _choices.frames
        size = None if _choices.size == "viewport" else _size(_choices.size, (960, 540))
        state = state.asking(Animate(target, _choices.kind, frames, _choices.fps, size, int(_choices.photons)))
    return state


def _size(text: str, default: tuple[int, int]) -> tuple[int, int]:
    width, _, height = text.partition("x")
    return (int(width), int(height)) if height else default


def reset() -> None:
    """Choices as at the start."""
    render_section.reset()
    fresh = _Choices()
    for name, value in vars(fresh).items():
        setattr(_choices, name, value)
