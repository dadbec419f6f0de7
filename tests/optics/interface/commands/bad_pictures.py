"""Bad pictures by what is wrong with them: what makes the file, and words of the refusal."""

import io
import os
import struct
import zlib

import numpy as np
from PIL import Image

from tests.optics.cases import picture


def saved(image, kind="PNG", **options):
    """Return a picture as the bytes of a file."""
    buffer = io.BytesIO()
    image.save(buffer, kind, **options)
    return buffer.getvalue()


GOOD = Image.fromarray(picture())
PNG, JPEG, TIFF, GIF = (saved(GOOD, kind) for kind in ("PNG", "JPEG", "TIFF", "GIF"))
BMP, WEBP = (saved(GOOD, kind) for kind in ("BMP", "WEBP"))
EPS = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 8 8\n%%EndComments\nshowpage\n%%EOF\n"
SVG = b'<svg xmlns="http://www.w3.org/2000/svg" width="8" height="8"><rect width="8" height="8"/></svg>'


def claimed(width, height):
    """Return a PNG that claims to have this size."""
    data = bytearray(PNG)
    data[16:24] = struct.pack(">II", width, height)
    data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    return bytes(data)


def floats(*values):
    return saved(Image.fromarray(np.array([values], dtype=np.float32)), "TIFF")


def black(mode, kind="PNG", colour=0):
    return saved(Image.new(mode, (8, 8), colour), kind)


def written(data):
    return lambda path: path.write_bytes(data)


def looped(path):
    path.symlink_to(path)


def missing(path):
    """Write nothing."""


MEND, AGAIN, KINDS = "check the path", "save it again", "save it as one of PNG, JPEG, TIFF"
SMALLER, PATH, DARK = "make it smaller", "give the path of a file", "it asks for no light"
# by name: what makes the file at a path, and the remedy that the refusal must hold
BAD_PICTURES = {
    "missing": (missing, MEND),
    "a folder": (lambda path: path.mkdir(), PATH),
    "a pipe": (os.mkfifo, PATH),
    "a device": (lambda path: path.symlink_to("/dev/zero"), PATH),
    "a link to itself": (looped, MEND),
    "a link to nothing": (lambda path: path.symlink_to(path.with_name("gone")), MEND),
    "empty": (written(b""), KINDS),
    "a text": (written(b"a picture of a pearl\n"), KINDS),
    "a web page": (written(b"<!DOCTYPE html><html><body>404</body></html>"), KINDS),
    "an SVG": (written(SVG), KINDS),
    "an EPS, which starts a program": (written(EPS), KINDS),
    "a PDF": (written(b"%PDF-1.4\n%%EOF\n"), KINDS),
    "zeros": (written(bytes(1000)), KINDS),
    "a PNG's head alone": (written(PNG[:8]), KINDS),
    "a PNG without pixels": (written(PNG[:33]), KINDS),
    "half a PNG": (written(PNG[: len(PNG) // 2]), AGAIN),
    "a PNG with wrong bytes": (written(PNG[:60] + bytes(40) + PNG[100:]), AGAIN),
    "half a JPEG": (written(JPEG[: len(JPEG) // 2]), AGAIN),
    "half a TIFF": (written(TIFF[: len(TIFF) // 2]), AGAIN),
    "half a GIF": (written(GIF[:300]), KINDS),
    "half a BMP": (written(BMP[: len(BMP) // 2]), AGAIN),
    "half a WebP": (written(WEBP[: len(WEBP) // 2]), AGAIN),
    "14000 x 14000 pixels": (written(claimed(14_000, 14_000)), SMALLER),
    "10 billion pixels": (written(claimed(100_000, 100_000)), SMALLER),
    "no pixels": (written(claimed(0, 48)), KINDS),
    "black": (written(black("L")), DARK),
    "black in colour": (written(black("RGB", "JPEG")), DARK),
    "transparent": (written(black("RGBA", colour=(255, 255, 255, 0))), DARK),
    "NaN": (written(floats(0.5, np.nan)), "mend them first"),
    "infinite light": (written(floats(0.5, np.inf)), "mend them first"),
    "negative light": (written(floats(0.5, -0.5)), "light cannot be negative"),
    "32 bits": (written(saved(Image.fromarray(np.array([[1, 1 << 20]], dtype=np.int32)), "TIFF")), "16 bits"),
}
