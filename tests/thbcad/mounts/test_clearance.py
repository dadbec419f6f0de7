"""The proof of a mount: its bounds hold in exact arithmetic, and what is too close has its place named."""

from fractions import Fraction
from math import hypot

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tests.thbcad.mounts.cases import CONCAVE, FLAT, FLAT_REAR, PLAIN, ROUND, SQUARE, changed
from thbcad.lens import FreeformSurface, Lens
from thbcad.mounts import mount_of, require_mount
from thbcad.outlines import Outline


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {"holes__0__at": [[12, 0]], "holes__0__countersink": 5},
            r"hole 1 at \(12, 0\) mm reaches 0.5 mm into the clear",
        ),
        ({"holes__0__at": [[0, 0]]}, r"hole 1 at \(0, 0\) mm reaches 10 mm into the clear aperture"),
        ({"pins__0__at": [[0, 9.05]]}, r"pin 1 at \(0, 9.05\) mm keeps only 0.05 mm from the clear aperture"),
        ({"bosses__0__at": [[11, 0]]}, r"boss 1 at \(11, 0\) mm reaches 1 mm into the clear aperture"),
        ({"holes__0__at": [[15, 12], [15, 10]]}, "a wall of -2 mm is left between hole 1 at .* and hole 2"),
        (
            {"holes__0__at": [[18, 12]]},
            "is left between hole 1 at .* and the outline of the flange, less than",
        ),
        ({"bosses__0__bore": 3.0}, "a wall of 0.5 mm is left round the bore of a boss, less than wall = 0.8"),
        ({"flange__thickness": 0.7}, "a wall of 0.7 mm is left as the thickness of the flange"),
        ({"flange__thickness": 6}, "the flange up to z = 6 mm meets the rear, which reaches down to"),
        ({"flange__size": [20.5, 32]}, "the flange reaches .* beyond the lens of 20 x 16 mm.*flange.size"),
        ({"flange__seat": "rear"}, "cannot be flush with the rear, which is no plane"),
        ({"flange__seat": -3.0}, "the flange from z = -3 mm meets the front, which reaches up to z = 0"),
        ({"flange__seat": 0.0}, "the flange from z = 0 mm meets the front"),
        ({"holes__0__countersink": 8.0, "flange__size": [60, 60]}, "a countersink of 8 mm is 2.9 mm deep"),
        ({"gate__width": 40}, "the gate of 40 mm is wider than the .* mm that the side -x"),
        ({"gate__thickness": 2}, "the gate of 2 mm is thicker than the side -x of the flange, 1.4 mm"),
    ],
)
def test_what_is_too_close_is_named_with_its_place(changes, sentence):
    table = changed(SQUARE, **changes)
    if "holes__0__at" in changes or "flange__thickness" in changes or "flange__seat" in changes:
        table.pop("gate")
    with pytest.raises(ValueError, match=sentence) as raised:
        require_mount(mount_of(table), FLAT)
    assert "\n" not in str(raised.value)


def test_a_round_flange_must_hold_the_corners_of_the_lens():
    with pytest.raises(
        ValueError, match=r"beyond the corner of the lens at \(10, 8\) mm.*flange.diameter = 27"
    ):
        require_mount(mount_of({"flange": {"outline": "round", "diameter": 24, "thickness": 1}}), FLAT)


@given(
    st.lists(st.tuples(*[st.floats(-20, 20)] * 2, st.floats(0.1, 3)), min_size=1, max_size=4),
    st.floats(0, 2),
)
def test_the_bounds_hold_in_exact_arithmetic(circles, clearance):
    rows = [{"at": [[x, y]], "diameter": d} for x, y, d in circles]
    table = {"flange": {"size": [60, 60], "thickness": 2}, "holes": rows, "clearance": clearance, "wall": 0.1}
    try:
        proof = require_mount(mount_of(table), FLAT)
    except ValueError:
        return
    for x, y, d in circles:  # squares of distances, in fractions
        beside = [max(abs(Fraction(p)) - a, 0) for p, a in zip((x, y), (10, 8))]
        least = Fraction(proof.clearance) + Fraction(d / 2)
        assert beside[0] ** 2 + beside[1] ** 2 >= least**2
    for k, (x, y, d) in enumerate(circles):
        for a, b, c in circles[:k]:
            apart = (Fraction(x) - Fraction(a)) ** 2 + (Fraction(y) - Fraction(b)) ** 2
            assert apart >= (Fraction(proof.wall) + Fraction(d / 2) + Fraction(c / 2)) ** 2


@pytest.mark.slow
def test_rounding_never_lifts_a_bound():
    """Half of all distances are rounded up in float64; the bound stays below the exact one."""
    for x, y, d in np.random.default_rng(5).uniform((11, 9, 0.1), (13, 11, 1.5), (300, 3)).tolist():
        table = {"flange": {"size": [40, 40], "thickness": 2}, "holes": [{"at": [[x, y]], "diameter": d}]}
        bound = require_mount(mount_of({**table, "wall": 0.1}), FLAT).clearance
        exact = (Fraction(x) - 10) ** 2 + (Fraction(y) - 8) ** 2
        assert 0 < exact - (Fraction(bound) + Fraction(d) / 2) ** 2 < 1e-11


def test_a_refused_hole_is_really_too_close():
    for x in np.linspace(8, 13, 101).tolist():
        table = {**PLAIN, "holes": [{"at": [[x, 0]], "diameter": 1}], "clearance": 0.5, "wall": 0.1}
        gap = x - 10 - 0.5
        if gap > 0.5:
            assert abs(require_mount(mount_of(table), FLAT).clearance - gap) < 1e-12
        elif gap < 0.5 - 1e-5:
            with pytest.raises(ValueError, match="hole 1"):
                require_mount(mount_of(table), FLAT)


@pytest.mark.parametrize(
    ("lens", "seat"), [(FLAT, "front"), (CONCAVE, "front"), (FLAT_REAR, "rear"), (FLAT, 1.0)]
)
def test_seats(lens, seat):
    proof = require_mount(mount_of(changed(PLAIN, flange__seat=seat)), lens)
    assert proof.framed is False
    assert proof.high - proof.low == pytest.approx(1)
    assert proof.high == (lens.thickness if seat == "rear" else proof.low + 1)


def test_a_flange_above_the_middle_of_a_concave_rear_is_a_frame():
    mount = mount_of(changed(PLAIN, flange__thickness=3.05))
    assert require_mount(mount, CONCAVE).framed
    smaller = Lens(CONCAVE.front, FLAT.rear.with_sag(None), 3.0, 1.5)
    assert smaller.front.half_width == smaller.rear.half_width


def test_the_corner_counts_by_its_distance():
    table = {**PLAIN, "holes": [{"at": [[12.0, 10.0]], "diameter": 1}], "wall": 0.1}
    assert require_mount(mount_of(table), FLAT).clearance == pytest.approx(hypot(2, 2) - 0.5)


def test_a_whole_mount_is_proven():
    for table in (SQUARE, ROUND):
        proof = require_mount(mount_of(table), FLAT)
        assert proof.clearance > 0.1
        assert proof.wall >= 0.8


@pytest.mark.parametrize("corners", [(10.0, 8.0), (4.0, 3.0)])
@pytest.mark.parametrize("turn", np.radians([0, 20, 45, 70]))
def test_the_distance_from_an_outline_is_that_of_its_nearest_point(corners, turn):
    """A pin beside the corner of the rectangle, which would be in its way, is free of the outline."""
    outline = Outline((10.0, 8.0), corners)
    spot = np.array([np.cos(turn), np.sin(turn)])
    spot *= 1.2 / outline.gauge(*spot)
    rim = np.concatenate([np.column_stack(p(np.linspace(*p.ends, 100_001))) for p in outline.pieces])
    nearest = np.hypot(*(rim - spot).T).min()
    flat = FreeformSurface((10, 8), corners=corners)
    lens = Lens(flat, flat, 5.0, 1.5)
    table = {"flange": {"size": [40, 40], "thickness": 1, "seat": 2.0}}
    table["pins"] = [{"at": [spot.tolist()], "diameter": 0.5, "length": 1}]
    proof = require_mount(mount_of({**table, "clearance": 0.1}), lens)
    assert proof.clearance <= nearest - 0.25 <= proof.clearance + 1e-6
    words = "keeps only .* mm from the clear aperture of "
    with pytest.raises(ValueError, match=words):
        require_mount(mount_of({**table, "clearance": 5.0}), lens)


def test_a_round_flange_holds_a_round_lens_that_its_square_would_not_fit():
    flat = FreeformSurface((10, 10), corners=(10, 10))
    disk = Lens(flat, flat, 5.0, 1.5)
    table = {"flange": {"outline": "round", "diameter": 24, "thickness": 1, "seat": 2.0}}
    assert require_mount(mount_of(table), disk).wall == pytest.approx(1.0)
    with pytest.raises(ValueError, match="beyond the lens of diameter 20 mm, less than wall"):
        require_mount(mount_of({"flange": {**table["flange"], "diameter": 20.5}}), disk)
