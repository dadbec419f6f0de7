"""Rows of elements: their light path, what each wavelength meets, and rows that cannot be."""

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.designing.optimisation import transmitted_flux
from optics.scene.paths import AIR, Medium
from optics.scene.problem import Problem, load_problem
from optics.scene.system import System, solvable_system
from tests.optics.scene.problem.cases import refusal
from thbcad.poses import Pose

SIZE = (10.0, 10.0)
FIXED = {"freeform": None, "half_width": SIZE}
LENS = {
    "kind": "lens",
    "name": "L1",
    "index": 1.5,
    "thickness": 5.0,
    "front": {"half_width": SIZE, "radius": 40.0},
    "rear": {**FIXED, "radius": -60.0, "conic": -1.0},
}
MIRROR = {"kind": "mirror", "name": "M1", "position": (0, 0, 60), "tilt": (45, 0, 0), "thickness": 5.0}
MIRROR |= {"face": {"half_width": (14.0, 20.0)}}
TARGET = {
    "kind": "tophat",
    "half_width": SIZE,
    "pixels": (16, 16),
    "position": (0, 80, 60),
    "tilt": (-90, 0, 0),
}


def row(*elements, **more):
    """Return a problem of elements in a beam along z."""
    source = {"kind": "collimated", "half_width": (5, 5), "distance": 40.0} | more.pop("source", {})
    return Problem(source=source, element=elements, target=TARGET | more.pop("target", {}), **more)


def test_the_path_goes_over_all_elements_in_their_poses():
    system = System(row(LENS | {"position": (1, 2, 3), "tilt": (10, 0, 0)}, MIRROR))
    path = system.path
    assert [surface.name for surface in path.surfaces] == ["L1.front", "L1.rear", "M1.face"]
    assert path.media == (AIR, Medium(1.5), AIR, AIR)
    lens = Pose.tilted((1, 2, 3), (10, 0, 0))
    wanted = lens, lens @ Pose.at((0, 0, 5)), Pose.tilted((0, 0, 60), (45, 0, 0))
    for surface, pose in zip(path.surfaces, wanted):
        np.testing.assert_allclose(surface.pose.rotation, pose.rotation, rtol=0, atol=1e-15)
        np.testing.assert_allclose(surface.pose.shift, pose.shift, rtol=0, atol=1e-14)
    assert path.surfaces[2].shape is system.base.front
    assert path.surfaces[0].shape.conic.radius == 40
    assert path.throw == pytest.approx(80)


@pytest.mark.parametrize("front", [None, 0.0, 0.3])
@pytest.mark.parametrize("rear", [None, 0.25])
@pytest.mark.parametrize("share", [0.7, "aluminium"])
def test_what_passes_at_normal_incidence_is_what_a_trace_sends_on(front, rear, share):
    """Planes bend no light, and a mirror's share is the same at every angle."""
    plane = [{**FIXED} if r is None else {**FIXED, "reflectance": r} for r in (front, rear)]
    lens = LENS | {"front": plane[0], "rear": plane[1]}
    mirror = MIRROR | {"reflectance": share, "face": MIRROR["face"] | {"radius": np.inf}}
    system = System(row(lens, mirror))
    traced = transmitted_flux(system, system.backend)
    assert system.passing == pytest.approx(traced, rel=1e-12)


def test_a_face_that_light_meets_going_to_its_minus_z_is_turned_round():
    """Its points stay where they are: (x, y, z) of the face is (x, -y, -z) in the frame that is turned."""
    lens = LENS | {"front": {"half_width": SIZE, "radius": 40.0, "conic": -1.0}, "rear": {"half_width": SIZE}}
    faces = ["L1.front", "L1.rear:reflect", "L1.front"]
    target = {"position": (0, 0, -50), "tilt": (180, 0, 0)}
    system = System(row(lens, path=({"faces": faces},), target=target))
    inwards, inside, outwards = system.path.surfaces
    assert inside.kind == "reflect"
    assert (inwards.name, outwards.name) == ("L1.front", "L1.front again")
    x, y = 3.0, 4.0
    here, there = (np.array([x, y, s.shape(x, y)]) for s in (inwards, outwards))
    assert here[2] == pytest.approx(25 / 80)
    np.testing.assert_allclose(outwards.pose.points(there), here * (1, -1, 1), rtol=0, atol=1e-15)


def test_each_lens_of_a_row_has_the_index_of_its_own_material():
    """Of N-BK7 by Schott's catalogue at F and C; PMMA has an Abbe number of about 57."""
    lenses = [
        {key: value for key, value in LENS.items() if key != "index"}
        | {"material": name, "name": part, **place}
        for name, part, place in (("PMMA", "L1", {}), ("N-BK7", "L2", {"position": (0, 0, 20)}))
    ]
    source = {"spectrum": [[486.13, 1.0], [656.27, 1.0]], "wavelength": 587.56}
    system = System(row(*lenses, MIRROR, source=source))
    blue, red = ([medium.index for medium in w.media] for w in system.wavelengths)
    assert blue[3] == pytest.approx(1.52238, abs=2e-5)
    assert red[3] == pytest.approx(1.51432, abs=2e-5)
    assert 0.007 < blue[1] - red[1] < 0.01
    assert blue[0] == blue[2] == blue[4] == blue[5] == 1


@pytest.mark.parametrize("wide", [9.0, 11.0])
def test_elements_whose_faces_differ_in_size_are_compared_face_by_face(wide):
    front = LENS.get("front", {}) | {"half_width": [wide, wide]}
    solvable_system(row(LENS | {"front": front}, MIRROR))
    with pytest.raises(UserError, match=r"element\.M1 and element\.L1 overlap"):
        solvable_system(row(LENS | {"front": front, "position": (0, 0, 58)}, MIRROR))


def test_rows_of_elements_survive_the_trip_through_toml(tmp_path):
    problem = row(LENS, MIRROR, path=({"faces": ["L1.front", "L1.rear", "M1"]},))
    (tmp_path / "row.toml").write_text(problem.to_toml(), "utf-8")
    assert load_problem(tmp_path / "row.toml") == problem
    further = load_problem(tmp_path / "row.toml", {"element.L1.rear.radius": -80.0})
    assert further.optics[0].rear.radius == -80
    assert further.optic == problem.optic


@pytest.mark.parametrize(
    ("elements", "words"),
    [
        ([LENS | {"position": (0, 0, 58)}, MIRROR], "element.M1 and element.L1 overlap"),
        (
            [LENS | {"position": (0, 0, 90)}, MIRROR],
            "element.L1 lies behind element.M1, at its own z = 21.21 mm; turn it by element.M1.tilt",
        ),
        (
            [LENS | {"tilt": (180, 0, 0)}, MIRROR],
            "light along +z meets element.L1 from behind, or never; turn it by element.L1.tilt",
        ),
    ],
)
def test_a_row_that_light_cannot_go_through_is_one_sentence(elements, words):
    assert words in refusal(lambda: solvable_system(row(*elements)))


@pytest.mark.every(4)
@pytest.mark.parametrize(
    ("target", "words"),
    [
        ({"position": (0, 2, 60)}, "the target cuts element.M1"),
        ({"position": (0, -40, 60), "tilt": (90, 0, 0)}, "light is asked for beside element.M1 or behind"),
        ({"tilt": (90, 0, 0)}, "where the target shows element.M1 its back"),
        ({"position": (0, 1, 2), "tilt": (0, 0, 0)}, "the target cuts element.L1"),
    ],
)
def test_a_target_that_light_of_the_last_fixed_element_never_meets_is_refused(target, words):
    """Light would be followed backwards to a target in a mirror's blank, or before the mirror."""
    mirror = MIRROR | {"face": MIRROR["face"] | {"freeform": None}}
    lens = LENS | {"rear": LENS["rear"] | {"freeform": {"spans": (4, 4), "z_freedom": 0.1}}}
    solvable_system(row(lens, mirror))
    assert words in refusal(lambda: solvable_system(row(lens, mirror, target=target)))


@pytest.mark.parametrize(
    "changes",
    [
        {"source.divergence": 0.3},
        {"source.divergence_profile": "sun"},
        {"element.M1.face.slope_rms": 0.01},
        {"element.L1.rear.slope_rms": 0.01},
    ],
)
def test_blur_of_a_row_is_refused_but_that_of_a_source_with_extent(changes):
    problem = row(LENS, MIRROR).with_(**changes)
    with pytest.raises(UserError, match=r"light meets L1.front, L1.rear, M1.face; take a source without"):
        solvable_system(problem)
    if "element" in next(iter(changes)):
        solvable_system(problem.with_(**{"source.kind": "lambertian", "source.half_angle": 5.0}))
