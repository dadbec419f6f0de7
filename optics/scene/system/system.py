"""A problem and the shape of every element."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import islice, product
from math import inf
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from optics.base.runtime import Backend, UserError, load_backend
from optics.scene.paths import LightPath, Stop
from optics.scene.photometry import Density
from optics.scene.problem import Optic, Problem
from optics.scene.receivers import Receiver
from optics.scene.sources import LightSource, RayGrid, Rays
from optics.scene.system.elements import base_lens, clear_aperture_of, surface_of
from optics.scene.system.lens_material import Wavelength, wavelengths_of, with_material
from optics.scene.system.made_bodies import bodies_of, made_of, possible, whole_of
from optics.scene.system.prescribed import Prescribed, shared
from optics.scene.system.source import Own, source_of
from optics.scene.system.stops import stops_of
from optics.scene.system.target import LightTarget, receiver_of
from optics.scene.system.tracing_skips import Skip, skips
from thbcad.checks import Floats
from thbcad.lens import FreeformSurface, Lens
from thbcad.outlines import Outline
from thbcad.poses import Pose
from thbcad.surfaces import THBSurface

if TYPE_CHECKING:
    from thbcad.moulds import Made, Solid


@dataclass(frozen=True, eq=False)
class System(Prescribed):
    """A problem and the shape of every element: an immutable value.

    Sources, wavelengths and targets are tuples; a problem file names one source and one target today.
    `problem` is the one given, with numbers for what it leaves to the material of the lens.

    aim : what the light of a sharp system is to be that stands for a blurred one, or that of one lens of a
        plate, see `blur.aimed`; None of other systems.
    own : a script's own source and receiver, in place of those that the problem describes.
    shapes : lenses or blanks by the names of their elements; an element without one is as prescribed.

    Raises UserError : nothing is known of the material.
    """

    aim: LightTarget | None = None
    own: Own = Own()
    shapes: Mapping[str, Lens] = field(default_factory=dict)

    def __post_init__(self, known: dict[str, Any] | None) -> None:
        super().__post_init__(known)
        object.__setattr__(self, "problem", with_material(self.problem))

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (type(self), self.problem, self.aim, self.own, self.shapes)

    def _with(self, **changes: Any) -> Self:
        """Return the system with other fields, of the same class, which may have another constructor."""
        other, own = object.__new__(type(self)), (f.name for f in fields(System) if f.init)
        System.__init__(other, **{name: getattr(self, name) for name in own} | changes)
        return other

    # ---- shapes ----

    @shared
    def base(self) -> Lens:
        """The designed element before optimisation: sags of zeros on the level-0 meshes.

        Raises UserError : the prescription makes no lens.
        """
        return base_lens(self.problem.optic)

    @property
    def designed(self) -> Lens:
        """The lens, or the blank of a mirror, that is designed; `base` until it has another shape."""
        return self.shapes.get(self.problem.optic.called) or self.base

    @shared
    def _prescribed_others(self) -> tuple[tuple[Optic, Lens], ...]:
        """The other elements as prescribed."""
        return tuple(
            (optic, base_lens(optic)) for optic in self.problem.optics if optic is not self.problem.optic
        )

    @property
    def elements(self) -> tuple[tuple[Optic, Lens], ...]:
        """All elements with their lenses or blanks, the designed one first.

        Raises UserError : a prescription makes no lens.
        """
        others = ((optic, self.shapes.get(optic.called) or lens) for optic, lens in self._prescribed_others)
        return (self.problem.optic, self.designed), *others

    @property
    def others(self) -> tuple[tuple[Optic, Lens], ...]:
        """The elements that are not designed, or have their shapes already, with their lenses or blanks."""
        return self.elements[1:]

    @property
    def free_elements(self) -> tuple[tuple[Optic, Lens], ...]:
        """The elements with free surfaces in the order of the light; the designed one is the last."""
        lenses = {optic.called: shape for optic, shape in self.elements}
        return tuple((optic, lenses[optic.called]) for optic in self.problem.free_optics)

    @property
    def free_others(self) -> tuple[tuple[Optic, Lens], ...]:
        """The elements with free surfaces before the designed one, in the order of the light."""
        return self.free_elements[:-1]

    @property
    def free_surfaces(self) -> list[FreeformSurface]:
        """The free surfaces of all elements in the order of the light."""
        return [surface for _, shape in self.free_elements for surface in shape.free_surfaces]

    @property
    def sags(self) -> tuple[THBSurface, ...]:
        """The sags of all elements in the order of the light, as `LightPath.sags`."""
        return tuple(sag for _, shape in self.free_elements for sag in shape.sags)

    def with_lens(self, lens: Lens) -> Self:
        """Return the system with another shape of the designed element."""
        return self.with_shapes({**self.shapes, self.problem.optic.called: lens})

    def with_sags(self, sags: Sequence[THBSurface]) -> Self:
        """Return the system with other sags of all free elements.

        Raises ValueError : too few or too many sags.
        """
        rest, shapes = iter(sags), dict(self.shapes)
        for optic, shape in self.free_elements:
            shapes[optic.called] = shape.with_sags([*islice(rest, len(shape.sags))])
        return self.with_shapes(shapes)

    def with_shapes(self, shapes: Mapping[str, Lens]) -> Self:
        """Return the system with only these shapes; `shared` properties keep their values."""
        return self._with(shapes=shapes, known=self.computed)

    @property
    def unshaped(self) -> Self:
        """The system with every element as prescribed."""
        return self.with_shapes({}) if self.shapes else self

    @property
    def backend(self) -> Backend:
        """Dr.Jit in double precision, on as many threads as the problem asks for.

        Threads belong to the process, and other work sets them: so they are set whenever this is asked for,
        which takes less than 0.1 ms.

        Raises ImportError, UserError, MemoryError : as `load_backend`.
        """
        return load_backend("double", self.problem.run.threads)

    @property
    def design_backend(self) -> Backend:
        """The same in the precision in which the problem asks to design."""
        precision = "single" if self.problem.run.precision == "single" else "double"
        return load_backend(precision, self.problem.run.threads)

    @property
    def axial(self) -> bool:
        """Whether it is a lens on the axis before a target across it, or before the far field around it."""
        return not self.problem.element and self.target.receiver.across_axis

    def held(self, path: LightPath, clear: tuple[Outline, Outline]) -> LightPath:
        """Return a path of which a holder of the designed element leaves these of front and rear free."""
        return path.held({k: clear[face.face == "rear"] for k, face in self.own_faces.items()})

    @property
    def own_path(self) -> LightPath:
        """The path in the frame of the designed element."""
        return self.path.seen_from(self.pose)

    def own_rays(self, rays: Rays | RayGrid) -> Rays:
        """Return single rays in the frame of the designed element; those of a grid start well before it."""
        single = rays.rays(self.path.before)
        return single.posed(self.pose.inverse())

    @property
    def clear_aperture(self) -> tuple[Outline, Outline] | None:
        """The parts of the designed front and rear that a holder leaves free; None is all."""
        return clear_aperture_of(self.problem.optic, self.designed)

    @property
    def density(self) -> Density:
        """The units of the light on the target."""
        return self.units.density(self.target.far_field)

    @property
    def shapes_parallel(self) -> bool:
        """Whether parallel light meets the surface that a transport map shapes."""
        return self.parallel or (self.shaped == "front" and self.source.collimated)

    @property
    def blurred(self) -> bool:
        """Whether the light is that of a source without extent, blurred: by divergence, or rough surfaces."""
        return self.source.diverging or (any(self.slope_rms) and not self.source.extended)

    @property
    def shaping(self) -> Self:
        """The system whose light a design traces: what blurs or displaces it is a convolution."""
        return self.sharp if self.blurred or (self.displaced and self.aim is None) else self

    @property
    def sharp(self) -> Self:
        """The system without the divergence of its beam and without roughness.

        Where it stands for a blurred one, or for the lenses of a plate, it aims at the target itself, as long
        as nothing is known of the blur.
        """
        return self._sharp.with_shapes(self.shapes)

    @shared
    def _sharp(self) -> Self:
        if not self.blurred:
            return self.with_prescription(aim=self.target if self.displaced else None)
        optic, source = self.problem.optic, self.problem.source
        smooth = {name: replace(getattr(optic, name), slope_rms=0.0) for name in ("front", "rear")}
        if self.source.diverging:
            source = replace(source, divergence=0.0, divergence_profile="uniform")
        problem = replace(self.problem.with_optic(**smooth), source=source)
        return self.with_prescription(problem=problem, aim=self.target)

    @shared
    def sources(self) -> tuple[LightSource, ...]:
        return (self.own.source or source_of(self.problem),)

    @shared
    def wavelengths(self) -> tuple[Wavelength, ...]:
        """At which light is measured: the lines of the spectrum, or the source's own wavelength.

        Raises UserError : the index or the absorption of the lens is not known at one of them.
        """
        return wavelengths_of(self.problem)

    @shared
    def targets(self) -> tuple[LightTarget, ...]:
        target = self.problem.target
        receiver = self.own.receiver or receiver_of(target, self.problem.optic.thickness)
        return (LightTarget(target, receiver, self.passing if target.kind == "zones" else 1.0),)

    @shared
    def stops(self) -> tuple[Stop, ...]:
        """What blocks light beside the lens, in the frame of its front vertex."""
        return stops_of(self.problem)

    @property
    def solid(self) -> Solid:
        """The solid of one lens: the lens itself, or a body as `moulded`, which also raises."""
        return made_of(self.problem.optic, self.designed)

    def as_possible(self) -> tuple[Self, str]:
        """Return the system with the body that its lens can have, and why it has not the whole one, as
        `possible`."""
        problem, unfit = possible(self.problem, self.designed)
        return self.with_prescription(problem=problem) if unfit else self, unfit

    @property
    def made(self) -> Made:
        """The solid of its file: as `solid`, or a plate with as many of them as it has."""
        return whole_of(self.problem.optic, self.designed)

    @property
    def source(self) -> LightSource:
        """The source, where there is one."""
        (source,) = self.sources
        return source

    @property
    def target(self) -> LightTarget:
        """The target, where there is one."""
        (target,) = self.targets
        return target

    @property
    def goal(self) -> LightTarget:
        """What transport, and the first of two stages of a blurred system, shape light to."""
        return self.aim or self.target

    def with_prescription(self, **changes: Any) -> Self:
        """Return the system with another problem, aim or own source and receiver; shapes stay."""
        return self._with(**changes)

    def elsewhere(self, problem: Problem) -> Self:
        """Return the system of a problem that differs in where things lie; lens and picture are not made
        again."""
        other = self._with(problem=problem, known={"base": self.base})
        return other.with_target(replace(other.target, given=self.target.light))

    def with_target(self, target: LightTarget) -> Self:
        """Return the system with another target than the problem describes."""
        return self._with(known={**self.computed, "targets": (target,)})

    @property
    def paths(self) -> tuple[LightPath, ...]:
        """The paths of the source's own wavelength over all elements, one to each target.

        The designed element may have whatever shape and index.
        """
        faces, media = self.problem.faces_met, [*self.media_at(self.problem.source.wavelength)]
        lenses = {id(optic): blank for optic, blank in self.elements}
        for k, face in enumerate(faces, 1):
            if face.into_glass:
                media[k] = replace(media[k], index=lenses[id(face.optic)].index)
        surfaces = [surface_of(face, lenses[id(face.optic)]) for face in faces]
        black = self.problem.optic.wall == "absorbing"
        return tuple(
            LightPath(
                tuple(surfaces), tuple(media), target.receiver, stops=self.stops, absorbing_wall=black
            ).named(self.problem.surface_names)
            for target in self.targets
        )

    @property
    def path(self) -> LightPath:
        """The path of the light, where there is one."""
        (path,) = self.paths
        return path

    @property
    def shaded_path(self) -> LightPath:
        """The path among the bodies of all elements and a plane screen.

        A lens on the axis before a target across it has none in the way.
        """
        return self.path if self.axial else self.crowded_path

    @property
    def crowded_path(self) -> LightPath:
        """The path among all bodies, also where its own light cannot meet any."""
        bodies = bodies_of(self.problem.faces_met, self.elements, self.target)
        emitted = -self.problem.source.distance if self.source.from_afar else -inf
        return replace(self.path, bodies=bodies, emitted=emitted)

    @shared
    def parallel(self) -> bool:
        """Whether rays stay parallel to z up to the rear: a collimated source before a plane front."""
        return self.lens_on_axis and self.source.collimated and self.base.front.is_plane

    @property
    def by_edges(self) -> bool:
        """Whether light may reach the target by other ways than through front and rear.

        Light that is parallel up to the rear meets no edge of a lens, but may meet the walls of a body.
        """
        return self.all_ways and not (self.parallel and self.body is None)

    @property
    def all_ways(self) -> bool:
        """Whether light can be followed by all ways: of a lens alone.

        Light by other ways through a plate is not that of one lens, shifted.
        """
        return self.lone_lens and self.problem.optic.array is None

    @property
    def with_all_sources(self) -> Self:
        """The system whose source has the flux of all sources of a plate, which lie behind like lenses.

        Raises UserError : a plate behind a source of a script.
        """
        array, source = self.problem.optic.array, self.problem.source
        if array is None:
            return self
        if self.own.source is not None:
            raise UserError(
                "lens.array repeats the source of the problem, and this one is a script's; leave it out"
            )
        return self.elsewhere(replace(self.problem, source=replace(source, flux=array.count * source.flux)))

    @property
    def columns_and_rows(self) -> tuple[Floats, Floats]:
        """Where the columns and the rows of a plate stand, mm from its middle, as far as its target tells.

        One lens, and a plate before the far field, have one of each.
        """
        array = self.problem.optic.array
        if array is None or self.target.far_field:
            return np.zeros(1), np.zeros(1)
        counts, pitches = (array.columns, array.rows), array.pitches
        x, y = (np.asarray(p * (np.arange(n) - (n - 1) / 2), np.float64) for n, p in zip(counts, pitches))
        return x, y

    @property
    def displaced(self) -> bool:
        """Whether the light is that of several lenses, whose pictures lie in several places."""
        return any(places.size > 1 for places in self.columns_and_rows)

    @property
    def seen_receivers(self) -> tuple[Receiver, ...]:
        """The receiver as every lens of a plate sees it, whose middle faces that of the target."""
        places = product(*self.columns_and_rows)
        return tuple(self.target.receiver.seen_from(Pose.at((x, y, 0.0))) for x, y in places)

    @shared
    def skips(self) -> tuple[Skip, ...]:
        """What tracing leaves out."""
        return tuple(skips(self.problem, self.source, self.parallel))


def _restored(kind: type[System], *values: Any) -> System:
    """Return a system of a class from the fields that are pickled."""
    system = object.__new__(kind)
    System.__init__(system, *values)
    return system
