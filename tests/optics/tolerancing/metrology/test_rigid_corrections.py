"""A lens whose only fault is where it stands is put back, and what does not help is not done."""

import numpy as np
import pytest

from optics.light.analysis import rel_l2
from optics.scene.problem import load_problem
from optics.scene.system import OpticalSystem
from optics.tolerancing.metrology.rigid_corrections import rigid_correction
from optics.tolerancing.perturbations import Perturbation, PerturbedLight
from tests.optics.cases import rough, write_problem
from thbcad.surfaces import THBSurface

SHIFT = 0.15  # mm


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> OpticalSystem:
    return OpticalSystem(load_problem(write_problem(tmp_path_factory.mktemp("problem"))))


@pytest.mark.slow  # 60 traces
def test_a_decentred_lens_is_put_back(system: OpticalSystem, backend) -> None:
    """The light asked for is that of the same lens in another place, which is to be found."""
    lens = system.lens.with_sags([THBSurface(sag.space, rough(sag.space)) for sag in system.lens.sags])
    wanted = Perturbation(lens_shift=(SHIFT, -SHIFT / 2, 0.0), lens_tilt=(0.0, 0.0, 0.01))
    target, _ = PerturbedLight(system, lens, backend)(wanted)
    found = rigid_correction(system, lens, target, backend)
    amounts = {move.name: move.amount for move in found.moves}
    assert found.after < 0.05 * found.before
    assert amounts["lens.decentre_x"] == pytest.approx(SHIFT, rel=0.1)
    assert amounts["lens.decentre_y"] == pytest.approx(-SHIFT / 2, rel=0.1)
    assert amounts["lens.tilt_z"] == pytest.approx(np.degrees(0.01), rel=0.2)
    again, _ = PerturbedLight(system, lens, backend)(found.perturbation)
    assert rel_l2(again, target) == pytest.approx(found.after)


@pytest.mark.slow  # 13 traces
def test_a_lens_that_stands_well_stays(system: OpticalSystem, backend) -> None:
    lens = system.lens.with_sags([THBSurface(sag.space, rough(sag.space)) for sag in system.lens.sags])
    target, _ = PerturbedLight(system, lens, backend)()
    found = rigid_correction(system, lens, target, backend)
    assert found.after <= found.before < 1e-12
    assert all(abs(move.amount) < 1e-9 for move in found.moves)
