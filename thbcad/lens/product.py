"""What a lens is called, who made it and what it is made of, as CAD files state it."""

import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, fields

# control characters, separators of lines and halves of surrogate pairs: a file would not give them back
FORBIDDEN = {"Cc", "Cs", "Zl", "Zp"}
LONGEST = 500  # characters; OCCT writes unreadable IGES files from 1000 on and ends the process from 2000 on

LENS_SIDES = "front", "rear"  # names of the optical faces in files
MIRROR_SIDES = "face", "back"
COLOURS = {
    "front": (0.72, 0.85, 0.95),
    "face": (0.72, 0.85, 0.95),
    "rear": (0.60, 0.75, 0.90),
}  # sRGB, by the first word of a face's name
OTHER_COLOUR = (0.80, 0.80, 0.80)


@dataclass(frozen=True)
class Product:
    """Names, material and refractive index for the head of a CAD file.

    name : of the solid, not empty.  author, organization, material : empty is unknown.
    density : g/cm^3, 0 is unknown.  index : refractive index, None is unknown.
    Density and index stand in a file only beside a material.
    sides : what front and rear are called.

    Raises ValueError : a text that is no string of one line of at most 500 characters or has a blank at an
        end; an empty name; a density below 0; an index that is not positive; a density or an index without a
        material.

    >>> Product("window", material="PMMA", density=1.19, index=1.49).material
    'PMMA'
    >>> Product("window", density=1.19)
    Traceback (most recent call last):
    ...
    ValueError: material must be named for a density or an index, got 1.19 g/cm^3 and index None
    """

    name: str = "lens"
    author: str = ""
    organization: str = ""
    material: str = ""
    density: float = 0.0
    index: float | None = None
    sides: tuple[str, str] = LENS_SIDES

    def __post_init__(self) -> None:
        from thbcad.checks import require_number  # loads numpy, which `require_line` does without

        for key in [field.name for field in fields(self) if field.type is str]:
            require_line(key, getattr(self, key))
        if not self.name:
            raise ValueError("name must not be empty")
        require_number("density", self.density, least=0.0, finite=True)
        object.__setattr__(self, "density", float(self.density))
        if self.index is not None:
            require_number("index", self.index, above=0.0, finite=True)
            object.__setattr__(self, "index", float(self.index))
        if not self.material and (self.density or self.index is not None):
            raise ValueError(
                f"material must be named for a density or an index, got {self.density:g} g/cm^3 and index "
                f"{self.index}"
            )

    def named(self, names: Sequence[str]) -> list[str]:
        """Return names of faces, those of its sides in place of front and rear."""
        own = dict(zip(LENS_SIDES, self.sides))
        return [own.get(name, name) for name in names]


def optical_places(names: Sequence[str]) -> tuple[int, int] | None:
    """Return where front and rear, or face and back of a mirror, are in names; None unless each is once."""
    for front, rear in (LENS_SIDES, MIRROR_SIDES):
        if names.count(front) == names.count(rear) == 1:
            return names.index(front), names.index(rear)
    return None


def require_line(key: str, text: object) -> None:
    """Raise ValueError unless the text is one line of at most 500 characters, none of them control characters
    or blanks at its ends."""
    if not isinstance(text, str):
        raise ValueError(f"{key} must be a string, got {type(text).__name__}")
    if text != text.strip():
        raise ValueError(f"{key} must not begin or end with a blank, got {text[:60]!r}")
    if len(text) > LONGEST:
        raise ValueError(f"{key} must have at most {LONGEST} characters, got {len(text)}")
    bad = [c for c in text if unicodedata.category(c) in FORBIDDEN]
    if bad:
        raise ValueError(
            f"{key} must be one line without control characters, got {bad[0]!r} in {text[:60]!r}"
        )


def face_colour(name: str) -> tuple[float, float, float]:
    """Return the colour of a face in CAD files and meshes by its name, sRGB from 0 to 1."""
    return COLOURS.get(name.partition(" ")[0], OTHER_COLOUR)


def one_line(text: str) -> str:
    """Return a text as `require_line` wants it: blanks for control characters and line breaks, cut at 500
    characters."""
    return " ".join("".join(" " if unicodedata.category(c) in FORBIDDEN else c for c in text).split())[
        :LONGEST
    ].rstrip()
