"""Problem files to start from."""

from __future__ import annotations

from optics.problem.problem_record import Problem
from optics.problem.schema import Freeform, Front, LensSpec, Rear, Source, Target
from optics.problem.toml_records import AUTO
from optics.problem.toml_text import problem_to_toml


def commented_problem() -> str:
    """Return a problem file to start from: every key with a value and a comment."""
    freeform = Freeform(max_level=AUTO, z_freedom=AUTO)
    example = Problem(
        title="my lens",
        source=Source(kind="collimated", half_width=(47.5, 47.5)),
        lens=LensSpec(
            index=1.5,
            thickness=20.0,
            front=Front(half_width=(50.0, 50.0)),
            rear=Rear(half_width=(50.0, 50.0), radius=AUTO, conic=AUTO, freeform=freeform),
        ),
        target=Target(kind="image", image="picture.png", distance=300.0, half_width=(100.0, 100.0)),
    )
    return problem_to_toml(example, notes=True)
