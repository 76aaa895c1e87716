"""A page as one file: its data in an HTML page with all that shows them, which asks nothing of a network.

Its words and its still stand before the scripts and the data, so that a browser shows them while it reads the rest, and
where the rest is damaged or cannot be shown."""

from __future__ import annotations

import base64
import html
import io
import itertools
import json
import re
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...base.paths import assets_dir

_DTYPES = {"float32": "f4", "float16": "f2", "uint8": "u1", "uint16": "u2", "uint32": "u4"}
_IMPORT = re.compile(r"^import\b.*;\n", re.MULTILINE)
_EXPORT = re.compile(r"^export (?=\w)", re.MULTILINE)


def data_elements(arrays: Mapping[str, np.ndarray], head: Mapping[str, Any]) -> str:
    """The two script elements that hold a page's data (docs/pages.md)."""
    packed, listed = _packed(arrays)
    text = json.dumps({**head, "arrays": listed}, ensure_ascii=False, allow_nan=False)
    return (
        f'<script type="application/json" id="head">{text.replace("<", chr(92) + "u003c")}</script>\n'
        f'<script type="text/plain" id="blob">{packed}</script>\n'
    )


def packed_bytes(arrays: Mapping[str, np.ndarray]) -> int:
    """Bytes that `arrays` take in a page's file."""
    return len(_packed(arrays)[0])


def _packed(arrays: Mapping[str, np.ndarray]) -> tuple[str, dict[str, Any]]:
    """All of them, deflated, base64; and where each lies in that."""
    blob, listed = bytearray(), {}
    for name, values in arrays.items():
        blob += bytes(-len(blob) % 4)
        data = np.ascontiguousarray(values)
        listed[name] = {"dtype": _DTYPES[data.dtype.name], "shape": list(data.shape), "offset": len(blob)}
        blob += data.astype(data.dtype.newbyteorder("<")).tobytes()
    return base64.b64encode(zlib.compress(bytes(blob), 6)).decode(), listed


def document(arrays: Mapping[str, np.ndarray], head: Mapping[str, Any]) -> str:
    """The whole page. `arrays`: as docs/pages.md lists them, with `still`, a JPEG file."""
    from PIL import Image

    folder = assets_dir() / "page"

    def text(name: str) -> str:
        return (folder / name).read_text(encoding="utf-8")

    held = dict(arrays)
    file = held.pop("still").tobytes()
    width, height = Image.open(io.BytesIO(file)).size
    still = "data:image/jpeg;base64," + base64.b64encode(file).decode()
    title = html.escape(head["title"])
    parts = {
        "<!--TITLE-->": title,
        "<!--DESCRIPTION-->": html.escape(head["description"]),
        "<!--STILL-->": f'<img id="still" elementtiming="still" alt="{title}: a still picture" src="{still}">',
        "<!--TALL-->": f"{height / width:.6g}",
        "<!--FIXED-->": "" if head["groups"] else " hidden",
        "<!--GLASSES-->": "".join(map(_glass_row, head["groups"], itertools.repeat(head))),
        "<!--GAIN-->": f"{head['limits']['gain_max']:g}",
        "<!--SPECTRA-->": "".join(_option(i, s["name"]) for i, s in enumerate(head["spectra"]) if s.get("choice")),
        "<!--NOTES-->": "".join(f"<p>{html.escape(note)}</p>\n" for note in head["notes"]),
        "/*STYLE*/": text("page.css"),
        "/*SCRIPT*/": "\n".join(_EXPORT.sub("", _IMPORT.sub("", text(name))) for name in text("modules.txt").split()),
        "<!--DATA-->": data_elements(held, head),
    }
    return re.sub("|".join(map(re.escape, parts)), lambda found: parts[found[0]], text("page.html"))


def _option(value: int, words: str) -> str:
    return f'<option value="{value}">{html.escape(words)}</option>'


def _glass_row(group: Mapping[str, Any], head: Mapping[str, Any]) -> str:
    """A label with the glasses among which a reader chooses."""
    glasses = ((row, head["glasses"][row]) for row in group["choices"])
    options = "".join(_option(row, f"{glass['name']} (V {glass['V_d']:.1f})") for row, glass in glasses)
    name = f"Glass of {', '.join(group['objects'])}" if len(head["groups"]) > 1 else "Glass"
    return f'<label class="row"><span>{html.escape(name)}</span><select>{options}</select></label>'
