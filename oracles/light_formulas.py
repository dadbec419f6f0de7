"""Independent numpy formulas that the tests compare with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from optics.scene.receivers import BoxWindow, BSplineWindow, GaussianWindow, PixelWindow

RULE = np.polynomial.legendre.leggauss(60)


def window_value(window, distance):
    """Return W at signed distances (in pixels) from a pixel's centre, by its definition."""
    d = np.asarray(distance, dtype=float)
    if isinstance(window, BoxWindow):
        return ((d >= -0.5) & (d < 0.5)).astype(float)
    if isinstance(window, BSplineWindow):
        knots = np.arange(window.degree + 2) - (window.degree + 1) / 2
        return np.nan_to_num(BSpline.basis_element(knots, extrapolate=False)(d))
    if isinstance(window, PixelWindow):  # the bump integrated over the pixel
        bump = np.polynomial.Polynomial([1, 0, -1]) ** 2 * (15 / 16)
        return bump.integ(lbnd=-1)(np.clip((0.5 - abs(d)) / window.blur, -1, 1))
    assert isinstance(window, GaussianWindow)
    reach = window.cut * window.sigma

    def lowered(s):
        return np.exp(-(s**2) / (2 * window.sigma**2)) - np.exp(-(window.cut**2) / 2)

    nodes, weights = RULE
    integral = reach * (weights @ lowered(reach / 2 * (1 + nodes)))
    return np.where(np.abs(d) < reach, lowered(d) / integral, 0.0)


def window_kinks(window):
    """Return the positions between which W is smooth."""
    if isinstance(window, GaussianWindow):
        return np.array([-1.0, 1.0]) * window.cut * window.sigma
    if isinstance(window, PixelWindow):
        return np.array(
            [-0.5 - window.blur, -0.5, window.blur - 0.5, 0.5 - window.blur, 0.5, 0.5 + window.blur]
        )
    order = 1 if isinstance(window, BoxWindow) else window.degree + 1
    return np.arange(order + 1) - order / 2


def brute_irradiance(screen, window, x, y, flux):
    """Return E_rc = sum_k flux_k W(column) W(row) / area over the padded screen, ray by ray."""
    pitch = [2 * h / n for h, n in zip(screen.half_width, screen.pixels)]
    rows, columns = screen.pixels[1] + 2 * screen.margin, screen.pixels[0] + 2 * screen.margin
    centre_x = -screen.half_width[0] + (np.arange(columns) - screen.margin + 0.5) * pitch[0]
    centre_y = screen.half_width[1] - (np.arange(rows) - screen.margin + 0.5) * pitch[1]
    image = np.zeros((rows, columns))
    for xk, yk, fk in zip(x, y, flux):
        by_column = window_value(window, (xk - centre_x) / pitch[0])
        by_row = window_value(window, (centre_y - yk) / pitch[1])
        image += fk * np.outer(by_row, by_column)
    return image / (pitch[0] * pitch[1])


def fresnel(angle, before, behind):
    """Return the transmittance of unpolarised light at an angle of incidence."""
    return np.mean(fresnel_parts(angle, before, behind), axis=0)


def fresnel_parts(angle, before, behind):
    """Return the transmittances of s and of p at an angle of incidence (sine and tangent form)."""
    i = np.asarray(angle, dtype=float)
    t = np.arcsin(np.sin(i) * before / behind)
    straight, some = ((before - behind) / (before + behind)) ** 2, np.where(i == 0, 1.0, i + t)
    parts = (np.sin(i - t) / np.sin(some)) ** 2, (np.tan(i - t) / np.tan(some)) ** 2
    return np.stack([1 - np.where(i == 0, straight, part) for part in parts])


@dataclass(frozen=True)
class Meridional:
    """A ray in a plane that holds the axis: height r and position z in mm, angle to the axis, shares of its
    flux across that plane and in it, (2, n)."""

    r: np.ndarray
    z: np.ndarray
    angle: np.ndarray
    shares: np.ndarray

    @property
    def share(self):
        """Of its flux, unpolarised at first."""
        return self.shares.mean(axis=0)

    def to(self, z):
        """Return the ray where it meets the plane z."""
        return Meridional(self.r + (z - self.z) * np.tan(self.angle), z, self.angle, self.shares)

    def refracted(self, slope, before, behind):
        """Return the ray behind a surface with slope dz/dr, by Snell's law in angles."""
        tilt = np.arctan(slope)  # the normal leans by this much towards -r
        incident = self.angle + tilt
        behind_normal = np.arcsin(np.sin(incident) * before / behind)
        shares = self.shares * fresnel_parts(np.abs(incident), before, behind)
        return Meridional(self.r, self.z, behind_normal - tilt, shares)


def meridional(r):
    """Return rays along the axis at heights r, before the lens at z = 0."""
    r = np.asarray(r, dtype=float)
    return Meridional(r, np.zeros_like(r), np.zeros_like(r), np.ones((2, *r.shape)))


def refracted_vector(direction, normal, eta):
    """Return the refracted unit directions (n, 3): the tangential part scales by eta, the rest follows."""
    tangential = eta * (direction - np.sum(direction * normal, axis=1, keepdims=True) * normal)
    return tangential + np.sqrt(1 - np.sum(tangential**2, axis=1, keepdims=True)) * normal
