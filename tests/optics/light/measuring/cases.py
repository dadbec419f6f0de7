"""Cells with given corners on a screen, laid by the fast code, and what rounding may do to them."""

from dataclasses import dataclass, replace

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from optics.light.measuring import MappedCells
from optics.light.measuring.cut_cells import LEAST_AREA
from optics.scene.receivers import FarField, Plane, Screen
from optics.scene.sources import corner_flux
from oracles.exact_cells import exact_image, signed_area, triangles

UNIT = 2.0**-53  # the relative rounding of one operation


def whole(columns, rows, margin=0, angular=False):
    """Return a screen of pixels of 1 x 1: a corner's position in pixels is exact."""
    return Screen((columns / 2, rows / 2), (columns, rows), margin, FarField() if angular else Plane())


@dataclass(frozen=True, eq=False)
class Sheet:
    """Cells with corners x, y on a screen, (nx + 1, ny + 1), flux (nx, ny), and the share of the corners'
    flux that arrives, NaN where a corner is not sound; turned (nx, ny), those split along the other diagonal.
    """

    screen: Screen
    x: np.ndarray
    y: np.ndarray
    emitted: np.ndarray
    passing: np.ndarray
    turned: np.ndarray | None = None

    def laid(self, backend):
        """Return the flux in every pixel, (rows, columns)."""
        cells, inputs = self._inputs(backend)
        image = cells(*inputs).numpy().reshape(self.screen.padded, order="F")
        return image * self.screen.pixel_area

    def slopes(self, backend, weights):
        """Return the derivatives by x, y and flux of the sum of weights times `laid`, and that sum."""
        cells, (x, y, flux, sound) = self._inputs(backend)
        for values in (x, y, flux):
            backend.dr.enable_grad(values)
        image = cells(x, y, flux, sound) * self.screen.pixel_area
        total = backend.dr.sum(image * backend.array(np.asarray(weights).T))
        backend.dr.backward(total)
        return [v.grad.numpy().reshape(self.x.shape) for v in (x, y, flux)], float(total.numpy()[0])

    def change(self, backend, dx, dy, dflux):
        """Return the derivative of `laid` as corners move by dx, dy and their flux by dflux."""
        cells, (x, y, flux, sound) = self._inputs(backend)
        for values, change in ((x, dx), (y, dy), (flux, dflux)):
            backend.dr.enable_grad(values)
            backend.dr.set_grad(values, backend.array(change))
        image = backend.dr.forward_to(cells(x, y, flux, sound))
        return image.numpy().reshape(self.screen.padded, order="F") * self.screen.pixel_area

    def _inputs(self, backend):
        corners, sound = corner_flux(self.emitted), ~np.isnan(self.passing)
        flux = np.where(sound, self.passing, 0) * corners
        rays = (backend.array(values) for values in (self.x, self.y, flux))
        return MappedCells(backend, self.screen, self.emitted, corners, self.turned), (
            *rays,
            backend.array(sound.astype(float)) > 0.5,
        )

    def exact(self):
        """Return the flux in every pixel as Fractions."""
        return exact_image(self.screen, self.x, self.y, self.emitted, self.passing, self.turned)

    def moved(self, dx, dy):
        return replace(self, x=self.x + dx, y=self.y + dy)

    def least_area(self):
        """Return the least area of a triangle, square pixels; 0 where there is none."""
        return min((abs(float(signed_area(corners))) for corners, _ in self._triangles()), default=0.0)

    def rounding(self):
        """Return what rounding may do to a pixel, W.

        A triangle of flux f, area A and extent L has the density f / A, and lays f / A times clip(a - i) db
        on the pixels.  A position of R pixels is off by a few roundings of R, over heights of at most L in
        sum; so is the area by a few of L^2 <= R L, and the running sum over R pixels.  Three edges with ten
        such terms each: 32 roundings of f R L / A, and no fewer than of f, for what is laid along an edge.
        """
        reach = max(np.nanmax(np.abs(self.x)), np.nanmax(np.abs(self.y))) + max(self.screen.padded)
        total = 0.0
        for corners, flux in self._triangles():
            extent = max(float(max(axis) - min(axis)) for axis in zip(*corners))
            area = abs(float(signed_area(corners)))
            total += float(flux) * max(1.0, reach * extent / area if area >= LEAST_AREA else 1.0)
        return 32 * UNIT * total

    def _triangles(self):
        return list(triangles(self.screen, self.x, self.y, self.emitted, self.passing, self.turned))


def sheet(screen, x, y, emitted=None, passing=None):
    """Return a Sheet; left out, every cell emits 1 W, all of which arrives."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    emitted = np.ones([n - 1 for n in x.shape]) if emitted is None else np.asarray(emitted, dtype=float)
    return Sheet(screen, x, y, emitted, np.ones(x.shape) if passing is None else passing)


def smooth(screen, counts, size=1.0, jitter=0.2, seed=0, centre=(0.0, 0.0)):
    """Return cells of `size` pixels that do not fold, jittered by a fraction of their size; flux and share
    at random."""
    rng = np.random.default_rng(seed)
    i, j = np.meshgrid(*(np.arange(n + 1) - n / 2 for n in counts), indexing="ij")
    px, py = screen.pitch
    x, y = (i + rng.uniform(-jitter, jitter, i.shape)), (j + rng.uniform(-jitter, jitter, i.shape))
    return Sheet(
        screen,
        centre[0] + x * size * px,
        centre[1] + y * size * py,
        rng.uniform(0.5, 1.5, counts),
        rng.uniform(0.5, 1.0, i.shape),
    )


SCREENS = [whole(8, 6), whole(5, 7, 2), whole(1, 1), whole(1, 6, 1), whole(9, 1)]


@st.composite
def shuffled(draw, screens=SCREENS, steps=(1, 2, 64), sound=True):
    """Draw cells whose corners lie anywhere, on fractions of pixels: folded, flat, and beyond all sides.

    sound : all corners are.
    """
    screen, step = draw(st.sampled_from(screens)), draw(st.sampled_from(steps))
    shape = draw(st.tuples(st.integers(2, 4), st.integers(2, 4)))
    count = shape[0] * shape[1]

    def positions(pixels):
        reach = (pixels // 2 + screen.margin + 3) * step
        numbers = draw(st.lists(st.integers(-reach, reach), min_size=count, max_size=count))
        return np.array(numbers).reshape(shape) / step

    def eighths(wanted, least=0):
        numbers = draw(st.lists(st.integers(least, 8), min_size=wanted, max_size=wanted))
        return np.array(numbers) / 8

    x, y = (positions(n) for n in screen.pixels)
    emitted = eighths((shape[0] - 1) * (shape[1] - 1)).reshape(shape[0] - 1, shape[1] - 1)
    passing = eighths(count, 0 if sound else -1).reshape(shape)
    turned = draw(st.none() | arrays(bool, emitted.shape))
    return Sheet(screen, x, y, emitted, np.where(passing < 0, np.nan, passing), turned)
