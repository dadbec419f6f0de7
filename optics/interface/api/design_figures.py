"""The figures of a design, which another process draws while this one goes on."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future
from functools import cached_property
from typing import Any

from optics.base.runtime import Backend, HelperProcess
from optics.designing.optimisation import Row, Stage
from optics.interface.api.level_records import LevelRecord
from optics.light.analysis import Measurement, fans as ray_fans
from optics.reporting.view import MIRRORED, elements_sight, photo_caption, photograph, scene_paths
from optics.scene.system import System
from thbcad.checks import Floats


class DesignFigures:
    """The figures of the report.

    process : in which they are drawn.
    """

    def __init__(self, process: HelperProcess, system: System) -> None:
        self.process, optic = process, system.problem.optic
        rows = [element.name for element in system.problem.element]
        self._noun = ", ".join(rows) if rows[1:] else optic.noun
        self._sides = optic.face_name("front"), optic.face_name("rear")

    def draw_lens(
        self,
        system: System,
        history: Sequence[Row],
        plan: Sequence[Stage],
        levels: Sequence[LevelRecord],
    ) -> None:
        """Draw what needs no measurement of the lens, and every level that was kept."""
        others = [
            (optic.called, shape, (optic.face_name("front"), optic.face_name("rear")))
            for optic, shape in system.free_others
        ]
        self._lens = self._figures("lens_figures", system.designed, history, plan, self._sides, others)
        self._solid = self._figures("solid_views", system.made, self._sides)
        self._levels = [
            self._figures("level_figure", system.with_lens(k.lens), k.name, k.measurement, k.gradients)
            for k in levels
        ]

    def draw_light(self, system: System, measurement: Measurement, backend: Backend) -> None:
        """Draw what the element delivers; `backend` traces the rays of the scene, and fans past the edges."""
        alone = system.problem.source.lone and not (system.source.from_afar or system.source.by_rays)
        placed = system.lens_on_axis and alone
        fans = ray_fans(system, backend) if placed and system.by_edges else {}
        paths = scene_paths(system, backend)
        irradiance = measurement.irradiance
        self._light = self._figures("light_figures", system, measurement, fans)
        self._scene = self._figures("scene_view", system, irradiance, paths)
        self._view = self.process.ask("optics.reporting.view", "scene_page", system, irradiance, paths)
        self._seen_from = "behind" if system.axial else "beside"
        if system.axial and system.target.mirrored:
            self._seen_from += f", where {MIRRORED}"

    def photograph(self, system: System, irradiance: Floats, backend: Backend) -> None:
        """Make the photograph, here, while another process draws."""
        sight = elements_sight(system, backend)
        self._photo = photo_caption(system), photograph(system, irradiance, sight)

    def _figures(self, function: str, *arguments: object) -> Future[Any]:
        """Ask the process for what a function of the figures returns."""
        return self.process.ask("optics.reporting.figures", function, *arguments)

    def levels(self) -> list[tuple[str, bytes]]:
        """Return (caption, PNG) of every level that was kept."""
        return [level.result() for level in self._levels]

    def view(self) -> str:
        """Return the page that shows the scene, to be turned in a browser."""
        return self._view.result()

    @cached_property
    def pictures(self) -> dict[str, tuple[str, bytes]]:
        """(caption, PNG) by name, in the order of the report.

        The photograph is the last in the row.
        """
        parts = f"Source, {self._noun} and target"
        scene = f"{parts}, seen from {self._seen_from}; rays that miss the target are red."
        solid = "The solid from four sides; the text below says how much steeper its relief is shaded."
        return {
            "photo": self._photo,
            **self._light.result(),
            **self._lens.result(),
            "scene": (scene, self._scene.result()),
            "solid": (solid, self._solid.result()),
        }
