"""Which lens tells the blur before a design: one that sends light to the target."""

import pytest

from optics.designing.starts import TransportStart, spot_system
from optics.light.blur import blur_of
from tests.optics.cases import small_system

SUN = {"target.kind": "tophat", "target.pixels": [32, 32], "source.divergence": 0.5}
WALL = SUN | {
    "lens.thickness": 16.0,
    "lens.rear.freeform.z_freedom": 11.0,
    "target.distance": False,
    "target.position": [0.0, -28.0, 80.0],
    "target.tilt": [70.0, 0.0, 0.0],
    "target.half_width": [15.0, 30.0],
}


@pytest.mark.slow
def test_on_a_wall_it_is_a_coarse_start_and_across_the_axis_the_base_lens(backend, tmp_path):
    """A wall that the base lens meets far behind is blurred twice as wide there, and more."""
    across = small_system(tmp_path, SUN)
    assert spot_system(across, backend).designed is across.base
    wall = small_system(tmp_path, WALL)
    start = TransportStart(wall.sharp, backend)
    designed = wall.base.with_sags([start.fit(wall.base.sags[-1].space.uniform(2)).sag])
    widths = [
        blur_of(wall, wall.with_lens(lens).path, backend).width
        for lens in (designed, spot_system(wall, backend).designed, wall.base)
    ]
    assert widths[1] == pytest.approx(widths[0], rel=0.05)
    assert widths[2] > 2 * widths[0]
    sharp = wall.sharp
    assert spot_system(sharp, backend).designed is sharp.base
