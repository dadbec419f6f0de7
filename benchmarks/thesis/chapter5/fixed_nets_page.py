"""The page of study 4."""

from __future__ import annotations

from benchmarks.thesis.chapter5.fixed_nets_claims import claims
from benchmarks.thesis.chapter5.fixed_nets_runs import CONTROL_NET, TARGETS
from benchmarks.thesis.pages import Choice, Picture, Section, Table
from benchmarks.thesis.records import Results

TITLE = "Fixed nets and step sizes"
HEAD = ("run", "iterations", "rel_l2", "astray", "roughness", "loss")
KINDS = ("1e-3", "1e-4", "L-BFGS", "transport")
CHOICES = (
    Choice("R of the rear.", "+1000 mm: half-width 71.25 mm."),
    Choice("Outline of the top hat.", "A square of 60 % of the target's width."),
    Choice(
        "z_freedom of section 5.3 (N/A in table 5.1).",
        "20 mm: 250 steps of 1e-3 then reach about 3 mm of sag. A control has 5 mm.",
    ),
    Choice(
        "Iterations with steps of 1e-4.",
        "10 (top hat) and 4 times (pearl) those of 1e-3; where the loss of 1e-3 is reached, the lens "
        "counts too.",
    ),
    Choice("Encoding of the pearl's numbers.", "sRGB, decoded to linear light."),
    Choice(
        "Rays of Mitsuba, drawn at random for every iteration.",
        "The same regular grid of rays in all iterations.",
    ),
    Choice(
        "Light outside is judged by eye on E^0.2.",
        "Flux 2.5 % of the target's width or more from the wanted light, or off the target, over the "
        "source's.",
    ),
)


def section(results: Results) -> Section:
    """Return the page's section, from the numbers alone."""
    return Section(
        number=4,
        title=TITLE,
        text=_text(results),
        claims=claims(results),
        tables=[_net_table(results), _control_table(results)],
        pictures=_pictures(results),
        choices=CHOICES,
    )


def _text(results: Results) -> list[str]:
    worst = max(found.numbers["step_difference"] for found in results.values())
    nets = sorted({found.numbers["net"] for found in results.values()})
    hat, close = (results[f"top hat {nets[0]} {kind}"].numbers for kind in ("1e-3", "z_freedom 5"))
    return [
        "A square collimated beam passes a plane front and a free rear of degree 5, as in table 5.1 of the "
        f"thesis. The rear has one net of control points: {', '.join(f'{n} x {n}' for n in nets)}. Adam "
        "starts from the flat sag and lowers the misfit of the irradiance on the pixels. The light is "
        "measured by a Gaussian of 0.5 pixels; the wanted light is not filtered, as in the thesis. The "
        "lens after the last iteration counts. The problem is "
        "[fixed_nets.toml](../../examples/thesis/fixed_nets.toml).",
        "Every lens is written as a STEP file and read back. An independent tracer sends the same rays "
        f"through the file. Its irradiance differs from the optimiser's by {worst:.1e} at most, relative. "
        "rel_l2 and light astray are measured with other rays, in exact pixels. Roughness is "
        "the root mean square of the sag's second derivatives, times the half-width.",
        "The step of Adam has no meaning without z_freedom b: near the flat start a step s moves a control "
        f"point by 2 b s / pi. With b = 20 mm and {nets[0]} x {nets[0]} control points, "
        f"{hat['evaluations'] - 1} steps of 1e-3 end at rel_l2 {hat['rel_l2']:.2f}; with b = 5 mm at "
        f"{close['rel_l2']:.2f}, where the sag gets less far.",
        "The loss sees pixels of the target only. Light that has left the target changes no pixel, so "
        "nothing calls it back.",
        f"Controls on {CONTROL_NET} x {CONTROL_NET} control points: light and wanted light both filtered; a "
        "Gaussian of 1 pixel; pixels merged 4 x 4, then 2 x 2, then not at all. Controls on all nets: "
        "L-BFGS from the flat start, and from the sag that optimal transport gives. Lists of numbers go from "
        "the smallest net to the largest.",
    ]


def _net_table(results: Results) -> Table:
    nets = sorted({found.numbers["net"] for found in results.values()})
    rows = [[f"{t}, {kind}", *(_cell(results, t, n, kind) for n in nets)] for t in TARGETS for kind in KINDS]
    return Table(
        "All nets: rel_l2, light astray in %, roughness.", ["run", *(f"{n} x {n}" for n in nets)], rows
    )


def _cell(results: Results, target: str, net: int, kind: str) -> str:
    name = f"{target} {net} {kind}"
    if name not in results:
        return "-"
    r = results[name].numbers
    return f"{r['rel_l2']:.2f}, {abs(100 * r['astray']):.1f}, {r['roughness']:.3g}"


def _control_table(results: Results) -> Table:
    names = [name for name in results if not name.endswith(KINDS)]
    return Table("Other controls.", HEAD, [_row(results, name) for name in names])


def _row(results: Results, name: str) -> list[str]:
    r = results[name].numbers
    shown = [f"{r[key]:.3f}" for key in ("rel_l2", "astray")]
    return [name, f"{r['evaluations'] - 1}", *shown, f"{r['roughness']:.2f}", f"{r['loss']:.3f}"]


def _pictures(results: Results) -> list[Picture]:
    rows = "Rows as above."
    return [
        Picture(
            "study4_top_hat",
            "Steps of 1e-3, top hat (figure 5.5). From top: light by the optimiser's tracer, by the "
            "independent tracer, that to the power 0.2, sag.",
        ),
        Picture("study4_pearl", f"Steps of 1e-3, pearl (figure 5.6). {rows}"),
        Picture("study4_small_step", f"Steps of 1e-4 (figure 5.7). {rows}"),
        Picture("study4_losses", "Loss against iterations (figures 5.8 and 5.9). Dashed: steps of 1e-4."),
        Picture("study4_controls", f"Controls on {CONTROL_NET} x {CONTROL_NET} control points. {rows}"),
    ]
