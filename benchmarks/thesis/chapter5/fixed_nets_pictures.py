"""The pictures of study 4, arranged as figures 5.5 to 5.9 of the thesis."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from benchmarks.thesis.chapter5.fixed_nets_runs import CONTROL_NET, TARGETS, trial_names
from benchmarks.thesis.drawing import curves, irradiance, panels, plt, png, relief
from benchmarks.thesis.records import Results

TOP = 4.0  # of the grey scale, times the mean: a top hat is at 2.8
TOP_OF_POWER = 1.3  # TOP to the power 0.2
SIZE = 1.6  # inches of a panel


def pictures(results: Results) -> Iterator[tuple[str, bytes]]:
    """Yield the name and the PNG of every picture."""
    yield "study4_top_hat", _states(results, trial_names(results, "top hat", "1e-3"))
    yield "study4_pearl", _states(results, trial_names(results, "pearl", "1e-3"))
    small = [name for target in TARGETS for name in trial_names(results, target, "1e-4")]
    yield "study4_small_step", _states(results, small)
    yield "study4_losses", _losses(results)
    others = [n for n in results if f" {CONTROL_NET} " in n and not n.endswith(("1e-3", "1e-4"))]
    yield "study4_controls", _states(results, [n for n in others if n.startswith("top hat")])


def _states(results: Results, names: Sequence[str]) -> bytes:
    """Draw light, light by the STEP file, that to the power 0.2, and sag; one column per run."""
    figure, axes = panels(4, len(names), SIZE)
    for column, name in zip(axes.T, names):
        found = results[name]
        title = name if len(name) < 22 else name.replace(str(CONTROL_NET), f"{CONTROL_NET}\n", 1)
        irradiance(column[0], found.arrays["model"], title, top=TOP)
        irradiance(column[1], found.arrays["step"], f"rel_l2 {found.numbers['rel_l2']:.3f}", top=TOP)
        irradiance(
            column[2], found.arrays["step"], f"astray {found.numbers['astray']:.1%}", 0.2, top=TOP_OF_POWER
        )
        relief(column[3], found.arrays["sag"], f"roughness {found.numbers['roughness']:.2f}")
    words = ("optimiser's\ntracer", "independent\ntracer", "to the\npower 0.2", "sag")
    for ax, word in zip(axes[:, 0], words):
        ax.set_ylabel(word, fontsize=8)
    return png(figure)


def _losses(results: Results) -> bytes:
    figure, first = curves((9.0, 4.0))
    first.remove()
    for k, target in enumerate(TARGETS, 1):
        ax = figure.add_subplot(1, 2, k)
        ax.grid(which="both", alpha=0.25)
        for kind, line in (("1e-3", "-"), ("1e-4", "--")):
            for name in trial_names(results, target, kind):
                net = results[name].numbers["net"]
                losses = results[name].arrays["losses"]
                ax.semilogx(
                    range(1, len(losses) + 1), losses, line, color=_colour(net), label=f"{net}, {kind}"
                )
        ax.set(title=target, xlabel="iteration", ylabel="||E - T|| / ||T||", ylim=(0, None))
        ax.legend(fontsize=7, title="net, step", title_fontsize=7)
    return png(figure)


def _colour(net: int) -> str:
    nets = (10, 25, 50, 75, 100)
    return plt.get_cmap("viridis")(nets.index(net) / len(nets))
