"""Sentences that name an option of the command line, said with what the window has instead.

Notes and errors come from the layers below, which know neither; who reads them in a window has no option to give.
"""

from __future__ import annotations

import re

_INSTEAD: tuple[tuple[str, str], ...] = (
    (r"; --(?:flat shows facets|smooth rounds it)", ""),
    (r"; --up y or z says it", "; the button on the picture stands it up along the other"),
    (r"--up is for", "an upward axis is for"),
    (r"--up '([^']*)'", r"the upward axis '\1'"),
    (r"; --glass takes another(?:, for one part too \([^)]*\))?", "; Choose glass… in the Dispersion panel has others"),
    (
        r"Make it glass with --glass diamond, or one part with --glass .*?, in the window with Make glass\.",
        "Make one part of it glass with Make glass, on the picture.",
    ),
    (r"--glass: ", ""),
    (r"--glass (\S+): ", r"\1: "),
    (r"--environment sky, or a panorama, shows another", "Environment, with World in the Inspector, shows another"),
    (r"--environment '([^']*)'", r"the environment '\1'"),
    (r"; --max-depth allows more", "; Longest path, with World in the Inspector, allows more"),
    (r"choose more --spp", "choose more Samples"),
    (r"--size (\d+x\d+)", r"a picture of \1"),
    (r" with --bins (\d+)", r" with \1 spectral bins"),
    (r"smaller --size", "smaller size"),
    (r"larger --size", "larger size"),
    (r"fewer --bins", "no spectral bins"),
    (r"choose another folder, or replace (its frames|them) with --overwrite", "choose another folder"),
    (r"allow it with --allow-outside \(or its folder in (\w+)\)", r"name its folder in \1 before the start"),
)


def in_window(text: str) -> str:
    """`text` without options of the command line."""
    if "--" not in text:
        return text
    began = text.startswith("--")
    for option, instead in _INSTEAD:
        text = re.sub(option, instead, text)
    return text[:1].upper() + text[1:] if began else text
