"""The lenses of the gallery: over all sources and targets, each from a problem file of examples/."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Shown:
    """A lens of the gallery.

    problem : file below examples/.  source, target, free : words for the table.
    words : what the lens is for, as sentences.
    body : options of `thbcad export` that give the lens another outline, which the picture then shows.
    """

    name: str
    title: str
    problem: str
    source: str
    target: str
    free: str
    words: str
    body: tuple[str, ...] = ()


LENSES = (
    Shown(
        "pearl",
        "Girl with a Pearl Earring",
        "pearl.toml",
        "parallel beam",
        "picture",
        "rear",
        "The painting is by J. Vermeer (c. 1665, public domain). The lens is 100 mm wide.",
    ),
    Shown(
        "hobby",
        "A photograph",
        "others/hobby.toml",
        "parallel beam",
        "photograph",
        "rear",
        "An astronaut (NASA, public domain) through 8 inches of acrylic. "
        "[Cases of others](others.md) compares it with a hobbyist's lens.",
    ),
    Shown(
        "text",
        "Letters on black",
        "others/text_near.toml",
        "parallel beam",
        "text on black",
        "rear",
        "A lens of 4 mm writes three letters. A smooth surface leaves faint light where black is wanted. "
        "[Cases of others](others.md) compares it with published work.",
    ),
    Shown(
        "point",
        "A picture from a point source",
        "point.toml",
        "point, 30 degrees",
        "picture",
        "rear",
        "A small lamp at 60 mm in place of the beam: its rays spread in the lens too.",
    ),
    Shown(
        "flower",
        "A flower in the sun",
        "flower.toml",
        "sun",
        "formula",
        "rear",
        "The target is a formula of one line. The sun blurs every edge, and the design takes account of it.",
    ),
    Shown(
        "two_pictures",
        "One picture into another",
        "two_pictures.toml",
        "beam that carries a picture",
        "another picture",
        "rear",
        "The beam carries the photograph above. The lens turns it into the painting.",
    ),
    Shown(
        "tophat_square",
        "Square beam, square top hat",
        "tophat_square.toml",
        "parallel beam, square",
        "uniform square",
        "rear",
        "The beam of a laser or a collimator becomes larger and stays uniform.",
    ),
    Shown(
        "tophat_circle",
        "Round beam, round top hat",
        "tophat_circle.toml",
        "parallel beam, round",
        "uniform disk",
        "rear",
        "A round beam becomes a larger disk. `--aperture` cuts the lens to an outline of 98 mm.",
        ("--aperture", "49", "49"),
    ),
    Shown(
        "disk",
        "Square beam, round top hat",
        "disk.toml",
        "parallel beam, square",
        "uniform disk",
        "rear",
        "A square beam becomes a disk. Detail is needed near the corners of the lens only, and the mesh is "
        "refined there ([local refinement](method.md)).",
    ),
    Shown(
        "far_field",
        "A square of angles",
        "far_field.toml",
        "parallel beam",
        "square of angles, far field",
        "rear",
        "Uniform intensity within 30 x 30 degrees. `--mount` adds a plate with four holes for screws "
        "([mounts](parts.md)).",
        ("--mount", "examples/mounts/wall_washer.toml"),
    ),
    Shown(
        "white_square",
        "White light through PMMA",
        "white_square.toml",
        "white LED, collimated",
        "uniform square, in colour",
        "rear",
        "PMMA bends blue light more than red light. The picture shows the colours that remain at the edge.",
    ),
    Shown(
        "flat_square",
        "Gaussian beam, square top hat",
        "others/flat_square.toml",
        "Gaussian beam",
        "uniform square",
        "front",
        "The front is free and the rear is flat. [Cases of others](others.md) compares it with diffinytrace.",
    ),
    Shown(
        "extended",
        "A curved region from an LED",
        "extended.toml",
        "LED of 1 mm, 2 mm away",
        "curved uniform region",
        "rear",
        "The source is as large as a tenth of the front, and no lens can make a sharp edge of it "
        "([etendue](etendue.md)).",
    ),
    Shown(
        "street",
        "A road lamp",
        "street.toml",
        "LED of 1 mm, 2 mm away",
        "uniform road, 24 m x 8 m",
        "front and rear",
        "A lamp on a pole of 8 m. Both surfaces are free, and the light has two wings along the road. "
        "Its result can be [opened](result/report.html).",
    ),
    Shown(
        "lamp",
        "The lamp of an IES file",
        "lamp.toml",
        "luminaire (IES file)",
        "uniform ellipse",
        "front and rear",
        "The source is a file with the intensity of a lamp, as makers publish it "
        "([luminaires](luminaires.md)).",
    ),
    Shown(
        "mirror",
        "A mirror",
        "mirror.toml",
        "parallel beam",
        "picture",
        "face of a mirror",
        "The same painting, by a mirror at 45 degrees to the beam.",
    ),
    Shown(
        "spot",
        "A round lens",
        "spot.toml",
        "point, 40 degrees",
        "uniform disk",
        "rear",
        "A lens of 60 mm that a mould makes: light beside its outline is lost, also while designing.",
    ),
    Shown(
        "wall_washer",
        "A wall washer",
        "wall_washer.toml",
        "point, 35 degrees",
        "uniform wall, 1.2 m x 2 m",
        "rear",
        "A lamp in the ceiling lights a wall evenly, whose foot is three times as far away as its top.",
    ),
    Shown(
        "four_leds",
        "Four LEDs",
        "four_leds.toml",
        "four LEDs of 2 mm",
        "uniform square",
        "rear",
        "The light of all is added, and one surface makes it uniform.",
    ),
    Shown(
        "street_plate",
        "A plate of lenses",
        "street_plate.toml",
        "twelve LEDs of 1.5 mm",
        "126 x 60 degrees, far field",
        "rear",
        "2 x 6 lenses are one solid. Light that leaves by a neighbour's faces is traced.",
    ),
    Shown(
        "headlamp_led",
        "A headlamp",
        "headlamp_led.toml",
        "LED of 2 mm",
        "upper beam, FMVSS 108",
        "rear",
        "No picture, but a table: all of its 19 rows are kept by 29 %.",
    ),
)
