"""Zones in the loss of a design: the gradient, what costs nothing, and what designs reach by it."""

from dataclasses import replace

import numpy as np
import pytest

import optics
from optics.designing.optimisation.zone_loss import ZoneLoss
from optics.scene.photometry import units_of
from optics.scene.receivers import FarField, Screen, zone_places, zone_rows

SCREEN = Screen((8.0, 6.0), (16, 12), margin=2, receiver=FarField())
TABLE = [  # shape, corners, limits, peak
    ("points", [[1.3, -0.4]], (2.0, 3.0, 0.0), False),
    ("points", [[-5.0, 2.0]], (0.0, 0.5, 0.0), False),
    ("box", [[-7, -5], [2, 1]], (0.8, np.inf, 0.0), False),
    ("whole", (), (4.0, np.inf, 0.0), True),
    ("whole", (), (0.0, 1.5, 0.0), True),
]


def rows():
    found = []
    for k, (shape, corners, limits, peak) in enumerate(TABLE):
        at = zone_places(shape, corners, SCREEN)
        found += zone_rows(str(k), at, SCREEN, limits, 0.2, peak)
    return tuple(replace(row, correction=1 + 0.05 * k) for k, row in enumerate(found))


def test_the_derivative_is_that_of_differences():
    """Hinges are squared: where steps of 1e-6 meet their kinks, they err by 1e-5."""
    rng = np.random.default_rng(3)
    loss, image = ZoneLoss(SCREEN, rows()), rng.uniform(0.2, 2.0, SCREEN.padded[:2])
    value, slope = loss(image)
    assert value > 0
    for _ in range(5):
        way = rng.normal(size=image.shape)
        change = (loss(image + 1e-6 * way)[0] - loss(image - 1e-6 * way)[0]) / 2e-6
        assert np.vdot(slope, way) == pytest.approx(change, rel=1e-5)


def test_light_that_keeps_what_is_aimed_at_costs_nothing_and_the_dark_margin_counts_nowhere():
    image = np.full(SCREEN.padded, 2.0) * SCREEN.pad(SCREEN.projection())
    kept = [row for row in rows() if row.name in "02" and not row.brightest]
    image *= 1.3 * max(row.aims(image)[0] for row in kept) / 2.6
    value, slope = ZoneLoss(SCREEN, tuple(kept))(image + 9 * (SCREEN.pad(np.ones(SCREEN.shape)) == 0))
    assert (value, np.abs(slope).max()) == (0.0, 0.0)


UB2 = {  # a sharp beam of 19 mm, on pixels half as wide as the aperture
    "source": {"kind": "collimated", "half_width": (9.5, 9.5), "unit": "lm", "flux": 529.0},
    "lens": {
        "index": 1.5,
        "thickness": 8.0,
        "front": {"half_width": (10.0, 10.0)},
        "rear": {
            "half_width": (10.0, 10.0),
            "radius": "auto",
            "conic": -1.0,
            "freeform": {"max_level": 2, "z_freedom": "auto"},
        },
    },
    "target": {
        "kind": "zones",
        "regulation": "FMVSS 108 UB2",
        "distance": np.inf,
        "half_width": (16.0, 8.0),
        "pixels": (128, 64),
        "aperture": 0.5,
    },
    "run": {"threads": 1},
}
CD = units_of("lm").density(True).factor


def steepest(light):
    """Return by what log10 I changes most over 0.5 degrees along H from -12 to 12, at V from 0.5 to -1.5."""
    shown = np.log10(light[30:38, 16:112])
    return np.abs(shown[:, 2:] - shown[:, :-2]).max()


@pytest.mark.slow
def test_half_the_flux_keeps_all_of_ub2_by_a_fifth_and_does_not_bump_between_its_points():
    """A bump by half on a point, gone 1 degree aside, adds 0.09 to the change of log10 I."""
    design = optics.design(optics.Problem(**UB2))
    margins = [row["margin"] for row in design.measurement.metrics["zones"]]
    assert len(margins) == 19
    assert min(margins) > 0.2
    assert design.verdict.grade == "made"
    made, asked = design.measurement.irradiance, design.measurement.target
    assert steepest(made) < steepest(asked) + 0.05


@pytest.mark.slow
def test_a_beam_that_diverges_is_aimed_again_until_fresh_light_keeps_what_the_model_does():
    """One convolution makes 12 % more at (12, 0) than the lens; aimed at are 30 %, 16 % come by one aim."""
    wide = {"source.half_width": (20, 20), "source.divergence": 1.0, "source.flux": 1058.0}
    wide |= {f"lens.{face}.half_width": (21, 21) for face in ("front", "rear")}
    problem = optics.Problem(**UB2).with_(**wide, **{"lens.thickness": 16.0})
    few = {"lens.rear.freeform.max_level": 3, "optimizer.iterations": (12,)}
    found = optics.design(problem.with_(**few)).measurement.metrics["zones"]
    assert min(row["margin"] + 2 * row["error"] / row["limit"] for row in found) > 0.27
