"""Small pictures of a result: its scene, its light, and its solid, as WebP."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from optics.reporting.view import Face, View, oblique, rendered, solid_faces
from optics.scene.photometry import srgb
from thbcad import Lens

Floats = NDArray[np.float64]

SIDE = 440  # pixels, of all pictures; three of them stand side by side
QUALITY = 82  # of WebP: 100 is the best; edges of text stay clean
TEXT_INCHES, DPI = 0.4, 110  # of the scene's picture: what stands under it is too small to be read here
MARGIN = 12  # pixels around what is drawn
BRIGHTEST = 0.999  # quantile of the light that is shown as white
TURN, RISE = 32.0, 24.0  # degrees: from where the solid is seen
ROOM = 0.55  # half-size of the view of the solid, in sizes of its picture
BODY = (0.80, 0.85, 0.90)  # colour of a lens with what holds it
DARK = 80  # levels of a picture of 256, of lines that are black
DENSE = 1.5  # points of a triangle per pixel of the view, in each direction


def webp(image: Image.Image) -> bytes:
    """Return a picture as WebP."""
    buffer = io.BytesIO()
    image.convert("RGB").save(buffer, "webp", quality=QUALITY, method=6)
    return buffer.getvalue()


def scene_picture(path: Path) -> bytes:
    """Return the picture of a scene without its text and margins."""
    image = Image.open(path).convert("RGB")
    drawn = image.crop((0, 0, image.width, image.height - round(TEXT_INCHES * DPI)))
    dark = np.asarray(drawn).min(axis=2) < 250
    rows, columns = (np.flatnonzero(dark.any(axis=axis)) for axis in (1, 0))
    box = columns[0] - MARGIN, rows[0] - MARGIN, columns[-1] + MARGIN, rows[-1] + MARGIN
    return webp(_fitted(_on_white(drawn, box)))


def _on_white(image: Image.Image, box: tuple[int, int, int, int]) -> Image.Image:
    """Return what lies in a box (left, upper, right, lower), white where it reaches out of the picture."""
    out = Image.new("RGB", (box[2] - box[0], box[3] - box[1]), "white")
    out.paste(image, (-box[0], -box[1]))
    return out


def _fitted(image: Image.Image) -> Image.Image:
    """Return a picture on a white square of SIDE pixels, as large as fits."""
    scale = SIDE / max(image.size)
    size = max(1, round(scale * image.width)), max(1, round(scale * image.height))
    small = image.resize(size, Image.Resampling.LANCZOS)
    out = Image.new("RGB", (SIDE, SIDE), "white")
    out.paste(small, ((SIDE - size[0]) // 2, (SIDE - size[1]) // 2))
    return out


def light_picture(path: Path) -> bytes:
    """Return the light of an irradiance.npz as a camera shows it: encoded as sRGB, in colour where it is.

    White is the 99.9 % quantile of the light.
    """
    with np.load(path) as arrays:
        light: dict[str, Floats] = dict(arrays)
    irradiance = light["irradiance"]
    top = float(np.quantile(irradiance, BRIGHTEST))
    if "xyz" in light:
        xyz, white = light["xyz"], light["xyz"].mean(axis=(1, 2))
        shown = srgb(xyz * (white[1] / np.quantile(xyz[1], BRIGHTEST)), white)
    else:
        shown = srgb(np.broadcast_to(np.clip(irradiance, 0.0, top) / top, (3, *irradiance.shape)), np.ones(3))
    levels = np.rint(255 * np.moveaxis(shown, 0, 2)).astype(np.uint8)
    x, y = np.ptp(light["x"]), np.ptp(light["y"])
    size = round(SIDE * min(1.0, x / y)), round(SIDE * min(1.0, y / x))
    return webp(_fitted(Image.fromarray(levels).resize(size, Image.Resampling.BICUBIC)))


def cells_picture(path: Path) -> bytes:
    """Return the picture of a mesh without what is around its frame.

    The frame consists of the outermost dark lines that run over half of the picture.
    """
    image = Image.open(path).convert("RGB")
    dark = np.asarray(image).max(axis=2) < DARK
    rows, columns = (np.flatnonzero(dark.mean(axis=axis) > 0.5) for axis in (1, 0))
    return webp(_fitted(image.crop((columns[0], rows[0], columns[-1] + 1, rows[-1] + 1))))


def lens_picture(lens: Lens) -> bytes:
    """Return the solid of a lens, seen obliquely from behind, or from before where the front alone is free.

    The relief is shaded steeper than it is.
    """
    faces, _ = solid_faces(lens)
    return _shaded(faces, oblique(TURN if lens.rear.sag or not lens.front.sag else TURN + 180, RISE))


def mesh_picture(mesh: Any) -> bytes:
    """Return a body seen obliquely from behind.  mesh : a trimesh.Trimesh."""
    turn = oblique(TURN, RISE)
    seen = np.ptp((turn[:2] @ mesh.vertices.T), axis=1).max()
    pixel = 2 * ROOM * seen / SIDE
    corners = np.asarray(mesh.triangles)  # (t, 3, 3)
    sides: Floats = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    counts = np.maximum(2, np.ceil(DENSE * sides / pixel).astype(int) + 1)
    points, normals = [], []
    for count in np.unique(counts):
        chosen = counts == count
        weights = barycentric(count)
        points.append(np.einsum("wk,tkd->dtw", weights, corners[chosen]).reshape(3, -1))
        normals.append(np.repeat(mesh.face_normals[chosen].T, len(weights), axis=1))
    cloud, outward = np.concatenate(points, axis=1), np.concatenate(normals, axis=1)
    body = Face("body", cloud[:, :, None], outward[:, :, None], BODY)
    return _shaded([body], turn)


def barycentric(count: int) -> Floats:
    """Return the weights of the points of a triangle with so many points on each side, (n, 3)."""
    i, j = np.triu_indices(count)
    return np.stack([i, j - i, count - 1 - j], axis=1) / (count - 1)


def _shaded(faces: list[Face], turn: Floats) -> bytes:
    seen = np.concatenate([turn[:2] @ face.points.reshape(3, -1) for face in faces], axis=1)
    low, high = seen.min(axis=1), seen.max(axis=1)
    view = View(turn, (low + high) / 2, ROOM * float((high - low).max()))
    _, image = rendered(faces, view)
    colour, opacity = image[::-1, :, :3], image[::-1, :, 3:]
    shown = np.rint(255 * np.clip(colour * opacity + 1 - opacity, 0, 1)).astype(np.uint8)
    return webp(_fitted(Image.fromarray(shown)))
