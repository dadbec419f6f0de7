"""What problems ask for in vain, by the words that ask for it; the help of commands loads it alone."""

from __future__ import annotations

_KINDS = (
    "an element is a lens or a mirror: [[element]] says where it lies, [[path]] how light goes through it"
)
_BARE = "a coating is a share of the light at any angle: lens.front.reflectance and lens.rear.reflectance"
# by key, or by the last name of any key or a choice, without the s of a plural: what stands in its way.  What
# the program learns leaves this table, as a test of it says
CANNOT = {
    **dict.fromkeys(("lense", "reflector", "prism"), _KINDS),
    "coating": _BARE,
    **dict.fromkeys(
        ("grin", "gradient_index", "scatter", "scattering"),
        "index and absorption are the same everywhere in the lens, and only its surfaces scatter: "
        "lens.front.slope_rms and lens.rear.slope_rms",
    ),
    **dict.fromkeys(
        ("polarisation", "polarization", "polarised", "polarized", "diffraction", "phase", "coherence"),
        "light is rays without phase, and sources are not polarised",
    ),
    "laser": 'there is no source of that name: one that diverges is kind = "point" with its half_angle, or a '
    'file of rays, and one that does not kind = "collimated" with profile = "gaussian"',
    **dict.fromkeys(
        ("asphere", "even_asphere", "biconic", "toroid", "coefficient", "polynomial", "a4", "a6"),
        "a fixed face is a conic; of a free one a spline stands on it, which scripts may start from any sag",
    ),
    "targets": "a problem has one target; a picture or [[target.zone]] holds several regions",
    **dict.fromkeys(
        ("lens.position", "lens.tilt"),
        "[lens] lies on the axis, with its front vertex at z = 0: take [[element]]",
    ),
    **dict.fromkeys(("run.device", "gpu", "cuda"), "light is traced on the processor"),
}


def cannot_do(word: object) -> str:
    """Return what keeps the program from what a key or a choice asks for, as a clause; "" of other words."""
    if not isinstance(word, str):
        return ""
    name = word.rpartition(".")[2]
    reason = CANNOT.get(word) or CANNOT.get(name) or CANNOT.get(name.removesuffix("s"))
    return f"thbcad cannot do that: {reason}" if reason else ""
