"""What keys of sources must go together."""

from __future__ import annotations

from optics.base.runtime import UserError, speaking_of
from optics.scene.keys import SHORTEST
from optics.scene.problem.source_schema import LEAST_FLUX, SOURCES, OneSource, Source

VISIBLE = 380.0, 780.0  # nm
LEAST_SIGMA = 0.005  # of a Gaussian profile: narrower ones fall between the rays


def require_sources(source: Source) -> None:
    """Refuse sources that lack a partner key, and several that cannot be added.

    Raises UserError : names the key.
    """
    _require_source(source)
    if not any(each.weight for each in source.each):
        raise UserError("source.weight is 0 of every source; make one greater")
    if not source.lone and not source.flux:
        raise UserError("source.flux must be given beside source.position, source.array or other sources")
    if any(0 < each.total < LEAST_FLUX for each in source.each):
        raise UserError(
            f"source.flux times source.weight must be 0 or at least {LEAST_FLUX:g}; make source.weight larger"
        )
    for k, other in enumerate(source.others, 2):
        with speaking_of(f"source {other.name or k} of the list"):
            _require_source(other)
            if other.file or other.image:
                raise UserError("a source with a file stands first in the list; move it there")
            for key in ("unit", "wavelength", "spectrum"):
                if getattr(other, key) != getattr(source, key):
                    raise UserError(
                        f"source.{key} must be that of the first source, {getattr(source, key)!r}, got "
                        f"{getattr(other, key)!r}; design each alone, or give them the same"
                    )


def _require_source(source: OneSource) -> None:
    kind, has = source.kind, SOURCES[source.kind]
    if source.profile == "image" and not source.image:
        raise UserError("the key source.image is missing; add it")
    if source.distance < has.nearest:
        raise UserError(
            f"source.distance must be at least {has.nearest} for a {kind}, which would lie in the lens, "
            f"got {source.distance!r}"
        )
    if has.file and not source.file:
        raise UserError("the key source.file is missing; add it")
    low, high = VISIBLE
    if source.unit == "lm" and not source.spectrum and not low <= source.wavelength <= high:
        raise UserError(
            f'source.unit = "lm" counts visible light, {low:g} to {high:g} nm, and source.wavelength is '
            f'{source.wavelength:g} nm; take source.unit = "W", or give the source.spectrum of the lumens'
        )
    if any(source.tilt) and any(source.turn):
        raise UserError(
            "source.tilt (about own axes) and source.turn (about axes that stay) say one rotation twice; "
            "leave one of them out"
        )
    if source.placed and source.half_divergence:
        raise UserError(
            "the blur of a diverging beam is known along the axis only; leave source.position, source.tilt "
            'and source.array out, or take kind = "lambertian" with its half_angle'
        )
    if not source.flux and not has.own_flux:
        raise UserError(f"source.flux must be at least {LEAST_FLUX:.7g}, got {source.flux!r}")
    if has.area and min(source.half_width) < SHORTEST:
        got = list(source.half_width)
        raise UserError(f"source.half_width must be at least {SHORTEST} for a {kind} source, got {got}")
    if has.profiles[1:] and source.profile not in has.profiles:
        known = " or ".join(f'"{name}"' for name in has.profiles)
        raise UserError(
            f"source.profile of a {kind} must be {known}, got {source.profile!r}: "
            "the same intensity from every point is all that its file tells"
        )
    if source.divergence_profile not in ("uniform", "sun") and not source.divergence:
        raise UserError(
            f'source.divergence_profile = "{source.divergence_profile}" needs source.divergence in degrees'
        )
    if source.profile not in has.profiles:
        raise UserError(
            f"source.profile is that of an area, the kind {kind!r} has none; got {source.profile!r}"
        )
    if source.profile in ("gaussian", "round_gaussian") and min(source.sigma) < LEAST_SIGMA:
        raise UserError(
            f"source.sigma must be at least {LEAST_SIGMA}, got {list(source.sigma)}; "
            "take a smaller source.half_width"
        )
