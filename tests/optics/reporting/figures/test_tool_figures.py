"""Pictures of a tool on a lens."""

from optics.reporting.figures import figures_of_tool
from optics.scene.problem import load_problem
from optics.scene.system import OpticalSystem
from optics.tolerancing.machining import ToolOrder, tool_findings
from tests.optics.cases import write_problem
from tests.optics.tolerancing.machining.cases import bowl_lens


def test_every_surface_that_is_cut_has_one_picture_with_a_panel_for_each_question(tmp_path, backend):
    system = OpticalSystem(load_problem(write_problem(tmp_path)))
    order = ToolOrder(nose=1.0, feed=0.01)
    ((name, caption, png),) = figures_of_tool(tool_findings(system, bowl_lens(), order, backend, rays=17))
    assert name == "tool_rear.png"
    assert "acceleration" in caption
    assert png.startswith(b"\x89PNG")
    ((_, fewer, _),) = figures_of_tool(tool_findings(system, bowl_lens(), ToolOrder(ball=50.0), backend, 17))
    assert "acceleration" not in fewer
