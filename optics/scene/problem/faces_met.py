"""The faces that light meets one after the other, as [[path]] names them, and whether light can go so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from optics.base.runtime import UserError
from optics.scene.keys import option
from optics.scene.problem.elements import MirrorElement, Placed
from optics.scene.problem.lens_schema import Optic

REFLECT = ":reflect"
MOST_FACES = 100  # that light meets: all are compiled into one program


@dataclass(frozen=True, kw_only=True)
class PathSpec:
    """The way of the light, as the table [[path]].

    >>> PathSpec(faces=("L1.front", "L1.rear:reflect", "L1.front", "M1")).faces[-1]
    'M1'
    """

    faces: tuple[str, ...] = option(
        note='in the order of the light, such as ["L1.front", "L1.rear", "M1"]; "L1.rear:reflect" is a '
        "reflection inside a lens"
    )


@dataclass(frozen=True)
class FaceMet:
    """A face that light meets.

    optic : whose it is.  face : "front" or "rear"; a mirror's is its front.
    reflects : the light goes on in the medium from which it came.
    backwards : the light goes to the -z of the element.
    """

    optic: Optic
    face: str
    reflects: bool = False
    backwards: bool = False

    @property
    def name(self) -> str:
        """What the path calls it, such as "L1.rear"; of the lens on the axis "rear"."""
        if isinstance(self.optic, Placed):
            return f"{self.optic.name}.{self.optic.face_name(self.face)}"
        return self.face

    @property
    def into_glass(self) -> bool:
        """Whether light is in the element's glass behind it."""
        inwards = (self.face == "front") != self.backwards
        return not isinstance(self.optic, MirrorElement) and inwards != self.reflects

    @property
    def share(self) -> float | None:
        """Of the light, what its mirror or coating sends on; None is bare glass, by Fresnel's law."""
        if isinstance(self.optic, MirrorElement):
            return self.optic.share
        through = self.optic.coats[self.face == "rear"]
        return 1 - through if self.reflects and through is not None else through


def faces_met(optics: Sequence[Optic], path: PathSpec | None) -> tuple[FaceMet, ...]:
    """Return the faces that light meets, in their order; without a path all elements one after the other.

    Raises UserError : names the face that light cannot meet there, or the element that it never meets.
    """
    if path is None:
        every = tuple(
            FaceMet(optic, face, isinstance(optic, MirrorElement))
            for optic in optics
            for face in (("front",) if isinstance(optic, MirrorElement) else ("front", "rear"))
        )
        _require_few(every)
        return every
    met: list[FaceMet] = []
    for k, word in enumerate(path.faces):
        face = _face(optics, f"path[0].faces[{k}]", word)
        _require_order(f"path[0].faces[{k}]", met, face)
        inside = bool(met) and met[-1].into_glass
        towards = met[-1].backwards != met[-1].reflects if inside else False
        met.append(FaceMet(face.optic, face.face, face.reflects, towards))
    if met[-1].into_glass:
        raise UserError(
            f'path[0].faces ends in the glass behind "{path.faces[-1]}"; add the face by which light leaves'
        )
    for optic in optics:
        if all(face.optic is not optic for face in met):
            raise UserError(f"path[0].faces meets no face of {optic.table}; add its faces, or leave it out")
    _require_free_once(met)
    _require_few(met)
    return tuple(met)


def _require_few(met: Sequence[FaceMet]) -> None:
    """Refuse more faces than can be compiled into one program within minutes."""
    if len(met) > MOST_FACES:
        raise UserError(
            f"light meets {len(met)} faces, and at most {MOST_FACES} are traced; leave elements out, or name "
            "fewer faces in [[path]]"
        )


def _face(optics: Sequence[Optic], key: str, word: str) -> FaceMet:
    """Return the face that a word of a path names, met forwards."""
    reflects = word.endswith(REFLECT)
    name, _, face = word.removesuffix(REFLECT).partition(".")
    known = {optic.name: optic for optic in optics if isinstance(optic, Placed)}
    if name not in known:
        raise UserError(f"{key} names {name!r}, but the elements are {', '.join(known)}; take one of them")
    optic = known[name]
    if isinstance(optic, MirrorElement):
        if face not in ("", "face"):
            raise UserError(f'{key} = "{word}": light meets the face of a mirror only; write "{name}"')
        return FaceMet(optic, "front", True)
    if face not in ("front", "rear"):
        raise UserError(f'{key} = "{word}" names no face of a lens; write "{name}.front" or "{name}.rear"')
    return FaceMet(optic, face, reflects)


def _require_order(key: str, met: Sequence[FaceMet], face: FaceMet) -> None:
    """Refuse a face that light cannot meet behind the last of `met`: it enters a lens by its front."""
    last = met[-1] if met else None
    if last is None or not last.into_glass:
        if face.face == "rear" and any(before.optic is face.optic for before in met):
            raise UserError(
                f'{key}: light that comes back into a lens by its rear, "{face.name}", is not followed; '
                "end the path before it, or lead the light past the lens"
            )
        if face.face == "rear" or (face.reflects and not isinstance(face.optic, MirrorElement)):
            raise UserError(
                f"{key}: light that comes through air enters a lens by its front, refracted; "
                f'write "{face.name.split(".")[0]}.front" there, or turn the lens round by its tilt'
            )
        return
    ahead = "front" if last.backwards != last.reflects else "rear"
    if face.optic is not last.optic or face.face != ahead:
        raise UserError(
            f'{key}: light in the glass behind "{last.name}" meets "{last.name.split(".")[0]}.{ahead}" next, '
            f'not "{face.name}"; add that face'
        )


def _require_free_once(met: Sequence[FaceMet]) -> None:
    """Refuse a free surface that light meets twice, or from within to its own -z."""
    for face in met:
        again = sum(f.optic is face.optic and f.face == face.face for f in met) > 1
        if face.face in face.optic.free and (again or face.backwards):
            other = "make the other surface of the lens the free one"
            if isinstance(face.optic, MirrorElement):
                other = "name it once, or set its freeform = false and free another element"
            how = "twice" if again else "from its +z"
            raise UserError(f'path[0].faces meets the free surface "{face.name}" {how}; {other}')
