"""A blur that is the same everywhere: the sharp light, convolved with the spot of one point of the rear.

    E(X) = integral E_sharp(X - Y) k(Y) dY,      k^(f) = E[exp(-2 pi i f . dX)]

with dX of `LandingShifts`.  Of a beam whose sines are sqrt(u) stretch(u) at quantiles u of the flux, in all
directions alike, and of Gaussian errors of the slopes with rms sigma that is

    k^(f) = g(f) integral_0^1 J_0(2 pi |B' f| sin(theta(u))) du,
    g(f) = exp(-2 pi^2 (sigma_front^2 |F' f|^2 + sigma_rear^2 |R' f|^2)).

It is exact where the lens and its distance to the target are the same for all light.  Behind a lens of 100 mm
that throws 200 mm wide pictures 300 mm far the spots differ by 3 %.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import ceil, pi, radians, sin, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.special import j0

from optics.base.runtime import Backend, UserError
from optics.light.blur.spot_matrices import LandingShifts, landing_shifts
from optics.scene.paths import LightPath
from optics.scene.receivers import Screen
from optics.scene.sources import Divergence
from optics.scene.system import System
from thbcad.checks import Floats

SIGMAS = 3.0  # of Gaussian errors, that a spot reaches: a hundredth of its light lies beyond
QUANTILES = 256  # of the flux over the angles: 1e-5 of the transfer function of a spot some pixels wide
FREQUENCIES = 2048  # at which the transfer function of the beam is tabulated
SUBPIXELS = 7  # odd, in each direction, of which the pixels of a spot are sums
FWHM = 2.355  # full width at half of a Gaussian, in sigmas
ACROSS = 16.0  # pixels across the spot, from which on finer ones change a blurred picture by less than 1 %
MOST_AROUND = 3072  # pixels in each direction: measured by three times finer ones, the light takes 10 GB
MOST_PARTS = 4096  # of all pixels in each direction: those of large pictures are small, and fill the memory


@dataclass(frozen=True, eq=False)
class BlurOnto:
    """The blur of light on a wide screen, as it is seen on a narrow one.

    wide : wider than the narrow one by the reach of the blur.  times : of its pixels in one of the narrow
        screen, in each direction.  extra : pixels of the wide screen, its margin among them, on every side of
        the narrow one.  convolution : of images on the wide screen.
    """

    wide: Screen
    times: int
    extra: int
    convolution: Callable[[Floats], Floats]

    def __call__(self, image: Floats) -> Floats:
        """Return what the narrow screen sees of the light of the wide one."""
        return self.narrowed(self.convolution(image))

    def back(self, image: Floats) -> Floats:
        """Return the adjoint: from the narrow screen to the wide one."""
        return self.convolution(self.spread(image)) / self.times**2

    def narrowed(self, image: Floats) -> Floats:
        """Return the mean of an image of the wide screen on every pixel of the narrow one."""
        extra, times = self.extra, self.times
        inner = image[extra : image.shape[0] - extra, extra : image.shape[1] - extra]
        if times == 1:
            return inner.copy()
        rows, columns = (n // times for n in inner.shape)
        return inner.reshape(rows, times, columns, times).mean(axis=(1, 3))

    def spread(self, image: Floats) -> Floats:
        """Return an image of the narrow screen on the pixels of the wide one, dark beside it."""
        if self.times > 1:
            image = image.repeat(self.times, axis=0).repeat(self.times, axis=1)
        return np.pad(image, self.extra)


@dataclass(frozen=True, eq=False)
class Blur:
    """The spot that all light of one point of the rear makes.

    spread : of the beam; None of light without divergence.  slope_rms : of the surfaces.
    """

    spread: Divergence | None
    slope_rms: tuple[float, ...]
    shifts: LandingShifts

    @property
    def width(self) -> float:
        """The full width of the spot, mm or degrees: of a disk its diameter, of Gaussians that at half."""
        sizes = [FWHM * rms * _size(m) for rms, m in self._gaussians]
        if self.spread is not None:
            gaussian = self.spread.kind == "gaussian"
            full = FWHM * radians(self.spread.half_angle) if gaussian else 2 * self._sine
            sizes.append(full * _size(self.shifts.beam))
        return float(np.hypot.reduce(sizes))

    @property
    def rms(self) -> float:
        """The rms deviation of the spot's light in one direction, of x and y together, mm or degrees."""
        squares = [(rms * np.linalg.norm(matrix)) ** 2 for rms, matrix in self._gaussians]
        if self.spread is not None:
            u = (np.arange(QUANTILES) + 0.5) / QUANTILES
            sine = self.spread.stretch(u) * np.sqrt(u)
            squares.append(np.mean(sine**2) / 2 * np.linalg.norm(self.shifts.beam) ** 2)
        return sqrt(sum(squares) / 2)

    def reach(self, screen: Screen) -> int:
        """Return how many pixels of a screen the spot reaches."""
        far = np.zeros(2)
        for rms, matrix in self._gaussians:
            far = np.hypot(far, SIGMAS * rms * np.linalg.norm(matrix, axis=1))
        if self.spread is not None:
            sine = self._sine * (SIGMAS if self.spread.kind == "gaussian" else 1)
            far = far + sine * np.linalg.norm(self.shifts.beam, axis=1)
        return ceil(max(far / screen.pitch))

    def widened(self, screen: Screen) -> Screen:
        """Return a screen that is wider by the reach of the spot.

        Raises UserError : the spot is wider than the screen, and reaches over more pixels than memory holds.
        """
        reach, most = self.reach(screen), max(screen.pixels)
        if most + 2 * reach > max(MOST_AROUND, 3 * most):
            raise UserError(
                f"divergence or roughness spreads the light of every point over {2 * reach} pixels, and the "
                f"target has {most}: too many to compute; use less of them, fewer target.pixels, or a "
                "wider or nearer target"
            )
        return screen.widened(reach)

    def parts(self, screen: Screen, most: int) -> int:
        """Return into how many parts a pixel is cut in each direction, so that the blur sees what lies in it.

        most : of them, for spots that are narrow beside a pixel.
        """
        wanted = min(most, ceil(ACROSS * min(screen.pitch) / self.width))
        return max(1, min(wanted, MOST_PARTS // max(screen.pixels)))

    def convolution(self, screen: Screen, shape: tuple[int, int]) -> Callable[[Floats], Floats]:
        """Return the convolution of images of a shape (rows, columns), on pixels as large as the screen's.

        Beyond their borders the images are dark.
        """
        padded = self._padded(shape, screen)
        return partial(_filtered, transfer=self.transfer(screen, padded), shape=padded)

    def onto(self, screen: Screen, times: int = 1, margin: int = 0) -> BlurOnto:
        """Return the blur as a screen without a margin sees it.

        times : pixels of the wide screen in one of this one, in each direction.  margin : of the wide screen,
            in pixels of this one.

        Raises UserError : see `widened`.
        """
        wide = replace(self.widened(screen).finer(times), margin=times * margin)
        extra = times * (self.reach(screen) + margin)
        return BlurOnto(wide, times, extra, self.convolution(wide, wide.padded))

    def sampled(self, image: Floats, screen: Screen, shifts: Floats) -> Floats:
        """Return the mean of an image at shifted places: a convolution with samples of the spot.

        shifts : (n, 2), mm or degrees.
        """
        shape = self._padded(image.shape, screen)
        fx, fy = _frequencies(screen, shape)
        waves = [np.exp(-2j * pi * np.outer(d, f)) for d, f in zip(shifts.T, (fx, fy))]
        return _filtered(image, waves[1].T @ waves[0] / len(shifts), shape)

    def kernel_side(self, screen: Screen) -> int:
        """Return how many pixels the kernel has in each direction."""
        return 2 * self.reach(screen) + 3

    def kernel(self, screen: Screen) -> Floats:
        """Return the light that pixels get of a point in the middle of one, (odd, odd); its sum is 1."""
        side = self.kernel_side(screen)
        shape = (2 * SUBPIXELS * side, 2 * SUBPIXELS * side)
        spot = fft.irfft2(self.transfer(screen.finer(SUBPIXELS), shape), shape)
        spot = np.roll(spot, SUBPIXELS * side // 2, (0, 1))[: SUBPIXELS * side, : SUBPIXELS * side]
        spot = spot.reshape(side, SUBPIXELS, side, SUBPIXELS).sum(axis=(1, 3))
        spot = np.maximum(spot, 0.0)  # a band-limited spot has a faint fringe below zero
        return np.asarray(spot / spot.sum())

    def transfer(self, screen: Screen, shape: tuple[int, int]) -> Floats:
        """Return k^ at the frequencies of a real FFT over pixels, (rows, columns // 2 + 1)."""
        fx, fy = _frequencies(screen, shape)
        fy = fy[:, None]

        def along(matrix: Floats) -> Floats:
            """Return |M' f|."""
            (a, b), (c, d) = matrix
            return np.hypot(a * fx + c * fy, b * fx + d * fy)

        out = np.ones((shape[0], shape[1] // 2 + 1))
        for rms, matrix in self._gaussians:
            out *= np.exp(-2 * pi**2 * rms**2 * along(matrix) ** 2)
        if self.spread is not None:
            at = along(self.shifts.beam)
            table = np.linspace(0, at.max(), FREQUENCIES)
            u = (np.arange(QUANTILES) + 0.5) / QUANTILES
            sine = self.spread.stretch(u) * np.sqrt(u)
            out *= np.interp(at, table, j0(2 * pi * table[:, None] * sine).mean(axis=1))
        return out

    def _padded(self, shape: tuple[int, ...], screen: Screen) -> tuple[int, int]:
        """Return the shape with which the blur of one border does not come in at the other."""
        rows, columns = (fft.next_fast_len(n + self.reach(screen), real=True) for n in shape)
        return rows, columns

    @property
    def _sine(self) -> float:
        """sin of the half-angle, or of one sigma."""
        return 0.0 if self.spread is None else sin(radians(self.spread.half_angle))

    @property
    def _gaussians(self) -> list[tuple[float, Floats]]:
        """Slope errors with what they do."""
        pairs = zip(self.slope_rms, (self.shifts.front, self.shifts.rear))
        return [(rms, matrix) for rms, matrix in pairs if rms]


def _frequencies(screen: Screen, shape: tuple[int, int]) -> tuple[Floats, Floats]:
    """Return the frequencies along x and along y of a real FFT over pixels."""
    fx, fy = fft.rfftfreq(shape[1]), -fft.fftfreq(shape[0])  # rows fall with y
    return fx / screen.pitch[0], fy / screen.pitch[1]


def _filtered(
    image: Floats, transfer: NDArray[np.complexfloating] | Floats, shape: tuple[int, int]
) -> Floats:
    """Return an image times a transfer function, cut to the image's own shape."""
    out = fft.irfft2(fft.rfft2(image, shape) * transfer, shape)
    return np.asarray(out[: image.shape[0], : image.shape[1]])


def _size(matrix: Floats) -> float:
    """Return the scale of lengths under a matrix."""
    return sqrt(abs(np.linalg.det(matrix)))


def blur_of(system: System, path: LightPath, backend: Backend) -> Blur:
    """Return the Blur of a path through the lens of a system that blurs, see `System.blurred`."""
    spread = system.source.spread if system.source.diverging else None
    return Blur(spread, system.slope_rms, landing_shifts(system.sharp, path, backend))
