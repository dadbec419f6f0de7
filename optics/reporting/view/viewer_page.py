"""A page that shows source, element, rays and the light on the target, to be turned in a browser.

The page holds its program and its data, and asks no network.  The points of the element are its own, rounded
to float32, on a grid that is denser where a surface is steep; the browser joins them by triangles and moves
them to the pose of the element.
"""

import json
from base64 import b64encode
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np

from optics.light.tracing import RayPath
from optics.reporting.view.drawn_rays import stop_rims
from optics.reporting.view.scene_layout import Scene, block_means, caption, drawn_elements, placed
from optics.reporting.view.solid_renderer import Face
from optics.scene.system import System
from thbcad.checks import Floats

SAMPLES = 177  # across a face: two faces of 8 bytes a point take 0.67 MB as text; the indices have 16 bits
OTHERS = 41  # the same of elements that are not designed
MOST_PIXELS = 256  # of the irradiance, across
MOST_PATHS = 96
INT16 = 32767


def scene_page(system: System, irradiance: Floats, paths: Sequence[RayPath]) -> str:
    """Return an HTML page of source, element, rays and the light on the target, of at most 1 MB.

    It shows what the picture by `figures.scene_view` shows.  Where that draws the throw shorter or longer,
    the page can show it true.  Of more than 96 paths, and of more than 256 pixels across, it shows paths at
    equal steps and means of blocks.

    irradiance : (rows, columns), row 0 at +y.  paths : from `scene_paths`.
    """
    elements = drawn_elements(system, SAMPLES, OTHERS)
    scene, to_own = placed(system, elements), system.pose.inverse()
    own, name = [], system.problem.optic.called
    for element in elements:
        turned = element.name != name
        motion = to_own @ element.pose
        own += [_face(face.posed(motion) if turned else face, turned) for face in element.faces]
    step = -(-len(paths) // MOST_PATHS) or 1
    shown = [(scene.visible(path.points), path.fate) for path in paths[::step]]
    far = [scene.outlook] if scene.target.size else [points[:, -1:] for points, _ in shown]
    stops = [rim for rims in stop_rims(system) for rim in rims]
    around = np.concatenate([*scene.bodies, scene.source, *stops, *far], axis=1)
    data = {
        "caption": caption(system.problem, scene),
        "angles": [
            float(np.arctan2(-scene.turn[0, 2], scene.turn[0, 0])),
            float(np.arcsin(scene.turn[2, 1])),
        ],
        "squeeze": float(scene.squeeze),
        "along": scene.along.tolist(),
        "gap": scene.gap,
        "views": {"scene": around.T.tolist(), "element": scene.body.T.tolist()},
        "element": system.problem.optic.noun,
        "pose": [*system.pose.rotation.T.tolist(), system.pose.shift.tolist()],
        "faces": own,
        "sources": [(s.outline if any(s.half_width) else s.outline[:, :1]).T.tolist() for s in scene.sources],
        "stops": [rim.T.tolist() for rim in stops],
        "target": _target(scene, irradiance),
        "rays": _rays(shown),
    }
    text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    page = files("optics.reporting.view").joinpath("viewer.html").read_text("utf-8")
    return page.replace("DATA", text, 1).replace("TITLE", escape(system.problem.title), 1)


def _packed(array: Floats, kind: type) -> str:
    """Return numbers as base64, little-endian, row by row."""
    return b64encode(array.astype(np.dtype(kind).newbyteorder("<")).tobytes()).decode()


def _grid(values: Floats, kind: type) -> tuple[int, int, str]:
    """Return numbers on a grid as (rows, columns, numbers): one row or column where all are equal."""
    if not np.ptp(values, axis=0).any():
        values = values[:1]
    if not np.ptp(values, axis=1).any():
        values = values[:, :1]
    return (*values.shape, _packed(values, kind))


def _face(face: Face, turned: bool) -> dict[str, Any]:
    """Return a face as a grid of points and normals; of the ruled edges the two rims are enough.

    On front and rear nz = +-sqrt(1 - nx^2 - ny^2) is left out, but where they are turned.  flip : whether
    triangles (i, j), (i + 1, j), (i + 1, j + 1) run clockwise, seen from outside.
    """
    optical = face.name in ("front", "rear")
    ends = slice(None) if optical else slice(None, None, face.points.shape[2] - 1)
    points, normals = face.points[:, :, ends], face.normals[:, :, ends]
    tangents = points[:, 1:, :1] - points[:, :-1, :1], points[:, :-1, -1:] - points[:, :-1, :1]
    outward = np.einsum("kij,kij->", np.cross(*tangents, axis=0), normals[:, :-1, :1])
    given = [_grid(np.rint(INT16 * n), np.int16) for n in normals]
    return {
        "glass": optical,
        "shape": points.shape[1:],
        "points": [_grid(p, np.float32) for p in points],
        "normals": [*given[:2], None if optical and not turned else given[2]],
        "side": 1 if face.name == "rear" else -1,
        "flip": bool(outward < 0),
    }


def _target(scene: Scene, irradiance: Floats) -> dict[str, Any] | None:
    """Return the target's points as a grid, and the light on it as grey levels up to the 99.9 % quantile."""
    if not scene.target.size:
        return None
    side = -(-max(irradiance.shape) // MOST_PIXELS)
    shown = block_means(irradiance, side)
    top = float(np.quantile(irradiance, 0.999)) or 1.0
    grey = np.rint(255 * np.clip(shown / top, 0.0, 1.0))
    return {
        "rim": scene.outlook.T.tolist(),
        "shape": scene.target.shape[1:],
        "points": scene.target.reshape(3, -1).T.tolist(),
        "image": {"shape": grey.shape, "grey": _packed(grey, np.uint8)},
    }


def _rays(shown: Sequence[tuple[Floats, str]]) -> dict[str, Any]:
    """Return the ends of the straight parts of all paths, and how many ends belong to paths that hit."""
    parts: dict[bool, list[Floats]] = {True: [], False: []}
    for points, fate in shown:
        parts[fate.endswith("on_target")].append(np.repeat(points, 2, axis=1)[:, 1:-1])
    ends = np.concatenate([np.zeros((3, 0)), *parts[True], *parts[False]], axis=1)
    return {"points": _packed(ends.T, np.float32), "hits": sum(part.shape[1] for part in parts[True])}
