"""The light of a spectrum: the sum over its wavelengths, each along its own path."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Any

import numpy as np

from optics.base.runtime import Backend
from optics.light.analysis.light_estimate import LightEstimate
from optics.light.tracing import SequentialFates, Tracer
from optics.scene.paths import LightPath
from optics.scene.photometry import chromaticity_distance, spectral_lines, white_of
from optics.scene.receivers import Screen
from optics.scene.system import System
from thbcad.checks import Floats

Estimate = Callable[["System", "LightPath", "Screen", "Backend"], tuple[LightEstimate, "SequentialFates"]]

BLUE, RED = 450.0, 650.0  # nm, between which the shift of colours is told
SHIFT_RAYS = (65, 65)
DARK = 0.01  # of the mean luminance: darker pixels have no colour worth a number


@dataclass(frozen=True, eq=False)
class SpectralLight:
    """Light of all wavelengths together.

    estimate : its LightEstimate.  fates : flux by fate.
    colour : CIE 1931 X, Y, Z in units of 683 lm/W, (3, rows, columns); None where there is no spectrum.
    """

    estimate: LightEstimate
    fates: SequentialFates
    colour: Floats | None


def light_of_plate(
    system: System,
    path: LightPath,
    screen: Screen,
    backend: Backend,
    estimate: Estimate,
    alone: bool = False,
) -> SpectralLight:
    """Return the light of all lenses of a plate: the mean of that of each with all of the flux, E(x - s), or
    in the far field that of one.

    path : through one lens.  estimate : as of `spectral_light`.  alone : in the source's own wavelength.
    The same rays are traced through each.
    """
    paths = [path.onto(receiver) for receiver in system.seen_receivers]
    if alone:
        parts = [SpectralLight(*estimate(system, way, screen, backend), None) for way in paths]
    else:
        parts = [spectral_light(system, way, screen, backend, estimate) for way in paths]
    if len(parts) == 1:
        return parts[0]
    mean = reduce(add, (part.estimate for part in parts)) * (1 / len(parts))
    colours = [part.colour for part in parts if part.colour is not None]
    fates = reduce(add, (part.fates for part in parts)) / len(parts)
    return SpectralLight(mean, fates, np.mean(colours, axis=0) if colours else None)


def coloured(system: System, path: LightPath) -> list[tuple[float, LightPath]]:
    """Return (share of the flux, path) of every wavelength at which light is measured."""
    if not system.spectral:
        return [(1.0, path)]
    return [(w.weight, path.in_media(w.media)) for w in system.wavelengths]


def spectral_light(
    system: System, path: LightPath, screen: Screen, backend: Backend, estimate: Estimate
) -> SpectralLight:
    """Return the light along a path in all of the source's wavelengths.

    The same rays or cells are traced at each.

    estimate : of light of one wavelength.  backend : of double precision.
    """
    if not system.spectral:
        return SpectralLight(*estimate(system, path, screen, backend), None)
    colour = np.zeros((3, *screen.shape))
    whole, fates = None, []
    for wavelength in system.wavelengths:
        light, by_fate = estimate(system, path.in_media(wavelength.media), screen, backend)
        colour += np.multiply.outer(wavelength.weight * np.array(wavelength.xyz), light.irradiance)
        part = light * wavelength.weight
        whole = whole + part if whole else part
        fates.append(by_fate * wavelength.weight)
    assert whole is not None, "a spectrum has wavelengths"
    return SpectralLight(whole, reduce(add, fates), colour)


def colour_metrics(
    system: System, path: LightPath, colour: Floats, screen: Screen, backend: Backend
) -> dict[str, Any]:
    """Return how far a path takes colours apart.

    from_nm, to_nm, shift, shift_pixels : flux-weighted mean distance of the same rays of two wavelengths on
        the target, mm (degrees in the far field), and in pixels.
    fringe : distance of the pixels' chromaticity (u', v') from the source's, weighted with their luminance.
    """
    lines = system.wavelengths
    first, last = lines[0].nm, lines[-1].nm
    between = max(BLUE, first), min(RED, last)
    ends = between if between[0] < between[1] else (first, last)  # all of them on one side
    shift = 0.0
    if first < last:
        rays = system.source.rays(SHIFT_RAYS)
        landed = (Tracer(backend, path.in_media(system.media_at(nm)), rays).landed() for nm in ends)
        blue, red = (np.array([a.numpy() for a in (at.x, at.y, at.flux)]) for at in landed)
        flux = np.where((blue[2] > 0) & (red[2] > 0), blue[2], 0.0)
        apart = np.where(flux > 0, np.hypot(*(blue[:2] - red[:2])), 0.0)
        shift = float((flux * apart).sum() / flux.sum()) if flux.any() else 0.0
    distance = fringe(system, colour)
    shown = np.isfinite(distance)
    weight = colour[1][shown]
    return {
        "from_nm": ends[0],
        "to_nm": ends[1],
        "shift": shift,
        "shift_pixels": shift / float(np.mean(screen.pitch)),
        "fringe": float(np.average(distance[shown], weights=weight)) if weight.sum() else None,
    }


def fringe(system: System, colour: Floats) -> Floats:
    """Return the distance of pixels' chromaticity from the source's in (u', v'), (rows, columns).

    It is NaN in the dark.  colour : (3, rows, columns).
    """
    white = white_of(spectral_lines(system.problem.source.spectrum))
    distance = chromaticity_distance(colour, white)
    return np.where(colour[1] > DARK * colour[1].mean(), distance, np.nan)
