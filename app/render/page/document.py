"""A page as one file: its data in an HTML page with all that shows them, which asks nothing of a network."""

from __future__ import annotations

import base64
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
    blob, listed = bytearray(), {}
    for name, values in arrays.items():
        blob += bytes(-len(blob) % 4)
        data = np.ascontiguousarray(values)
        listed[name] = {"dtype": _DTYPES[data.dtype.name], "shape": list(data.shape), "offset": len(blob)}
        blob += data.astype(data.dtype.newbyteorder("<")).tobytes()
    text = json.dumps({**head, "compressed": True, "arrays": listed}, ensure_ascii=False, allow_nan=False)
    packed = base64.b64encode(zlib.compress(bytes(blob), 6)).decode()
    return (
        f'<script type="application/json" id="head">{text.replace("<", chr(92) + "u003c")}</script>\n'
        f'<script type="text/plain" id="blob">{packed}</script>\n'
    )


def document(arrays: Mapping[str, np.ndarray], head: Mapping[str, Any]) -> str:
    """The whole page."""
    folder = assets_dir() / "page"

    def text(name: str) -> str:
        return (folder / name).read_text(encoding="utf-8")

    modules = "\n".join(_EXPORT.sub("", _IMPORT.sub("", text(name))) for name in text("modules.txt").split())
    parts = {"/*STYLE*/": text("page.css"), "/*SCRIPT*/": modules, "<!--DATA-->": data_elements(arrays, head)}
    page = text("page.html").replace("<title></title>", f"<title>{_escaped(head['title'])}</title>")
    for mark, content in parts.items():
        page = page.replace(mark, content, 1)
    return page


def _escaped(words: str) -> str:
    return words.replace("&", "&amp;").replace("<", "&lt;")
