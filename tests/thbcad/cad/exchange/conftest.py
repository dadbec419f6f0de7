"""The file of one lens, the formats in turn, and OpenCASCADE's settings put back."""

import pytest
from OCP.IGESControl import IGESControl_Controller
from OCP.Interface import Interface_Static
from OCP.STEPControl import STEPControl_Writer

from tests.thbcad.cad.exchange.cases import KINDS
from tests.thbcad.cases import LENSES
from thbcad import write_step

SETTINGS = (
    "write.step.schema",
    "write.step.unit",
    "write.step.assembly",
    "write.iges.unit",
    "xstep.cascade.unit",
    "read.iges.bspline.continuity",
)


@pytest.fixture(scope="module")
def text(tmp_path_factory):
    """The file of the Table 6.3 lens, as text."""
    path = tmp_path_factory.mktemp("text") / "lens.step"
    write_step(LENSES["table63"], path)
    return path.read_text("ascii")


@pytest.fixture
def occt_settings():
    """Put back OCCT's process-wide settings that a test changes."""
    IGESControl_Controller.Init_s()
    STEPControl_Writer()  # the settings exist only once these have been made
    before = {name: Interface_Static.CVal_s(name) for name in SETTINGS}
    yield
    for name, value in before.items():
        Interface_Static.SetCVal_s(name, value)


@pytest.fixture(params=KINDS)
def kind(request):
    """The ending of a file's name, of each format in turn."""
    return request.param
