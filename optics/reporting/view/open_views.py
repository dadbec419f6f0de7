"""From where a scene is seen: from beside and above, where its parts stand apart and its picture is open."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from optics.reporting.view.solid_renderer import oblique
from optics.scene.receivers import Receiver
from thbcad.checks import Floats

TURNS, RISES = range(-50, 310, 10), (18.0, 35.0)  # degrees, of the views that are tried, the usual one first
LINES = 16  # directions in the picture, in which two parts may stand apart
FREE = 0.2  # of a part's size: more room between two parts is not better
LEAST = 0.2  # of the larger of two parts: as large is the smaller taken at least
OPEN = 0.6  # cosine: a picture seen less obliquely is not better
HIDDEN = 0.1  # below it a part of a curved picture is lost
SAMPLES = 9  # of a picture in each direction
# what is worth how much beside room for the target: room for the source, which is seen through, a picture
# that is upright and reads right, the face of a mirror, a way of light that is long and leads to the right
SOURCE, UPRIGHT, FACE, LEG, LEADS = 0.5, 0.5, 0.5, 0.5, 0.1


def best_view(
    parts: Sequence[Floats], face: Floats | None, receiver: Receiver, half_width: tuple[float, float]
) -> Floats:
    """Return the rotation of a view, rows right, up and towards the viewer, (3, 3).

    parts : points (3, n) of source, elements in the order of the light, and target.
    face : (3,), outward normal of the face of the element that is to be seen; None is any.
    half_width : of the picture that is to be seen, in the chart of its receiver
    """
    turns = np.stack([oblique(turn, rise) for rise in RISES for turn in TURNS])
    right, up, toward = turns[:, 0], turns[:, 1], turns[:, 2]
    worth = _apart(right, up, parts[-2:]) + SOURCE * _apart(right, up, parts[:2])
    for pair in ((parts[0], parts[-1]), *pairwise(parts[1:-1])):
        worth += SOURCE * _apart(right, up, pair)
    for leg in np.diff([part.mean(axis=1) for part in parts], axis=0):
        leg /= np.linalg.norm(leg)
        worth += LEG * np.hypot(right @ leg, up @ leg) + LEADS * (right @ leg)
    if face is not None:
        worth += FACE * np.clip(toward @ face, 0.0, OPEN) / OPEN
    if not receiver.far_field:
        grid = np.meshgrid(*(h * np.linspace(-1, 1, SAMPLES) for h in half_width))
        normals = np.stack(np.broadcast_arrays(*receiver.normal(*grid))).reshape(3, -1)
        cosines = toward @ normals
        cosines *= np.sign(cosines.mean(axis=1, keepdims=True))
        worth += np.where(cosines < HIDDEN, -1.0, np.minimum(cosines, OPEN) / OPEN).mean(axis=1)
        u, v, _ = receiver.pose.rotation.T
        worth += UPRIGHT * (right @ u + up @ v) / 2
    return turns[int(np.argmax(worth))]


def _apart(right: Floats, up: Floats, pair: Sequence[Floats]) -> Floats:
    """Return how far two parts stand apart in views, relative to the smaller, (m,): -1 where one hides it."""
    angles = 2 * np.pi / LINES * np.arange(LINES)
    lines = np.cos(angles)[:, None, None] * right + np.sin(angles)[:, None, None] * up
    one, other = (lines @ part for part in pair)
    sizes = [float(np.ptp(part, axis=1).max()) for part in pair]
    room = (one.min(axis=-1) - other.max(axis=-1)).max(axis=0)
    return np.clip(room / max(min(sizes), LEAST * max(sizes)), -1.0, FREE)
