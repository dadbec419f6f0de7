"""The text of a pack: what its files are, which way is up, how to bring it in, and what should come out."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from optics.exchange.packs.light_to_expect import ASIDE, Quantity
from optics.exchange.packs.programs import Program
from optics.scene.ray_files import RaySet
from optics.scene.system import OpticalSystem
from thbcad import __version__
from thbcad.lens import DenseGrid, Lens

WIDTH = 100
PLACES = 0.0, 0.5  # of the half-widths, at which heights are compared
HEIGHT_NEAR, VOLUME_NEAR = 1e-4, 1e-6  # mm; relative
UNTESTED = (
    "No version of this program was at hand when the pack was made: the steps below are from public "
    "knowledge, and nobody has tried them. Menus differ between versions. What the files hold was read back "
    "and compared with the exact surfaces."
)
MEASURED = "Fill in compare.csv: what you measured beside what was expected."
DRAWING = "drawing.svg"
WITHOUT_DRAWING = "A drawing is left out: it would show the lens without the body that leaves the mould."
FILES = {
    "lens.step": "the part as one solid, verified: the exact faces",
    DRAWING: "views, sections and dimensions",
    "lens.stl": "triangles, nowhere farther than {chord} mm from the part; not for tracing",
    "sag_front.dat": "regular table z, dz/dx, dz/dy, d2z/dxdy of the front (Zemax grid sag), from its vertex",
    "sag_rear.dat": "the same of the rear",
    "points_front.xyz": "x y z nx ny nz, mm, outward normals; {front}",
    "points_rear.xyz": "the same of the rear; {rear}",
    "ray_table.csv": "some 1e4 rays in double precision: start, direction, flux, and where each lands",
    "rays_source": "some 1e6 rays before the lens: the source",
    "rays_behind": "some 1e6 rays that leave the rear, for what stands behind; not to be traced with the "
    "lens",
    "irradiance.npz": "light expected and light asked for, with axes (numpy)",
    "irradiance.csv": "the light expected, {shown}: first row u of the columns, first column v of the rows",
    "irradiance.png": "the same, 16 bits, linear",
    "compare.csv": "the table below to fill in",
}


def geometry_quantities(system: OpticalSystem, lens: Lens) -> list[Quantity]:
    """Return what a program that holds the part may measure of it."""
    volume = system.made(lens).volume()
    rows = [Quantity("volume", "mm^3", volume, None, VOLUME_NEAR * volume)]
    for name, surface, vertex in (("front", lens.front, 0.0), ("rear", lens.rear, lens.thickness)):
        for a, b in product(PLACES, PLACES):
            x, y = a * surface.half_width[0], b * surface.half_width[1]
            z = vertex + float(surface(x, y))
            rows.append(Quantity(f"z of the {name} at x = {x:g}; y = {y:g}", "mm", z, None, HEIGHT_NEAR))
    return rows


def table_text(rows: Iterable[Quantity]) -> bytes:
    """Return the table to fill in, CSV."""
    lines = ["quantity,unit,of the lens,by the rays of this pack,within,found"]
    lines += [
        f"{r.name},{r.unit},{r.value:.9g},{'' if r.by_rays is None else f'{r.by_rays:.9g}'},{r.within:.3g},"
        for r in rows
    ]
    return ("\n".join(lines) + "\n").encode()


@dataclass(frozen=True, eq=False)
class Told:
    """What a README tells of.

    verdict : of the result, a sentence.  paths : "all" or "sequential", by which its light was measured.
    chord : mm, of the mesh.  grids : of the points of front and rear.  rows : the numbers to compare.
    rays : before the lens, as their file holds them; None in a pack without light.
    """

    system: OpticalSystem
    lens: Lens
    program: Program
    verdict: str
    paths: str
    chord: float
    grids: Mapping[str, DenseGrid]
    rows: Sequence[Quantity]
    rays: RaySet | None

    def readme(self, names: Iterable[str]) -> bytes:
        """Return README.txt.  names : of the other files."""
        facts = {
            "index": f"{self.lens.index:.9g}",
            "wavelength": f"{self.system.problem.source.wavelength:g} nm",
            "shown": self.system.density.shown,
            "chord": f"{self.chord:g}",
        } | {word: _grid_words(grid) for word, grid in self.grids.items()}
        files = {name: FILES[_kind(name)].format(**facts) for name in names}
        blocks = [
            f"{self.system.problem.title or 'Lens'}: for {self.program.name}",
            f"Made by thbcad {__version__} of a finished result. "
            f"{self.verdict[:1].upper()}{self.verdict[1:]}.",
            *([UNTESTED] if self.program.traces else []),
            "FILES",
            "\n".join(_hanging(name, words) for name, words in files.items()),
            *([] if DRAWING in files else [WITHOUT_DRAWING]),
            "FRAME AND UNITS",
            *_frame(self.lens),
            *([] if self.rays is None else ["SOURCE AND SCREEN", *_light(self.system, self.lens, self.rays)]),
            "STEPS",
            *(f"{k}. {step.format(**facts)}" for k, step in enumerate(self.program.steps, 1)),
            "WHAT SHOULD COME OUT",
            *(self._light_to_expect() if self.rays is not None else [MEASURED]),
            "\n".join(_table(self.rows)),
        ]
        filled = (block if "\n" in block else textwrap.fill(block, WIDTH) for block in blocks)
        return ("\n\n".join(filled) + "\n").encode()

    def _light_to_expect(self) -> Iterator[str]:
        ways = "all ways" if self.paths == "all" else "front and rear"
        yield (
            f'Fill in compare.csv. "of the lens" is its light by {ways}, without noise. "by the rays" is '
            "what "
            "the rays of rays_source make by front and rear, each in the pixel where it lands: compare with "
            "that "
            'column. "within" is by how much it changes where all landing points are off by '
            f"{ASIDE:g} of a pixel. Rays of your own add noise: N at random on P pixels about sqrt(P / N) to "
            "rel_l2. ray_table.csv has landing points of single rays."
        )
        if self.paths == "all":
            yield (
                "Light by edges, or reflected inside, reaches the screen too. A non-sequential trace finds "
                'it as well: its efficiency lies between the columns, or at "of the lens" where rays split.'
            )
        unit = self.system.units.flux
        yield (
            f"efficiency = flux on the screen / {self.system.problem.flux:.6g} {unit}. rel_l2 = ||E - T|| / "
            "||T|| of the light E and the light asked for T on all pixels, each divided by its mean. U0 = "
            "least / mean over the boxes of a grid. The peak is the brightest pixel."
        )


def _hanging(name: str, words: str) -> str:
    return textwrap.fill(words, WIDTH, initial_indent=f"  {name:<19}  ", subsequent_indent=" " * 23)


def _kind(name: str) -> str:
    """Return the key of a file in FILES."""
    return name if name in FILES else name.partition(".")[0]


def _grid_words(grid: DenseGrid) -> str:
    steps = np.concatenate([np.diff(grid.x), np.diff(grid.y)])
    return (
        f"{len(grid.x)} x {len(grid.y)} points, {steps.min():.4g} to {steps.max():.4g} mm apart, all knots "
        f"among them: between them linear interpolation errs by at most {1e3 * grid.linear:.3g} um, Coons "
        f"patches (cubic sides by heights and normals) by at most {1e6 * grid.cubic:.3g} nm, proven"
    )


def _frame(lens: Lens) -> Iterator[str]:
    (a, b), (c, d) = lens.front.half_width, lens.rear.half_width
    yield (
        "All lengths are in mm, in one right-handed frame: the front's vertex is the origin, z is the "
        f"optical axis, light travels to +z, the rear's vertex lies at z = {lens.thickness:.9g}. +y is up. "
        "Seen from behind the lens, against the light, +x is to the right."
    )
    round_it = "" if lens.rear.outline.is_rectangle else " of which the outline leaves out the corners"
    yield (
        f"The front fills |x| <= {a:.9g}, |y| <= {b:.9g}, the rear |x| <= {c:.9g}, |y| <= {d:.9g}{round_it}. "
        "Tables and points go over the whole rectangles."
    )


def _light(system: OpticalSystem, lens: Lens, rays: RaySet) -> Iterator[str]:
    """Yield paragraphs about source, faces and screen."""
    source, screen, receiver = system.problem.source, system.target.screen(), system.target.receiver
    place = "a beam along +z" if system.source.from_afar else f"at z = {-source.distance:.9g}"
    kind = "several, which lie where rays start" if system.source.several else f"{source.kind}, {place}"
    lines = len(system.wavelengths)
    spectrum = f" The lens was measured in light of {lines} wavelengths, these rays have one." * (lines > 1)
    yield (
        f"Source: {kind}, {system.problem.flux:.6g} {rays.unit} at {source.wavelength:g} nm. rays_source "
        f"holds {len(rays)} rays with {rays.total:.9g} {rays.unit}; the rest passes beside the "
        f"lens.{spectrum}"
    )
    absorbs = [m.absorption for m in system.path(lens).media]
    coats = [s.share for s in system.path(lens).surfaces]
    losses = [
        "Fresnel's for unpolarised light" if share is None else f"a coating that lets {share:.6g} through"
        for share in coats
    ]
    yield (
        f"Lens: index {lens.index:.9g} at {source.wavelength:g} nm, absorption {max(absorbs):.6g} per mm. "
        f"Losses at the front: {losses[0]}; at the rear: {losses[1]}. Light by front and rear alone counts "
        "in the rays."
    )
    (hu, hv), (columns, rows) = screen.half_width, screen.pixels
    where = receiver.normal if screen.angular else receiver.points
    middle, left, below = (_vector(where(u, v)) for u, v in ((0.0, 0.0), (-hu, hv), (hu, -hv)))
    what = "a plane"
    if screen.angular:
        what = "directions of the far field, u = atan(l / n), v = atan(m / n) seen along its middle"
    kind = "direction" if screen.angular else "corner at"
    yield (
        f"Screen: {what}; |u| <= {hu:.9g}, |v| <= {hv:.9g} {screen.unit}, {columns} x {rows} pixels. Its "
        f"middle is {middle}. Row 0 of irradiance.csv lies at +v and column 0 at -u: the {kind} {left} is "
        f"first, the {kind} {below} last. Light goes through it along its normal "
        f"{_vector(receiver.normal(0.0, 0.0))}."
    )


def _vector(numbers: Sequence[float]) -> str:
    return f"({', '.join(f'{float(n) + 0.0:.9g}' for n in numbers)})"


def _table(rows: Iterable[Quantity]) -> Iterator[str]:
    yield f"  {'quantity':<36} {'unit':<8} {'of the lens':>14} {'by the rays':>14} {'within':>10}   found"
    for r in rows:
        by_rays = "" if r.by_rays is None else f"{r.by_rays:.7g}"
        yield f"  {r.name:<36} {r.unit:<8} {r.value:>14.7g} {by_rays:>14} {r.within:>10.2g}   ________"
