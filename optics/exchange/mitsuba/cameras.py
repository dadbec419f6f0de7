"""What measures light in a Mitsuba scene: a screen, a camera that sees just that, one that sees more.

Screens may lie anywhere.  They face the light: it goes along the +z of their own frame.
"""

from math import atan2, degrees, inf, radians, tan
from types import ModuleType
from typing import Any

import numpy as np

from optics.base.runtime import UserError
from optics.scene.receivers import Screen
from thbcad.checks import Floats
from thbcad.poses import Pose

FIELD = 40.0  # degrees, of the camera, where the bodies leave room
NEAREST = 0.9  # of the distance at which a body would come between camera and screen
ROOM = 1.25  # around the screen, of half its diagonal, in the picture of the other camera
WIDE = (640, 480)  # pixels of the camera that sees an element and the screen
FLAT = 1e-6  # relative difference of a pixel's sides


def placed(mi: ModuleType, pose: Pose) -> Any:
    """Return a pose as Mitsuba's transform."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = pose.rotation, pose.shift
    return mi.ScalarTransform4f(matrix)


def square_pixels(screen: Screen) -> None:
    """Check that pixels are square, as a camera's are."""
    (hx, hy), (columns, rows) = screen.half_width, screen.pixels
    if abs(hx * rows / (hy * columns) - 1) > FLAT:
        raise UserError(
            "the camera's pixels are square: target.pixels must be in proportion to target.half_width, "
            f"got {columns} x {rows} pixels on {hx:g} x {hy:g} mm"
        )


def screen_rectangle(mi: ModuleType, screen: Screen, pose: Pose, reflectance: float) -> dict[str, Any]:
    """Return the screen at its pose, which faces the light."""
    hx, hy = screen.half_width
    return {
        "type": "rectangle",
        "to_world": placed(mi, pose).rotate([0, 1, 0], 180).scale([hx, hy, 1]),
        "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": reflectance}},
    }


def watching_camera(
    mi: ModuleType, screen: Screen, pose: Pose, points: Floats, sigma: float = 0.0
) -> dict[str, Any]:
    """Return a pinhole camera before the screen that sees just the screen, and no body.

    A point of a body at depth d before the screen and (x, y) across it is beside the pyramid of a camera at
    the distance a where a < d / (1 - max(|x| / hx, |y| / hy)).

    points : of all bodies, (3, n) mm.
    sigma : pixels, of the Gaussian in which the film measures; 0 is a film of box pixels.
    """
    (hx, hy), (columns, rows) = screen.half_width, screen.pixels
    x, y, z = pose.inverse().points(points)
    beside = 1 - np.maximum(np.abs(x) / hx, np.abs(y) / hy)
    before = (z < 0) & (beside > 0)
    room = float(np.min(-z[before] / beside[before], initial=inf))
    away = min(max(hx, hy) / tan(radians(FIELD / 2)), NEAREST * room)
    view = {"origin": [0, 0, -away], "target": [0, 0, 0], "up": [0, 1, 0]}
    return _pinhole(
        to_world=placed(mi, pose) @ mi.ScalarTransform4f().look_at(**view),
        fov=(2 * degrees(atan2(hx, away)), "x"),
        clip=(1e-3 * away, 10 * (away + hx + hy)),
        pixels=(columns, rows),
        window={"type": "gaussian", "stddev": sigma} if sigma else {"type": "box"},
    )


def overview_camera(
    mi: ModuleType, screen: Screen, pose: Pose, middle: Floats, size: float
) -> dict[str, Any]:
    """Return a pinhole camera that looks past an element at the whole screen.

    The element stands dark before a quarter of the screen at most: paths from the source end in a camera from
    matt surfaces alone, and glass is none.

    middle : of the element, (3,) mm.  size : half of the element's, mm.
    """
    hx, hy = screen.half_width
    half, size = size, max(hx, hy, size)
    # half of what it covers, as large as it looks from there
    shade = half * (1 + float(np.linalg.norm(middle - pose.shift)) * tan(radians(FIELD / 2)) / (2 * size))
    covered = pose.points(np.array([max(hx / 2, shade), -max(hy / 2, shade), 0.0]))
    apart = float(np.linalg.norm(middle - covered))
    away = apart + 2 * size / tan(radians(FIELD / 2))
    origin = covered + (middle - covered) * (away / apart)
    up = pose.directions(np.array([0.0, 1.0, 0.0]))
    view = {"origin": origin.tolist(), "target": pose.shift.tolist(), "up": up.tolist()}
    seen = atan2(ROOM * np.hypot(hx, hy), np.linalg.norm(origin - pose.shift))
    return _pinhole(
        to_world=mi.ScalarTransform4f().look_at(**view),
        fov=(2 * degrees(seen), "smaller"),
        clip=(1e-3 * away, 10 * (away + hx + hy)),
        pixels=WIDE,
        window={"type": "box"},
    )


def _pinhole(
    to_world: Any,
    fov: tuple[float, str],
    clip: tuple[float, float],
    pixels: tuple[int, int],
    window: dict[str, Any],
) -> dict[str, Any]:
    """Return a pinhole camera.  fov : degrees, along an axis.  window : of its pixels."""
    return {
        "type": "perspective",
        "fov": fov[0],
        "fov_axis": fov[1],
        "near_clip": clip[0],
        "far_clip": clip[1],
        "to_world": to_world,
        "film": {
            "type": "hdrfilm",
            "width": pixels[0],
            "height": pixels[1],
            "pixel_format": "luminance",
            "rfilter": window,
        },
    }
