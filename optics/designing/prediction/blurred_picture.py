"""What the blur of a beam, or of rough surfaces, leaves of a picture: as it is, and at best.

One blur everywhere is a model: the spot k of `Blur` is the mean over the lens.  With the picture T the sharp
light T itself makes k * T, and no light F >= 0 comes nearer than

    min || k * F - T || / || T ||      over F >= 0, beside the picture too,

for which `optics.designing.etendue.approximate` has a certificate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from optics.base.runtime import Backend
from optics.designing.etendue import Kernel, approximate, merged
from optics.light.analysis import rel_l2
from optics.light.blur import Blur, blur_of
from optics.scene.receivers import Screen
from optics.scene.system import System, solvable_system
from thbcad.checks import Floats

MOST_PIXELS = 256  # in each direction, that the best light is looked for on; more are merged
FINER = 7  # parts of a pixel in each direction: a narrower spot blurs the borders of lit pixels too
KKT, STEPS = 1e-5, 2000  # of the best light; 5000 raise the bound of a photograph in the sun by 1 %
SMALL = 1e-3  # of rel_l2: less is none
WIDER, FEWER_PIXELS = (1.5, 2.0, 3.0, 4.0, 6.0, 8.0), 128  # times, that targets are tried
ROOM = 0.5  # of a limit, that the least may take: lenses reach about 1.7 times the least
ASLANT = 0.6  # slope to the axis of light at a corner of a wider target, at most: 31 degrees
RIDGE = 4.0  # width of a long stroke, over the mean distance of its points to its border


@dataclass(frozen=True)
class BlurLimits:
    """What a blur leaves of a picture.

    width : full width of the spot.  pixel : mm or degrees, as all lengths.
    strokes : mean width of the bright parts of a picture, None of other targets.
    variation : of the spot over the lens, relative.
    plain : rel_l2 of the picture, blurred.
    least : of rel_l2 of all light with this blur everywhere; None where the spot is wider than the target.
    """

    width: float
    pixel: float
    strokes: float | None
    variation: float
    plain: float
    least: float | None


def blur_limits(system: System, backend: Backend) -> BlurLimits:
    """Return what the blur of a lens leaves of the target of a blurred system."""
    blur, screen = blur_of(system, system.path, backend), system.target.screen()
    target, shown = system.target.irradiance(screen, 1.0), screen.projection()
    picture = target / shown  # in the far field intensities are compared
    return BlurLimits(
        width=blur.width,
        pixel=max(screen.pitch),
        strokes=stroke_width(picture, screen.pitch) if system.target.settings.kind == "image" else None,
        variation=blur.shifts.variation,
        plain=rel_l2(_blurred(blur, target, screen) / shown, picture),
        least=_least(system, blur),
    )


def wider_picture(
    system: System, backend: Backend, keeps: Callable[[float], bool]
) -> tuple[float, float] | None:
    """Return half-widths of a target at the same place whose light may keep limits: its detail is wider, the
    spot is not.

    None where WIDER does not reach, of zones, which keep their size, and beyond ASLANT: the base lens tells
    the spots of light that goes about along the axis.

    keeps : called with a rel_l2, returns whether it keeps them.
    """
    target, receiver = system.problem.target, system.target.receiver
    if target.kind == "zones" or not receiver.across_axis:
        return None
    for times in WIDER:
        half_x, half_y = (float(f"{times * h:.3g}") for h in target.half_width)
        x, y, z = receiver.toward((0.0, 0.0, system.base.thickness), half_x, half_y)
        if np.hypot(x, y) > ASLANT * z:
            return None
        wider = solvable_system(system.problem.with_(**{"target.half_width": (half_x, half_y)}))
        least = _least(wider, blur_of(wider, wider.unshaped.path, backend), FEWER_PIXELS)
        if least is not None and keeps(least / ROOM):
            return half_x, half_y
    return None


def _blurred(blur: Blur, picture: Floats, screen: Screen) -> Floats:
    """Return the means over pixels of a blurred picture that is constant on every pixel."""
    rows, columns = picture.shape
    times = blur.parts(screen, FINER)
    parts = picture.repeat(times, axis=0).repeat(times, axis=1)
    fine = blur.convolution(screen.finer(times), parts.shape)(parts)
    return np.asarray(fine.reshape(rows, times, columns, times).mean(axis=(1, 3)))


def blur_sentence(system: System, found: BlurLimits, reached: float | None = None) -> str:
    """Return what a blur leaves of a picture, in words.  reached : rel_l2 of a lens."""
    unit = system.target.unit
    said = f"{_who(system)} blurs {found.width:.2g} {unit} ({found.width / found.pixel:.2g} pixels)"
    if found.strokes is not None:
        said += f", the strokes of the picture are about {found.strokes:.2g} {unit} wide"
    said += f"; the picture itself, blurred so, has a rel_l2 of {found.plain:.2g}"
    if found.least is None:
        return f"{said}; the spot is wider than the target"
    said += f"; one blur everywhere, a model from which the spots of the lens vary by {found.variation:.1%}, "
    said += f"allows {found.least:.2g} at least" if found.least >= SMALL else "costs nothing on these pixels"
    return said if reached is None else f"{said}; this lens has {reached:.2g}"


def stroke_width(picture: Floats, pitch: Sequence[float]) -> float:
    """Return the mean width of the bright parts of a picture, in the unit of pitch (x, y).

    Bright is what lies above Otsu's threshold.  The points of a stroke of width w are w / 4 from its border
    in the mean, and half a pixel more from the middle of the next pixel.
    """
    from skimage.filters import threshold_otsu

    bright = picture > threshold_otsu(picture) if np.ptp(picture) else picture > 0
    inside = distance_transform_edt(np.pad(bright, 1), sampling=pitch[::-1])
    if not bright.any():
        return 0.0
    return RIDGE * (float(inside[1:-1, 1:-1][bright].mean()) - float(np.mean(pitch)) / 2)


def _who(system: System) -> str:
    if not system.source.diverging:
        return "the roughness of the surfaces"
    what = "the sun" if system.problem.source.divergence_profile == "sun" else "the divergence of the light"
    return f"{what} with the roughness of the surfaces" if any(system.slope_rms) else what


def _least(system: System, blur: Blur, most: int = MOST_PIXELS) -> float | None:
    """Return a lower bound of rel_l2 of the light of one blur, on merged pixels, at most so many in each
    direction; None of a wider spot.

    With the irradiance T and P = shown, | (k * F - T) / P | / | T / P | is no less than
    | k * F - T | / (max P | T / P |).
    """
    sharp = system.target.screen()
    target, shown = system.target.irradiance(sharp, 1.0), sharp.projection()
    merge = -(-max(system.target.settings.pixels) // most)
    goal = merged(target, merge)
    screen = system.target.screen(merge)
    if blur.kernel_side(screen) > min(goal.shape):  # asked first: the kernel of a wide spot fills the memory
        return None
    scale = merge * float(np.linalg.norm(goal) / np.linalg.norm(target / shown) / shown.max())
    return scale * approximate(Kernel(blur.kernel(screen)), goal, KKT, STEPS).lower_bound
