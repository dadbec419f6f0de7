"""diffinytrace itself on the picture of the cone: python diffinytrace_run.py CHECKOUT MINUTES

CHECKOUT is a clone of github.com/martinpflaum/diffinytrace (MIT), in an environment with its packages.
What it imports for CAD, pages and colours is replaced by nothing.  Its own `create_lens` runs with its
published settings but for two: fewer rays (2^16 in place of 2^21), and every level ends after its part of the
minutes.  Such a run is shorter than theirs.  The net goes to diffinytrace_pearl.npz.
"""

from __future__ import annotations

import importlib.abc
import importlib.machinery
import sys
import types
from pathlib import Path
from time import perf_counter
from unittest.mock import MagicMock

import numpy as np

OUT = Path(__file__).with_name("diffinytrace_pearl.npz")
PICTURE = Path(__file__).parents[2] / "examples" / "pearl.png"
UNUSED = {"cadquery", "OCP", "plotly", "colour", "pvlib"}
RAYS = 1 << 16
PARTS = (
    1,
    1,
    1,
    1,
    2,
    4,
    8,
)  # of the minutes, by level: nets of 4, 6, 10, 18, 34, 66 and 130 functions a side


class Unused(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Gives empty modules for packages that the run does not need."""

    def find_spec(self, name, path, target=None):
        wanted = name.split(".")[0] in UNUSED
        return importlib.machinery.ModuleSpec(name, self, is_package=True) if wanted else None

    def create_module(self, spec):
        module = types.ModuleType(spec.name)
        module.__path__ = []
        module.__getattr__ = lambda name: MagicMock()
        return module

    def exec_module(self, module):
        """Nothing is to be run."""


class Limited:
    """Their `minimize`, ended level by level; the net is kept after every step."""

    def __init__(self, minimize, minutes):
        self.minimize, self.seconds = minimize, 60 * minutes / sum(PARTS)
        self.begun, self.level, self.evaluations = perf_counter(), 0, 0

    def counted(self, function):
        def evaluated():
            self.evaluations += 1
            return function()

        return evaluated

    def __call__(self, function, params, callback, **options):
        (net,) = (p for p in params if p.requires_grad)
        end = perf_counter() + self.seconds * PARTS[self.level]
        print(f"level {self.level}, net {tuple(net.shape)}, {self.evaluations} evaluations", flush=True)
        callback()  # they read what it keeps

        def keep():
            done = {"evaluations": self.evaluations, "seconds": perf_counter() - self.begun}
            np.savez(OUT, net=net.detach().numpy(), level=self.level, **done)
            if perf_counter() > end:
                raise StopIteration

        found = self.minimize(self.counted(function), [net], callback=keep, **options)
        self.level += 1
        return found


def without_measure(system, sequence, source, detector, smoother, **options):
    """Return nothing in place of their measure of 1e8 rays after every step: the net is measured here."""
    import torch

    def measured():
        smoother.last_raycounting = smoother.discrete_desired_irradiance
        return (torch.tensor(0.0),) * 3

    return measured


def run(checkout: Path, minutes: float) -> None:
    """Design the lens and keep its net."""
    sys.meta_path.insert(0, Unused())
    sys.path[:0] = [str(checkout), str(checkout / "examples")]
    import diffinytrace
    import sunlight_picture
    import torch

    torch.manual_seed(0)
    diffinytrace.gaussian_smoother.make_evaluation_function = without_measure
    sunlight_picture.minimize = Limited(sunlight_picture.minimize, minutes)
    sunlight_picture.create_lens(
        str(PICTURE),
        diffinytrace.materials["PMMA"],
        diffinytrace.materials["AIR"],
        "cpu",
        sigma=0.3,
        lens_thickness=5.0,
        detector_distance=60.0,
        lens_distance=5.0,
        num_refinements=len(PARTS) - 1,
        grid_size=256,
        num_rays=RAYS,
        theta_max_rad=0.02,
    )


if __name__ == "__main__":
    run(Path(sys.argv[1]), float(sys.argv[2]))
