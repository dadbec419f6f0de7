"""What diffraction does to published pictures: the estimate of `thbcad check` against scalar waves.

Run: thbcad bench diffraction
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import zoom

from benchmarks.checkout import EXAMPLES
from benchmarks.rows.row import Row
from optics.designing.prediction import diffraction, in_waves
from optics.designing.transport import transport_map
from optics.light.analysis import rel_l2
from optics.scene.system import System, load_system
from oracles.wave_light import picture_in_waves, row_in_waves

Floats = NDArray[np.float64]

CASES = {
    "pearl": "pearl",
    "hobbyist's photograph": "others/hobby",
    "portrait, near target": "others/pearl_near",
    "text, near target": "others/text_near",
}
LINES = np.arange(0.1, 0.95, 0.1)  # of the height and the width of a picture
GREY = 0.005  # of the brightest pixel: every part of a row gets some light
FACTOR, SINGLE = 1.25, 1.5  # that all rows of a picture are within, and one picture
FAR = {"portrait, far target": "others/pearl_far", "text, far target": "others/text_far"}
SMALL = ("pearl", "hobbyist's photograph", "text, near target")
PIXELS, CELLS, NUMBER = 64, 4, 1200.0  # of a small picture; cells of the map in a pixel; W D / (lambda L)
PERFECT = "rel_l2 of a lens that is perfect by geometrical optics"


def rows() -> list[Row]:
    """Return the measured rows."""
    systems = {name: load_system(EXAMPLES / f"{file}.toml") for name, file in CASES.items()}
    lines = [row for name, system in systems.items() for row in _of_lines(name, system)]
    far = [_whole(name, load_system(EXAMPLES / f"{file}.toml")) for name, file in FAR.items()]
    return [*lines, *far, *(_of_picture(name, systems[name]) for name in SMALL)]


def _of_lines(name: str, system: System) -> Iterator[Row]:
    """Yield the rows of a square target before a square beam."""
    problem, screen = system.problem, system.target.screen()
    picture, (pixel, _) = system.target.irradiance(screen, 1.0), screen.pitch
    half, lens, distance = screen.half_width[0], problem.source.half_width[0], problem.throw
    wavelength = problem.source.wavelength * 1e-6
    square = wavelength * distance * half / lens / pixel**2
    places = (LINES * len(picture)).astype(int)
    lines = np.maximum(np.concatenate([picture[places], picture[:, places].T]), GREY * picture.max())
    waves = np.array([_off(row_in_waves(t, half, lens, distance, wavelength), t) for t in lines])
    told = np.array([_off(in_waves(t[None], square, 0.0), t) for t in lines])
    apart = float(np.linalg.norm(told) / np.linalg.norm(waves))
    yield Row(
        f"{name}: rel_l2 of its rows by waves",
        _rms(waves),
        "",
        f"{len(lines)} rows and columns, root mean square",
        quantity=PERFECT,
        estimator="scalar waves",
    )
    yield Row("  by the estimate", _rms(told), "", "waves", quantity=PERFECT, estimator="estimate")
    yield Row("  larger over smaller of both", max(apart, 1 / apart), "", "1", FACTOR)
    yield Row(
        "  the same of single rows, at most", float(np.exp(np.abs(np.log(told / waves)).max())), "", "1"
    )
    yield replace(_whole(name, system), name="  of the picture, by the estimate")


def _whole(name: str, system: System) -> Row:
    """Return what the estimate says of a whole picture: that of `thbcad check`."""
    problem = system.problem
    halves = dict.fromkeys(problem.face_names, problem.source.half_width)
    found = diffraction(system, halves, lambda: 0.0)
    assert found, "diffraction matters in these cases"
    assert found.rel_l2, "they are pictures"
    title = f"{name}: rel_l2 of the picture, by the estimate"
    return Row(title, found.rel_l2, quantity=PERFECT, estimator="estimate")


def _of_picture(name: str, system: System) -> Row:
    """Return how a picture of few pixels compares with waves in two dimensions."""
    picture = system.target.irradiance(replace(system.target.screen(), pixels=(PIXELS, PIXELS)), 1.0)
    picture = np.maximum(picture, GREY * picture.max())[::-1].T  # x first

    def density(shape: tuple[int, int]) -> Floats:
        return np.asarray(zoom(picture, np.divide(shape, PIXELS), order=0, mode="nearest", grid_mode=True))

    transport = transport_map(system.backend, density, (CELLS * PIXELS, CELLS * PIXELS), 1.0)
    waves = _off(picture_in_waves(transport.psi, PIXELS, NUMBER), picture)
    estimate = _off(in_waves(picture, PIXELS**2 / NUMBER, PIXELS**2 / NUMBER), picture)
    return Row(
        f"{name}, {PIXELS} x {PIXELS} pixels: rel_l2 by the estimate / by waves",
        estimate / waves,
        "",
        f"waves in two dimensions, paraxial, W D / (lambda L) = {NUMBER:g}",
        SINGLE,
        quantity=PERFECT,
        estimator="estimate",
    )


def _off(light: Floats, target: Floats) -> float:
    return rel_l2(np.atleast_2d(light), np.atleast_2d(target))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
