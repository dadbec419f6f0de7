"""What a worker does with a variant: a real design, also of a picture that only the client has."""

import numpy as np
import pytest
from PIL import Image

import optics
from optics.exchange.results import fingerprint
from optics.interface.sweeps.variant_work import Shared, Work, designed
from tests.optics.interface.sweeps.cases import problem

SMALL = {
    "target.pixels": [24, 24],
    "lens.rear.freeform.max_level": 0,
    "optimizer.iterations": 1,
    "optimizer.start": "flat",
}


@pytest.fixture
def picture(tmp_path):
    path = tmp_path / "light.png"
    Image.fromarray(np.linspace(0, 255, 24 * 24).reshape(24, 24).astype(np.uint8)).save(path)
    return path


def test_a_variant_is_that_design_and_its_picture_travels_by_content(picture):
    given = problem(**SMALL, **{"target.kind": "image", "target.image": str(picture)})
    wanted = optics.design(given.with_(**{"target.distance": 250, "run.threads": 1}))
    shared = Shared(given, {str(picture): picture.read_bytes()})
    picture.unlink()
    found = designed(shared, Work({"target.distance": 250}, keep_lens=True))
    assert found.metrics["rel_l2"] == wanted.metrics["rel_l2"]
    assert found.metrics["fates_w.on_target"] == wanted.metrics["fates_w"]["on_target"]
    assert found.picture.startswith(b"\x89PNG")
    assert '"thbcad-lens"' in found.lens


@pytest.mark.slow
def test_pictures_can_be_varied(picture, tmp_path):
    other = tmp_path / "other.png"
    Image.open(picture).transpose(Image.Transpose.FLIP_LEFT_RIGHT).save(other)
    given = problem(**SMALL, **{"target.kind": "image", "target.image": str(picture)})
    ranges = {"target.image": [str(picture), str(other)]}
    found = optics.sweep(given, ranges, tmp_path / "out", workers=2)
    assert found.counts()["done"] == 2
    assert found.rows[0].metrics["rel_l2"] != found.rows[1].metrics["rel_l2"]
    assert fingerprint(given) != fingerprint(given.with_(**{"target.image": str(other)}))
