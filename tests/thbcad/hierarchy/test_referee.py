"""nutils as a referee: its THB-spline basis spans the same space on the same hierarchy."""

import numpy as np
import pytest

from thbcad import KnotVector, THBSpace

mesh = pytest.importorskip("nutils.mesh")
function = pytest.importorskip("nutils.function")


def both(degree, spans, marks):
    """Return (space, nutils topology, its geometry) after the same refinements of [0, spans]^2."""
    kv = KnotVector.uniform(degree, spans, 0.0, float(spans))
    space = THBSpace(kv, kv)
    topology, geometry = mesh.rectilinear([np.arange(spans + 1.0)] * 2)
    for level, chosen in enumerate(marks):
        space = space.refine({level: chosen})
        centres = topology.sample("gauss", 1).eval(geometry)
        cells = np.floor(centres * 2**level).astype(int)
        # elements of the topology that are cells of this level and chosen
        volumes = topology.integrate_elementwise(function.J(geometry), degree=1)
        here = np.isclose(volumes, 0.25**level)
        wanted = set(map(tuple, chosen))
        topology = topology.refined_by(
            [k for k, cell in enumerate(cells.tolist()) if here[k] and tuple(cell) in wanted]
        )
    return space, topology, geometry


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("degree", "spans", "marks"),
    [
        (1, 4, [[(0, 0), (0, 1), (1, 1)]]),
        (
            2,
            5,
            [
                [(i, j) for i in range(3) for j in range(4)],
                [(i, j) for i in range(1, 5) for j in range(2, 6)],
            ],
        ),
        (3, 6, [[(i, j) for i in range(6) for j in range(6) if abs(i - j) <= 1]]),
    ],
)
def test_the_same_space(degree, spans, marks):
    """As many functions, and every one of ours is a combination of nutils' ones at Gauss points that
    determine it."""
    space, topology, geometry = both(degree, spans, marks)
    basis = topology.basis("th-spline", degree=degree)
    sample = topology.sample("gauss", 2 * degree + 1)
    x, theirs = sample.eval(geometry), sample.eval(basis)
    theirs = theirs.toarray() if hasattr(theirs, "toarray") else np.asarray(theirs)
    ours = space.collocation(*x.T).toarray()
    assert len(topology) == len(space.cells)
    assert ours.shape == theirs.shape
    change, *_ = np.linalg.lstsq(theirs, ours, rcond=None)
    assert abs(theirs @ change - ours).max() <= 1e-12
    assert np.allclose(np.sort(change.sum(axis=1)), 1, atol=1e-10)  # both bases sum to one
