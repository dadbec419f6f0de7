"""Spline surfaces of many poles in STEP files.

OCCT takes 1.8 s to write 194 000 poles and to shorten their text.  So it writes the first span of such a
surface in its stead, and the whole takes its place in the text: 0.4 s.  All else of the file stays OCCT's.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import accumulate

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_BSplineSurface
from OCP.gp import gp_Pnt
from OCP.TopLoc import TopLoc_Location

from thbcad.cad.exchange.occt_texts import STRING, ShortestTexts
from thbcad.cad.shapes import Part, spline_surface
from thbcad.splines import BSplineSurface, KnotVector

MANY = 1000  # poles
FAR = 10**9  # mm: x of the first pole of what stands for the first surface, and so on
POINT = "=CARTESIAN_POINT('',("
REFERENCE = re.compile(rf"{STRING}|#(\d+)")
PER_LINE = 12  # references or knots


def shortened(part: Part) -> list[BSplineSurface]:
    """Leave of every long surface of a part its first span, and return the whole ones, in the order of faces.

    The first poles of the spans say which is which.
    """
    whole: list[BSplineSurface] = []
    for face in part.faces:
        place = TopLoc_Location()
        geom = BRep_Tool.Surface_s(face, place)
        if not (isinstance(geom, Geom_BSplineSurface) and place.IsIdentity() and _is_long(geom)):
            continue
        surface = spline_surface(geom)
        if isinstance(surface, BSplineSurface):
            geom.Segment(geom.UKnot(1), geom.UKnot(2), geom.VKnot(1), geom.VKnot(2))
            geom.SetPole(1, 1, gp_Pnt(FAR + len(whole), 0.0, 0.0))
            whole.append(surface)
    return whole


def _is_long(geom: Geom_BSplineSurface) -> bool:
    turns = geom.IsUClosed() or geom.IsVClosed() or geom.IsUPeriodic() or geom.IsVPeriodic()
    return not turns and geom.NbUPoles() * geom.NbVPoles() > MANY


def with_whole(text: str, surfaces: Sequence[BSplineSurface]) -> str:
    """Return the text of a shortened part with the whole surfaces in their places.

    Entities behind them have higher numbers.

    Raises RuntimeError : OCCT wrote other than one span for each.
    """
    spans = sorted(
        (_Span(text, k, surface) for k, surface in enumerate(surfaces)), key=lambda span: span.start
    )
    shifts = dict(zip((span.last for span in spans), accumulate(span.more for span in spans)))

    def renumbered(found: re.Match[str]) -> str:
        if found[1] is None:
            return found[0]
        number = int(found[1])
        return f"#{number + max((shift for last, shift in shifts.items() if last < number), default=0)}"

    known, parts, end = ShortestTexts(), [], 0
    for span, shift in zip(spans, [0, *shifts.values()]):
        parts += [REFERENCE.sub(renumbered, text[end : span.start]), span.whole(shift, known)]
        end = span.stop
    return "".join([*parts, REFERENCE.sub(renumbered, text[end:])])


class _Span:
    """What stands for a surface in the text, and where: its first span, with its points behind it."""

    def __init__(self, text: str, index: int, surface: BSplineSurface) -> None:
        first = re.findall(rf"^#(\d+){re.escape(POINT)}{FAR + index}\.,", text, re.MULTILINE)
        if len(first) != 1:
            raise RuntimeError(f"OCCT wrote {len(first)} surfaces for one")
        self._surface, self._number = surface, int(first[0]) - 1
        count = (surface.kv_u.degree + 1) * (surface.kv_v.degree + 1)
        # texts between quotes hold no line's end
        self.start = text.index(f"\n#{self._number}=B_SPLINE_SURFACE_WITH_KNOTS(") + 1
        self.stop = text.index("\n", text.index(f"\n#{self._number + count}{POINT}") + 1) + 1
        self.last, self.more = self._number + count, surface.kv_u.dim * surface.kv_v.dim - count

    def whole(self, shift: int, known: ShortestTexts) -> str:
        """Return the text of the whole surface, whose number grows by `shift`."""
        number, surface = self._number + shift, self._surface
        m, n = surface.kv_u.dim, surface.kv_v.dim
        names = [f"#{k}" for k in range(number + 1, number + 1 + m * n)]
        net = ",\n".join(_listed(names[k : k + n]) for k in range(0, m * n, n))
        knots = [_knots(kv, known) for kv in (surface.kv_u, surface.kv_v)]
        times, values = (",".join(texts) for texts in zip(*knots))
        degrees = f"{surface.kv_u.degree},{surface.kv_v.degree}"
        head = f"#{number}=B_SPLINE_SURFACE_WITH_KNOTS('',{degrees},(\n{net}),.UNSPECIFIED.,.F.,.F.,.F.,"
        reals = [[*map(known.__getitem__, c)] for c in surface.coefficients.reshape(-1, 3).T.tolist()]
        points = "".join(f"{name}{POINT}{x},{y},{z}));\n" for name, x, y, z in zip(names, *reals))
        return f"{head}{times},{values},.UNSPECIFIED.);\n{points}"


def _knots(kv: KnotVector, known: ShortestTexts) -> tuple[str, str]:
    """Return the multiplicities and the values of knots."""
    values, times = np.unique(kv.knots, return_counts=True)
    return _listed([*map(str, times.tolist())]), _listed([known[value] for value in values.tolist()])


def _listed(texts: Sequence[str]) -> str:
    lines = (",".join(texts[k : k + PER_LINE]) for k in range(0, len(texts), PER_LINE))
    return "(" + ",\n".join(lines) + ")"
