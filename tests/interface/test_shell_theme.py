"""Fonts and colours: every sign the panels use has a glyph, and words can be read on their grounds."""

from __future__ import annotations

import pytest
from spectrasplat.gpu.context import Context
from spectrasplat.ui import theme
from spectrasplat.ui.theme import DARK, LIGHT, Colour, Palette

from tests.interface.shell_rig import ShellRig

SIGNS = "λμµ°²₂₁−×ΔΣ≤≥·…–—→±½√∞αβη"


def test_both_faces_have_every_sign(gl: Context) -> None:
    with ShellRig(gl):
        from imgui_bundle import imgui

        for font in (imgui.get_font(), theme.bold()):
            assert font is not None
            assert not [sign for sign in SIGNS if not font.is_glyph_in_font(ord(sign))]


@pytest.mark.parametrize("chosen", [DARK, LIGHT])
def test_words_have_contrast(chosen: Palette) -> None:
    """WCAG 2.2, 1.4.3: 4.5 for words."""
    for words in (chosen.text, chosen.muted, chosen.warning, chosen.error, chosen.good, chosen.accent):
        assert _contrast(words, chosen.window) >= 4.5, words
    assert _contrast(chosen.text, chosen.frame) >= 7.0


def _contrast(a: Colour, b: Colour) -> float:
    low, high = sorted((_luminance(a), _luminance(b)))
    return (high + 0.05) / (low + 0.05)


def _luminance(colour: Colour) -> float:
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour[:3]]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
