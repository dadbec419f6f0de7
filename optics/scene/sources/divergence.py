"""How the light of every point of a source spreads around +z, by quantiles of its flux.

u(theta) is the fraction of the flux within the angle theta of the axis.  Rays take theta at u = r^2 on the
unit disk:

    lambertian      sin^2 theta = u sin^2 a                   a Lambertian area, as far as a
    uniform         cos theta = 1 - u (1 - cos a)             the same flux in every solid angle
    theta_uniform   theta = u a                               the same flux in every step of angle
    gaussian        theta^2 = -2 a^2 ln(1 - u)                a is one sigma of each angle
    sun             sin^2 theta = sin^2 a (1 - mu^2)          with L(mu) = 0.30 + 0.93 mu - 0.23 mu^2

a is the half-angle.  The sun's law is that of its limb at 550 nm, with the cosine mu of the angle at which
light leaves the sun's surface.

Source: limb darkening by A. N. Cox (ed.), Allen's astrophysical quantities, 4th ed., Springer, 2000.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, exp, pi, radians, sin, sqrt

import numpy as np

from optics.scene.sources.profile import Profile
from thbcad.checks import Floats

LIMB = 0.30, 0.93, -0.23  # of mu^0, mu, mu^2
SMALLEST = 1e-100  # rad, whose square is a number: light of less is parallel
FARTHEST = 6.0  # sigmas, to which a Gaussian is cut
CUT = 89.0  # degrees, to which it is cut too
WIDEST = radians(CUT)
SEEN = 3.0  # sigmas of a Gaussian that its picture shows
PIXELS = 64  # of the sun's picture, in each direction: blurs are some pixels wide
STEPS = 12  # of Newton's method; six reach the last digit but near the limb


@dataclass(frozen=True)
class Divergence:
    """The spread of light around +z.

    kind : "lambertian", "uniform", "theta_uniform", "gaussian" or "sun".  half_angle : a, degrees.
    """

    kind: str
    half_angle: float

    def stretch(self, u: Floats) -> Floats | float:
        """Return sin(theta) / sqrt(u) at quantiles u of the flux, 0 <= u < 1."""
        a = radians(self.half_angle)
        if self.kind == "lambertian":
            return sin(a)
        if self.kind == "uniform":
            deepest = 1 - cos(a)
            return np.sqrt((2 - u * deepest) * deepest)
        root = np.sqrt(u)
        if self.kind == "theta_uniform":
            return a * root * np.sinc(u * a / pi)
        if self.kind == "sun":
            return sin(a) * np.sqrt(_limb_quantile(u) / np.where(u == 0, 1.0, u))
        cut = 1 - exp(-(min(FARTHEST, WIDEST / a) ** 2) / 2)
        theta = a * np.sqrt(-2 * np.log1p(-cut * u))
        return np.sin(theta) / np.where(u == 0, 1.0, root)

    def direction(self, u: float, turn: float) -> Floats:
        """Return the unit vector at the quantile u of the flux.  turn : around the axis, radians.  (3,)"""
        sine = float(self.stretch(np.array(u)) * sqrt(u))
        return np.array([sine * cos(turn), sine * sin(turn), sqrt(1 - sine**2)])

    @property
    def on_axis(self) -> float:
        """The radiance on the axis times the area over the flux, 1 / sr; inf where it has no bound."""
        a = radians(self.half_angle)
        if self.kind == "theta_uniform" or a < SMALLEST:
            return np.inf
        if self.kind == "lambertian":
            return 1 / (pi * sin(a) ** 2)
        if self.kind == "uniform":
            return 1 / (4 * pi * sin(a / 2) ** 2)
        if self.kind == "sun":
            mean = LIMB[0] + 2 / 3 * LIMB[1] + LIMB[2] / 2  # of L over the disk, over L in its middle
            return 1 / (pi * sin(a) ** 2 * mean)
        return 1 / (2 * pi * a**2 * (1 - exp(-(min(FARTHEST, WIDEST / a) ** 2) / 2)))

    @property
    def greatest(self) -> float:
        """The greatest radiance in any direction times the area over the flux, 1 / sr; inf without a bound.

        Of the same flux in every solid angle it goes with 1 / cos(theta), that of a Gaussian with
        theta / (sin theta cos theta) exp(-theta^2 / (2 a^2)), which first falls and then rises: it is
        greatest on the axis or at the rim.
        """
        a, end = radians(self.half_angle), radians(self.widest)
        if self.kind == "uniform":
            return self.on_axis / cos(a)
        if self.kind == "gaussian" and a >= SMALLEST:
            return self.on_axis * max(1.0, end / (sin(end) * cos(end)) * exp(-((end / a) ** 2) / 2))
        return self.on_axis

    @property
    def widest(self) -> float:
        """The greatest angle from the axis, degrees."""
        return min(FARTHEST * self.half_angle, CUT) if self.kind == "gaussian" else self.half_angle

    @property
    def picture(self) -> Profile:
        """What a point of the source looks like in angles, as far as `half_angle`, or SEEN sigmas."""
        if self.kind == "gaussian":
            return Profile("gaussian", (1 / SEEN, 1 / SEEN))
        if self.kind != "sun":
            return Profile("round")
        at = (2 * np.arange(PIXELS) + 1) / PIXELS - 1
        mu = np.sqrt(np.maximum(1 - at**2 - at[:, None] ** 2, 0.0))
        return Profile("image", light=np.where(mu > 0, np.polyval(LIMB[::-1], mu), 0.0))


PARALLEL = Divergence("uniform", 0.0)


def _limb_quantile(u: Floats) -> Floats:
    """Return t = 1 - mu^2 within which there is the fraction u of the flux.

    With the antiderivative G(mu) = c0 mu^2 / 2 + c1 mu^3 / 3 + c2 mu^4 / 4 of L(mu) mu the fraction is
    (G(1) - G(mu)) / G(1), and its derivative by t is L(mu) / (2 G(1)).
    """
    c0, c1, c2 = LIMB
    whole = c0 / 2 + c1 / 3 + c2 / 4
    t = np.array(u, dtype=np.float64)
    for _ in range(STEPS):
        mu = np.sqrt(1 - t)
        rest = mu * mu * (c0 / 2 + mu * (c1 / 3 + mu * c2 / 4))
        slope = (c0 + mu * (c1 + mu * c2)) / (2 * whole)
        t = np.clip(t - (1 - rest / whole - u) / slope, 0.0, 1.0)
    return t
