"""A lens is a plain record: what is proven of it is proven at the doors, with the same sentence."""

import json
from functools import partial

import pytest

from thbcad import write_step
from thbcad.cad.exchange import (
    SolidState,
    brep_bytes,
    iges_bytes,
    named_faces,
    step_bytes,
    step_shape,
    to_build123d,
)
from thbcad.cad.shapes import flanged_part, lens_part, lens_solid, patched_part, trimmed_part
from thbcad.io import lens_from_dict, lens_to_dict, read_lens, write_lens
from thbcad.lens.cuts import Flange
from thbcad.lens.freeform_surface import FreeformSurface
from thbcad.lens.lens import Lens
from thbcad.lens.soundness import require_sound
from thbcad.lens.triangulation import tessellated
from thbcad.sags import Conic

CROSSING = {
    "surfaces": (FreeformSurface((3, 4)), FreeformSurface((3, 4), Conic(-10, -1)), 1.0),
    "edges": (FreeformSurface((8, 8), Conic(-5.0, -1.0)), FreeformSurface((5, 5), Conic(-5.0, -1.0)), 0.5),
}
SENTENCE = {
    "surfaces": r"the surfaces cross: at x = -?3, y = -?4 mm the rear lies 0\.25 mm before the front",
    "edges": r"the ruled edge at -x crosses the front: at x = \S+, y = \S+ mm it lies \S+ mm before it",
}
DOORS = {
    "step": step_bytes,
    "iges": iges_bytes,
    "brep": brep_bytes,
    "part": lens_part,
    "solid": lens_solid,
    "patches": patched_part,
    "aperture": partial(trimmed_part, semi_axes=(2.0, 2.0)),
    "flange": partial(flanged_part, flange=Flange(2.0, 0.2, 0.4)),
    "mesh": partial(tessellated, chord=1e-2),
    "native": lambda lens: lens_from_dict(lens_to_dict(lens)),
    "build123d": to_build123d,
    "faces": named_faces,
}


def test_a_sound_lens_is_returned():
    lens = Lens(FreeformSurface((3, 4)), FreeformSurface((3, 4), Conic(-10, -1)), 2.0, 1.5)
    assert require_sound(lens) is lens


@pytest.mark.parametrize("crossing", CROSSING)
@pytest.mark.parametrize("door", DOORS)
def test_doors_refuse_a_lens_that_crosses_itself(door, crossing):
    lens = Lens(*CROSSING[crossing], 1.5)
    with pytest.raises(ValueError, match=SENTENCE[crossing]):
        DOORS[door](lens)


@pytest.mark.parametrize("crossing", CROSSING)
def test_nothing_is_written_of_a_lens_that_crosses_itself(crossing, tmp_path):
    lens = Lens(*CROSSING[crossing], 1.5)
    for write, suffix in ((write_lens, ".json"), (write_step, ".step")):
        with pytest.raises(ValueError, match=SENTENCE[crossing]):
            write(lens, tmp_path / f"lens{suffix}")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "lens.json").write_text(json.dumps(lens_to_dict(lens)), "utf-8")
    with pytest.raises(ValueError, match=SENTENCE[crossing]):
        read_lens(tmp_path / "lens.json")


TINY = {
    "thickness": (Lens(FreeformSurface((3, 4)), FreeformSurface((3, 4)), 9e-7, 1.5), "9e-07 mm thick"),
    "rims": (
        Lens(FreeformSurface((3, 4)), FreeformSurface((3, 4), Conic(-12.5, -1.0)), 1.0 + 1e-9, 1.5),
        "1e-09 mm thick",
    ),
    "width": (Lens(FreeformSurface((4, 4e-7)), FreeformSurface((4, 4e-7)), 1.0, 1.5), "8e-07 mm wide"),
}


@pytest.mark.parametrize("tiny", TINY)
@pytest.mark.parametrize("door", DOORS)
def test_doors_refuse_a_lens_that_cad_files_cannot_hold(door, tiny):
    """CAD programs take points within 1e-7 mm of each other for one."""
    lens, sentence = TINY[tiny]
    with pytest.raises(
        ValueError, match=f"{sentence}, less than the 1e-06 mm that CAD files can hold; raise"
    ):
        DOORS[door](lens)


def test_the_thinnest_lens_is_a_solid_in_its_file(tmp_path):
    lens = Lens(FreeformSurface((3, 4)), FreeformSurface((3, 4)), 1.001e-6, 1.5)
    write_step(lens, tmp_path / "lens.step")
    read = SolidState(step_shape(tmp_path / "lens.step"))
    assert (read.solids, read.free_edges, read.closed, read.valid) == (1, 0, True, True)
    assert read.volume == pytest.approx(lens.volume(), rel=1e-6)


def test_something_else_is_refused():
    with pytest.raises(ValueError, match="lens must be a Lens, got str"):
        require_sound("lens")
