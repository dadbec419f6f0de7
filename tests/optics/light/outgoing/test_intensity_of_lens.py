"""The intensity behind a lens: that of a plate and a wedge in closed form, and its flux by fates."""

import numpy as np
import pytest

import optics
from optics.base.runtime import load_backend
from optics.light.outgoing import outgoing_intensity
from optics.light.tracing import TargetArea, trace_nonsequential
from optics.scene.receivers import receiver_at
from optics.scene.sources import single_rays
from oracles.light_formulas import fresnel_parts
from tests.optics.cases import rough, small_problem, small_system

LAMP = {"source.kind": "lambertian", "source.half_width": [0.1, 0.1], "source.distance": 2.0}
PLATE = LAMP | {
    "lens.thickness": 1.0,
    "lens.rear.radius": np.inf,
    "lens.rear.conic": 0.0,
    "lens.rear.freeform.z_freedom": 0.2,
}


@pytest.mark.slow
def test_a_plate_sends_lambertian_light_on_and_back_as_its_reflections_say(tmp_path):
    """With t = 1 - r at each face, t^2 / (1 - r^2) goes on, and t^2 r / (1 - r^2) leaves by the front."""
    system = optics.System(small_problem(tmp_path, PLATE))
    found = outgoing_intensity(system, load_backend("double"), 1 << 17, 5.0)
    lamp = found.luminaire
    assert lamp.flux == pytest.approx(found.flux, rel=1e-12)
    assert found.steps == (10.0, 5.0)
    assert 0.005 < found.noise < 0.1
    other = optics.System(system.problem.with_(**{"run.seed": 7}))
    again = outgoing_intensity(other.with_lens(system.base), load_backend("double"), 1 << 17, 5.0)
    apart = lamp.node_solid_angles * (again.luminaire.candela - lamp.candela) ** 2
    whole = lamp.node_solid_angles * lamp.candela**2
    noise = np.hypot(found.noise, again.noise)  # each known to a quarter: few angles have most of it
    assert np.sqrt(apart.sum() / whole.sum()) == pytest.approx(noise, rel=0.5)
    theta = np.radians(np.arange(5, 56, 5))
    t = fresnel_parts(theta, 1.0, 1.5)  # of s and of p
    on, back = (np.cos(theta) / np.pi * part.mean(axis=0) for part in (t / (2 - t), t * (1 - t) / (2 - t)))
    by_gamma = lamp.candela[:-1].mean(axis=0)
    np.testing.assert_allclose(by_gamma[1:12], on, rtol=0.03)
    np.testing.assert_allclose(by_gamma[-2:-13:-1], back, rtol=0.25)


@pytest.mark.every(3)
@pytest.mark.parametrize(
    "changes",
    [{}, {"target.distance": np.inf, "target.half_width": [20.0, 20.0]}, LAMP],
    ids=["beam", "far field", "lamp"],
)
def test_the_flux_is_that_of_all_light_that_left_the_lens(tmp_path, changes):
    system = optics.System(small_problem(tmp_path, changes))
    space = system.space()
    lens = system.lens(space, rough(space, 0.03, 0))
    found = outgoing_intensity(system.with_lens(lens), load_backend("double"), 1 << 13, 10.0)
    fates = vars(
        trace_nonsequential(
            load_backend("double"),
            lens,
            single_rays(system.source.rays((64, 64)), lens),
            TargetArea(receiver_at(66.0), (20.0, 20.0)),
        ).fates
    )
    left = sum(fates.values()) - sum(
        fates[k] for k in ("beside_lens", "reflected_outside", "trapped", "failed")
    )
    assert found.luminaire.flux == pytest.approx(found.flux, rel=1e-12)
    assert found.flux == pytest.approx(left, rel=0.05)
    np.testing.assert_allclose(found.parts.mean(axis=0), found.luminaire.candela, rtol=1e-12)


def test_what_the_lens_absorbs_does_not_leave_it(tmp_path):
    """Of a beam that enters a plate, w = exp(-a t) comes to the other face; r is reflected at each."""
    flat = {"lens.rear.radius": np.inf, "lens.rear.conic": 0.0, "lens.absorption": 0.05}
    system = optics.System(small_problem(tmp_path, flat))
    found = outgoing_intensity(system, load_backend("double"), 1 << 13, 10.0)
    r, w = 0.04, np.exp(-0.05 * 6.0)
    on, back = (1 - r) ** 2 * w / (1 - (r * w) ** 2), (1 - r) ** 2 * r * w**2 / (1 - (r * w) ** 2)
    # of the faint light, 3 % of all, roulette keeps every seventh ray, 1000 of them: 0.1 % of the flux
    assert found.flux == pytest.approx(system.problem.source.flux * (on + back), rel=5e-3)


def test_a_wedge_throws_the_beam_where_snell_says(tmp_path):
    """A wedge turns a parallel beam to its thick side: to +x is C = 0, to -y is C = 90."""
    flat = {"lens.rear.radius": np.inf, "lens.rear.conic": 0.0}
    system = optics.System(small_problem(tmp_path, flat))
    space = system.space()
    for slope, c in (((0.05, 0.0), 0.0), ((0.0, -0.05), 90.0)):
        x, y = space.kv_u.greville(), space.kv_v.greville()
        net = np.add.outer(slope[0] * scaled(x), slope[1] * scaled(y))
        lens = system.lens(space, net.ravel())
        light = outgoing_intensity(system.with_lens(lens), load_backend("double"), 1 << 10, 0.5).luminaire
        i, j = np.unravel_index(light.candela.argmax(), light.candela.shape)
        tilt = np.arctan(0.05)
        assert light.planes[i] == c
        assert light.gammas[j] == pytest.approx(np.degrees(np.arcsin(1.5 * np.sin(tilt)) - tilt), abs=0.26)


def scaled(row):
    """Return parameters as positions on a half-width of 10 mm."""
    return 20 * (row - row[0]) / (row[-1] - row[0]) - 10


@pytest.mark.parametrize(("outline", "is_round"), [("round", True), ("rectangle", False)])
def test_the_opening_has_the_outline_of_the_lens(tmp_path, backend, outline, is_round):
    system = small_system(tmp_path, {"lens.outline": outline})
    opening = outgoing_intensity(system, backend, 1 << 10, 45.0).luminaire.opening
    assert (opening.size, opening.round) == ((20.0, 20.0), is_round)


def test_a_plate_absorbs_every_wavelength_by_itself(tmp_path):
    """Of a beam along the axis t^2 x / (1 - r x) leaves, x = exp(-a d), by front and rear together."""
    lines = {450.0: (1.53, 0.2, 0.25), 550.0: (1.5, 0.0, 0.25), 650.0: (1.48, 0.1, 0.5)}
    changes = {
        "source.spectrum": [[nm, share] for nm, (_, _, share) in lines.items()],
        "lens.indices": [[nm, index] for nm, (index, _, _) in lines.items()],
        "lens.absorptions": [[nm, absorption] for nm, (_, absorption, _) in lines.items()],
        "source.half_width": [3.0, 2.0],
        **{key: value for key, value in PLATE.items() if key.startswith("lens.")},
    }
    system = optics.System(small_problem(tmp_path, changes))
    wanted = 0.0
    for index, absorption, share in lines.values():
        r, x = ((index - 1) / (index + 1)) ** 2, np.exp(-absorption * system.base.thickness)
        wanted += share * (1 - r) ** 2 * x / (1 - r * x)
    found = outgoing_intensity(system, load_backend("double"), 1 << 14, 10.0)
    assert found.flux == pytest.approx(wanted * system.problem.flux, rel=5e-3)  # roulette: 1.2e-3
