"""Pictures as targets: every kind of file, decoding, fitting, and what is refused."""

import struct
import tracemalloc
import zlib

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from PIL import EpsImagePlugin, Image, ImageCms

from optics.base.runtime import UserError
from optics.scene.receivers.fitted_picture import divided, fit_picture
from optics.scene.receivers.picture import LUMINANCE, read_picture
from optics.scene.receivers.screen import Screen
from optics.scene.system import target_irradiance
from tests.cases import DATA
from tests.optics.cases import picture


def srgb(value):
    """Return linear light of an sRGB value in [0, 1], IEC 61966-2-1."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def saved(folder, image, name="p.png", **options):
    path = folder / name
    image.save(path, **options)
    return path


def grey(values):
    return Image.fromarray(np.asarray(values))


# Reading


@pytest.mark.parametrize("gamma", [1.0, 0.5, 1 / 2.4])
def test_the_chunk_gama_of_a_png_is_heeded_and_said(tmp_path, gamma, capsys):
    levels = np.arange(256, dtype=np.uint8).reshape(16, 16)
    path = saved(tmp_path, grey(levels))
    plain = path.read_bytes()
    path.write_bytes(plain[:33] + png_chunk(b"gAMA", struct.pack(">I", round(1e5 * gamma))) + plain[33:])
    np.testing.assert_allclose(read_picture(path), (levels / 255) ** (1 / round(gamma, 5)), rtol=1e-12)
    assert (
        f"decoded by the chunk gAMA of the file, {round(gamma, 5):g}, not as sRGB" in capsys.readouterr().err
    )
    np.testing.assert_array_equal(read_picture(path, "linear"), levels / 255)
    path.write_bytes(plain[:33] + png_chunk(b"sRGB", b"\0") + path.read_bytes()[33:])
    np.testing.assert_allclose(read_picture(path).ravel()[::17], [srgb(v / 255) for v in range(0, 256, 17)])


def test_the_usual_gama_means_srgb(tmp_path, capsys):
    path = saved(tmp_path, grey(np.arange(256, dtype=np.uint8).reshape(16, 16)))
    light, plain = read_picture(path), path.read_bytes()
    path.write_bytes(plain[:33] + png_chunk(b"gAMA", struct.pack(">I", 45455)) + plain[33:])
    np.testing.assert_array_equal(read_picture(path), light)
    assert capsys.readouterr().err == ""


def test_linear_numbers_as_practice_has_them_are_linear():
    path = DATA / "practice" / "i14_gama1.png"
    np.testing.assert_array_equal(read_picture(path), np.asarray(Image.open(path)) / 255)


def png_chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def profile(tag, curve):
    """Return an ICC profile with one curve and nothing else."""
    return bytes(128) + struct.pack(">I4sII", 1, tag, 144, len(curve)) + curve


def para(kind, *numbers):
    return (
        b"para"
        + bytes(4)
        + struct.pack(">HH", kind, 0)
        + struct.pack(f">{len(numbers)}i", *(round(65536 * n) for n in numbers))
    )


CURV = b"curv" + bytes(4)
CURVES = {
    "linear": (CURV + struct.pack(">I", 0), lambda v: v),
    "an exponent": (CURV + struct.pack(">IH", 1, 461), lambda v: v ** (461 / 256)),
    "a table": (
        CURV + struct.pack(">I3H", 3, 0, 13107, 65535),
        lambda v: np.interp(v, [0, 0.5, 1], [0, 0.2, 1]),
    ),
    "formula 0": (para(0, 1.75), lambda v: v**1.75),
    "formula 1": (para(1, 2, 1.25, -0.25), lambda v: np.maximum(1.25 * v - 0.25, 0) ** 2),
    "formula 2": (para(2, 2, 0.75, 0.125, 0.125), lambda v: (0.75 * v + 0.125) ** 2 + 0.125),
    "formula 3": (para(3, 2, 1, 0, 0.5, 0.5), lambda v: np.where(v >= 0.5, v**2, 0.5 * v)),
    "formula 4": (
        para(4, 2, 1, 0, 0.5, 0.5, 0.125, 0.25),
        lambda v: np.where(v >= 0.5, v**2 + 0.125, 0.5 * v + 0.25),
    ),
}


@pytest.mark.parametrize("tag", [b"kTRC", b"gTRC"])
@pytest.mark.parametrize("name", CURVES)
def test_the_curve_of_an_icc_profile_is_heeded(tmp_path, name, tag):
    curve, formula = CURVES[name]
    levels = np.arange(256, dtype=np.uint8).reshape(16, 16)
    path = saved(tmp_path, grey(levels), icc_profile=profile(tag, curve))
    np.testing.assert_allclose(read_picture(path), formula(levels / 255), rtol=1e-12)


def test_the_profile_of_srgb_and_damaged_ones_leave_srgb(tmp_path, capsys):
    levels = np.arange(256, dtype=np.uint8).reshape(16, 16)
    light = read_picture(saved(tmp_path, grey(levels)))
    whole = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    for data in (whole, whole[:100], whole[:200], bytes(500), profile(b"kTRC", b"mft1" + bytes(9))):
        np.testing.assert_array_equal(read_picture(saved(tmp_path, grey(levels), icc_profile=data)), light)
    assert capsys.readouterr().err == ""


def test_8_bit_greys_are_decoded_by_the_srgb_formula(tmp_path):
    levels = np.arange(256, dtype=np.uint8).reshape(16, 16)
    light = read_picture(saved(tmp_path, grey(levels)))
    np.testing.assert_allclose(light.ravel(), [srgb(v / 255) for v in range(256)], rtol=1e-14)


def test_linear_encoding_keeps_the_numbers(tmp_path):
    levels = np.arange(256, dtype=np.uint8).reshape(16, 16)
    np.testing.assert_array_equal(read_picture(saved(tmp_path, grey(levels)), "linear"), levels / 255)


def test_row_0_is_the_top_of_the_picture(tmp_path):
    levels = np.zeros((2, 3), dtype=np.uint8)
    levels[0, 2] = 255
    np.testing.assert_array_equal(read_picture(saved(tmp_path, grey(levels))), [[0, 0, 1], [0, 0, 0]])


@pytest.mark.parametrize("name", ["p.png", "p.tif"])
def test_16_bit_greys_keep_their_depth(tmp_path, name):
    levels = np.array([[0, 1, 255, 256], [257, 32768, 65534, 65535]], dtype=np.uint16)
    path = saved(tmp_path, grey(levels), name)
    np.testing.assert_array_equal(read_picture(path, "linear"), levels / 65535)
    expected = [[srgb(v / 65535) for v in row] for row in levels.tolist()]
    np.testing.assert_allclose(read_picture(path), expected, rtol=1e-14)


def test_colours_count_by_their_luminance_in_linear_light(tmp_path):
    colours = np.array(
        [[(255, 0, 0), (0, 255, 0), (0, 0, 255)], [(255, 255, 255), (10, 128, 250), (0, 0, 0)]],
        dtype=np.uint8,
    )
    light = read_picture(saved(tmp_path, grey(colours)))
    expected = [
        [sum(w * srgb(c / 255) for w, c in zip(LUMINANCE, colour)) for colour in row]
        for row in colours.tolist()
    ]
    np.testing.assert_allclose(light, expected, rtol=1e-14)
    linear = read_picture(tmp_path / "p.png", "linear")
    np.testing.assert_allclose(linear, colours / 255 @ np.array(LUMINANCE), rtol=1e-14)


def test_transparent_parts_are_dark(tmp_path):
    pixels = np.full((1, 3, 4), 200, dtype=np.uint8)
    pixels[0, :, 3] = 0, 128, 255
    light = read_picture(saved(tmp_path, grey(pixels)))
    np.testing.assert_allclose(light, srgb(200 / 255) * np.array([[0, 128 / 255, 1]]), rtol=1e-14)


def test_grey_with_transparency_is_as_colour_with_transparency(tmp_path):
    pixels = np.array([[(200, 0), (200, 128), (90, 255)]], dtype=np.uint8)
    light = read_picture(saved(tmp_path, Image.merge("LA", [grey(pixels[..., k]) for k in (0, 1)])))
    np.testing.assert_allclose(light, [[0, srgb(200 / 255) * 128 / 255, srgb(90 / 255)]], rtol=1e-14)


def test_1_bit_pictures_are_black_and_white(tmp_path):
    bits = np.array([[True, False, True], [False, False, True]])
    np.testing.assert_array_equal(read_picture(saved(tmp_path, grey(bits))), bits.astype(float))


def test_palettes_are_looked_up(tmp_path):
    image = grey(np.array([[0, 1, 2]], dtype=np.uint8)).convert("P")
    image.putpalette([255, 0, 0, 0, 255, 0, 50, 50, 50])
    light = read_picture(saved(tmp_path, image))
    np.testing.assert_allclose(light, [[LUMINANCE[0], LUMINANCE[1], srgb(50 / 255)]], rtol=1e-14)


def test_transparent_palette_entries_are_dark(tmp_path):
    image = grey(np.array([[0, 1]], dtype=np.uint8)).convert("P")
    image.putpalette([255, 255, 255, 255, 255, 255])
    light = read_picture(saved(tmp_path, image, transparency=0))
    np.testing.assert_allclose(light, [[0, 1]], rtol=1e-14)


def test_float_pictures_keep_their_numbers(tmp_path):
    values = np.array([[0.0, 0.25], [1.0, 7.5]], dtype=np.float32)
    np.testing.assert_array_equal(read_picture(saved(tmp_path, grey(values), "p.tif"), "linear"), values)


@pytest.mark.parametrize("size", [(3, 3), (1, 1), (1, 7)])
def test_tiny_pictures_are_read(tmp_path, size):
    levels = np.full(size, 128, dtype=np.uint8)
    np.testing.assert_allclose(
        read_picture(saved(tmp_path, grey(levels))), np.full(size, srgb(128 / 255)), rtol=1e-14
    )


def test_jpeg_is_read_and_turned_as_its_exif_says(tmp_path):
    """A camera held upright stores the picture lying down and says so in its Exif data."""
    levels = np.zeros((16, 32), dtype=np.uint8)
    levels[:, :16] = 255
    exif = Image.Exif()
    exif[0x0112] = 6  # turn by 90 degrees clockwise
    light = read_picture(saved(tmp_path, grey(levels), "p.jpg", exif=exif, quality=95))
    assert light.shape == (32, 16)
    assert light[:12].mean() > 0.9
    assert light[20:].mean() < 0.1


# Refusing


@pytest.mark.parametrize("encoding", ["srgb", "linear"])
def test_negative_light_is_refused(tmp_path, encoding):
    values = np.array([[0.5, -0.25]], dtype=np.float32)
    with pytest.raises(UserError, match=r"negative"):
        read_picture(saved(tmp_path, grey(values), "p.tif"), encoding)


@pytest.mark.parametrize("mode", ["1", "L", "RGB", "RGBA", "I;16", "F"])
def test_black_everywhere_is_refused(tmp_path, mode):
    with pytest.raises(UserError, match=r"black everywhere"):
        read_picture(saved(tmp_path, Image.new(mode, (4, 4)), "p.tif"))


@pytest.mark.parametrize("side", [12_000, 14_000, 20_000, 100_000])
def test_a_picture_too_large_is_refused_before_it_is_decoded(tmp_path, side):
    """A kilobyte of PNG can claim 10 billion pixels; Pillow's own limit is 179 million."""
    path = saved(tmp_path, Image.new("1", (8, 8), 1))
    data = bytearray(path.read_bytes())
    data[16:24] = side.to_bytes(4, "big") * 2
    data[29:33] = zlib.crc32(data[12:29]).to_bytes(4, "big")
    path.write_bytes(data)
    with pytest.raises(UserError, match=r"p\.png has .* the 100,000,000 pixels allowed; make it smaller"):
        read_picture(path)


def test_a_picture_starts_no_other_program(tmp_path, monkeypatch):
    """Pillow reads EPS, under whatever name, by running Ghostscript on it."""
    stub = tmp_path / "gs"
    stub.write_text(f"#!/bin/sh\ntouch {tmp_path}/started\n")
    stub.chmod(0o755)
    monkeypatch.setattr(EpsImagePlugin, "gs_binary", str(stub))
    (tmp_path / "p.png").write_text(
        "%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 8 8\n%%EndComments\nshowpage\n%%EOF\n"
    )
    with pytest.raises(UserError, match=r"p\.png is not a picture that can be read; save it as one of PNG,"):
        read_picture(tmp_path / "p.png")
    assert not (tmp_path / "started").exists()


def test_bands_of_a_coloured_picture_are_as_the_whole(tmp_path, monkeypatch):
    colours = np.random.default_rng(2).integers(0, 255, (23, 17, 4), dtype=np.uint8)
    path = saved(tmp_path, grey(colours))
    whole = read_picture(path)
    monkeypatch.setattr("optics.scene.receivers.picture.BAND_PIXELS", 5 * 17)
    np.testing.assert_array_equal(read_picture(path), whole)


def light_or_message(path):
    """Return the picture and "", or a single dark pixel and the reason for which it is refused."""
    try:
        return read_picture(path), ""
    except UserError as error:
        return np.zeros((1, 1)), str(error)


@pytest.mark.parametrize("suffix", ["gif", "png", "webp", "tif"])
def test_a_file_of_several_frames_or_pages_is_refused_with_their_number(tmp_path, suffix):
    """Nobody said which one is meant."""
    frames = [Image.fromarray(np.roll(picture(), 5 * k, axis=1)) for k in range(3)]
    path = tmp_path / f"many.{suffix}"
    frames[0].save(path, save_all=True, append_images=frames[1:])
    with pytest.raises(
        UserError, match=rf"many\.{suffix} holds 3 pictures, frames or pages, and one is wanted"
    ):
        read_picture(path)
    frames[0].save(path)
    assert read_picture(path).shape == picture().shape


def test_a_photograph_with_others_made_of_it_is_its_first_one(tmp_path):
    """Telephones write such JPEG files (MPO)."""
    frames = [Image.fromarray(picture()).convert("RGB"), Image.fromarray(255 - picture()).convert("RGB")]
    frames[0].save(tmp_path / "one.jpg", quality=100)
    frames[0].save(tmp_path / "two.jpg", format="MPO", save_all=True, append_images=frames[1:], quality=100)
    np.testing.assert_array_equal(read_picture(tmp_path / "two.jpg"), read_picture(tmp_path / "one.jpg"))


FORMATS = {"png": {}, "tif": {"compression": "tiff_lzw"}, "jpg": {}, "gif": {}, "bmp": {}, "webp": {}}


@pytest.mark.parametrize("suffix", FORMATS)
def test_damaged_pictures_give_light_or_a_user_error(tmp_path, suffix):
    """Truncated at every place and with bytes overwritten, a picture never causes any other exception."""
    path = saved(tmp_path, grey(picture(16, 16)), f"p.{suffix}", **FORMATS[suffix])
    good = path.read_bytes()
    rng = np.random.default_rng(7)
    damaged = [good[:n] for n in range(0, len(good), max(1, len(good) // 40))]
    for _ in range(60):
        data = bytearray(good)
        for at in rng.integers(0, min(len(good), 400), 3):
            data[at] = rng.integers(0, 256)
        damaged.append(bytes(data))
    for data in damaged:
        path.write_bytes(data)
        light, message = light_or_message(path)
        assert "\n" not in message
        assert np.ndim(light) == 2
        assert np.isfinite(light).all()


# Fitting


def test_whole_ratios_give_block_means():
    """Of more rows than are turned together."""
    light = np.random.default_rng(1).uniform(0, 1, (240, 60))
    expected = light.reshape(80, 3, 12, 5).mean(axis=(1, 3))
    for fit in ("crop", "pad", "stretch"):
        np.testing.assert_allclose(fit_picture(light, (12, 80), 60 / 240, fit), expected, rtol=1e-14)


def test_more_pixels_than_the_picture_has_repeat_its_pixels():
    light = np.random.default_rng(1).uniform(0, 1, (3, 3))
    np.testing.assert_allclose(
        fit_picture(light, (12, 12), 1.0), light.repeat(4, axis=0).repeat(4, axis=1), rtol=1e-14
    )


@given(
    size=st.tuples(st.integers(1, 12), st.integers(1, 12)), parts=st.integers(1, 5), seed=st.integers(0, 99)
)
@settings(deadline=None)
def test_parts_of_pixels_have_their_light(size, parts, seed):
    light = np.maximum(np.random.default_rng(seed).uniform(-1, 1, size), 0)
    found = divided(light, parts)
    means = found.reshape(size[0], parts, size[1], parts).mean(axis=(1, 3))
    np.testing.assert_allclose(means, light, atol=1e-12)
    assert found.min() >= -1e-12


def test_parts_of_smooth_light_are_smooth():
    """Means of a formula on pixels give those on their parts, but for the border."""

    def means(count):
        ends = np.linspace(0, 1, count + 1)
        return np.outer(*[np.diff(ends + np.sin(3 * ends) / 5) * count] * 2)

    off = np.abs(divided(means(32), 4) / means(128) - 1)
    assert off[4:-4, 4:-4].max() < 2e-3
    assert off.max() < 0.01


def test_light_on_pixels_of_its_own_is_kept_bit_for_bit():
    light = np.random.default_rng(1).uniform(0, 1, (31, 47))
    for fit in ("crop", "pad", "stretch"):
        np.testing.assert_array_equal(fit_picture(light, (47, 31), 47 / 31, fit), light)


def test_fitting_needs_memory_for_the_pictures_alone():
    """Matrices of all pairs of old and new pixels would take 2 x 16 MB here, 2 x 134 MB for 4096 pixels."""
    light = np.ones((2, 2048))
    tracemalloc.start()
    fit_picture(light, (1024, 2), 1024.0)
    assert tracemalloc.get_traced_memory()[1] < 2e6
    tracemalloc.stop()


@given(
    size=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    pixels=st.tuples(st.integers(1, 50), st.integers(1, 50)),
    aspect=st.floats(0.1, 10),
    seed=st.integers(0, 99),
)
@settings(deadline=None)
def test_stretching_keeps_the_mean(size, pixels, aspect, seed):
    light = np.random.default_rng(seed).uniform(0, 1, size)
    fitted = fit_picture(light, pixels, aspect, "stretch")
    assert fitted.shape == pixels[::-1]
    assert fitted.mean() == pytest.approx(light.mean(), rel=1e-12)


@given(
    size=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    pixels=st.tuples(st.integers(1, 50), st.integers(1, 50)),
    aspect=st.floats(0.1, 10),
)
@settings(deadline=None)
def test_padding_keeps_the_light_and_cropping_a_flat_picture_its_level(size, pixels, aspect):
    rows, columns = size
    light = np.random.default_rng(1).uniform(0.1, 1, size)
    padded = fit_picture(light, pixels, aspect, "pad")
    covered = min(columns / rows / aspect, aspect * rows / columns)
    # shapes within 1e-5 count as equal (numpy.isclose)
    assert padded.mean() == pytest.approx(light.mean() * covered, rel=3e-5)
    # the edges are numbers up to 40, known to 40 eps; a pixel is narrow, so that this counts more
    extent = (min(columns, rows * aspect), min(rows, columns / aspect))
    rounding = 4 * 40 * np.finfo(float).eps / min(e / n for e, n in zip(extent, pixels))
    np.testing.assert_allclose(fit_picture(np.full(size, 0.3), pixels, aspect, "crop"), 0.3, rtol=rounding)


WIDE = (
    np.arange(4)[None, :].repeat(500, axis=1).repeat(500, axis=0) + np.arange(500)[:, None] / 500.0
)  # 500 rows, 2000 columns


def test_crop_of_a_wide_picture_keeps_its_middle():
    """2000 x 500 on a square: columns 750 ... 1249 survive, half 1 and half 2."""
    expected = WIDE[:, 750:1250].reshape(50, 10, 50, 10).mean(axis=(1, 3))
    np.testing.assert_allclose(fit_picture(WIDE, (50, 50), 1.0, "crop"), expected, rtol=1e-13)


def test_pad_of_a_wide_picture_adds_dark_bars():
    """2000 x 500 on a square of 80 pixels: 20 rows of light, 30 dark ones above and below."""
    fitted = fit_picture(WIDE, (80, 80), 1.0, "pad")
    assert not fitted[:30].any()
    assert not fitted[50:].any()
    np.testing.assert_allclose(fitted[30:50], WIDE.reshape(20, 25, 80, 25).mean(axis=(1, 3)), rtol=1e-13)


def test_pad_shares_a_pixel_that_the_border_cuts():
    """One bright row on a square of three rows of pixels: 1 x 3 covers the middle third; of two rows, a third
    of each."""
    light = np.ones((1, 3))
    np.testing.assert_allclose(
        fit_picture(light, (3, 3), 1.0, "pad"), [[0, 0, 0], [1, 1, 1], [0, 0, 0]], atol=1e-15
    )
    np.testing.assert_allclose(fit_picture(light, (2, 2), 1.0, "pad"), np.full((2, 2), 1 / 3), rtol=1e-14)


def test_stretch_of_a_wide_picture_keeps_everything():
    expected = WIDE.reshape(50, 10, 50, 40).mean(axis=(1, 3))
    np.testing.assert_allclose(fit_picture(WIDE, (50, 50), 1.0, "stretch"), expected, rtol=1e-13)


@pytest.mark.parametrize("fit", ["crop", "pad", "stretch"])
def test_tall_pictures_are_fitted_as_wide_ones_turned(fit):
    np.testing.assert_allclose(
        fit_picture(WIDE.T, (40, 50), 0.8, fit), fit_picture(WIDE, (50, 40), 1.25, fit).T, rtol=1e-12
    )


def test_fitting_keeps_up_up_and_left_left():
    light = np.zeros((40, 40))
    light[:10, :20] = 1.0
    np.testing.assert_allclose(fit_picture(light, (2, 4), 1.0), [[1, 0], [0, 0], [0, 0], [0, 0]], atol=1e-15)


def test_target_irradiance_carries_the_flux():
    screen = Screen((20.0, 10.0), (30, 17))
    target = target_irradiance(np.random.default_rng(1).uniform(0, 1, (40, 80)), screen, "crop", 0.7)
    assert target.shape == (17, 30)
    assert target.sum() * screen.pixel_area == pytest.approx(0.7, rel=1e-14)


@pytest.mark.parametrize("fit", ["crop", "pad"])
def test_a_picture_of_the_targets_shape_is_kept_whole(fit):
    """Twice as wide as high, on a target twice as wide as high."""
    screen, light = Screen((20.0, 10.0), (30, 17)), np.random.default_rng(1).uniform(0, 1, (40, 80))
    whole = target_irradiance(light, screen, "stretch", 0.7)
    np.testing.assert_allclose(target_irradiance(light, screen, fit, 0.7), whole, rtol=1e-14)


def test_a_picture_whose_middle_is_black_is_refused_when_cropped():
    light = np.zeros((10, 100))
    light[:, 0] = 1.0
    with pytest.raises(UserError, match=r"choose another target\.fit"):
        target_irradiance(light, Screen((5.0, 5.0), (10, 10)), "crop", 1.0)


@pytest.mark.parametrize("deep", [False, True])
def test_the_grey_that_a_png_calls_transparent_is_dark(tmp_path, deep):
    def chunk(name, data):
        body = name + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    code, bits = (">4H", 16) if deep else (">4B", 8)
    white, grey = (65535, 32768) if deep else (255, 128)
    row = b"\0" + struct.pack(code, white, white, 0, grey)
    parts = [chunk(b"IHDR", struct.pack(">IIBBBBB", 4, 2, bits, 0, 0, 0, 0))]
    parts += [chunk(b"tRNS", struct.pack(">H", white)), chunk(b"IDAT", zlib.compress(2 * row))]
    path = tmp_path / "p.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(parts) + chunk(b"IEND", b""))
    np.testing.assert_allclose(read_picture(path, "linear"), 2 * [[0.0, 0.0, 0.0, grey / white]])


@pytest.mark.parametrize("depth", [np.uint8, np.uint16])
def test_a_tiff_whose_zero_is_white_is_read_so(tmp_path, depth):
    most = np.iinfo(depth).max
    stored = np.array([[0, most // 4, most]], depth)
    with Image.fromarray(stored) as image:
        image.save(tmp_path / "p.tif", tiffinfo={262: 0})
    if depth is np.uint8:  # Pillow turns what it writes, and what it reads
        stored = most - stored
    np.testing.assert_allclose(read_picture(tmp_path / "p.tif", "linear"), 1 - stored / most)


@pytest.mark.parametrize(
    ("curve", "leads"),
    [
        (CURV + struct.pack(">IH", 1, 0), "from 1 to 1"),  # light = v^0
        (CURV + struct.pack(">I2H", 2, 0, 0), "from 0 to 0"),
        (para(0, -1), "from inf to 1"),
        (para(2, 1, 1, 0, -0.5), "from -0.5 to 0.5"),
    ],
)
def test_a_damaged_curve_of_a_profile_is_named(tmp_path, curve, leads):
    path = saved(tmp_path, grey(np.eye(4, dtype=np.uint8)), icc_profile=profile(b"kTRC", curve))
    with pytest.raises(UserError, match=f"the ICC profile of the file is damaged, .* leads {leads}"):
        read_picture(path)
