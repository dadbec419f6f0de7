"""Light that a surface loses on its way to the places of a map, against Fresnel's equations."""

import numpy as np
import pytest

from optics.designing.starts import TransportStart
from optics.light.tracing import transmittances
from tests.optics.cases import small_system

SMALL_FAR_FIELD = {
    "target.kind": "tophat",
    "target.image": "",
    "target.distance": float("inf"),
    "target.half_width": [0.1, 0.1],
    "target.pixels": [16, 16],
    "lens.rear.radius": float("inf"),
    "lens.rear.conic": 0.0,
}


@pytest.mark.parametrize("aside", [0.0, 20.0, 35.0, 44.0])
def test_a_beam_that_is_sent_aside_as_a_whole_loses_what_fresnel_says(tmp_path, backend, aside):
    """A prism turns it by d where tan(incidence) = sin d / (n - cos d); directions differ by 0.1 degrees."""
    straight, tilted = (
        small_system(tmp_path, SMALL_FAR_FIELD | {"target.tilt": [0.0, tilt, 0.0]}) for tilt in (0.0, aside)
    )
    turn = np.radians(aside)
    angles = [np.arctan2(np.sin(d), 1.5 - np.cos(d)) for d in turn + np.radians([-0.1, 0.0, 0.1])]
    lost = [1 - float(np.mean(transmittances(1.5, 1.0, a))) for a in angles]
    start = TransportStart(straight, backend, 64)
    assert start.lost(tilted) == pytest.approx(lost[1], abs=max(abs(np.diff(lost))) + 1e-12)


def test_light_that_no_surface_can_send_there_is_lost(tmp_path, backend):
    """Half of a far field around arccos(1 / 1.5) aside asks for more than that, to a row of pixels or so."""
    changes = SMALL_FAR_FIELD | {"target.half_width": [10.0, 1.0]}
    start = TransportStart(small_system(tmp_path, changes), backend, 64)
    limit = float(np.degrees(np.arccos(1 / 1.5)))
    beyond = small_system(tmp_path, changes | {"target.tilt": [0.0, limit, 0.0]})
    angles = np.linspace(limit - 7.5, limit, 20001)[:-1]  # tophat: three quarters of the half-width are lit
    turned = np.radians(angles)
    passing = np.mean(transmittances(1.5, 1.0, np.arctan2(np.sin(turned), 1.5 - np.cos(turned))), axis=0)
    assert start.lost(beyond) == pytest.approx(1 - passing.mean() / 2, abs=0.02)


@pytest.mark.slow
def test_light_of_a_place_elsewhere_loses_what_that_of_a_start_there_does(tmp_path, backend):
    """A start that has to make up for much loss tells of a gentler place, where it would not."""
    flat = {"lens.rear.radius": float("inf"), "lens.thickness": 12.0, "lens.rear.freeform.z_freedom": 11.0}
    aside = {"target.kind": "tophat", "target.distance": False, "target.tilt": [0.0, 45.0, 0.0]}
    far, near = (
        small_system(tmp_path, flat | aside | {"target.position": place})
        for place in ([44.0, 0.0, 66.0], [27.5, 0.0, 76.0])
    )
    there, here = (TransportStart(system, backend) for system in (far, near))
    assert there.lost(near) == pytest.approx(here.lost(near), rel=0.02)
    assert there.lost(far) > 3 * there.lost(near)
