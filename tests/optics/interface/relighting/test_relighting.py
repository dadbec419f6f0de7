"""Other light in words, and what a lens makes of it: the sun against the angles of its rays."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

import optics
from optics import UserError
from optics.base.runtime import load_backend
from optics.interface.relighting import other_source, relit
from optics.light.analysis import measure
from optics.scene.luminaires import Opening, write_ies
from optics.scene.problem import Problem, load_problem
from optics.scene.system import System, index_at, solvable_system, source_of
from tests.cases import EXAMPLES, ROOT, slow_unless
from tests.optics.cases import target_z, write_problem
from tests.optics.scene.luminaires.cases import asymmetric

POINT = {"source.kind": "point", "source.half_width": [0.0, 0.0], "source.distance": 40.0, "source.flux": 3.0}


def problem_of(folder, changes=None):
    return load_problem(write_problem(folder, changes))


def test_the_sun_is_the_own_beam_with_its_divergence(tmp_path):
    problem = problem_of(tmp_path)
    sun = other_source("SUN", problem)
    assert (sun.kind, sun.half_width, sun.divergence_profile) == (
        "collimated",
        problem.source.half_width,
        "sun",
    )
    assert sun.half_divergence == 0.2665


def test_the_sun_fills_the_front_of_a_lens_for_a_point(tmp_path):
    problem = problem_of(tmp_path, POINT)
    sun = other_source("sun", problem)
    assert (sun.half_width, sun.flux) == (problem.lens.front.half_width, 3.0)


def test_an_led_stands_where_the_point_was_or_where_it_is_said(tmp_path):
    problem = problem_of(tmp_path, POINT)
    for words, distance in (("led:1.5mm", 40.0), ("led:1.5mm@12mm", 12.0)):
        led = other_source(words, problem)
        assert (led.kind, led.half_width, led.distance, led.flux) == (
            "lambertian",
            (0.75, 0.75),
            distance,
            3.0,
        )


def test_a_lamp_stands_where_a_placed_source_was_with_all_of_its_flux(tmp_path):
    placed = POINT | {"source.position": [3.0, 0.0, -25.0], "source.weight": 0.5}
    del placed["source.distance"]
    led = other_source("led:1mm", problem_of(tmp_path, placed))
    assert (led.position, led.flux, led.weight) == ((3.0, 0.0, -25.0), 1.5, 1.0)
    array = {"source.array.columns": 2, "source.array.rows": 2, "source.array.pitch": [2.0, 2.0]}
    several = problem_of(tmp_path, POINT | array)
    assert other_source("led:1mm@9mm", several).flux == 12.0
    with pytest.raises(UserError, match="made for several lights: say where the light is, led:1mm@30mm"):
        other_source("led:1mm", several)


@pytest.mark.parametrize(
    "turned",
    [{}, {"source.distance": 2.0, "source.position": [0.0, 90.0, 0.0], "source.tilt": [90.0, 0.0, 0.0]}],
)
def test_a_lamp_before_a_mirror_stands_and_looks_as_the_own_light(turned):
    """Both ways the axis of the light meets the mirror's plane y = z in the origin."""
    problem = load_problem(EXAMPLES / "lamp_reflector.toml", turned)
    away = 90 if turned else 100
    led = other_source(f"led:1mm@{away}mm", problem)
    assert led.position == pytest.approx(source_of(problem).middle, abs=1e-12)
    assert led.tilt == problem.source.tilt


def test_a_lamp_before_a_lens_on_the_axis_stands_so_far_before_its_vertex():
    problem = load_problem(EXAMPLES / "two_elements.toml")
    led = other_source("led:1mm@30mm", problem)
    assert (led.position, led.tilt) == ((0.0, 0.0, -160.0 - 30.0), (0.0, 0.0, 0.0))


def test_where_the_own_light_goes_by_an_element_its_axis_tells_no_place():
    problem = load_problem(EXAMPLES / "lamp_reflector.toml", {"source.tilt": [-45.0, 0.0, 0.0]})
    with pytest.raises(UserError, match=r"does not meet element\.M1 from before, .* 100 mm are; give a"):
        other_source("led:1mm@100mm", problem)


def test_every_lens_of_a_row_has_its_index_at_another_wavelength(monkeypatch):
    problem = load_problem(EXAMPLES / "two_elements.toml")
    problem = problem.with_(**{"element.L1.material": "PMMA", "element.L1.index": "auto"})
    auto = {"element.M1.face.radius": 2000.0, "element.M1.face.freeform.z_freedom": 1.0}
    system, seen = System(problem.with_(**auto)), []
    module = import_module("optics.interface.relighting.other_light")
    monkeypatch.setattr(module, "measure", lambda *given: seen.append(given))
    relit(system, replace(problem.source, wavelength=420.0), None)
    ((moved, _),) = seen
    wanted = index_at(system.problem.optics[0], 420.0, problem.source.wavelength)
    assert moved.path.media[1].index == pytest.approx(wanted, rel=1e-12)
    assert wanted > 1.504


def test_the_sun_covers_a_mirror_that_lies_elsewhere_from_before_it():
    """The face is 50 mm by 80 mm, tilted by 45 degrees about x, and 40 mm before the origin; its sag is free
    by 2 mm."""
    face = {"half_width": (50, 80), "radius": np.inf, "freeform": {"z_freedom": 2.0}}
    mirror = {"kind": "mirror", "name": "M1", "position": (3, 0, -40), "tilt": (45, 0, 0), "thickness": 9}
    target = {"kind": "tophat", "position": (0, 90, 0), "tilt": (-90, 0, 0), "half_width": (9, 9)}
    problem = Problem(source={"kind": "point"}, element=[mirror | {"face": face}], target=target)
    sun = other_source("sun", problem)
    assert sun.half_width == pytest.approx((53, 80 * np.sqrt(0.5)))
    assert sun.distance == pytest.approx(2 + 40 + 80 * np.sqrt(0.5) + 2)


def test_the_sun_on_a_row_is_refused_as_light_that_diverges():
    problem = load_problem(ROOT / "examples" / "two_elements.toml")
    with pytest.raises(UserError, match=r"light meets L1.front, L1.rear, M1.face; take a source without div"):
        solvable_system(replace(problem, source=other_source("sun", problem)))


@pytest.mark.parametrize("words", ["sun", "led:1mm", "lamp.ies"])
def test_other_light_has_unit_and_wavelength_of_the_own(tmp_path, words):
    own = POINT | {"source.unit": "lm", "source.wavelength": 633.0}
    other = other_source(words, problem_of(tmp_path, own))
    assert (other.flux, other.unit, other.wavelength) == (3.0, "lm", 633.0)


@pytest.mark.slow
def test_the_sun_starts_before_a_front_around_its_source(tmp_path, backend):
    hollow = {"source.distance": 4.0, "lens.front.radius": -30.0, "lens.front.conic": -1.0}
    problem = problem_of(tmp_path, POINT | hollow | {"target.pixels": [12, 12]})
    sun = other_source("sun", problem)
    fates = relit(System(problem).with_lens(optics.System(problem).base), sun, backend).metrics["fates_w"]
    assert sum(fates.values()) == pytest.approx(3.0, rel=1e-12)


def test_the_source_of_another_file_is_taken(tmp_path):
    (tmp_path / "other").mkdir()
    path = write_problem(tmp_path / "other", {"source.half_width": [3.0, 2.0]})
    assert other_source(str(path), problem_of(tmp_path)).half_width == (3.0, 2.0)


@pytest.mark.slow
def test_a_luminaire_has_the_flux_of_the_own_light_and_the_opening_of_its_file(tmp_path):
    write_ies(asymmetric(Opening((3.0, 2.0), round=True)), tmp_path / "lamp.ies")
    problem = problem_of(tmp_path, POINT | {"target.pixels": [12, 12]})
    lamp, same = (other_source(f"{tmp_path}/lamp.ies{at}", problem) for at in ("", "@40mm"))
    assert lamp == same
    assert (lamp.kind, lamp.distance, lamp.flux) == ("luminaire", 40.0, 3.0)
    lens = optics.System(problem).base
    fates = relit(System(problem).with_lens(lens), lamp, load_backend("double")).metrics["fates_w"]
    assert sum(fates.values()) == pytest.approx(3.0, rel=1e-12)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("moon", "--source must be"),
        ("led:1mm", "no place: say where the light is, led:1mm@30mm"),
        ("led:1e400mm@1mm", "half_width"),
        ("led:--mm@1mm", "--source must be"),
        ("led:0mm@1mm", "source.half_width must be at least"),
        ("led:1mm@-3mm", "source.distance"),
        ("none.toml", "none.toml"),
        ("lamp.ies", "no place: say where the light is, lamp.ies@30mm"),
        ("none.ldt@30mm", "none.ldt"),
        ("lamp.ies@--mm", "--source must be"),
    ],
)
def test_other_words_are_one_sentence(tmp_path, words, sentence):
    problem = problem_of(tmp_path)
    lens = optics.System(problem).base
    with pytest.raises(UserError, match=sentence):
        relit(System(problem).with_lens(lens), other_source(words, problem), load_backend("double"))


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", slow_unless(("sun", "gaussian").count, ["sun", "uniform", "gaussian", "theta_uniform"])
)
def test_a_diverging_beam_moves_the_light_by_the_variance_of_its_angles(tmp_path, kind):
    """Plane surfaces send every ray on in its own direction: variances of landing points add up.

    Between the plates of a parallel plate the path is shorter by n, so that the variance is (L sigma)^2 with
    L = distance before + thickness / n + distance behind, to the second order in the angle.
    """
    angle = {"sun": 0.8, "uniform": 0.8, "gaussian": 0.4, "theta_uniform": 0.8}[kind]
    problem = problem_of(
        tmp_path,
        {
            "source.divergence": angle,
            "source.divergence_profile": kind,
            "source.distance": 5.0,
            "lens.rear.radius": np.inf,
            "lens.rear.conic": 0.0,
            "target.half_width": [20.0, 20.0],
        },
    )
    light = optics.System(problem)
    measured = light.measure(light.base)
    x = (2 * np.arange(48) + 1) / 48 * 20 - 20
    row = measured.irradiance.sum(axis=0)
    variance = (row @ x**2) / row.sum() - (row @ x / row.sum()) ** 2 - (40 / 48) ** 2 / 12
    beam = problem.source.half_width[0] ** 2 / 3
    lens = problem.lens
    behind = target_z(problem) - lens.thickness
    length = problem.source.distance + lens.thickness / lens.index + behind
    limb = (0.30 / 4 + 0.93 * (1 / 3 - 1 / 5) - 0.23 * (1 / 4 - 1 / 6)) / (0.30 / 2 + 0.93 / 3 - 0.23 / 4)
    sigma2 = {"sun": limb / 2, "uniform": 1 / 4, "gaussian": 1.0, "theta_uniform": 1 / 6}[kind]
    wanted = beam + (length * np.radians(angle)) ** 2 * sigma2
    assert variance == pytest.approx(wanted, rel=2e-3)
    assert measured.metrics["estimator"] == "beams"
    fates = measured.metrics["fates_w"]
    assert measured.metrics["rel_l2_floor"] < 0.03
    assert sum(fates.values()) == pytest.approx(problem.source.flux, rel=1e-12)


def test_in_other_colours_the_lens_has_its_index_there(tmp_path):
    """A design in glass at 550 nm, in light of 650 nm and in white light: it is measured as if made so."""
    backend = load_backend("double", 1)
    glass = {"lens.material": "N-BK7", "lens.absorption": "auto"}
    problem = load_problem(write_problem(tmp_path, glass, drop=("lens.index",)))
    lens = System(problem).base
    resolved = System(problem).problem  # as a result folder holds it
    red = replace(problem.source, wavelength=650.0)
    made_so = System(problem.with_(**{"source.wavelength": 650.0}))
    wanted = measure(made_so.with_lens(replace(lens, index=made_so.base.index)), backend)
    assert relit(System(resolved).with_lens(lens), red, backend).irradiance == pytest.approx(
        wanted.irradiance, rel=1e-4
    )
    white = relit(System(resolved).with_lens(lens), replace(problem.source, spectrum="LED-B1"), backend)
    assert white.colour.shape == (3, *wanted.irradiance.shape)
    assert white.metrics["rel_l2"] != wanted.metrics["rel_l2"]
    assert white.metrics["fates_w"]["absorbed"] > 0


def test_an_index_without_a_known_material_stays(tmp_path):
    backend = load_backend("double", 1)
    problem = problem_of(tmp_path)
    lens = System(problem).base
    red = relit(System(problem).with_lens(lens), replace(problem.source, wavelength=650.0), backend)
    assert red.irradiance.tobytes() == measure(System(problem).with_lens(lens), backend).irradiance.tobytes()
    with pytest.raises(UserError, match=r"source\.spectrum needs the index at .* nm too"):
        relit(System(problem).with_lens(lens), replace(problem.source, spectrum="LED-B1"), backend)


def test_the_sun_comes_from_where_a_tilted_beam_comes(tmp_path):
    problem = problem_of(tmp_path, {"source.tilt": [5.0, 0.0, 0.0]})
    sun = other_source("sun", problem)
    assert (sun.tilt, sun.half_width) == ((5.0, 0.0, 0.0), problem.source.half_width)


def test_a_lamp_stands_where_a_shifted_file_put_its_light(tmp_path):
    """0.1 mm wide, so that another opening hardly matters; its light lands at -2.4 pixels."""
    write_ies(asymmetric(), tmp_path / "lamp.ies")
    shifted = optics.Source(
        kind="luminaire",
        file=str(tmp_path / "lamp.ies"),
        flux=100.0,
        half_width=(0.5, 0.5),
        distance=25.0,
        shift=(4.0, 1.0),
        tilt=(0.0, 0.0, 30.0),
    )
    problem = replace(problem_of(tmp_path), source=shifted)
    same, led = (other_source(words, problem) for words in (str(tmp_path / "lamp.ies"), "led:1mm"))
    assert (same.shift, same.distance, same.tilt) == (shifted.shift, 25.0, shifted.tilt)
    assert led.position == (4.0, 1.0, -25.0)
    away = other_source("led:1mm@30mm", problem)
    assert (away.position, away.distance) == (None, 30.0)


@pytest.mark.parametrize("place", [{"source.position": [0.0, 0.0, -40.0]}, {"source.tilt": [0.0, 5.0, 0.0]}])
def test_a_beam_has_no_place_for_a_lamp_wherever_it_starts(tmp_path, place):
    with pytest.raises(UserError, match="parallel light, which has no place"):
        other_source("led:1mm", problem_of(tmp_path, place))
