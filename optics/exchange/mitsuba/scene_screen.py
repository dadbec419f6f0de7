"""The diffuse screen of a scene and the pinhole camera that watches it, as dictionaries for mi.load_dict."""

from __future__ import annotations

from math import atan2, degrees, radians, tan
from types import ModuleType
from typing import Any

import numpy as np

from optics.base.runtime import UserError
from optics.scene.receivers import Screen
from thbcad.lens import Lens

FIELD = 40.0  # degrees, of the camera, where the lens leaves room
NEAREST = 0.9  # of the distance from the screen to the lens: the camera is not farther away
WIDE = (640, 480)  # pixels of the camera that sees lens and screen
FLAT = 1e-6  # relative difference of a pixel's sides


def square_pixels(screen: Screen) -> None:
    """Check that pixels are square, as a camera's are.

    Raises
    ------
    UserError : they are not.
    """
    (hx, hy), (columns, rows) = screen.half_width, screen.pixels
    if abs(hx * rows / (hy * columns) - 1) > FLAT:
        raise UserError(
            "the camera's pixels are square: target.pixels must be in proportion to target.half_width, "
            f"got {columns} x {rows} pixels on {hx:g} x {hy:g} mm"
        )


def screen_rectangle(mi: ModuleType, screen: Screen, z: float, reflectance: float) -> dict[str, Any]:
    """Return the screen at z mm, which faces the lens."""
    hx, hy = screen.half_width
    plane = mi.ScalarTransform4f().translate([0, 0, z])
    return {
        "type": "rectangle",
        "to_world": plane.rotate([0, 1, 0], 180).scale([hx, hy, 1]),
        "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": reflectance}},
    }


def watching_camera(
    mi: ModuleType, screen: Screen, z: float, highest: float, sigma: float = 0.0
) -> dict[str, Any]:
    """Return a pinhole camera between the lens and the screen that sees just the screen.

    highest : z of the lens's highest point, mm.
    sigma : pixels, of the Gaussian in which the film measures; 0 is a film of box pixels.
    """
    (hx, hy), (columns, rows) = screen.half_width, screen.pixels
    away = min(max(hx, hy) / tan(radians(FIELD / 2)), NEAREST * (z - highest))
    view = {"origin": [0, 0, z - away], "target": [0, 0, z], "up": [0, 1, 0]}
    return {
        "type": "perspective",
        "fov": 2 * degrees(atan2(hx, away)),
        "fov_axis": "x",
        "near_clip": 1e-3 * away,
        "far_clip": 10 * (away + hx + hy),
        "to_world": mi.ScalarTransform4f().look_at(**view),
        "film": {
            "type": "hdrfilm",
            "width": columns,
            "height": rows,
            "pixel_format": "luminance",
            "rfilter": {"type": "gaussian", "stddev": sigma} if sigma else {"type": "box"},
        },
    }


def overview_camera(mi: ModuleType, screen: Screen, z: float, lens: Lens) -> dict[str, Any]:
    """Return a pinhole camera behind the source that looks past the lens at the whole screen.

    The lens stands dark before a quarter of the screen: paths from the source end in a camera from matt
    surfaces alone, and glass is none.
    """
    (hx, hy), middle = screen.half_width, lens.thickness / 2
    behind = np.array([hx / 2, -hy / 2, z])  # the point of the screen that the middle of the lens covers
    size = max(hx, hy, *lens.rear.half_width)
    away = z - middle + 2 * size / tan(radians(FIELD / 2))
    origin = behind + (np.array([0.0, 0.0, middle]) - behind) * (away / (z - middle))
    view = {"origin": origin.tolist(), "target": [0, 0, z], "up": [0, 1, 0]}
    return {
        "type": "perspective",
        "fov": FIELD,
        "fov_axis": "smaller",
        "near_clip": 1e-3 * away,
        "far_clip": 10 * (away + hx + hy),
        "to_world": mi.ScalarTransform4f().look_at(**view),
        "film": {
            "type": "hdrfilm",
            "width": WIDE[0],
            "height": WIDE[1],
            "pixel_format": "luminance",
            "rfilter": {"type": "box"},
        },
    }
