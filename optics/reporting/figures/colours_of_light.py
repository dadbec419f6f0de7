"""The light of a spectrum in colour, and where a lens takes its colours apart (matplotlib)."""

import numpy as np

from optics.light.analysis import Measurement, fringe
from optics.reporting.figures.canvas import block, new_figure, plane_figure, png_bytes
from optics.reporting.view import block_means
from optics.scene.photometry import srgb
from optics.scene.system import OpticalSystem
from thbcad.checks import Floats

MOST = 0.995  # quantile of the fringe at which its scale ends
LEAST_SCALE = 1e-3  # in (u', v'): a tenth of what an eye sees between two fields


def colour_figures(
    system: OpticalSystem, measurement: Measurement, unit: str
) -> dict[str, tuple[str, bytes]]:
    """Return (caption, PNG) of the picture in colour and of the colour fringe, by name.

    Without a spectrum, or where no light is visible, there are none.  unit : of lengths on the target.
    """
    if measurement.colour is None:
        return {}
    source, numbers = system.problem.source, measurement.metrics["colour"]
    half_width = system.target.settings.half_width
    named = source.spectrum if isinstance(source.spectrum, str) else f"{len(system.wavelengths)} wavelengths"
    of_unit_flux = [wavelength.weight * np.array(wavelength.xyz) for wavelength in system.wavelengths]
    white = np.sum(of_unit_flux, axis=0) * measurement.target.max()
    if not white[1]:
        return {}
    distance = fringe(system, measurement.colour)
    seen = distance[np.isfinite(distance)]
    top = max(float(np.quantile(seen, MOST)), LEAST_SCALE) if seen.size else LEAST_SCALE
    return {
        "colour": (
            f"The light of {named} in colour, seen by an eye adapted to it; white is the brightest light "
            "asked for. Colours that sRGB cannot show are mixed with grey.",
            _colour_picture(srgb(measurement.colour, white), half_width, unit),
        ),
        "fringe": (
            "Colour fringe: distance of the chromaticity (u', v') from that of the source. The same ray "
            f"lands {numbers['shift']:.3g} {unit} ({numbers['shift_pixels']:.2g} pixels) apart at "
            f"{numbers['from_nm']:.0f} and {numbers['to_nm']:.0f} nm on average.",
            plane_figure(distance, half_width, unit, "distance in (u', v')", "magma", (0, top)),
        ),
    }


def _colour_picture(picture: Floats, half_width: tuple[float, float], unit: str) -> bytes:
    """Draw an sRGB picture, (3, rows, columns)."""
    (hx, hy), side = half_width, block(picture.shape[1:])
    figure, axes = new_figure()
    shown = block_means(np.moveaxis(picture, 0, -1), side)
    axes.imshow(shown, extent=(-hx, hx, -hy, hy), interpolation="nearest")
    axes.set(xlabel=f"x / {unit}", ylabel=f"y / {unit}")
    return png_bytes(figure)
