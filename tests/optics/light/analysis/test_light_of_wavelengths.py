"""Light of several wavelengths, each through the lens of its own index."""

import numpy as np
import pytest

from optics.base.runtime import UserError
from optics.light.analysis import fringe, measure
from optics.scene.materials import MATERIALS
from optics.scene.photometry import spectral_lines, srgb, white_of
from optics.scene.system import System
from tests.optics.cases import GLOWING, alone, roughened, small_system
from thbcad.surfaces import THBSurface

TILT = 0.35  # of the prism's rear, dz/dy
SMALL = {"target.pixels": [24, 24]}
TWO = {"lens.material": "PC", "source.spectrum": [[450.0, 1.0], [650.0, 3.0]]}
POINT = {"source.kind": "point", "source.distance": 30.0, "source.half_angle": 12.0}
DIVERGING = {"source.divergence": 0.3}


def system_of(folder, changes):
    drop = ("lens.index",) if "lens.material" in changes or "lens.indices" in changes else ()
    return small_system(folder, SMALL | changes, drop=drop)


def parts(measurement, system):
    """Return the irradiance of each of two wavelengths, which have different colours."""
    colours = np.array([w.xyz for w in system.wavelengths]).T
    shape = measurement.irradiance.shape
    return np.linalg.lstsq(colours, measurement.colour.reshape(3, -1))[0].reshape(2, *shape)


def prism(system):
    """Return the lens with a plane rear that is tilted by TILT in y."""
    (sag,) = system.base.sags
    heights = sag.space.kv_v.greville() * TILT
    return system.base.with_sags([THBSurface(sag.space, np.tile(heights, sag.space.kv_u.dim))])


@pytest.mark.slow
@pytest.mark.parametrize("changes", [GLOWING | TWO, DIVERGING], ids=["spectrum", "beam that diverges"])
def test_the_error_of_light_beside_the_target_is_told(tmp_path, backend, changes):
    system = system_of(tmp_path, changes | {"target.half_width": [5.0, 5.0]})
    metrics = measure(system, backend).metrics
    assert metrics["stray"] > 0.1
    assert metrics["stray_error"] > 0


def test_a_prism_bends_each_wavelength_by_its_own_snells_law(tmp_path, backend):
    """Rows of pixels hold what a beam leaves in them whose rays leave the prism parallel, by numpy."""
    changes = TWO | {"lens.rear.radius": np.inf, "target.pixels": [32, 96], "target.half_width": [20.0, 60.0]}
    system = system_of(tmp_path, changes)
    measurement = measure(system.with_lens(prism(system)), backend)
    edges = np.linspace(60.0, -60.0, 97)
    shifts = []
    for light, nm, weight in zip(parts(measurement, system), (450.0, 650.0), (0.25, 0.75)):
        n, i = MATERIALS["PC"].index(nm), np.arctan(TILT)
        r = np.arcsin(n * np.sin(i))
        s, p = np.sin(r - i) / np.sin(r + i), np.tan(r - i) / np.tan(r + i)
        kept = (1 - ((n - 1) / (n + 1)) ** 2) * (1 - (s**2 + p**2) / 2)
        low, high = (y + (60 - TILT * y) * np.tan(r - i) for y in (-9.5, 9.5))
        within = np.clip(edges, low, high)
        rows = light.sum(axis=1) * system.target.screen().pixel_area
        # the index is rounded at 1e-6
        assert rows == pytest.approx(weight * kept * -np.diff(within) / (high - low), abs=1e-6)
        shifts.append((low + high) / 2)
    told = measurement.metrics["colour"]
    assert (told["from_nm"], told["to_nm"]) == (450, 650)
    assert told["shift"] == pytest.approx(shifts[0] - shifts[1], abs=1e-4)
    assert told["shift_pixels"] == pytest.approx(told["shift"] / 1.25)


def test_all_wavelengths_are_summed(tmp_path, backend):
    """The irradiance and its fates are the weighted sums of those of single wavelengths."""
    system = system_of(tmp_path, TWO | {"lens.absorptions": [[400.0, 0.05], [700.0, 0.001]]})
    whole = measure(system, backend)
    image, fates = 0.0, {}
    for wavelength in system.wavelengths:
        one = alone(system, wavelength)
        part = measure(one, backend)
        image = image + wavelength.weight * part.irradiance
        for name, flux in part.metrics["fates_w"].items():
            fates[name] = fates.get(name, 0.0) + wavelength.weight * flux
    assert whole.irradiance == pytest.approx(image, rel=1e-12)
    assert whole.metrics["fates_w"] == pytest.approx(fates, abs=1e-14)
    assert fates["absorbed"] > 0.05


def test_a_picture_is_read_once_for_all_wavelengths(tmp_path, backend):
    """The file may go when the source has made its first rays."""
    system = system_of(tmp_path, TWO | {"source.profile": "image", "source.image": "picture.png"})
    _ = system.source.rays((4, 4)), system.target.light
    (tmp_path / "picture.png").unlink()
    assert measure(system, backend).metrics["efficiency"] > 0.5


def test_the_design_wavelength_is_told_beside_all(tmp_path, backend):
    system = system_of(tmp_path, TWO)
    metrics = measure(system, backend).metrics
    single = System(system.problem.with_(**{"source.spectrum": []}))
    own = measure(single, backend)
    assert own.colour is None
    assert "colour" not in own.metrics
    assert metrics["rel_l2_design_wavelength"] == pytest.approx(own.metrics["rel_l2"], rel=1e-4)
    assert metrics["rel_l2"] != pytest.approx(own.metrics["rel_l2"], rel=1e-4)


@pytest.mark.parametrize("name", ["A", "LED-B3"])
def test_white_light_without_dispersion_is_white(tmp_path, backend, name):
    system = system_of(tmp_path, {"lens.indices": [[380.0, 1.5], [780.0, 1.5]], "source.spectrum": name})
    measurement = measure(system, backend)
    white = white_of(spectral_lines(name))
    lit = measurement.irradiance > 1e-9
    shown = srgb(measurement.colour[:, lit] / measurement.irradiance[lit], white)
    assert shown == pytest.approx(1, abs=1e-9)
    assert np.nanmax(fringe(system, measurement.colour)) < 1e-9
    assert measurement.metrics["colour"]["fringe"] < 1e-9
    assert measurement.metrics["colour"]["shift"] == pytest.approx(0, abs=1e-12)
    assert measurement.metrics["rel_l2"] == pytest.approx(measurement.metrics["rel_l2_design_wavelength"])


@pytest.mark.every(3)
@pytest.mark.parametrize(
    "changes",
    [{}, POINT, pytest.param(DIVERGING, marks=pytest.mark.slow), GLOWING],
    ids=["cells", "point", "beams", "rays"],
)
def test_fates_of_all_wavelengths_sum_to_the_source_flux(tmp_path, backend, changes):
    wide = {"target.pixels": [8, 8], "lens.absorption": 0.01, "source.flux": 2.0}
    system = system_of(tmp_path, TWO | changes | wide)
    measurement = measure(system, backend)
    metrics = measurement.metrics
    assert sum(metrics["fates_w"].values()) == pytest.approx(2, rel=1e-12)
    assert metrics["fates_w"]["absorbed"] > 0.05
    luminous = measurement.colour[1].sum() * system.target.screen().pixel_area
    share = luminous / (2 * white_of(spectral_lines(TWO["source.spectrum"]))[1])
    assert share == pytest.approx(metrics["efficiency"], rel=0.05)


def test_light_that_nobody_sees_has_no_fringe(tmp_path, backend):
    system = system_of(tmp_path, {"lens.material": "PMMA", "source.spectrum": [[900.0, 1.0], [1000.0, 1.0]]})
    metrics = measure(system, backend).metrics
    assert metrics["colour"]["fringe"] is None
    assert metrics["colour"]["shift"] > 0
    assert metrics["efficiency"] > 0.9


def test_one_line_is_measured_at_its_wavelength(tmp_path, backend):
    system = system_of(tmp_path, {"lens.material": "PC", "source.spectrum": [[650.0, 5.0]]})
    lens = roughened(system.base)
    red = alone(system, system.wavelengths[0])
    shaped = red.base.with_sags(lens.sags)
    wanted = measure(red.with_lens(shaped), backend).irradiance
    assert measure(system.with_lens(lens), backend).irradiance == pytest.approx(wanted, rel=1e-12)


def test_lumens_of_a_spectrum_count_by_v_of_lambda(tmp_path, backend):
    """In lumens a line counts by its watts times V: so the lines in watts are weighted."""
    changes = TWO | {"lens.rear.radius": -40.0}
    watts, lumens = (system_of(tmp_path, changes | {"source.unit": unit}) for unit in ("W", "lm"))
    of_watts, of_lumens = (measure(s, backend) for s in (watts, lumens))
    visible = [w.xyz[1] for w in watts.wavelengths]
    seen = sum(w.weight * y for w, y in zip(watts.wavelengths, visible))
    expected = sum(y * light for y, light in zip(visible, parts(of_watts, watts))) / seen
    np.testing.assert_allclose(of_lumens.irradiance, expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(of_lumens.colour[1], of_lumens.irradiance, rtol=1e-12)
    assert sum(of_lumens.metrics["fates_lm"].values()) == pytest.approx(1.0, rel=1e-12)


def test_lumens_of_unseen_light_are_refused(tmp_path):
    unseen = system_of(tmp_path, TWO | {"source.spectrum": [[900.0, 1.0]], "source.unit": "lm"})
    with pytest.raises(UserError, match="no visible light, so that source"):
        _ = unseen.wavelengths
