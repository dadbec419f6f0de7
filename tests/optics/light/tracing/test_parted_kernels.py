"""Derivatives back over many surfaces: kernels of bounded size, and nothing kept behind."""

import numpy as np
import pytest

from optics.light.tracing import Tracer
from optics.scene.paths import AIR, LightPath, Medium, Surface
from optics.scene.receivers import Plane
from optics.scene.sources import Rays
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface
from thbcad.poses import Pose
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface


def sheets(count):
    """Return a path through rough surfaces, 2 mm apart, and rays that spread."""
    knots = KnotVector.uniform(3, 4, -5.0, 5.0)
    space, rng = THBSpace(knots, knots), np.random.default_rng(1)
    shapes = (
        FreeformSurface((5.0, 5.0), sag=THBSurface(space, rng.uniform(-1e-3, 1e-3, space.dim)))
        for _ in range(count)
    )
    surfaces = tuple(Surface(shape, Pose.at((0, 0, 2.0 * k))) for k, shape in enumerate(shapes))
    path = LightPath(surfaces, (*(AIR, Medium(1.5)) * (count // 2), AIR), Plane(Pose.at((0, 0, 40.0))))
    p, q = rng.uniform(-0.1, 0.1, (2, 50))
    directions = np.array([p, q, np.sqrt(1 - p * p - q * q)])
    return path, Rays(np.array([0 * p, 0 * p, 0 * p - 10]), directions, np.full(50, 0.02))


def backward(backend, tracer):
    """Trace, and go back to the coefficients."""
    hits, landing = tracer.trace()
    total = backend.dr.sum(landing.x * landing.flux)
    backend.dr.eval(total)
    backend.dr.kernel_history_clear()
    backend.dr.backward(total)
    tracer.pull_back(hits)


@pytest.fixture
def kernel_history(backend):
    with backend.dr.scoped_set_flag(backend.dr.JitFlag.KernelHistory, True):
        yield backend.dr.kernel_history


def test_back_over_more_surfaces_no_kernel_is_larger(backend, kernel_history):
    largest = []
    for count in (2, 4, 6):
        backward(backend, Tracer(backend, *sheets(count), proven=False, polarised=False))
        largest.append(max(kernel.get("operation_count", 0) for kernel in kernel_history()))
    assert max(largest) <= largest[0]


def test_a_trace_over_many_surfaces_leaves_no_variables(backend):
    tracer, left = Tracer(backend, *sheets(4), proven=False, polarised=False), []
    for _ in range(3):
        backward(backend, tracer)
        left.append(len(backend.dr.whos_ad(as_string=True).splitlines()))
    assert left[0] == left[1] == left[2]
