"""What diffraction does to light that is designed by rays: an estimate from a scalar model of coherent light.

No lens of width D makes detail finer than lambda L / D, in the far field lambda / D.  A lens whose rays draw
a picture exactly is worse.  Its rays map the lens to the target with a magnification m, and the light of one
point of the target comes from a part of the lens about sqrt(lambda L / m) wide.  So the target is blurred
over the Fresnel length

    b = sqrt(lambda L m),    m = W / D on average, with the width W of what is lit.

With n pixels of width p across, (b / p)^2 is n lambda L / (p D).

- Weak detail of the frequency f keeps sin(chi) / chi of its contrast, chi = pi b^2 f^2.
- Bright parts use more of the lens: there m is (E / mean E)^(-1/2) times the mean one.  Dark parts count as
  if they had the mean light.
- Light ends in the fringes of a slit (Fresnel), as that of a lens or a beam with a sharp border.

The filter is the weak-contrast limit of the diffraction integral.  `oracles.wave_light` solves this integral
for rows of pictures.  Source: M. Born, E. Wolf, Principles of Optics, 8.7.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import ceil, sqrt

import numpy as np
from scipy.fft import dctn, idctn
from scipy.ndimage import distance_transform_edt, uniform_filter1d
from scipy.special import fresnel

from optics.base.runtime import Backend, plain_number
from optics.light.analysis import rel_l2
from optics.light.blur import spot_width
from optics.light.outgoing import least_half_widths
from optics.scene.receivers import lit_part
from optics.scene.system import System
from thbcad.checks import Floats

MM_PER_NM = 1e-6
HALF_A_PIXEL = 0.5
LEAST = 0.01  # of rel_l2: less is not worth a line
FINE = 0.1  # pixels: Fresnel lengths of less leave rel_l2 below LEAST
MOST_PIXELS = 512  # in each direction, that the estimate is made on; more are merged, which makes it smaller
DARK = 1e-3  # of the brightest pixel: the lens sends no light there
BRIGHTEST = 0.1  # of the mean magnification, at least
CLASSES = 4  # of magnifications, between which the filtered pictures are interpolated
ALIASES = range(-2, 3)  # of the frequencies of square pixels
BEYOND = 3.0  # cycles a pixel
SHARP = 1e-12  # square pixels: of a direction without diffraction
PARTS = 8  # of a pixel or of a Fresnel length, over which fringes are averaged


@dataclass(frozen=True)
class Diffraction:
    """What diffraction does to the light of a lens.  Lengths on the target are mm, in the far field degrees.

    wavelength : nm.  lens : mm, width of the lens that light uses, in the direction with the wider blur.
    blur : lambda L / D there, the least of any lens.  pixel : in that direction.
    rel_l2 : estimate for a lens whose rays draw the target exactly; None of zones, of several sources, and
        where the blur is wider than what is to be lit.
    """

    wavelength: float
    lens: float
    blur: float
    pixel: float
    rel_l2: float | None

    @property
    def matters(self) -> bool:
        """Whether it is worth a line: half a pixel of blur, or LEAST of rel_l2."""
        return self.blur >= HALF_A_PIXEL * self.pixel or (self.rel_l2 or 0.0) >= LEAST

    def metrics(self, unit: str) -> dict[str, float]:
        """Return its numbers by name.  unit : of lengths on the target."""
        found = {f"diffraction_blur_{unit}": self.blur}
        return found if self.rel_l2 is None else found | {"rel_l2_diffraction": self.rel_l2}

    def sentence(self, unit: str) -> str:
        """Return it in words.  unit : of lengths on the target."""
        blur = f"{plain_number(self.blur, 2)} {unit} ({plain_number(self.blur / self.pixel, 2)} pixels)"
        said = (
            f"light of {self.wavelength:.0f} nm that passes {plain_number(self.lens, 3)} mm of the lens is "
            f"blurred by at least {blur}"
        )
        if self.rel_l2 is not None:
            said += (
                "; with waves, a lens that is perfect by geometrical optics has a rel_l2 of about "
                f"{self.rel_l2:.2g} (an estimate for coherent light)"
            )
        return f"{said}; all other numbers are by geometrical optics"


def diffraction(
    system: System, lit_halves: Mapping[str, Sequence[float]], spot: Callable[[], float]
) -> Diffraction | None:
    """Return what diffraction does to the light of a system; None where it does not matter, or is hidden by
    the blur of the source.

    lit_halves : half-widths of the parts of the faces that light uses, by name of the face, mm.
    spot : returns the width of the light of one point of the lens on the target; 0 is sharp.
    """
    path, target = system.unshaped.path, system.target
    half = lit_halves[system.problem.face_names[path.shaped]]
    if min(half) <= 0:
        return None
    widths = 2 * np.array(half if target.receiver.across_axis else [min(half)] * 2)
    lines = system.wavelengths
    wavelength = float(np.average([line.nm for line in lines], weights=[line.weight for line in lines]))
    blurs = MM_PER_NM * wavelength * path.lever / widths
    screen = target.screen(ceil(max(target.settings.pixels) / MOST_PIXELS))
    picture = target.irradiance(screen, 1.0) / screen.projection()
    lit = 2 * np.array(lit_part(picture, screen, DARK)[2])
    squares = blurs * lit / np.square(screen.pitch)
    if squares.max() < FINE**2 or spot() ** 2 > (blurs * lit).max():
        return None
    pitch = target.screen().pitch
    k = int(np.argmax(blurs / pitch))
    told = target.settings.kind != "zones" and not system.source.several and (blurs < lit).all()
    error = rel_l2(in_waves(picture, *squares), picture) if told else None
    found = Diffraction(wavelength, float(widths[k]), float(blurs[k]), pitch[k], error)
    return found if found.matters else None


def diffraction_of(system: System, backend: Backend) -> Diffraction | None:
    """Return what `diffraction` says of a lens.  backend : of double precision."""
    lit_halves = least_half_widths(system, backend)
    return diffraction(system, lit_halves, lambda: spot_width(system, backend))


def in_waves(picture: Floats, along_x: float, along_y: float) -> Floats:
    """Return an estimate of the light, in waves, of a lens whose rays draw a picture exactly.

    picture : (rows, columns), means of pixels.  along_x, along_y : squares of the Fresnel length b, in
        pixels; 0 leaves a direction as it is.
    """
    light = picture > DARK * picture.max()
    if not light.all():  # the lens ends where the convex hull of its light does
        from skimage.morphology import convex_hull_image

        light = convex_hull_image(light)
    lengths = np.sqrt(np.maximum([along_y, along_x], SHARP))  # of rows and columns, pixels
    beside, nearest = distance_transform_edt(~light, 1 / lengths, return_indices=True)
    within = distance_transform_edt(np.pad(light, 1), 1 / lengths)[1:-1, 1:-1]
    filled = picture[tuple(nearest)]
    pixel = float(1 / lengths.max())  # in Fresnel lengths
    depth = np.where(light, within - pixel / 2, pixel / 2 - beside)
    return _filtered(filled, filled / picture[light].mean(), along_x, along_y) * _fringes(depth, pixel)


def _filtered(picture: Floats, brightness: Floats, along_x: float, along_y: float) -> Floats:
    """Return a picture whose detail has lost contrast.  brightness : relative to the mean light."""
    magnification = np.clip(1 / np.sqrt(np.maximum(brightness, DARK)), BRIGHTEST, 1.0)
    levels = np.linspace(np.log(magnification.min()), 0.0, CLASSES)
    place = np.interp(np.log(magnification), levels, np.arange(CLASSES))
    spectrum, found = dctn(picture), np.zeros_like(picture)
    for k, level in enumerate(levels):
        share = np.maximum(1 - np.abs(place - k), 0.0)
        if share.any():
            scale = float(np.exp(level))
            found += share * idctn(spectrum * _contrast(picture.shape, scale * along_x, scale * along_y))
    return found


def _contrast(shape: tuple[int, ...], along_x: float, along_y: float) -> Floats:
    """Return what each frequency of a cosine transform over pixels keeps of its contrast.

    Square pixels hold the frequencies f + k for all integers k, by sinc(f + k) when they are drawn and once
    more when they are measured.  Those beyond ALIASES count as BEYOND.
    """
    rows, columns = (np.arange(n) / (2 * n) for n in shape)
    kept, total = np.zeros(shape), np.zeros(shape)
    for i, j in product(ALIASES if along_y else [0], ALIASES if along_x else [0]):
        f, g = (rows + i)[:, None], (columns + j)[None, :]
        weight = np.sinc(f) ** 2 * np.sinc(g) ** 2
        kept += weight * np.sinc(along_y * f * f + along_x * g * g)
        total += weight
    return kept + (1 - total) * np.sinc((along_x + along_y) * BEYOND**2) ** 2


def _fringes(depth: Floats, pixel: float) -> Floats:
    """Return the mean over a pixel of the light of a slit, |A(d) - A(d - w)|^2 / 2.

    A(d) = C + i S are Fresnel's integrals up to sqrt(2) d.

    depth : d, how far pixels lie within the light, in Fresnel lengths; w is twice the greatest.
    """
    parts = PARTS * max(1, ceil(pixel))
    at = np.arange(depth.min() - pixel, depth.max() + 2 * pixel, pixel / parts)

    def amplitude(distance: Floats) -> Floats:
        sine, cosine = fresnel(sqrt(2) * distance)
        return np.asarray(cosine + 1j * sine)

    light = np.abs(amplitude(at) - amplitude(at - 2 * depth.max())) ** 2 / 2
    return np.interp(depth, at, uniform_filter1d(light, parts))
