"""The first of several meetings with a wavy face: the independent trace and the optimiser's search against
dense sampling."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from optics.exchange.verification.reference_tracer import _intersect, trace_step
from optics.exchange.verification.traced_faces import ParametricFace
from optics.light.intersections import SearchedHits
from optics.scene.receivers import receiver_at
from optics.scene.sources import Rays
from oracles.light_formulas import refracted_vector
from tests.cases import examples, slow_unless
from tests.optics.cases import coefficients, grazing_rays, landing_points, tracer_to
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens, placed_surfaces
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

HALF, THICKNESS, DENSE, TARGET_Z = 8.0, 12.0, 1501, 200.0
SHORT = 2 / (DENSE - 1)  # of the way: what the samples of this test may step over


def wavy_lens(height, waves, phase=(0.3, 1.1), index=1.05, spans=12):
    """Return a lens with a plane front whose rear carries height * sin * cos, `waves` half periods per
    half-width in x and y."""
    kv = KnotVector.uniform(3, spans, -HALF, HALF)
    space = THBSpace(kv, kv)
    a, b = (np.pi * n * kv.greville() / HALF + p for n, p in zip(waves, phase))
    sag = THBSurface(space, (height * np.outer(np.sin(a), np.cos(b))).ravel())
    return Lens(
        FreeformSurface((HALF, HALF)),
        FreeformSurface((HALF, HALF), Conic(-10.0, -1.0), sag),
        THICKNESS,
        index,
    )


def grazing(lens, count, seed=0, least=0.02):
    """Return rays (origin, direction), (n, 3), that start in the glass up to grazing, cos(theta) >= least."""
    origin, direction = grazing_rays(lens.rear, count, seed, least)
    return origin.T + np.array([0, 0, THICKNESS]), direction.T


def first_fall(lens, origin, direction):
    """Return where rays first fall through the rear, by dense sampling and bisection on the kernel's heights.

    t : ray parameters.  falls : there is such a place.  clear : and from there on the ray is above the face
        for longer than
    both searches may step over, after a start below the face.
    """
    rear, top = lens.rear, THICKNESS + lens.rear.sag.coefficients.max() + 0.1
    wall_x, wall_y = np.where(direction[:, 0] < 0, -HALF, HALF), np.where(direction[:, 1] < 0, -HALF, HALF)
    ends = [(w - o) / d for w, o, d in zip((wall_x, wall_y, top), origin.T, direction.T)]
    last = np.minimum.reduce(ends)

    def above(t):
        x, y, z = (origin[:, k, None] + t * direction[:, k, None] for k in range(3))
        x, y = (np.clip(a, -HALF, HALF) for a in (x, y))
        return (THICKNESS + rear(x.ravel(), y.ravel())).reshape(t.shape) - z > 0

    t = last[:, None] * np.linspace(0, 1, DENSE)
    below = above(t)
    fall = below[:, :-1] & ~below[:, 1:]
    falls, k = fall.any(axis=1), fall.argmax(axis=1)[:, None]
    back = below & (np.arange(DENSE) > k)
    run = np.where(back.any(axis=1), back.argmax(axis=1), DENSE) - 1 - k[:, 0]
    low, high = (np.take_along_axis(t, i, axis=1) for i in (k, k + 1))
    for _ in range(60):
        middle = (low + high) / 2
        is_below = above(middle)
        low, high = np.where(is_below, middle, low), np.where(is_below, high, middle)
    several = fall.sum(axis=1) > 1
    clear = falls & (run > (DENSE - 1) * SHORT + 1) & below[:, 0]
    return SimpleNamespace(t=high[:, 0], falls=falls, clear=clear, several=several)


def searched(backend, lens, origin, direction):
    """Return (ray parameters, hit) of the optimiser's search for the rear, sure of the first meeting."""
    e = lens.rear.sag.space.embedding
    search = SearchedHits(backend, lens.rear.conic, lens.rear.outline, (e.kv_u, e.kv_v), True)
    at = origin - [0, 0, THICKNESS]
    hits = search.meet(
        *([backend.array(a) for a in v.T] for v in (at, direction)),
        e.coefficients(lens.rear.sag.coefficients),
    )
    points = np.column_stack([hits.x.numpy(), hits.y.numpy(), hits.z.numpy()])
    return np.einsum("ij,ij->i", points - at, direction), hits.hit.numpy()


def require_first(backend, lens, origin, direction):
    """Compare both searches with the samples, ray by ray; return (the clear rays, those among them that meet
    the face again)."""
    found = first_fall(lens, origin, direction)
    points, normals, met = _intersect(ParametricFace(placed_surfaces(lens)[1]), origin, direction)
    by_step = np.einsum("ij,ij->i", points - origin, direction)
    by_search, hit = searched(backend, lens, origin, direction)
    clear = found.clear
    assert hit[clear].all()
    np.testing.assert_allclose(by_search[clear], found.t[clear], rtol=0, atol=1e-6)
    assert met[clear].all()
    # |f| < 1e-9 mm (search) or 1e-12 (Newton) over a slope along the ray that is above 1e-3 for all but
    # tangent rays
    np.testing.assert_allclose(by_step[clear], found.t[clear], rtol=0, atol=1e-6)
    assert (normals[met][:, 2] > 0).all()
    return clear, clear & found.several


@pytest.mark.every(2)
@pytest.mark.parametrize(
    "wave",
    slow_unless(
        lambda wave: wave[0] in (0.4, 2.0),
        [(0.4, (2, 3)), (1.0, (3, 2)), (1.5, (2, 1.4)), (2.0, (4, 3)), (2.5, (1, 4))],
    ),
    ids=str,
)
def test_rays_meet_a_wavy_face_where_they_first_fall_through_it(backend, wave):
    height, waves = wave
    lens = wavy_lens(height, waves)
    clear, several = require_first(backend, lens, *grazing(lens, 1200, 1))
    assert clear.mean() > 0.5
    if height >= 1.5:
        assert several.sum() >= 5


def test_rays_steeper_than_a_face_fall_through_it_where_the_search_finds_it():
    lens = wavy_lens(0.5, (2, 3))
    origin, direction = grazing(lens, 4000, 1)
    origin[::10, 0] += 4 * HALF  # beside the face
    face = ParametricFace(placed_surfaces(lens)[1])
    steep = np.abs(direction[:, :2]) @ face._steepest < direction[:, 2]
    origin, direction = origin[steep], direction[steep]
    falls, at = face._crossing(origin, direction)
    assert falls.sum() > 300
    assert (~falls).sum() > 10
    assert np.abs(at - face._search(origin[falls], direction[falls])).max() < 1e-3 * HALF
    _, _, met = _intersect(face, origin, direction)
    np.testing.assert_array_equal(met, falls)


@pytest.mark.slow
@examples(12)
@given(
    height=st.floats(0.2, 2.5),
    waves=st.tuples(*[st.floats(0.5, 4)] * 2),
    phase=st.tuples(*[st.floats(0, 6)] * 2),
    seed=st.integers(0, 999),
)
def test_any_waves(backend, height, waves, phase, seed):
    lens = wavy_lens(height, waves, phase)
    require_first(backend, lens, *grazing(lens, 250, seed))


@pytest.mark.slow
@pytest.mark.parametrize(("height", "waves", "spans"), [(2.0, (4, 2.8), 16), (1.5, (6, 5), 20)], ids=str)
def test_a_slope_that_turns_within_a_sample_loses_no_ray(height, waves, spans):
    """Newton's steps from the chord between two samples leave some of these rays for places behind the origin
    or beside the face."""
    lens = wavy_lens(height, waves, spans=spans)
    origin, direction = grazing(lens, 4000, 1)
    found = first_fall(lens, origin, direction)
    points, _, met = _intersect(ParametricFace(placed_surfaces(lens)[1]), origin, direction)
    assert found.clear.sum() > 2000
    assert np.flatnonzero(found.clear & ~met).tolist() == []
    off = np.abs(np.einsum("ij,ij->i", points - origin, direction) - found.t)
    assert np.flatnonzero(found.clear & (off > 1e-6)).tolist() == []


@pytest.mark.slow
@pytest.mark.parametrize("index", [1.05, 1.3])
def test_the_whole_trace_lands_where_the_first_meeting_sends_the_light(backend, index):
    """By the kernel's normal at the first fall and Snell's law in vectors; the optimiser's tracer says the
    same, ray by ray."""
    lens = wavy_lens(1.0, (3, 2), index=index)
    origin, direction = grazing(lens, 2000, 2, 0.1)
    origin[:, 2] = -0.5
    across = origin - direction * (origin[:, 2:] / direction[:, 2:])
    origin, direction, across = (
        a[(np.abs(across[:, :2]) < HALF).all(axis=1)] for a in (origin, direction, across)
    )
    inside = refracted_vector(direction, np.array([[0.0, 0.0, 1.0]]), 1 / index)
    found = first_fall(lens, across, inside)
    at = across + found.t[:, None] * inside
    slopes = [lens.rear(*np.clip(at[:, :2].T, -HALF, HALF), d) for d in ((1, 0), (0, 1))]
    normal = np.column_stack([-slopes[0], -slopes[1], np.ones(len(at))])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    cosine = np.einsum("ij,ij->i", inside, normal)
    passes = found.clear & (
        index**2 * (1 - cosine**2) < 0.99
    )  # well before total reflection, where a last digit moves light by far
    out = refracted_vector(inside[passes], normal[passes], index)
    forward = out[:, 2] > 0.05
    expected = (at[passes] + ((TARGET_Z - at[passes][:, 2]) / out[:, 2])[:, None] * out)[forward, :2]
    chosen = np.flatnonzero(passes)[forward]
    assert len(chosen) > 300
    step = SimpleNamespace(**dict(zip(("front", "rear"), placed_surfaces(lens))))
    reference = trace_step(step, origin, direction, 1.0, index, receiver_at(TARGET_Z))
    assert (reference.flux[chosen] > 0).all()
    # 1e-11 of the angle, by a slope of at most 1 / 0.05 and the cosine 0.05 of the direction out
    np.testing.assert_allclose(reference.points[chosen], expected, rtol=0, atol=1e-6)
    tracer = tracer_to(backend, lens, Rays(origin.T, direction.T, np.ones(len(origin))), TARGET_Z)
    landing = tracer.trace(coefficients(lens))[1]
    np.testing.assert_allclose(landing_points(landing)[chosen], expected, rtol=0, atol=1e-6)
    np.testing.assert_allclose(landing.flux.numpy()[chosen], reference.flux[chosen], rtol=1e-8)
