"""Words that the help of the commands names, or answers; they are all that it loads of this room."""

from __future__ import annotations

ENGINES = ("exact", "mitsuba-exact", "mitsuba-mesh")  # of optimizer.engine
STARTS = ("collimated", "far_field", "point", "extended", "two_surfaces")  # problem files to start from

_KINDS = (
    "an element is a lens or a mirror: [[element]] says where it lies, [[path]] how light goes through it"
)
_BARE = "a coating is a share of the light at any angle: lens.front.reflectance and lens.rear.reflectance"
_ALONG_Z = "this source lies on the axis and shines along +z; the light of a file can be turned and shifted"
# by key, or by the last name of any key or a choice, without the s of a plural: what stands in its way.  What
# the program learns leaves this table, as a test of it says
CANNOT = {
    **dict.fromkeys(("lense", "reflector", "prism"), _KINDS),
    "coating": _BARE,
    "grin": "the index is the same everywhere in the lens",
    **dict.fromkeys(
        ("lens.position", "lens.tilt"),
        "[lens] lies on the axis, with its front vertex at z = 0: take [[element]]",
    ),
    "source.position": _ALONG_Z,
    "run.device": "light is traced on the processor",
}


def cannot_do(word: object) -> str:
    """Return what keeps the program from what a key or a choice asks for, as a clause; "" of other words."""
    if not isinstance(word, str):
        return ""
    name = word.rpartition(".")[2]
    reason = CANNOT.get(word) or CANNOT.get(name) or CANNOT.get(name.removesuffix("s"))
    return f"thbcad cannot do that: {reason} (its README lists what it cannot do)" if reason else ""
