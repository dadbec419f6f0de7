"""Light of a row of a picture by scalar waves: the exact phase that rays need, propagated without rays.

A plane wave meets a thin element on |x| <= a, whose rays bring the light of every part of the element to
that part of the row which has the same share of the light:

    k sin(theta) = d phase / dx,    tan(theta) = (u(x) - x) / L,    share of u in the row = (x + a) / 2a.

The field exp(i phase) goes on by its angular spectrum, exp(i z sqrt(k^2 - kx^2)).  Nothing is paraxial, and
nothing of it is used by the estimate of `optics.designing.prediction`.
"""

from __future__ import annotations

import numpy as np

SAMPLES = 2.5  # for each cycle of the steepest ray
WINDOW = 1.3  # of the wider of element and row


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
