"""Pixels of pictures, and what pages hold."""

import io
import json
import re

import numpy as np
from PIL import Image


def pixels(png):
    """Return (rows, columns, 3) float, 0 to 255."""
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), float)


def held(page):
    """Return the data of a page that is turned in a browser."""
    (data,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page)
    return json.loads(data)
