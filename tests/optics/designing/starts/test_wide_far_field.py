"""Starts for wide far fields, whose corners lie far aside, and where much light is reflected."""

import numpy as np
import pytest

from optics.designing.starts import TransportStart
from optics.light.analysis import cell_irradiance, rel_l2
from tests.optics.cases import WIDE, small_system

BORDER = 4  # pixels, where jumps of the light are as sharp as cells


def started(folder, changes, drop=()):
    """Return the small system with a far field of 35 degrees and a flat rear as base."""
    flat = {"lens.rear.radius": float("inf"), "lens.rear.conic": 0.0, "lens.rear.freeform.z_freedom": 20.0}
    far = {"target.half_width": [35.0, 35.0], "target.pixels": [48, 48]}
    return small_system(folder, WIDE | flat | far | changes, drop=drop)


def fitted(system, backend):
    """Return the start, and its sag on 32 spans."""
    start = TransportStart(system, backend)
    return start, start.fit(system.base.sags[-1].space.uniform(3)).sag


@pytest.mark.slow
def test_a_wide_far_field_asks_for_slopes_of_a_surface(tmp_path, backend, monkeypatch):
    """Its chart for transport is that of slopes: a sag misses them by a fifth, root mean square, of what it
    misses where angles are the chart, or less."""
    system = started(tmp_path, {"target.kind": "image"}, drop=["target.lit"])

    def misfit():
        start, sag = fitted(system, backend)
        return np.sqrt(start.misfit(sag).sum())

    by_slopes = misfit()
    monkeypatch.setattr("optics.designing.starts.transport_start.WIDE", 90.0)
    assert by_slopes < 0.2 * misfit()


@pytest.mark.parametrize("fresnel", [True, False])
def test_a_start_makes_up_for_the_losses_that_the_design_reckons_with(tmp_path, backend, fresnel):
    """In the corners, 48 degrees aside, a quarter is reflected: what is even with these losses is uneven
    without, and the reverse."""
    system = started(tmp_path, {"optimizer.fresnel": fresnel})
    _, sag = fitted(system, backend)
    path, screen = system.with_lens(system.base.with_sags([sag])).path, system.target.screen()
    inner = (slice(BORDER, -BORDER),) * 2
    wanted, cells = system.target.irradiance(screen, 1.0)[inner], system.source.cells((193, 193))
    lossy, bare = (
        rel_l2(cell_irradiance(way, screen, cells, backend)[0][inner], wanted)
        for way in (path, path.without_reflection())
    )
    assert (lossy < 0.3 * bare) if fresnel else (bare < 0.3 * lossy)
