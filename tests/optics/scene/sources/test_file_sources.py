"""Light of files: a new kind of it is all that its class says."""

from dataclasses import dataclass

import numpy as np
import pytest

from optics.base.runtime import load_backend
from optics.light.analysis import sequential
from optics.scene.sources import FileSource, PointSource, Rays
from optics.scene.system import advice
from optics.tolerancing.perturbations import tolerances_of
from tests.optics.cases import small_system


@dataclass(frozen=True, eq=False, kw_only=True)
class Torch(FileSource):
    """A kind that nobody knows: a cone of rays from a small square, whatever its file holds."""

    def sample(self):
        x, y = (a.ravel() * 0.02 for a in np.mgrid[-8:9, -8:9])
        direction = np.stack([x, y, np.ones_like(x)]) / np.sqrt(1 + x * x + y * y)
        start = np.stack([x, y, np.full_like(x, -self.distance)])
        return Rays(start, direction, np.full(x.size, self.flux / x.size))

    def parts(self, counts, fresh=None, most=1000, aperture=None, centre=(0.0, 0.0)):
        yield from self.sample().slices(most)


def test_a_source_of_a_new_kind_is_all_that_its_class_says(tmp_path):
    """Traced, judged and held against tolerances without a word about it elsewhere."""
    place = {"shift": (0.0, 0.0), "tilt": (0.0, 0.0, 0.0), "turn": (0.0, 0.0, 0.0)}
    torch = Torch(flux=2.0, distance=20.0, file="none", **place)
    system = small_system(tmp_path, {"lens.front.radius": 100.0})
    system.__dict__["sources"] = (torch,)
    image, fates, _ = sequential(system, load_backend("double"), 17)
    assert fates.total == pytest.approx(2.0, rel=1e-12)
    assert image.any()
    point = torch.without_extent()
    assert isinstance(point, PointSource)
    assert point.distance == pytest.approx(21.0, rel=1e-12)  # its rays meet 1 mm behind the square
    assert torch.envelope()[1] == pytest.approx(np.degrees(np.arctan(0.16 * np.sqrt(2))), rel=1e-12)
    assert torch.cone == pytest.approx(np.degrees(np.arctan(0.16 * np.sqrt(2))), rel=0.1)
    names = {tolerance.name for tolerance in tolerances_of(system)}
    assert "source.defocus" in names
    assert "source.size" not in names
    assert not any("luminaire" in sentence for sentence in advice(system))
