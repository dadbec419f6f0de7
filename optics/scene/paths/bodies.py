"""Bodies: what fills space beside the faces that light means to meet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf

import numpy as np

from thbcad.certified import greatest_slope
from thbcad.checks import Floats
from thbcad.lens import Lens
from thbcad.moulds import Solid, lens_of
from thbcad.poses import IDENTITY, Pose

ROUGH = 1e-2  # of a slope: it only tells which rays need not be searched for


@dataclass(frozen=True, eq=False)
class Body:
    """A closed body, which takes the light that meets it in air where it means to go elsewhere.

    solid : in its own frame, with its front vertex at 0.  pose : from there to the frame of the path.
    faces : by the numbers of its own surfaces along the path, which they are, "front" or "rear"; one more
        than the last is the receiver's.
    name : in words.
    beside : poses beside some of its faces, by their numbers, which have moved in it: there it is where they
        are, or else light to such a face would meet the body that it was in before.
    """

    solid: Solid
    pose: Pose = IDENTITY
    faces: Mapping[int, str] = field(default_factory=dict)
    name: str = "a body"
    beside: Mapping[int, Pose] = field(default_factory=dict)

    def moved(self, motion: Pose) -> Body:
        """Return the body elsewhere.  motion : in the frame of the path."""
        if motion.is_identity:
            return self
        beside = {k: motion @ pose for k, pose in self.beside.items()}
        return replace(self, pose=motion @ self.pose, beside=beside)

    def with_faces_moved(self, motions: Sequence[Pose]) -> Body:
        """Return the body where its last face takes it.  motions : of all surfaces along the path."""
        last = motions[max(self.faces)]
        beside = {k: motions[k] @ self.pose for k in self.faces if motions[k] != last}
        body = self.moved(last)
        return replace(body, beside=beside) if beside else body

    def pose_between(self, before: int, behind: int) -> Pose:
        """Return its pose for light on its way between two surfaces, by their numbers."""
        return self.beside.get(before, self.beside.get(behind, self.pose))

    @cached_property
    def box(self) -> Floats:
        """The corners of a box around the solid in its own frame, mm, (2, 3)."""
        lens = lens_of(self.solid)
        front, rear = (graph.coefficients for graph in lens.own_graphs())
        edges = [] if isinstance(self.solid, Lens) else [z for _, z in self.solid.level_edges]
        low, high = (end([end(front), lens.thickness + end(rear), *edges]) for end in (np.min, np.max))
        half = np.max([lens.front.half_width, lens.rear.half_width], axis=0)
        return np.array([[*-half, low], [*half, high]])

    @cached_property
    def steepest(self) -> float:
        """A slope that front and rear nowhere exceed; of a body for a mould, with a land beside them, inf."""
        if not isinstance(self.solid, Lens):
            return inf
        surfaces = zip(self.solid.own_graphs(), (self.solid.front, self.solid.rear))
        return max(greatest_slope(graph, ROUGH, surface.outline).upper for graph, surface in surfaces)
