"""`thbcad tool`: whether a tool fits a lens, what its cusps do to the light, how its machine must move."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import fields
from pathlib import Path

from optics.base.runtime import check_lines, verification
from optics.exchange.results import ResultFolder, require_own, writable_folder, write_recorded
from optics.interface.commands.outcome import OF_GRADES, Outcome
from optics.interface.screens import tool_screen
from optics.reporting.report import check_page
from optics.tolerancing.machining import ToolOrder, tool_data, tool_findings, tool_lines

RECORD, PAGE = "tool.json", "tool.html"
PICTURES = ("tool_front.png", "tool_rear.png")


def tool(options: Namespace) -> Outcome:
    """Try a tool on the lens of a result folder."""
    order = ToolOrder(**{field.name: getattr(options, field.name) for field in fields(ToolOrder)})
    system = ResultFolder(options.result).read().system
    folder = Path(options.out or Path(options.result) / "tool")
    writable_folder(folder)
    require_own(folder, (RECORD, PAGE, *PICTURES), RECORD, options.force)
    findings = tool_findings(system, order, system.backend)
    checked, lines = verification(findings.checks), tool_lines(findings)
    data = tool_data(findings) | checked
    from optics.reporting.figures import figures_of_tool  # matplotlib

    figures = figures_of_tool(findings)
    page = check_page(f"{system.problem.title}: tools", data, lines, [(c, p) for _, c, p in figures])
    files = {name: picture for name, _, picture in figures} | {PAGE: page.encode()}
    write_recorded(folder, RECORD, data, files, {*PICTURES} - {*files})
    screen = tool_screen(findings, system.problem.title, folder)
    lines += [*check_lines(checked), f"wrote {folder}"]
    return Outcome(data, lines, OF_GRADES[checked["grade"]], screen)
