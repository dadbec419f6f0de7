"""The pictures of the problem files beside this script: `python examples/others/pictures.py` writes them.

All are grey numbers that count as light (`encoding = "linear"`), as in the work that they are compared with.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

HERE = Path(__file__).parent
PEARL = HERE.parent / "pearl.png"  # J. Vermeer, c. 1665, public domain
SIZE, PADDED = 256, 25  # pixels: diffinytrace's picture, and what it adds on every side
TEXT, LETTERS = 512, 230  # pixels: of the text's picture, and the size of its letters
FAR = 45.0  # degrees: half of the far target, at the middle of its sides
REACHED = 40.0  # degrees from the axis: there the rear passes 56 % of the light, at 45 degrees 26 %


def padded() -> Image.Image:
    """Return the pearl as diffinytrace's own reader makes it: 256 x 256, in a black frame of 25 pixels."""
    picture = np.asarray(Image.open(PEARL).convert("L").resize((SIZE, SIZE)))
    return Image.fromarray(np.pad(picture, PADDED))


def text() -> Image.Image:
    """Return white letters "BIT" on black."""
    picture = Image.new("L", (TEXT, TEXT))
    font = ImageFont.load_default(LETTERS)
    ImageDraw.Draw(picture).text((TEXT / 2, TEXT / 2), "BIT", 255, font, anchor="mm")
    return picture


def photograph() -> Image.Image:
    """Return a portrait by NASA, public domain, that scikit-image carries."""
    from skimage.data import astronaut

    return Image.fromarray(astronaut()).convert("L")


def reachable(picture: Image.Image) -> Image.Image:
    """Return a picture of the far field, black beyond REACHED from the axis."""
    light = np.array(picture.convert("L").resize((TEXT, TEXT)))
    tangent = np.tan(np.radians(FAR * ((2 * np.arange(TEXT) + 1) / TEXT - 1)))
    light[tangent**2 + tangent[:, None] ** 2 > np.tan(np.radians(REACHED)) ** 2] = 0
    return Image.fromarray(light)


if __name__ == "__main__":
    padded().save(HERE / "pearl_padded.png")
    text().save(HERE / "text.png")
    photograph().save(HERE / "astronaut.png")
    reachable(Image.open(PEARL)).save(HERE / "pearl_far.png")
