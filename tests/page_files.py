"""The files that a page takes as given, in the folder in which its commands run."""

import re
import shutil

import numpy as np

from optics.interface.api import Design
from tests.cases import EXAMPLES, ROOT
from tests.optics.cases import write_problem

TOML = re.compile(r"^```toml\n(.*?)^```", re.DOTALL | re.MULTILINE)
SMALL = {"target.pixels": [16, 16], "optimizer.iterations": [2], "lens.rear.freeform.max_level": 1}


def prepare(page, folder, results):
    """Put the files into the folder of a terminal that a page takes as given."""
    make_folders(folder)
    for name in ("pearl", "tophat_square") if page in GIVEN else ():
        shutil.copytree(results / name, folder / "exports" / name)
    GIVEN.get(page, own_problem)(folder)


def first_toml(page):
    """Return the first block of TOML of a page."""
    return TOML.search((ROOT / page).read_text("utf-8"))[1]


def make_folders(folder):
    """Make those that a checkout has, or that results go to."""
    for name in ("examples", "exports"):
        (folder / name).mkdir()


def own_problem(folder):
    """Write examples/my.toml, the problem that both first pages show."""
    (folder / "examples" / "my.toml").write_text(first_toml("README.md"), "utf-8")


def variants(folder):
    """Write my.toml, a small problem that the page varies, and another picture."""
    write_problem(folder, SMALL | {"target.distance": 200.0}, name="my.toml")
    (folder / "other.png").symlink_to(EXAMPLES / "others" / "astronaut.png")


def measured(folder):
    """Write points of the rear of the designed lens, and errors of it in nm."""
    rear = Design.load(folder / "exports" / "pearl").lens.rear
    x, y = np.random.default_rng(0).uniform(-9.9, 9.9, (2, 2000))
    np.savetxt(folder / "rear.xyz", np.column_stack([x, y, rear(x, y)]))
    np.savetxt(folder / "errors.csv", np.column_stack([x, y, 20 * np.cos(x)]), delimiter=",")


def foreign(folder):
    """Write part.step, a lens as another program might have it, and the problem that it is for."""
    (folder / "part.step").symlink_to(folder / "exports" / "pearl" / "lens.step")
    write_problem(folder, {"target.pixels": [16, 16]}, name="problem.toml")


def theirs(folder):
    """Write theirs.step, a lens as another program might have it."""
    (folder / "theirs.step").symlink_to(folder / "exports" / "tophat_square" / "lens.step")


def mounted(folder):
    """Write mount.toml, the mount that the page shows."""
    (folder / "mount.toml").write_text(first_toml("docs/parts.md"), "utf-8")


def of_a_shop(folder):
    """Write shop.toml, the tolerances that the page shows."""
    (folder / "shop.toml").write_text(first_toml("docs/tolerances.md"), "utf-8")


def placeholder(folder):
    """Make DIR a result."""
    (folder / "DIR").symlink_to(folder / "exports" / "pearl")


GIVEN = {  # pages that take results as given: what writes their other files
    "docs/as_built.md": measured,
    "docs/commands.md": variants,
    "docs/parts.md": mounted,
    "docs/reading.md": foreign,
    "docs/sweeps.md": variants,
    "docs/tolerances.md": of_a_shop,
    "docs/tools.md": placeholder,
    "docs/tracing.md": theirs,
}
