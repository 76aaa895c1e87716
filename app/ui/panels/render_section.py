"""Render…: size, photons or time, samples, layers and output of a finished picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ...base.image_io import OFFERED_LINEAR, OFFERED_SHOWN, SPECTRAL_SUFFIXES
from ...edit.requests import RenderPicture
from ...edit.state import State
from ..view_model import ViewModel
from . import file_browser, widgets

SIZES = {
    "scene": "As the scene says",
    "viewport": "As the viewport",
    "960x540": "960 × 540",
    "1280x720": "1280 × 720",
    "1920x1080": "1920 × 1080",
    "3840x2160": "3840 × 2160",
}
PHOTONS = {
    "250000": "250 thousand",
    "1000000": "1 million",
    "4000000": "4 million",
    "16000000": "16 million",
    "64000000": "64 million",
}
_UNTIL = {"photons": "A number of photons", "time": "A time"}
_SAMPLES = {"0": "As the scene needs", "4": "4", "16": "16", "64": "64", "256": "256"}
_QUESTION = "export render"


@dataclass
class _Choices:
    """What was chosen last; memory of the interface, not of the document."""

    size: str = "scene"
    until: str = "photons"
    photons: str = "4000000"
    seconds: float = 60.0
    samples: str = "0"
    caustic: bool = False
    spectral: bool = False


_choices = _Choices()


def draw_render(state: State, view_model: ViewModel, idle: bool) -> State:
    """Draw the section's contents; a chosen name becomes a request."""
    _, _choices.size = widgets.combo("Size##render", SIZES, _choices.size, tip="Pixels of the picture.")
    _, _choices.until = widgets.combo("Until", _UNTIL, _choices.until, tip="When the picture is finished.")
    if _choices.until == "photons":
        _, _choices.photons = widgets.combo(
            "Photons##render", PHOTONS, _choices.photons, tip="Photons emitted for the picture."
        )
    else:
        _, _choices.seconds, _ = widgets.slider(
            "Seconds",
            _choices.seconds,
            5.0,
            3600.0,
            unit="s",
            format="%.0f",
            reset=60.0,
            logarithmic=True,
            tip="What the whole picture may take, writing included.",
        )
    _, _choices.samples = widgets.combo("Samples", _SAMPLES, _choices.samples, tip="Camera samples a pixel.")
    if _choices.until == "photons":
        _, _choices.caustic = widgets.toggle(
            "Caustics alone too", _choices.caustic, tip="Write a second file, NAME_caustic, with nothing but caustics."
        )
    _, _choices.spectral = widgets.toggle(
        "Spectral bins##render", _choices.spectral, tip="Write an EXR with 20 spectral channels beside its colours."
    )
    suffixes = SPECTRAL_SUFFIXES if _choices.spectral else (*OFFERED_SHOWN, *OFFERED_LINEAR)
    tip = "Choose a name, then render with the present view. How long it takes is shown while it works."
    if widgets.button("Render…", tip=tip, enabled=idle, width=-1):
        proposed = file_browser.beside(view_model.path, Path(view_model.title).stem, suffixes[0])
        file_browser.ask(file_browser.Question(_QUESTION, "Render", suffixes, proposed, saving=True))
    path = file_browser.take(_QUESTION)
    return state if path is None else state.asking(_request(state, path))


def _request(state: State, path: Path) -> RenderPicture:
    if _choices.size == "scene":
        size = state.scene.render.width, state.scene.render.height
    elif _choices.size == "viewport":
        size = state.viewport_size
    else:
        width, _, height = _choices.size.partition("x")
        size = int(width), int(height)
    by_time = _choices.until == "time"
    return RenderPicture(
        path,
        size,
        None if by_time else int(_choices.photons),
        float(_choices.seconds) if by_time else None,
        int(_choices.samples) or None,
        _choices.caustic and not by_time,
        SPECTRAL_BINS if _choices.spectral else None,
    )


SPECTRAL_BINS = 20


def reset() -> None:
    """Choices as at the start."""
    for name, value in vars(_Choices()).items():
        setattr(_choices, name, value)
