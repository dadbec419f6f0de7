"""Fresnel's transmittances: closed forms, the tracer's own, limits, the picture."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from matplotlib import pyplot as plt

from optics.light.tracing.refraction import (
    critical_angle,
    normal_incidence_transmittance,
    traced_transmittance,
    transmittances,
)
from optics.reporting.figures import fresnel_figure
from tests.cases import examples

EPS = np.finfo(float).eps
FEW = examples(60)
INDICES = st.floats(1.05, 4.0)


def by_angles(before, behind, angle):
    """Return (T_s, T_p) by the angles alone: R_s = sin^2(i - t) / sin^2(i + t), R_p = tan^2(i - t) / tan^2(i
    + t)."""
    t = np.arcsin(before / behind * np.sin(angle))
    difference, total = angle - t, angle + t
    return 1 - (np.sin(difference) / np.sin(total)) ** 2, 1 - (np.tan(difference) / np.tan(total)) ** 2


@FEW
@given(index=INDICES, share=st.floats(0.01, 0.99), outward=st.booleans())
def test_transmittances_are_fresnels(index, share, outward):
    """Below the critical angle both forms agree.

    sin(i - t) loses digits where i - t is small, relative to i >= 0.01 and |i - t| >= 0.04 i: a factor 25 on
    each of two squares; arcsin near the critical angle, at 0.99 of it, stretches errors 10 times.
    """
    before, behind = (index, 1.0) if outward else (1.0, index)
    angle = share * (critical_angle(before, behind) or np.pi / 2)
    assert np.ravel(transmittances(before, behind, angle)) == pytest.approx(
        by_angles(before, behind, angle), abs=1000 * EPS
    )


@FEW
@given(index=INDICES, share=st.floats(0.0, 0.99), outward=st.booleans())
def test_power_is_the_square_of_the_field_times_the_width_of_the_beam(index, share, outward):
    """T = n_t cos_t / (n_i cos_i) |t|^2 with the amplitudes t_s, t_p of thesis 2.7 and 2.10; cos_t as in the
    next test."""
    before, behind = (index, 1.0) if outward else (1.0, index)
    angle = share * (critical_angle(before, behind) or np.pi / 2)
    a, b = np.cos(angle), np.cos(np.arcsin(before / behind * np.sin(angle)))
    fields = np.array(
        [2 * before * a / (before * a + behind * b), 2 * before * a / (behind * a + before * b)]
    )
    power = behind * b / (before * a) * fields**2
    assert np.ravel(transmittances(before, behind, angle)) == pytest.approx(power, abs=1000 * EPS)


@FEW
@given(index=INDICES, share=st.floats(0.0, 0.99), outward=st.booleans())
def test_the_tracer_takes_the_mean_of_both(backend, index, share, outward):
    """T_u = 1 - (R_s + R_p) / 2 (thesis 2.11), by the function that refracts every ray.

    1 - cos^2 + sin^2 leaves some EPS in cos_t^2; at 0.99 of the critical angle it is 0.01 and more, so cos_t
    keeps 100 EPS.
    """
    before, behind = (index, 1.0) if outward else (1.0, index)
    angle = share * (critical_angle(before, behind) or np.pi / 2)
    traced = traced_transmittance(backend, before, behind, angle)
    assert traced == pytest.approx(np.mean(transmittances(before, behind, angle), axis=0), abs=1000 * EPS)


@FEW
@given(index=INDICES)
def test_normal_incidence_loses_the_same_in_both_polarisations(index):
    """R = ((n - 1) / (n + 1))^2 (thesis 2.12), 0.04 for n = 1.5."""
    wanted = 1 - ((index - 1) / (index + 1)) ** 2
    for pair in ((1.0, index), (index, 1.0)):
        assert np.ravel(transmittances(*pair, 0.0)) == pytest.approx([wanted, wanted], abs=4 * EPS)


@FEW
@given(index=INDICES)
def test_at_brewsters_angle_all_p_polarised_light_passes(index):
    """tan = n_t / n_i; R_p is the square of a rounding error there."""
    t_s, parallel = transmittances(1.0, index, np.arctan(index))
    assert parallel == pytest.approx(1.0, abs=2 * EPS)
    assert t_s < 1


@FEW
@given(index=INDICES, angle=st.floats(0.0, 1.5))
def test_light_passes_a_face_as_well_in_both_directions(index, angle):
    """T(i, n_i -> n_t) = T(t, n_t -> n_i): reciprocity.  Backwards i is known to EPS / cos(i), and T_p rises
    like 4 n / cos(i)."""
    there = np.ravel(transmittances(1.0, index, angle))
    back = np.ravel(transmittances(index, 1.0, np.arcsin(np.sin(angle) / index)))
    assert back == pytest.approx(there, abs=100 * index * EPS / np.cos(angle) ** 2)


@FEW
@given(index=INDICES, share=st.floats(0.0, 0.99))
def test_beyond_the_critical_angle_nothing_passes(backend, index, share):
    critical = critical_angle(index, 1.0)
    angle = critical + (1 - share) * (np.pi / 2 - critical) * 0.99
    assert np.ravel(transmittances(index, 1.0, angle)) == pytest.approx([0.0, 0.0], abs=8 * EPS)
    assert traced_transmittance(backend, index, 1.0, angle) == 0.0


def test_glass_of_1_5_reflects_totally_from_41_81_degrees_on():
    assert np.degrees(critical_angle(1.5, 1.0)) == pytest.approx(41.810314895778596, rel=4 * EPS)
    assert critical_angle(1.0, 1.5) is None


def test_two_faces_at_normal_incidence():
    """n = 1.5 loses 4 % at each (thesis 2.13), n = 1 nothing."""
    assert normal_incidence_transmittance(1.5) == pytest.approx(0.96**2, rel=1e-15)
    assert normal_incidence_transmittance(1.0) == 1.0


def test_one_pass_at_normal_incidence_is_no_bound():
    """A plate with all its reflections passes 2 n / (n^2 + 1), and oblique faces of n = 4 pass more."""
    one_pass = normal_incidence_transmittance(1.5)
    face = np.sqrt(one_pass)
    assert one_pass < face / (2 - face)
    assert face / (2 - face) == pytest.approx(2 * 1.5 / (1.5**2 + 1), rel=16 * EPS)
    oblique = np.mean(transmittances(1.0, 4.0, np.radians(57.5)))
    assert oblique**2 > 1.003 * normal_incidence_transmittance(4.0)


def test_the_picture_is_made_again_bit_for_bit_and_depends_on_the_index(backend):
    png = fresnel_figure(backend, 1.5)
    assert png.startswith(b"\x89PNG")
    assert fresnel_figure(backend, 1.5) == png != fresnel_figure(backend, 1.7)
    assert plt.get_fignums() == []
