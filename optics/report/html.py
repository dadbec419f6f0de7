"""The report: one self-contained HTML file with figures and tables."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

from optics.analysis import NEGLIGIBLE
from optics.tracing import SENTENCES

if TYPE_CHECKING:
    from optics.problem import Problem

STYLE = """
body{font:15px/1.5 system-ui,sans-serif;max-width:70rem;margin:2rem auto;padding:0 1rem;color:#222}
h1{font-weight:600} table{border-collapse:collapse;margin:1rem 0}
td,th{padding:.2rem .8rem;border-bottom:1px solid #ddd;text-align:left}
td.n{text-align:right;font-variant-numeric:tabular-nums}
.bad{color:#b00020;font-weight:600} .good{color:#1b7f3b}
.grid{display:grid;grid-template-columns:repeat(auto-fill,minmax(24rem,1fr));gap:1rem}
figure{margin:0} img{width:100%}
figcaption{font-size:.9em;color:#555} pre{background:#f6f6f6;padding:1rem;overflow:auto}
"""


@dataclass(frozen=True)
class Report:
    """What a report shows.

    metrics : numbers by name
    verification : as `optics.runtime.verification`
    manufacture : rows (name, value, unit, position)
    pictures : (caption, PNG bytes) by name
    limit : a sentence on what etendue allows
    """

    problem: Problem
    metrics: dict[str, Any]
    verification: dict[str, Any]
    manufacture: Sequence[tuple[str, float, str, str]]
    pictures: Mapping[str, tuple[str, bytes]]
    limit: str | None = None


def report_html(report: Report, problem_text: str) -> str:
    """Return the report as one HTML page without outside references."""
    title, metrics, verification = escape(report.problem.title), report.metrics, report.verification
    figures = "".join(
        f'<figure><img alt="{escape(caption)}" src="data:image/png;base64,{base64.b64encode(png).decode()}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
        for caption, png in report.pictures.values()
    )
    verdict = (
        '<span class="good">every check passed</span>'
        if verification["ok"]
        else '<span class="bad">a check failed</span>'
    )
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title><style>{STYLE}</style>'
        f"<h1>{title}</h1><p>{_summary(metrics)}{_limit_sentence(report.limit)}</p>"
        f'<div class="grid">{figures}</div>'
        f"<h2>Metrics</h2>{_metric_table(metrics)}"
        f"<h2>Manufacture</h2>{_manufacture_table(report.manufacture)}"
        f"<h2>Verification of lens.step: {verdict}</h2>{_check_table(verification)}"
        f"<h2>Problem</h2><pre>{escape(problem_text)}</pre></html>\n"
    )


def _summary(metrics: dict[str, Any]) -> str:
    return (
        f"Relative error {metrics['rel_l2']:.1%}, "
        f"{metrics['efficiency']:.1%} of the source flux inside the target "
        f"(at most {metrics['efficiency_bound']:.1%} passes two uncoated faces), "
        f"{metrics['stray']:.2%} stray; "
        f"{metrics['dof']} degrees of freedom, {metrics['evaluations']} evaluations, "
        f"{metrics['wall_s']['total']:.1f} s."
        f"{_other_paths(metrics.get('nonsequential'))}"
    )


def _limit_sentence(limit: str | None) -> str:
    return f" {escape(limit)}." if limit else ""


def _other_paths(fluxes: dict[str, Any] | None) -> str:
    """Return a sentence on whether the sequential tracer suffices.

    It is empty where all paths were not traced, or no light arrives.
    """
    if not fluxes or not fluxes["lit_w"]:
        return ""
    other = 1 - fluxes["lit_direct_w"] / fluxes["lit_w"]
    verdict = "suffices" if other <= NEGLIGIBLE else "does not suffice"
    return (
        f" {other:.2%} of the light on the lit pixels comes by other paths than front and rear: "
        f"the sequential tracer {verdict}."
    )


def _metric_table(metrics: dict[str, Any]) -> str:
    cells = (
        f'<tr><td>{escape(label)}</td><td class="n">{escape(shown)}</td></tr>'
        for label, shown in _labelled(metrics)
    )
    return f"<table>{''.join(cells)}</table>"


def _labelled(metrics: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yield (label, number as text) of metrics, those of a group behind its name; fates as sentences."""
    for name, value in metrics.items():
        label = f"{prefix}light that {SENTENCES[name]}, W" if name in SENTENCES else f"{prefix}{name}"
        if isinstance(value, Mapping):
            yield from _labelled(value, f"{label}: ")
        else:
            yield label, f"{value:.6g}" if isinstance(value, float) else str(value)


def _manufacture_table(rows: Sequence[tuple[str, float, str, str]]) -> str:
    cells = (
        f'<tr><td>{escape(name)}</td><td class="n">{value:.6g}</td>'
        f"<td>{escape(unit)}</td><td>{escape(position)}</td></tr>"
        for name, value, unit, position in rows
    )
    return f"<table>{''.join(cells)}</table>"


def _check_table(verification: dict[str, Any]) -> str:
    rows = ["<tr><th>check</th><th>value</th><th>limit</th><th>unit</th><th></th></tr>"]
    for check in verification["checks"]:
        mark = '<td class="good">passed</td>' if check["ok"] else '<td class="bad">failed</td>'
        rows.append(
            f'<tr><td>{escape(check["name"])}</td><td class="n">{check["value"]:.3g}</td>'
            f'<td class="n">{check["limit"]:g}</td><td>{check["unit"]}</td>{mark}</tr>'
        )
    left_out = "".join(f"<p>Left out: {escape(text)}.</p>" for text in verification.get("left_out", ()))
    return f"<table>{''.join(rows)}</table>{left_out}"
