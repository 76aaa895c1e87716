"""Draws the shipped textures: a page of print, which shows what glass does to edges better than any pattern, and tiles.

The words are our own; the letters are those of the font that Pillow brings (Aileron, CC0), so nothing is installed.
Run from the project's folder: python assets/textures/generate.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

HERE = Path(__file__).resolve().parent
SIZE = 1024
MARGIN = 64
TILES, JOINT = 8, 1.5
"""Along a side of the picture; half a joint's width, pixels."""
HEADING_SIZE, TEXT_SIZE = 62, 37
HEADING = "White light, bent"
TEXT = (
    "Glass slows light down, and the blue of it more than the red. A ray that meets a "
    "slanted face is therefore bent, and each of its colours by an angle of its own. "
    "Behind a prism the edge of a white card is no longer white and black: on one side it "
    "wears a rim of red and yellow, on the other one of blue and violet. "
    "A lens is a prism whose angle grows from the middle to the rim. In its middle these "
    "letters stay black; towards the rim they part into colours, the more so the further "
    "out they stand. Opticians call this lateral colour. They take it away with a second "
    "lens, of another glass, whose colours run the other way. "
    "A ball bends most of all. What lies behind it stands on its head, and the light that "
    "it gathers draws a bright curve on the table, with a coloured border where the rays "
    "turn back. Hold a page under a glass of water in the sun and look."
)


def page() -> Image.Image:
    """The page, SIZE × SIZE, black on white."""
    image = Image.new("L", (SIZE, SIZE), 255)
    pen = ImageDraw.Draw(image)
    heading, letters = ImageFont.load_default(HEADING_SIZE), ImageFont.load_default(TEXT_SIZE)
    pen.text((MARGIN, MARGIN - 14), HEADING, fill=0, font=heading)
    top = MARGIN + int(1.45 * HEADING_SIZE)
    for line in broken(TEXT, letters, SIZE - 2 * MARGIN):
        pen.text((MARGIN, top), line, fill=0, font=letters)
        top += int(1.32 * TEXT_SIZE)
    assert top <= SIZE - MARGIN // 2, f"the text ends at {top}, below the page"
    return image


def tiles() -> Image.Image:
    """TILES × TILES tiles of a pool, each a little another colour, with joints between them."""
    random = np.random.default_rng(4)
    colour = np.array([0.80, 0.93, 0.96]) + random.normal(0.0, 0.022, (TILES, TILES, 1)) * [1.0, 0.9, 0.8]
    side = SIZE // (2 * TILES)
    picture = np.kron(colour, np.ones((side, side, 1)))
    place = (np.arange(side * TILES) + 0.5) % side
    joint = np.minimum(place, side - place) < JOINT
    picture[joint[:, None] | joint] = [0.55, 0.62, 0.64]
    return Image.fromarray(np.round(255.0 * np.clip(picture, 0.0, 1.0)).astype(np.uint8))


def broken(text: str, font: ImageFont.FreeTypeFont, width: float) -> list[str]:
    """`text` in lines no wider than `width` pixels."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if font.getlength(longer) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


if __name__ == "__main__":
    page().save(HERE / "text.png", optimize=True)
    tiles().save(HERE / "tiles.png", optimize=True)
