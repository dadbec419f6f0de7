"""The small problem designed from the base conic and from an optimal-transport map."""

import pytest

from tests.optics.designing.optimisation.cases import FLAT, run


@pytest.fixture(scope="session")
def small(tmp_path_factory, backend):
    """The small problem designed from the base conic, with one window on all levels."""
    return run(tmp_path_factory.mktemp("flat"), backend, FLAT | {"optimizer.window": "bspline"})


@pytest.fixture(scope="session")
def moved(tmp_path_factory, backend):
    """The small problem designed from an optimal-transport map."""
    return run(tmp_path_factory.mktemp("transport"), backend, {"optimizer.start": "transport"})


@pytest.fixture(params=["flat", "transport"])
def either(request, small, moved):
    """Both designs, one after the other."""
    return small if request.param == "flat" else moved
