"""Light on a screen as it was estimated, with the estimate's own error."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import hypot, sqrt

import numpy as np

from optics.scene.receivers import Screen, with_mirror_images
from thbcad.checks import Bools, Floats


@dataclass(frozen=True, eq=False)
class LightEstimate:
    """Light in the target plane.

    irradiance : (rows, columns), W/mm^2.
    noise : of it, (rows, columns), as a standard deviation: independent in every pixel, another every time.
    drift : (rows, columns), or 0: what finer cells would add to it, about.
    on_target, off_target : W in the target plane, on the screen and beside it.
    off_error : of the latter, as a standard deviation.
    axes : 0 for x and 1 for y, of directions in which its error is its own mirror image.
    """

    irradiance: Floats
    noise: Floats
    on_target: float
    off_target: float
    off_error: float = 0.0
    axes: tuple[int, ...] = ()
    drift: Floats | float = 0.0

    @property
    def error(self) -> Floats:
        """Of the irradiance, noise and drift together, (rows, columns), as a standard deviation."""
        return np.hypot(self.noise, self.drift)

    @classmethod
    def of_replicates(
        cls, replicates: Iterable[tuple[Floats, float, float]], axes: tuple[int, ...] = ()
    ) -> LightEstimate:
        """Return the mean of independent estimates (irradiance, on_target, off_target) of the same light.

        The error of the mean of R images is their standard deviation / sqrt(R).  At least two are needed.
        """
        count, mean, squares, on, besides = 0, np.zeros(()), np.zeros(()), 0.0, list[float]()
        for image, onto, beside in replicates:  # Welford's recurrence: one image at a time is kept
            count += 1
            before = image - mean
            mean = mean + before / count
            squares = squares + before * (image - mean)
            on += onto
            besides.append(beside)
        off, spread = float(np.mean(besides)), float(np.std(besides, ddof=1)) / sqrt(count)
        return cls(mean, np.sqrt(squares / (count * (count - 1))), on / count, off, spread, axes)

    def __add__(self, other: LightEstimate) -> LightEstimate:
        """Return the sum of two independent estimates."""
        return LightEstimate(
            self.irradiance + other.irradiance,
            np.hypot(self.noise, other.noise),
            self.on_target + other.on_target,
            self.off_target + other.off_target,
            float(np.hypot(self.off_error, other.off_error)),
            tuple(sorted({*self.axes, *other.axes})),
            self.drift + other.drift,
        )

    def finer(self, screen: Screen) -> LightEstimate:
        """Return it on a screen of the same size with a multiple of the pixels in each direction.

        Errors are larger by that multiple: a mean over as many pixels as came from one has its error again.
        """
        times = screen.shape[0] // self.irradiance.shape[0]
        whole = np.ones((times, times))
        numbers = self.irradiance, times * self.noise, times * self.drift * np.ones_like(self.irradiance)
        image, noise, drift = (np.asarray(np.kron(a, whole), np.float64) for a in numbers)
        return replace(self, irradiance=image, noise=noise, drift=drift)

    def over(self, projection: Floats) -> LightEstimate:
        """Return it with irradiance, noise and drift divided by a function of the pixels, (rows, columns)."""
        over = {name: getattr(self, name) / projection for name in ("irradiance", "noise", "drift")}
        return replace(self, **over)

    def error_of_sum(self, weights: Floats | Bools) -> float:
        """Return the standard deviation of a weighted sum of the irradiance.  weights : (rows, columns).

        Of pixel errors s_i that n images share, and that are independent else, it is
        sqrt(sum_i v_i^2 s_i^2 / n) with the sums v_i of the weights of a pixel's images.  The sum of a drift
        adds to it.
        """
        own = np.asarray(weights, np.float64)
        summed = with_mirror_images(own, self.axes)
        independent = float(np.linalg.norm(summed * self.error)) / sqrt(2 ** len(self.axes))
        return hypot(independent, float(np.sum(own * self.drift)))

    def error_of_rel_l2(self, target: Floats) -> dict[str, float | None]:
        """Return what the estimate's error does to rel_l2 = ||E - T|| / ||T||, for E and T of unit mean.

        rel_l2_floor : f, the L2 norm of E's error, relative to T.
        rel_l2_debiased : sqrt(rel_l2^2 - g^2), or 0, with the norm g of the noise alone, which adds g^2 to
            rel_l2^2 on average.  A drift adds nothing of the kind: it goes with the residual.
        rel_l2_error : the standard deviation of that, at most f.  With the residual r = E - T and pixel
            errors s_i, independent of each other, the variance of ||r||^2 is sum_i (4 r_i^2 - 2 s_i^2) s_i^2;
            where n images share errors, sum_i (4 R_i^2 / n - 2 n s_i^2) s_i^2 with R_i summed over images.
            The second terms are of noise alone.  A drift d adds to the standard deviation: it moves ||r||^2
            by 2 (r, d) + ||d||^2, where only its size is certain.
        """
        norm = float(np.linalg.norm(target) / target.mean())
        scale = self.irradiance.mean()
        if scale <= 0:
            return {"rel_l2_floor": 0.0, "rel_l2_debiased": 1.0, "rel_l2_error": 0.0}
        residual = self.irradiance / scale - target / target.mean()
        noise, drift = (a / scale * np.ones_like(residual) for a in (self.noise, self.drift))
        floor = float(np.linalg.norm(np.hypot(noise, drift))) / norm
        debiased = sqrt(max(float(np.sum(residual**2 - noise**2)), 0.0)) / norm
        summed, images = with_mirror_images(residual, self.axes), 2 ** len(self.axes)
        variance = float(np.sum(4 * summed**2 / images * (noise**2 + drift**2) - 2 * images * noise**4))
        known = 2 * abs(float(np.sum(residual * drift))) + float(np.sum(drift**2))
        spread = sqrt(max(variance, 0.0) + known**2) / norm**2 / 2
        return {
            "rel_l2_floor": floor,
            "rel_l2_debiased": debiased,
            "rel_l2_error": min(spread / debiased, floor) if debiased else floor,
        }
