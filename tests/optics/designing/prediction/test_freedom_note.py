"""What `check` proposes where z_freedom is too small: who follows it is asked for no more."""

import math
import re
import shlex

import pytest

from optics.designing.prediction import expected
from optics.designing.starts import STEEP, TransportStart
from optics.scene.keys import assignment
from optics.scene.problem import Problem
from optics.scene.system import System, solvable_system
from tests.optics.cases import flat_problem, small_system
from tests.optics.designing.optimisation.cases import designed

pytestmark = pytest.mark.usefixtures("coarse_concentration")

TIGHT = {"lens.rear.freeform.z_freedom": 0.2}
POINT = TIGHT | {"source.kind": "point", "source.distance": 20.0, "source.half_angle": 15.0}
LED = POINT | {"source.kind": "lambertian", "source.half_width": [0.2, 0.2], "optimizer.window": "bspline"}
FAR = TIGHT | {"target.kind": "tophat", "target.distance": math.inf, "target.half_width": [12.0, 12.0]}
THIN = TIGHT | {"lens.thickness": 0.6, "lens.rear.radius": math.inf}
WIDE = TIGHT | {"target.half_width": [45.0, 45.0], "lens.thickness": 25.0, "lens.rear.radius": math.inf}
CASES = {"beam": TIGHT, "point": POINT, "LED": LED, "far field": FAR, "thin": THIN, "wide": WIDE}


def followed(problem, note):
    """Return the problem with the first alternative of a note: options --set KEY=VALUE."""
    first = re.search(r"(--set .*?)(?: or --set|, or |$)", note)[1]
    options = [word for word in shlex.split(first) if word != "--set"]
    return problem.with_(**dict(assignment(text, Problem) for text in options)), options


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_who_follows_the_note_is_asked_for_no_more(tmp_path, backend, name):
    """Nor by the design, which then starts from the whole map."""
    system = solvable_system(small_system(tmp_path, CASES[name] | {"optimizer.iterations": [1]}).problem)
    asked, _ = expected(system, backend)
    assert not asked.from_transport
    problem, options = followed(system.problem, asked.note)
    assert any("z_freedom=" in option for option in options)
    other = solvable_system(problem)
    found, _ = expected(other, backend)
    assert found.note == ""
    assert found.from_transport
    made = designed(other, backend)
    assert made.state.started_from_transport
    assert not any("transport map" in note for note in made.notes)


@pytest.mark.slow
def test_a_thin_lens_is_proposed_thicker_with_the_freedom_that_it_then_needs(tmp_path, backend):
    system = small_system(tmp_path, THIN)
    note = expected(system, backend)[0].note
    assert "which would bring rear and front together: --set lens.thickness=" in note
    problem, _ = followed(system.problem, note)
    thinner = problem.with_(**{"lens.thickness": 0.6})
    assert "bring rear and front together" in expected(System(thinner), backend)[0].note


@pytest.mark.slow
def test_no_freedom_is_proposed_where_the_surface_of_the_map_loses_the_light(tmp_path, backend):
    """A geometry is, in which it loses no more than a tenth."""
    system = small_system(tmp_path, WIDE)
    assert TransportStart(system, backend).lost(system) > STEEP
    found, _ = expected(system, backend)
    assert "but no z_freedom helps, since so steep a surface would lose" in found.note
    assert "or let both surfaces bend it" in found.note
    problem, options = followed(system.problem, found.note)
    assert any(option.startswith("target.") for option in options)
    other = System(problem)
    assert TransportStart(other, backend).lost(other) <= STEEP


@pytest.mark.slow
def test_a_fixed_rear_that_light_misses_is_proposed_wider(backend):
    """As wide as takes all of it: a free front spreads a beam of nearly the width of both faces."""
    front = {"half_width": (10, 10), "freeform": {"spans": (5, 5), "max_level": 1, "z_freedom": 4.0}}
    target = {"kind": "function", "formula": "exp(-2*r^2) + 0.1", "half_width": (20, 20), "distance": 100}
    beam = {"kind": "collimated", "half_width": (9.5, 9.5)}
    rear = {"half_width": (10, 10), "freeform": False}
    lens = {"front": front, "rear": rear, "thickness": 12}
    system = solvable_system(flat_problem(beam, target, lens))
    found, _ = expected(system, backend)
    said, share = found.note, re.match(r"([\d.]+)% of the light would miss the rear", found.note)[1]
    assert float(share) == pytest.approx(100 * (0.9216 - found.efficiency - found.stray), abs=0.5)
    problem, _ = followed(system.problem, said.replace("; --set", ": --set").removesuffix(" takes it"))
    other, _ = expected(solvable_system(problem), backend)
    assert other.note == ""
    assert other.efficiency + other.stray > 0.92


@pytest.mark.slow
def test_no_rear_of_several_lenses_is_proposed(backend):
    """The light that misses a face may miss that of another lens."""
    freeform = {"spans": (5, 5), "max_level": 1, "z_freedom": 5.5}
    faces = [{"half_width": (half, half), "freeform": False} for half in (10, 9)]
    lenses = [
        {"name": "L1", "front": faces[0] | {"freeform": freeform}, "rear": faces[0], "position": (0, 0, -40)},
        {"name": "L2", "front": faces[1], "rear": faces[1], "position": (0, 0, 0)},
    ]
    lenses = [lens | {"kind": "lens", "index": 1.5, "thickness": 6} for lens in lenses]
    source = {"kind": "collimated", "half_width": (9.5, 9.5), "distance": 60}
    target = {"kind": "function", "formula": "1 + 0.3*x", "position": (0, 0, 100), "half_width": (60, 60)}
    system = solvable_system(Problem(source=source, element=lenses, target=target | {"pixels": (16, 16)}))
    assert "would miss the rear" not in expected(system, backend)[0].note


@pytest.mark.slow
def test_the_design_says_what_check_says(tmp_path, backend):
    """Of a start whose coarse mesh alone is cut off, for which the design does without the map."""
    system = small_system(tmp_path, POINT | {"optimizer.iterations": [1], "lens.rear.freeform.max_level": 3})
    start = TransportStart(system, backend)
    fine = start.fit(system.base.sags[-1].space.uniform(system.freeforms[-1].finest))
    assert start.traced.asked > fine.asked
    needed = re.search(r"z_freedom=[\d.]+", expected(system, backend)[0].note)[0]
    first, *_ = designed(system, backend).notes
    assert f"--set lens.rear.freeform.{needed}; the design starts from the base surface instead" in first
