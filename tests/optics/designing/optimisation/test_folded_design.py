"""A design behind a plane mirror that folds its light is that of the unfolded lens, with one axis turned."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from PIL import Image, ImageFilter

from optics.designing.optimisation import shape_lens
from optics.light.analysis import measure
from optics.light.engines import ExactEngine
from optics.scene.paths import AIR, Surface
from optics.scene.problem import Problem
from optics.scene.system import System
from tests.cases import ROOT
from thbcad import Pose
from thbcad.lens import FreeformSurface

FOLD = Pose.at((1.0, 0.0, 40.0), (-np.pi / 4, 0.1, 0.0))
SCREEN = Pose.at((0.0, 0.0, 71.0))
PIXELS = 64


@dataclass(frozen=True, eq=False)
class Folded(System):
    """A system whose light a fixed plane mirror turns aside behind the lens."""

    @property
    def paths(self):
        mirror = Surface(FreeformSurface((60.0, 90.0)), FOLD, "reflect", 1.0)
        return tuple(
            replace(path, surfaces=(*path.surfaces, mirror), media=(*path.media, AIR))
            for path in super().paths
        )


def problem(picture, screen):
    """A lens 5 mm behind the origin before a beam, and a picture on a screen anywhere."""
    free = {"spans": (7, 7), "max_level": 2, "z_freedom": 3.0}
    rear = {"half_width": (10.0, 10.0), "radius": 60.0, "conic": -1.0, "freeform": free}
    lens = {"kind": "lens", "name": "L1", "position": (0, 0, 5), "index": 1.5, "thickness": 6.0, "rear": rear}
    return Problem(
        source={"kind": "collimated", "half_width": (9.5, 9.5)},
        element=[lens | {"front": {"half_width": (10.0, 10.0)}}],
        target={
            "kind": "image",
            "image": str(picture),
            "position": screen.shift.tolist(),
            "tilt": screen.tilt,
            "half_width": (20.0, 20.0),
            "pixels": (PIXELS, PIXELS),
        },
        optimizer={"iterations": (60,)},
    )


def designed(system):
    shaped, _ = shape_lens(system, system.backend, ExactEngine(system.backend))
    lens = shaped.designed
    return lens, measure(system.with_lens(lens), system.backend)


@pytest.mark.slow
def test_a_folded_design_is_as_good_as_the_unfolded_one(tmp_path):
    """The screen's mirror image, whose x is turned round, and the picture's.

    Of a soft photograph on a coarse net, whose design ends at its least error: of a sharp one on a fine net a
    screen that is moved by 1e-6 mm changes it by 1.5 %.
    """
    picture = Image.open(ROOT / "examples" / "pearl.png").convert("L").filter(ImageFilter.GaussianBlur(24))
    pixels = np.asarray(picture.resize((PIXELS, PIXELS)))
    Image.fromarray(pixels).save(tmp_path / "straight.png")
    Image.fromarray(np.ascontiguousarray(pixels[:, ::-1])).save(tmp_path / "turned.png")
    normal = FOLD.rotation[:, 2]
    across = np.eye(3) - 2 * np.outer(normal, normal)
    aside = Pose(
        across @ SCREEN.rotation @ np.diag([-1.0, 1.0, 1.0]),
        across @ (SCREEN.shift - FOLD.shift) + FOLD.shift,
    )
    lens, straight = designed(System(problem(tmp_path / "straight.png", SCREEN)))
    system = Folded(problem(tmp_path / "turned.png", aside))
    folded = designed(system)[1].metrics
    assert straight.metrics["rel_l2"] < 0.03
    assert folded["rel_l2"] == pytest.approx(straight.metrics["rel_l2"], rel=0.01)
    assert folded["efficiency"] == pytest.approx(straight.metrics["efficiency"], rel=1e-4)
    same = measure(system.with_lens(lens), system.backend).irradiance[:, ::-1]
    assert np.abs(same - straight.irradiance).max() < 1e-10 * straight.irradiance.max()
