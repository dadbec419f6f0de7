"""Examples in the help of every command."""

from __future__ import annotations

EXAMPLES = {
    "design": (
        "thbcad design my.toml --out lens",
        "thbcad design my.toml --set target.distance=400 --out far",
        "thbcad design my.toml --out lens --resume --iterations 20",
    ),
    "new": (
        "thbcad new > my.toml",
        "thbcad new --kind far_field > far.toml",
    ),
    "check": (
        "thbcad check my.toml",
        "thbcad check my.toml --explain --set lens.thickness=25.0",
        "thbcad check my.toml --json",
    ),
    "verify": (
        "thbcad verify lens",
        "thbcad verify lens/lens.step --json",
        "thbcad verify lens --light mitsuba --rays 1e6",
    ),
    "export": (
        "thbcad export lens --out lens.stl --chord 0.01",
        "thbcad export lens --out mounted.step --aperture 40 40 --flange 5 2 6",
        "thbcad export lens/lens.json --out surface.dat",
    ),
    "sheet": (
        "thbcad sheet lens --out lens.pdf",
        "thbcad sheet lens --out lens.svg --set-indication grade='PMMA 8N' --set-indication gate=-13,0",
        "thbcad sheet lens --out lens.dxf --manner cut --set-indication '5/rear=2x0.1'",
    ),
    "pack": (
        "thbcad pack exports/pearl --for zemax --out pearl_zemax.zip",
        "thbcad pack exports/pearl --for shop --out pearl_shop.zip",
    ),
    "trace": (
        "thbcad trace lens",
        "thbcad trace lens --rays 1025 --out traced",
    ),
    "etendue": (
        "thbcad etendue my.toml",
        "thbcad etendue my.toml --efficiency 0.7 --out bound.png",
        "thbcad etendue my.toml --measure lens",
    ),
    "relight": (
        "thbcad relight exports/pearl --source sun --out sun.png",
        "thbcad relight exports/pearl --source led:1mm@500mm",
    ),
    "road": (
        "thbcad road exports/street --class P4 --height 8 --spacing 24 --overhang 3.5 --lenses 4",
        "thbcad road lamp.ies --class M4 --height 8 --spacing 30 --r-table R3.txt",
    ),
    "sweep": (
        "thbcad sweep my.toml --vary target.distance=200:400:5 --out distances",
        "thbcad sweep my.toml --vary 'lens.rear.half_width=[[30,30],[40,40]]' --workers 2 --out sizes",
        "thbcad sweep my.toml --vary target.distance=200:400:5 --scheduler tcp://host:8786 --out distances",
    ),
    "tolerance": (
        "thbcad tolerance exports/pearl",
        "thbcad tolerance exports/pearl --tolerances shop.toml --set temperature=0 --limit 0.005 --json",
        "thbcad tolerance exports/tophat_square --limit min_over_mean=0.7 --float-shift",
    ),
    "tool": (
        "thbcad tool exports/pearl --ball 3 --step 0.02",
        "thbcad tool exports/pearl --nose 1 --feed 0.005 --acceleration 10",
    ),
    "asbuilt": (
        "thbcad asbuilt exports/pearl --measured rear.xyz",
        "thbcad asbuilt exports/pearl --measured errors.csv --errors --height-unit nm --align best-fit",
    ),
    "audit": (
        "thbcad audit",
        "thbcad audit --out audited --json",
    ),
    "bench": (
        "thbcad bench overview",
        "thbcad bench overview --store",
        "thbcad bench --markdown",
    ),
    "completion": (
        "thbcad completion bash > ~/.local/share/bash-completion/completions/thbcad",
        "thbcad completion zsh > ~/.zfunc/_thbcad",
    ),
}


def examples_text(command: str) -> str:
    """Return the examples of a command as the end of its help."""
    return "\n".join(("examples:", *(f"  {line}" for line in EXAMPLES[command])))
