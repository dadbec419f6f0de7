"""The record of sources in a problem file: every key with its default and limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from optics.scene.keys import FARTHEST, LONGEST, SHORTEST, Rows, option
from optics.scene.photometry import ILLUMINANTS

PROFILES = ("uniform", "round", "gaussian", "round_gaussian", "image")
DIVERGENCES = ("uniform", "gaussian", "sun", "theta_uniform")
FLUX_UNITS = ("W", "lm")
LEAST_FLUX = 1e-12  # of source.unit
SUN = 0.2665  # degrees: the mean half-angle of its disk


class SourceKeys(NamedTuple):
    """Which keys a kind of source has: a half_width above 0 (area), values of profile, a divergence, those of
    light of a file (file), 0 as flux for that of the file (own_flux); and its least distance, mm (nearest).
    """

    area: bool = False
    profiles: tuple[str, ...] = ("uniform",)
    diverges: bool = False
    file: bool = False
    own_flux: bool = False
    nearest: float = 0.0


SOURCES = {
    "collimated": SourceKeys(area=True, profiles=PROFILES, diverges=True),
    "lambertian": SourceKeys(area=True, profiles=PROFILES),
    "point": SourceKeys(nearest=SHORTEST),
    "rays": SourceKeys(file=True),
    "luminaire": SourceKeys(profiles=("uniform", "round"), file=True, own_flux=True),
}
OF_FILES = {"kind": tuple(kind for kind, keys in SOURCES.items() if keys.file)}
OF_BEAMS = {"kind": tuple(kind for kind, keys in SOURCES.items() if keys.diverges)}
OF_SIZED = {"kind": tuple(kind for kind, keys in SOURCES.items() if keys.area or keys.own_flux)}


@dataclass(frozen=True, kw_only=True)
class SourceArray:
    """Sources of one kind side by side, as the table [source.array].

    >>> SourceArray(columns=2, rows=2, pitch=(6, 6)).places
    ((-3.0, -3.0), (3.0, -3.0), (-3.0, 3.0), (3.0, 3.0))
    """

    columns: int = option(low=1, high=100, note="along own x")
    rows: int = option(low=1, high=100, note="along own y")
    pitch: tuple[float, float] = option(low=SHORTEST, high=LONGEST, note="mm, from middle to middle")

    @property
    def places(self) -> tuple[tuple[float, float], ...]:
        """Own x and y of every source, mm; the array's middle is 0."""
        x, y = (
            [(k - (n - 1) / 2) * step for k in range(n)]
            for n, step in zip((self.columns, self.rows), self.pitch)
        )
        return tuple((a, b) for b in y for a in x)


@dataclass(frozen=True, kw_only=True)
class OneSource:
    """A source of light, or an array of like ones.

    >>> OneSource(kind="lambertian", half_width=(1, 1), position=(5, 0, -20)).placed
    True
    """

    kind: str = option(
        choices=tuple(SOURCES),
        note="parallel rays along +z, a Lambertian emitter, a point, rays or a luminaire of a file",
    )
    name: str = option("", note="each has its own, where there are several")
    half_width: tuple[float, float] = option(
        (0.0, 0.0),
        low=0,
        high=LONGEST,
        note="mm; a point has none, 0 is that of a luminaire's file",
        only=OF_SIZED,
    )
    position: tuple[float, float, float] | None = option(
        None, size=(0, FARTHEST), note="mm, of its middle, in place of distance"
    )
    distance: float = option(
        2.0,
        low=0,
        high=FARTHEST,
        note="mm from the source plane to the front vertex",
        only={"position": (None,)},
    )
    flux: float = option(
        1.0,
        low=LEAST_FLUX,
        high=1e12,
        zero=True,
        note="of the whole source, of each in an array; 0 is that of the file",
    )
    weight: float = option(1.0, low=0, high=1e6, note="times flux: how bright it is driven; 0 is off")
    unit: str = option("W", choices=FLUX_UNITS, note="of flux: lumens make lx and cd of all that is reported")
    profile: str = option(
        "uniform", choices=PROFILES, note="over the area; the round ones fill the inscribed ellipse"
    )
    sigma: tuple[float, float] = option(
        (0.5, 0.5),
        above=0,
        high=1e6,
        note="of the gaussian profiles, relative to half_width",
        only={"profile": ("gaussian", "round_gaussian")},
    )
    image: str = option(
        "",
        note="picture file of the profile image, linear light, relative to the problem file",
        picture=True,
        only={"profile": ("image",)},
    )
    file: str = option(
        "",
        note="rays (TM-25, Zemax .dat, LightTools .ray) or luminaire (IES, EULUMDAT), relative to the "
        "problem file",
        picture=True,
        only=OF_FILES,
    )
    shift: tuple[float, float] = option(
        (0.0, 0.0),
        size=(0, LONGEST),
        note="mm in x and y, of a file's origin; distance is that along -z",
        only=OF_FILES,
        instead="position",
    )
    tilt: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0),
        size=(0, 360),
        note="right-handed degrees about own x, then own y, then own z, around its middle or a file's origin",
    )
    turn: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0),
        size=(0, 360),
        note="the same about axes that stay: x, then y, then z; tilt or turn, not both; of a file's light",
        only=OF_FILES,
        instead="tilt",
    )
    half_angle: float = option(
        90.0,
        low=1e-3,
        high=90,
        note="degrees, of the cone that a lambertian or a point source lights",
        only={"kind": ("lambertian", "point")},
    )
    exponent: float = option(
        0.0,
        low=0,
        high=1000,
        note="a point's intensity goes with cos(angle)^exponent",
        only={"kind": ("point",)},
    )
    divergence: float = option(
        0.0,
        low=0,
        high=60,
        note="degrees, of collimated light: the half-angle, or sigma; 0 is parallel, but 0.2665 for the sun",
        only=OF_BEAMS,
        instead="half_angle",
    )
    divergence_profile: str = option(
        "uniform",
        choices=DIVERGENCES,
        note="over solid angle, of angles, of the sun's disk, or over the angle (theta_uniform)",
        only=OF_BEAMS,
        instead="half_angle",
    )
    wavelength: float = option(
        550.0,
        low=1,
        high=1e6,
        note="nm, that the lens is designed at; limits.feature compares the lens's features with it",
    )
    spectrum: str | Rows = option(
        (),
        choices=ILLUMINANTS,
        note="light to measure with: [[nm, radiant weight], ...] or a CIE illuminant; [] is wavelength alone",
    )

    array: SourceArray | None = option(None, note="like sources side by side; false is one")

    @property
    def placed(self) -> bool:
        """Whether it is one that stands elsewhere than on the axis, or an array."""
        return self.position is not None or self.array is not None or any(self.own_tilt)

    @property
    def own_tilt(self) -> tuple[float, float, float]:
        """Its tilt, unless a file's light turns by itself."""
        return (0.0, 0.0, 0.0) if SOURCES[self.kind].file else self.tilt

    @property
    def total(self) -> float:
        """The flux of it all, in its unit."""
        return self.flux * self.weight * (len(self.array.places) if self.array else 1)

    @property
    def data(self) -> str:
        """The key of the file that the source is read from, where it names one."""
        return "file" if self.file else "image"

    @property
    def half_divergence(self) -> float:
        """The half-angle of a collimated source's light, degrees; 0 where it is parallel."""
        return self.divergence or (SUN if self.divergence_profile == "sun" else 0.0)


@dataclass(frozen=True, kw_only=True)
class Source(OneSource):
    """The light that comes in, as the table [source] of a problem file, or as a list of them, [[source]].

    >>> Source(kind="collimated", half_width=(9.5, 9.5), divergence_profile="sun").half_divergence  # degrees
    0.2665
    """

    others: tuple[OneSource, ...] = option((), note="the second and further tables of a list [[source]]")

    @property
    def each(self) -> tuple[OneSource, ...]:
        return self, *self.others

    @property
    def lone(self) -> bool:
        """Whether there is one source, on the axis."""
        return not (self.placed or self.others)
