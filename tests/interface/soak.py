"""Random mouse and keyboard, seeded: the same actions every time, over every control that is on the screen."""

from __future__ import annotations

import gc
import os
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from pathlib import Path

import moderngl
import numpy as np
from imgui_bundle import imgui
from spectrasplat.edit import requests
from spectrasplat.edit.state import Panels, Selection, State
from spectrasplat.ui.shell import draw_interface
from spectrasplat.ui.view_model import ViewModel

from tests.interface.rig import Hands

Key = imgui.Key
KEYS = [getattr(Key, letter) for letter in "gtybpvxrmlfhcwasdqe"] + [Key._0, Key._1, Key._2, Key.f1, Key.f5, Key.home]
KEYS += [
    Key.space,
    Key.escape,
    Key.delete,
    Key.enter,
    Key.tab,
    Key.left_bracket,
    Key.right_bracket,
    Key.equal,
    Key.minus,
]
KEYS += [Key.up_arrow, Key.down_arrow]
CHORDS = (Key.z, Key.y, Key.c, Key.v, Key.d, Key.r, Key.e, Key.s, Key.n, Key.o, Key.q, Key._1, Key._2)
MODIFIERS = ((), (), (), (Key.mod_shift,), (Key.mod_ctrl,), (Key.mod_alt,))
TEXTS = ("1.5", "0", "-3", "1e9", "nan", "inf", "-inf", "1e39", "589.3", "N-BK7", "λ", "", "a" * 40)
LEAVES_THE_SCENE = (requests.NewScene, requests.Open, requests.Recover)
"""What the soak must not do: its history would begin anew."""
TAKES_LONG = (requests.Animate, requests.Bake)
MAX_OBJECTS = 6
TABS = ("dispersion", "dispersion", "inspector", "inspector", "view", "brush")
EDITORS = ("Dispersion", "Inspector", "View", "Brush", "Abbe")
"""Windows that edit the scene: most of what is done is done there."""


@dataclass
class Guard:
    """The interface with its requests kept inside the test's own folder and time."""

    folder: Path
    answered: int = 0
    labels: set[str] = field(default_factory=set)
    """Of all edits."""

    def draw(self, state: State, view_model: ViewModel) -> State:
        """`draw_interface`, and what it may ask for."""
        after = draw_interface(state, view_model)
        kept: list[requests.Request] = []
        for request in after.requests:
            if isinstance(request, LEAVES_THE_SCENE + TAKES_LONG):
                continue
            if isinstance(request, requests.Save | requests.Screenshot) and request.path is not None:
                request = replace(request, path=self.folder / request.path.name)
            kept.append(request)
        self.answered += len(kept)
        if len(after.scene.objects) > MAX_OBJECTS:
            after = replace(after, scene=state.scene)
        elif after.scene is not state.scene:
            self.labels.add(after.edit_label)
        return replace(after, requests=tuple(kept))


class RandomHand:
    """Random actions on `hands`; `log` tells what was done, for the report of a failure."""

    def __init__(self, hands: Hands, seed: int) -> None:
        self._hands = hands
        self._rng = np.random.default_rng(seed)
        self.log: list[str] = []

    def act(self) -> None:
        """One action."""
        actions: list[tuple[float, Callable[[], str]]] = [
            (6, self._click),
            (5, self._drag_item),
            (1, self._double_click),
            (1, self._right_click),
            (2, self._wheel),
            (3, self._key),
            (2, self._chord),
            (2, self._type),
            (4, self._drag_picture),
            (2, self._click_picture),
            (1, self._panel),
            (1, self._rest),
            (9, self._edit),
            (2, self._undo),
        ]
        weights = np.array([weight for weight, _ in actions])
        chosen = int(self._rng.choice(len(actions), p=weights / weights.sum()))
        self.log.append(actions[chosen][1]())
        session = self._hands.session
        if session.wants_to_close:
            session.wants_to_close = session.asks_to_quit = False
        if session.jobs.exports.job is not None:
            session.jobs.cancel_export()

    def _item(self) -> str:
        labels = sorted(k for k, item in self._hands.interface.items.items.items() if "/" in k and item.is_visible)
        editors = [label for label in labels if label.split("/")[0] in EDITORS and "Window:" not in label]
        if editors and self._rng.random() < 0.7:
            labels = editors
        return labels[int(self._rng.integers(len(labels)))] if labels else "Picture"

    def _place(self) -> tuple[float, float]:
        width, height = self._hands.interface.size
        return float(self._rng.uniform(0, width)), float(self._rng.uniform(0, height))

    def _on_picture(self) -> tuple[float, float]:
        items = self._hands.interface.items.items
        return items["Picture"].at(*self._rng.uniform(0.02, 0.98, 2)) if "Picture" in items else self._place()

    def _modifiers(self) -> tuple[imgui.Key, ...]:
        return MODIFIERS[int(self._rng.integers(len(MODIFIERS)))]

    def _click(self) -> str:
        item = self._item()
        self._hands.interface.click(item, keys=self._modifiers())
        return f"click {item}"

    def _double_click(self) -> str:
        item = self._item()
        self._hands.interface.click(item, count=2)
        return f"double click {item}"

    def _right_click(self) -> str:
        item = self._item()
        self._hands.interface.click(item, button=1)
        return f"right click {item}"

    def _drag_item(self) -> str:
        item = self._item()
        start = self._hands.interface.find(item).at(*self._rng.uniform(0.1, 0.9, 2))
        end = start[0] + float(self._rng.normal(0, 80)), start[1] + float(self._rng.normal(0, 15))
        self._hands.interface.drag(start, end, steps=3)
        return f"drag {item}"

    def _wheel(self) -> str:
        place = self._on_picture() if self._rng.random() < 0.5 else self._place()
        self._hands.interface.wheel(place, float(self._rng.integers(-3, 4)), self._modifiers())
        return "wheel"

    def _key(self) -> str:
        key = KEYS[int(self._rng.integers(len(KEYS)))]
        self._hands.interface.key(key)
        return f"key {key.name}"

    def _chord(self) -> str:
        key = CHORDS[int(self._rng.integers(len(CHORDS)))]
        self._hands.interface.key(key, (Key.mod_ctrl,) if self._rng.random() < 0.8 else (Key.mod_ctrl, Key.mod_shift))
        return f"chord {key.name}"

    def _type(self) -> str:
        text = TEXTS[int(self._rng.integers(len(TEXTS)))]
        item = self._item()
        self._hands.interface.click(item, keys=(Key.mod_ctrl,))
        self._hands.interface.type(text)
        self._hands.interface.key(Key.enter)
        return f"type {text!r} into {item}"

    def _drag_picture(self) -> str:
        button = int(self._rng.integers(3))
        self._hands.interface.drag(
            self._on_picture(), self._on_picture(), steps=3, button=button, keys=self._modifiers()
        )
        return f"drag picture with button {button}, tool {self._hands.session.state.tool}"

    def _click_picture(self) -> str:
        self._hands.interface.click(self._on_picture(), keys=self._modifiers())
        return "click picture"

    def _panel(self) -> str:
        names = [each.name for each in fields(Panels) if each.name != "start_page" or self._rng.random() < 0.3]
        name = names[int(self._rng.integers(len(names)))]
        state = self._hands.session.state
        self._hands.session.state = state.with_panels(**{name: not getattr(state.preferences.panels, name)})
        self._hands.interface.frame(2)
        return f"panel {name}"

    def _edit(self) -> str:
        """Close what is in the way, choose something else, and drag one of its values: no dead ends."""
        for _ in range(2):
            self._hands.interface.key(Key.escape)
        state = self._hands.session.state
        kind = "light" if self._rng.random() < 0.3 else "object"
        count = len(state.scene.lights if kind == "light" else state.scene.objects)
        selection = Selection(kind, int(self._rng.integers(max(count, 1)))) if count else Selection()
        state = replace(state, selection=selection).with_panels(start_page=False)
        tab = TABS[int(self._rng.integers(len(TABS)))]
        self._hands.session.state = state.with_panels(**{tab: True})
        self._hands.interface.frame(2)
        items = self._hands.interface.items.items
        if f"Window: {tab.capitalize()}" in items:
            self._hands.interface.click(f"Window: {tab.capitalize()}")
        inside = sorted(
            k
            for k, item in items.items()
            if k.startswith(f"{tab.capitalize()}/") and item.is_visible and item.size[0] > 60
        )
        if not inside:
            return f"look at {kind} {selection.index}, {tab}"
        item = inside[int(self._rng.integers(len(inside)))]
        self._hands.interface.drag(items[item].at(0.75), items[item].at(float(self._rng.uniform(0.55, 0.95))), steps=2)
        return f"edit {kind} {selection.index}: drag {item}"

    def _undo(self) -> str:
        self._hands.interface.key(Key.z, (Key.mod_ctrl,))
        return "undo"

    def _rest(self) -> str:
        """Nothing for a while, as when the hand rests."""
        self._hands.interface.frame(6)
        return "rest"


def resident_bytes() -> int:
    """Memory of this process."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


DATA = (moderngl.Texture, moderngl.Buffer, moderngl.Framebuffer, moderngl.VertexArray)
PROGRAMS = (moderngl.Program, moderngl.ComputeShader)


def device_objects(kinds: tuple[type, ...] = DATA + PROGRAMS) -> int:
    """OpenGL objects that are alive."""
    gc.collect()
    alive = [o for o in gc.get_objects() if isinstance(o, kinds) and not isinstance(o.mglo, moderngl.InvalidObject)]
    return sum(o.glo != 0 for o in alive)  # 0 is the context's own framebuffer
