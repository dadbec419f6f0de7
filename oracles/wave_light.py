"""Light by scalar waves: the exact phase that rays need to draw a picture, propagated without rays.

Along a row, a plane wave meets a thin element on |x| <= a, whose rays bring the light of every part of the
element to that part of the row which has the same share of the light:

    k sin(theta) = d phase / dx,    tan(theta) = (u(x) - x) / L,    share of u in the row = (x + a) / 2a.

The field exp(i phase) goes on by its angular spectrum, exp(i z sqrt(k^2 - kx^2)).  Nothing is paraxial, and
nothing of it is used by the estimate of `optics.designing.prediction`.
"""

from __future__ import annotations

import numpy as np
from scipy.fft import fft2
from scipy.interpolate import interp1d
from scipy.ndimage import zoom

SAMPLES = 2.5  # for each cycle of the steepest ray
WINDOW = 1.3  # of the wider of element and row
BAND = 2.2  # of the width of a target, that its field covers
FINER = 2  # samples of the light, for each of 1 / F of the target's width


def row_in_waves(row, half_width, lens, distance, wavelength):
    """Return the mean irradiance of every pixel, (n,).

    row : (n,), means of pixels over |u| <= half_width.  lens : a, half-width.  All lengths are mm.
    """
    borders = half_width * np.linspace(-1, 1, len(row) + 1)
    share = np.concatenate([[0.0], np.cumsum(row)]) / np.sum(row)

    def sine(x):
        apart = np.interp((x + lens) / (2 * lens), share, borders) - x
        return apart / np.hypot(apart, distance)

    steepest = np.abs(sine(np.linspace(-lens, lens, 20001))).max()
    width = 2 * WINDOW * max(half_width, lens)
    count = 2 ** int(np.ceil(np.log2(2 * SAMPLES * width * steepest / wavelength)))
    step = width / count
    x = (np.arange(count) - (count - 1) / 2) * step
    slopes = sine(x)
    phase = 2 * np.pi / wavelength * step * (np.cumsum(slopes) - slopes / 2)
    field = np.where(np.abs(x) <= lens, np.exp(1j * phase), 0.0)
    k, kx = 2 * np.pi / wavelength, 2 * np.pi * np.fft.fftfreq(count, step)
    onward = np.exp(1j * distance * (np.sqrt(np.maximum(k * k - kx * kx, 0.0)) - k)) * (np.abs(kx) < k)
    light = np.abs(np.fft.ifft(np.fft.fft(field) * onward)) ** 2
    summed = np.concatenate([[0.0], np.cumsum(light)]) * step
    ends = np.append(x, x[-1] + step) - step / 2
    return np.diff(np.interp(borders, ends, summed)) / (2 * half_width / len(row))


def picture_in_waves(potential, pixels, number):
    """Return the mean light of every pixel of a square target, (pixels, pixels), x first, of any scale.

    The rays of a square lens go paraxially from x to y = x - grad psi, both in units of the widths D and W of
    lens and target.  With F = D W / (lambda L) the field at y is the Fourier transform

        integral of exp(2 pi i F (|x|^2 / 2 - psi(x) - x y)) dx.

    potential : psi, (m, m), at the middles of cells of |x| <= 1/2.  number : F.
    """
    count = int(np.ceil(BAND * number))
    x = (np.arange(count) + 0.5) / count - 0.5
    psi = zoom(potential, count / len(potential), order=3, mode="nearest", grid_mode=True)
    phase = (x[:, None] ** 2 + x**2) / 2 - psi
    field = np.zeros((FINER * count, FINER * count), np.complex64)
    field[:count, :count] = np.exp(2j * np.pi * number * phase)
    light = np.fft.fftshift(np.abs(fft2(field, overwrite_x=True)) ** 2)
    y = (np.arange(len(light) + 1) - len(light) // 2 - 0.5) / (FINER * number)
    borders = np.arange(pixels + 1) / pixels - 0.5
    for axis in range(2):
        summed = np.cumsum(np.insert(light, 0, 0, axis), axis, dtype=np.float64)
        light = np.diff(interp1d(y, summed, axis=axis)(borders), axis=axis)
    return light
