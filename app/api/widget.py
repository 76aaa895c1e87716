"""The part of a live view that runs in the browser, by anywidget (the extra `notebook`)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..base.paths import assets_dir

Handler = Callable[[dict[str, Any]], None]


def lack_of_front_end() -> str | None:
    """Why there can be no live view here; None where there can."""
    try:
        import anywidget  # noqa: F401
        from IPython import get_ipython
    except ImportError:
        return "for a live view install anywidget: pip install anywidget, then restart the kernel"
    shell = get_ipython()
    if getattr(shell, "kernel", None) is None:
        return "a live view needs a notebook with a running kernel (Jupyter, VS Code, Colab); this is the picture alone"
    return None


class Front:
    """One widget; what it is shown in may be several cells."""

    def __init__(self, handle: Handler, size: tuple[int, int]) -> None:
        import anywidget
        import traitlets

        folder = assets_dir() / "notebook"
        kept = {
            "_esm": (folder / "view.js").read_text(encoding="utf-8"),
            "_css": (folder / "view.css").read_text(encoding="utf-8"),
            "size": traitlets.List().tag(sync=True),
            "glasses": traitlets.List().tag(sync=True),
            "told": traitlets.Unicode("").tag(sync=True),
            "page": traitlets.Unicode("").tag(sync=True),
        }
        # Made here, so that nothing of Jupyter is imported before somebody asks for a view.
        kind = type("SpectraSplatView", (anywidget.AnyWidget,), kept)
        self.widget = kind(size=list(size))
        self.widget.on_msg(lambda _, message, buffers: handle(message))

    def send(self, message: dict[str, Any], data: bytes | None = None) -> None:
        """To the browser."""
        self.widget.send(message, [] if data is None else [data])

    def glasses(self, listed: list[dict[str, Any]]) -> None:
        """What there are sliders for, with their values."""
        if self.widget.glasses != listed:
            self.widget.glasses = listed

    def tell(self, text: str) -> None:
        """A sentence below the picture; "" for none."""
        if self.widget.told != text:
            self.widget.told = text

    def keep(self, page: str) -> None:
        """A page that stays in saved notebooks, for readers without a kernel; "" for none."""
        if self.widget.page != page:
            self.widget.page = page

    def mimebundle(self) -> dict[str, Any]:
        """For a cell's output."""
        bundle = self.widget._repr_mimebundle_()
        return dict(bundle[0] if isinstance(bundle, tuple) else bundle or {})

    def close(self) -> None:
        """Take it out of the notebook."""
        self.widget.close()
