"""The light to expect from the rays of a pack, in a far field in watts and on a plane in lumens."""

import numpy as np
import pytest

from optics.exchange.packs.expected import light_quantities, ray_files, ray_table
from optics.light.analysis import fresh_light, measure
from tests.optics.cases import HOLLOW, WIDE, hollow_lens, small_lens, small_system

EMITTER = HOLLOW | {"source.kind": "lambertian", "source.half_width": [0.5, 0.5], "source.distance": 2.0}
LUMENS = EMITTER | {"source.unit": "lm", "source.flux": 50.0, "target.half_width": [2000.0, 1500.0]}


@pytest.mark.every(2)
@pytest.mark.parametrize(
    ("changes", "lens", "unit", "quantity"),
    [(WIDE, small_lens(), "degrees", "peak intensity"), (LUMENS, hollow_lens(), "mm", "peak illuminance")],
)
def test_rays_make_nearly_the_light_of_the_lens(
    monkeypatch, tmp_path, backend, changes, lens, unit, quantity
):
    """Up to the noise of 147 rays a pixel or more, five standard deviations of the peak's."""
    monkeypatch.setattr("optics.exchange.packs.expected.MANY", (512, 512))
    monkeypatch.setattr("optics.exchange.packs.expected.LISTED", (8, 8))
    system = small_system(tmp_path, changes | {"target.pixels": [24, 24]})
    found = measure(system.with_lens(lens), backend)
    files, rays = ray_files(system.with_lens(lens), ".tm25ray")
    assert list(files) == ["rays_source.tm25ray", "rays_behind.tm25ray"]
    direct, screen = (
        fresh_light(system.with_lens(lens), backend),
        system.target.screen(),
    )  # by front and rear alone
    light = {"irradiance": direct, "target": found.target}
    on_target = (direct * screen.projection()).sum() * screen.pixel_area
    rows = {q.name: q for q in light_quantities(system.with_lens(lens), rays, light, found.metrics)}
    per_pixel = len(rays) / 24**2
    assert rows["efficiency"].by_rays == pytest.approx(on_target / system.problem.flux, abs=0.003)
    assert rows[quantity].by_rays == pytest.approx(rows[quantity].value, rel=5 / np.sqrt(per_pixel))
    assert all(row.within > 0 for row in rows.values())
    head, *lines = ray_table(system.with_lens(lens)).decode().splitlines()
    assert f"landing_u_{unit}" in head
    assert len(lines) == 64
