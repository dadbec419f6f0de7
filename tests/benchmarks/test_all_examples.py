"""`make gallery` designs every example as it is."""

from benchmarks.gallery.lenses import LENSES
from benchmarks.gallery.other_examples import other_examples
from tests.cases import EXAMPLES


def test_every_example_is_designed_by_the_gallery():
    shown = {EXAMPLES / lens.problem for lens in LENSES}
    files = {path for path in EXAMPLES.rglob("*.toml") if path.parent.name != "mounts"}
    assert shown | set(other_examples().values()) == files
    assert EXAMPLES / "dome.toml" in files
