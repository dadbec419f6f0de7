"""What is measured of lenses with outlines and of a body, walls included, against light on the faces of their
STEP files by OCCT: the same rays and corners of cells, laid on pixels alike."""

import numpy as np
import pytest

from optics.light.analysis import closed_lens_light, light_by_all_ways, light_of_cells, measure
from optics.light.analysis.border_triangles import Borders
from optics.light.analysis.light_of_cells import extrapolated, traced_cells
from optics.light.tracing import (
    FATES,
    Fate,
    Landing,
    SequentialFates,
    TargetArea,
    Tracer,
    trace_nonsequential,
)
from oracles.step_branches import file_branches, file_sequence
from tests.optics.cases import roughened, small_system
from thbcad.cad.exchange import step_bytes

pytestmark = pytest.mark.slow

POINT = {
    "source.kind": "point",
    "source.half_angle": 62.0,
    "source.distance": 6.0,
    "target.half_width": [80.0, 80.0],
    "target.pixels": [12, 12],
    "target.fit": "stretch",
}
LENSES = {
    "round": {"lens.outline": "round", "lens.rear.half_width": [12.0, 12.0]},
    "rounded": {
        "lens.outline": "rounded",
        "lens.corner_radius": 3.0,
        "lens.front.half_width": [10.0, 8.0],
        "lens.rear.half_width": [11.0, 8.0],
    },
    "body": {"lens.outline": "round", "lens.body.draft": 5.0, "lens.clear_aperture": [9.4, 9.4]},
}
RAYS, REPLICATES = (12, 12), 2
CELLS, COARSER = 14, 10  # each way, twice primes: of the finest grid and of the next one
LEAST = 1e-3  # of a ray's flux: weaker branches end, in place of the roulette, which is random


class File:
    """Light through the faces of a STEP file."""

    def __init__(self, system, lens, path, backend):
        clear = system.with_lens(lens).clear_aperture
        self.radii = clear and {name: c.half_width[0] for name, c in zip(("front", "rear"), clear)}
        self.path, self.backend, self.index = path, backend, lens.index
        self.screen = system.target.screen()
        self.target = TargetArea.of(system.with_lens(lens).path, self.screen.half_width)

    def sequence(self, rays):
        return file_sequence(self.path, rays, self.index, self.target, self.radii)

    def every(self, rays):
        return file_branches(self.path, rays, self.index, self.target, LEAST, (), self.radii)

    def trace(self, rays):
        """Return what `traced_cells` asks for: fates, and a Landing."""
        points, fates = self.sequence(rays)
        self.by_fate = {FATE[name]: flux for name, flux in fates.items()}
        values = *points, fates["on_target"] + fates["off_target"], np.isfinite(points[0])
        x, y, flux, arrives = (self.backend.array(np.nan_to_num(a)) for a in values)
        return self, Landing(x, y, x, y, flux, arrives > 0)

    def fates(self, landing, half_width, weights=None):
        of_rays = 1.0 if weights is None else weights.numpy()
        return SequentialFates({fate: float(np.sum(of_rays * flux)) for fate, flux in self.by_fate.items()})


FATE = {
    "beside_lens": Fate("missed", 0),
    "front_reflected": Fate("reflected", 0),
    "missed_rear": Fate("missed", 1),
    "rear_reflected": Fate("reflected", 1),
    "on_target": Fate("on_target"),
    "off_target": Fate("off_target"),
    "blocked": Fate("blocked"),
    "total_internal": Fate("total_internal"),
}


@pytest.fixture(scope="module", params=LENSES)
def made(request, tmp_path_factory, backend):
    """Return system, lens, and its File."""
    folder = tmp_path_factory.mktemp("light")
    system = small_system(folder, POINT | LENSES[request.param])
    lens = roughened(system.base)
    (folder / "lens.step").write_bytes(step_bytes(system.with_lens(lens).solid))
    return system, lens, File(system, lens, folder / "lens.step", backend)


def ends(fates, names=FATE):
    """Return the flux by name.  What a holder blocks is beside the rear: that of a body is smaller."""
    found = {name: float(np.sum(fates.get(name, 0.0))) for name in names}
    return found | {"missed_rear": found["missed_rear"] + found.pop("blocked")}


def test_rays_land_where_those_of_the_file_do(made, backend):
    system, lens, file = made
    rays = system.source.rays((24, 24))
    tracer = Tracer(backend, system.with_lens(lens).path, rays)
    _, landing = tracer.trace()
    points, fates = file.sequence(rays)
    arrives = np.isfinite(points[0])
    assert (landing.flux.numpy() > 0).tolist() == arrives.tolist()
    for found, wanted in zip((landing.x, landing.y), points):
        assert found.numpy()[arrives] == pytest.approx(wanted[arrives], abs=1e-8)
    own = tracer.fates(landing, file.target.half_width).by_name
    assert ends(own) == pytest.approx(ends(fates), abs=1e-12)
    assert sum(own.values()) == pytest.approx(1, rel=1e-12)


def test_metrics_are_those_of_the_file(made, backend, monkeypatch):
    """Few cells and rays, the same for both; so is what ends below the threshold.  A fifth of the light and
    more comes by way of the walls."""
    system, lens, file = made
    seen = []

    def certain(backend, solid, rays, target, **_):
        seen.append(rays)
        return trace_nonsequential(backend, solid, rays, target, threshold=LEAST)

    of_rays = {"RAYS": RAYS, "REPLICATES": REPLICATES, "PILOT": REPLICATES, "trace_nonsequential": certain}
    for name, value in of_rays.items():
        monkeypatch.setattr(closed_lens_light, name, value)
    monkeypatch.setattr(light_by_all_ways, "REPLICATES", REPLICATES)
    monkeypatch.setattr(light_of_cells, "_cells", lambda *_: CELLS)
    monkeypatch.setattr(light_of_cells, "FINEST", Borders(2 * CELLS, 20))
    found = measure(system.with_lens(lens), backend)

    ((fine,), fates), ((coarse,), _) = (
        traced_cells(
            file.trace, [file.screen], system.source.cells([n] * 2), backend, borders=Borders(fine, 20)
        )
        for n, fine in ((CELLS, 2 * CELLS), (COARSER, CELLS))
    )
    wanted, closed = extrapolated(fine, coarse, (CELLS / COARSER) ** 2), np.zeros(len(FATES))
    for rays in seen:
        by_ray, (x, y, flux, _) = file.every(rays)
        points, straight = file.sequence(rays)
        image = file.screen.binned(np.stack([x, y], axis=1), flux)
        image -= file.screen.binned(points.T, straight["on_target"] + straight["off_target"])
        wanted = wanted + image / file.screen.pixel_area / REPLICATES
        closed += by_ray.sum(axis=1) / REPLICATES
    assert np.linalg.norm(found.irradiance - wanted) <= 1e-6 * np.linalg.norm(wanted)
    assert ends(found.metrics["fates_w"]) == pytest.approx(ends(fates.by_name), abs=1e-9)
    others = found.metrics["nonsequential"]
    by_name = dict(zip(FATES, closed))
    assert others["fates_w"] == pytest.approx({name: by_name[name] for name in others["fates_w"]}, abs=1e-8)
    assert sum(others["fates_w"].values()) == pytest.approx(1, rel=1e-12)
    assert found.metrics["paths"] == "all"
    assert others["by_other_ways"] > 0.2
