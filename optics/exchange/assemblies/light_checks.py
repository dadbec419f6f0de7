"""What is proven of the glass and the light of a part, what is traced, and what is left out, in words."""

from optics.base.runtime import Check
from optics.exchange.assemblies.light_proof import GLASS, PartLight
from thbcad.checks import Floats

VOLUME = 1e-9  # relative
LOST = 1e-3  # of the flux, which trims and mounts may cost
SEGMENTS = {
    "source to front": "from the source to the front",
    GLASS: "in the glass, from front to rear",
    "rear to target": "from the rear to the lit part of the target",
}
FOLLOWED = "light by edges and inner reflections: light through front and rear alone is followed"
ELSEWHERE = (
    "light before the front and behind the rear: it is followed of a lens on the axis alone, not of one that "
    "lies elsewhere or beside other elements"
)
UNKNOWN = (
    "light before the front and behind the rear: a lens by itself knows no source and no target; give --lens "
    "the result folder"
)


def light_checks(part: PartLight, unknown: str) -> tuple[list[Check], list[str]]:
    """Return the Checks of a part's glass and light, and what is left out.

    unknown : what is left out where the part has no system.
    """
    checks, left_out = _proven(part), [FOLLOWED, *_beside_the_proof(part)]
    checks.append(Check.none_of("holes and pads of front and rear where they are lit", len(part.pierced)))
    inside = part.certain_voids
    where = _place({number: part.within[GLASS][number] for number in inside})
    checks.append(Check.none_of(f"faces of the part within the light's glass{where}", len(inside)))
    if part.system is None:
        left_out.append(unknown)
        if part.uncovered:  # the areas of front and rear tell
            return checks, left_out
    if not part.proven:
        more, words = _traced(part)
        checks += more
        left_out += words
    return checks, left_out


def _beside_the_proof(part: PartLight) -> list[str]:
    """Return what the hulls of the light do not hold."""
    words = [] if part.whole else ["the volume between front and rear: a face of the part may lie there"]
    if part.system is not None and part.system.spectral:
        words.append("light of other wavelengths than that of the design: the hulls are of its index")
    if part.system is not None and any(part.system.slope_rms):
        words.append("light that rough surfaces turn out of the hulls of the smooth ones")
    return words


def _proven(part: PartLight) -> list[Check]:
    checks = []
    if part.whole:
        name = (
            "volume of the part between front and rear against the closed form, relative, proven to be within"
        )
        checks.append(Check(name, part.most_missing, VOLUME, ""))
    for name, found in part.within.items():
        if not found:
            checks.append(Check.none_of(f"faces of the part in the light {SEGMENTS[name]}, proven", 0))
    if part.system is not None and not part.uncovered:
        checks.append(Check.none_of("faces of front and rear that lack what is lit of them, proven", 0))
    return checks


def _traced(part: PartLight) -> tuple[list[Check], list[str]]:
    """Return the Checks of light that is traced, and sentences on what is not proven therefore."""
    stopped = part.stopped()
    what = (
        "straight paths from front to rear" if part.system is None else "light to the lit part of the target"
    )
    rays = f"{stopped.rays:,}".replace(",", " ")
    name = f"share of the {what} that the part stops, by {rays} rays"
    checks = [Check(name, stopped.share, LOST, "", error=stopped.error)]
    if part.voids:
        checks.append(Check.none_of(f"rays of {rays} that meet a face within the glass", stopped.voided))
    words = [
        f"proof of the light {SEGMENTS[name]}: {_faces(found)}, may lie in its hull, so that it is sampled "
        f"by {rays} rays"
        for name, found in part.within.items()
        if found
    ]
    words += [
        f"proof that the {name} is whole where it is lit: its edges may lie there, so that it is sampled by "
        f"{rays} rays"
        for name in part.uncovered
    ]
    return checks, words


def _faces(found: dict[int, Floats]) -> str:
    """Return the faces that may lie in a hull."""
    return (f"{len(found)} faces of the part" if len(found) > 1 else "a face of the part") + _place(found)


def _place(found: dict[int, Floats]) -> str:
    """Return where one of some faces lies, as far as that is known."""
    points = next((points for points in found.values() if len(points)), None)
    return "" if points is None else ", as at ({:.4g}, {:.4g}, {:.4g}) mm of the lens".format(*points[0])
