"""Light through the solid of a STEP file by OCCT's intersections with its faces: all branches, and what goes
through front and rear alone."""

from __future__ import annotations

import re
from functools import lru_cache

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt, gp_Vec
from OCP.IntCurvesFace import IntCurvesFace_ShapeIntersector
from OCP.TopAbs import TopAbs_FACE
from OCP.TopExp import TopExp

from optics.light.tracing import FATES
from oracles.polarised_faces import split_fields, unpolarised
from thbcad.cad.exchange import first_hit, read_step
from thbcad.cad.occt_names import ShapeNumbers, as_face

# of fates, by the face that light left last; else "edges_"
PREFIX = {"front": "front_", "rear": "", "neighbour": "neighbours_"}
OTHER_LENS = re.compile(r"^(front|rear) \d+$")  # of a plate
LEAVES = 1e-6  # mm along a ray, where it has left its own face
NEWTON = 3  # steps after OCCT's search, which meets splines within 1e-9 mm


class FileFaces:
    """The faces of the solid in a STEP file, as OCCT reads them."""

    def __init__(self, path):
        solid = read_step(path)
        self._names = [OTHER_LENS.sub("neighbour", name).split(" ")[0] for name in solid.face_names]
        self._numbers, self._intersector = ShapeNumbers(), IntCurvesFace_ShapeIntersector()
        TopExp.MapShapes_s(solid.shape, TopAbs_FACE, self._numbers)
        keys = map(self._numbers.FindKey, range(1, self._numbers.Extent() + 1))
        self._surfaces = [BRep_Tool.Surface_s(as_face(key)) for key in keys]
        self._intersector.Load(solid.shape, 1e-7)

    def meet(self, origins, directions):
        """Return points and unit normals, (n, 3), where rays first meet a face, and its name's first word, ""
        for none."""
        points, normals = origins.copy(), np.full(origins.shape, [0.0, 0.0, 1.0])
        names, search = np.full(len(origins), "", dtype="<U9"), self._intersector
        met, surfaces, places = [], [], []
        for k, (o, d) in enumerate(zip(origins.tolist(), directions.tolist())):
            if first := first_hit(search, gp_Lin(gp_Pnt(*o), gp_Dir(*d)), LEAVES):
                number = self._numbers.FindIndex(search.Face(first)) - 1
                names[k] = self._names[number]
                met.append(k)
                surfaces.append(self._surfaces[number])
                places.append([search.UParameter(first), search.VParameter(first), search.WParameter(first)])
        if met:
            o, d, place = origins[met], directions[met], np.array(places)
            for _ in range(NEWTON):  # S(u, v) = o + t d
                s, by_u, by_v = jets(surfaces, place)
                off = s - o - place[:, 2:] * d
                place -= np.linalg.solve(np.stack([by_u, by_v, -d], axis=-1), off[..., None])[..., 0]
            points[met], by_u, by_v = jets(surfaces, place)
            normals[met] = np.cross(by_u, by_v)
        return points, normals / np.linalg.norm(normals, axis=1, keepdims=True), names


@lru_cache(maxsize=1)
def faces_of(path, changed):
    """Return the faces of a file, read once.  changed : when, in nanoseconds."""
    return FileFaces(path)


def jets(surfaces, places):
    """Return S, S_u and S_v of a surface at each place, (n, 3) each."""
    point, by_u, by_v = gp_Pnt(), gp_Vec(), gp_Vec()
    out = np.empty((3, len(places), 3))
    for k, (surface, (u, v, _)) in enumerate(zip(surfaces, places.tolist())):
        surface.D1(u, v, point, by_u, by_v)
        out[:, k] = point.Coord(), by_u.Coord(), by_v.Coord()
    return out


def file_branches(path, rays, index, target, threshold, absorbing=(), clear=None):
    """Return the flux of every ray by fate, (len(FATES), n), and x, y, flux and ray of branches in the target
    plane, (4, k).

    path : of the STEP file.  target : as of `trace_nonsequential`, whose receiver is a plane across z.
    absorbing : the first words of names of faces at which light is blocked.
    clear : by name of a face, the radius about the axis that a holder leaves free; light beside is blocked.
    """
    faces = faces_of(path, path.stat().st_mtime_ns)
    by_ray, landings = np.zeros((len(FATES), len(rays.flux))), []

    def account(ray, flux, fates):
        np.add.at(by_ray, ([FATES.index(fate) for fate in fates], ray), flux)

    o, d, flux, ray = rays.origin.T, rays.direction.T, rays.flux, np.arange(len(rays.flux))
    inside, left = np.zeros(len(ray), dtype=bool), np.full(len(ray), "none", dtype="<U9")
    fields = unpolarised(d)
    for _ in range(65):
        point, normal, met = faces.meet(o, d)
        gone = met == ""
        z = target.receiver.pose.shift[2]
        t = (z - o[gone, 2]) / d[gone, 2]
        there = (o[gone] + t[:, None] * d[gone])[:, :2]
        on = (abs(there) <= target.half_width).all(axis=1)
        forward = (d[gone, 2] > 0) & (t >= 0)
        fates = [
            "failed" if inner else escape(out, ahead, onto)
            for inner, out, ahead, onto in zip(inside[gone], left[gone], forward, on)
        ]
        account(ray[gone], flux[gone], fates)
        through = np.array([fate.endswith("_target") for fate in fates], dtype=bool)
        landings.append(np.vstack([there[through].T, flux[gone][through], ray[gone][through]]))
        dark = ~gone & (np.isin(met, absorbing) | beside(point, met, clear))
        account(ray[dark], flux[dark], ["blocked"] * int(dark.sum()))
        on = ~(gone | dark)
        if not on.any():
            return by_ray, np.hstack(landings)
        point, normal, met = point[on], normal[on], met[on]
        d, flux, ray, inside, left, fields = (a[on] for a in (d, flux, ray, inside, left, fields))
        eta = np.where(inside, index, 1 / index)
        (onward, passing, passed), (mirrored, staying) = split_fields(fields, d, towards(d, normal), eta)
        first = np.where(inside, met, left), np.where(~inside & (left == "none"), "outside", left)
        o, d = np.concatenate([point, point]), np.concatenate([onward, mirrored])
        fields = np.concatenate([passing, staying])
        flux = np.concatenate([flux * passed, flux * (1 - passed)])
        ray, inside, left = np.tile(ray, 2), np.concatenate([~inside, inside]), np.concatenate(first)
        weak = flux <= threshold * rays.flux[ray]
        account(ray[weak], flux[weak], ["trapped"] * int(weak.sum()))
        o, d, flux, ray, inside, left, fields = (a[~weak] for a in (o, d, flux, ray, inside, left, fields))
    account(ray, flux, ["trapped"] * len(ray))
    return by_ray, np.hstack(landings)


def file_sequence(path, rays, index, target, clear=None):
    """Return x and y of every ray in the target plane, (2, n), NaN unless it went through front and rear, and
    its flux by fate, {name: (n,)}.

    Parameters as of `file_branches`; the fates have the names of those of a lens alone.
    """
    faces = faces_of(path, path.stat().st_mtime_ns)
    o, d, flux = rays.origin.T, rays.direction.T, np.array(rays.flux)
    fields = unpolarised(d)
    goes, fates = np.ones(len(flux), dtype=bool), {"blocked": np.zeros(len(flux)), "total_internal": 0.0}

    def ended(fate, where):
        fates[fate] = fates.get(fate, 0.0) + np.where(goes & where, flux, 0.0)
        return goes & ~where

    for face, eta, missed in ("front", 1 / index, "beside_lens"), ("rear", index, "missed_rear"):
        point, normal, met = faces.meet(o, d)
        goes = ended(missed, met != face)
        goes = ended("blocked", beside(point, met, clear))
        (onward, fields, passed), _ = split_fields(fields, d, towards(d, normal), np.full(len(flux), eta))
        goes = ended("total_internal", passed == 0)
        o, d = (np.where(goes[:, None], new, old) for old, new in ((o, point), (d, onward)))
        fates[f"{face}_reflected"] = np.where(goes, flux * (1 - passed), 0.0)
        flux = np.where(goes, flux * passed, 0.0)
    there = (o + ((target.receiver.pose.shift[2] - o[:, 2]) / d[:, 2])[:, None] * d)[:, :2]
    on = (abs(there) <= target.half_width).all(axis=1) & (d[:, 2] > 0)
    fates |= {"on_target": np.where(on, flux, 0.0), "off_target": np.where(on, 0.0, flux)}
    return np.where(goes, there.T, np.nan), fates


def beside(points, faces, clear):
    """Return which points of faces lie beside what a holder leaves free."""
    free = np.array([np.inf if clear is None else clear.get(face, np.inf) for face in faces])
    return np.hypot(*points[:, :2].T) > free


def escape(left, forward, onto):
    """Return the fate of light that leaves."""
    if left in ("none", "outside"):
        return "beside_lens" if left == "none" else "reflected_outside"
    return PREFIX.get(left, "edges_") + ("on_target" if onto else "off_target") if forward else "back"


def towards(d, normal):
    """Return normals to the side to which light goes."""
    return normal * np.sign(np.einsum("ij,ij->i", d, normal))[:, None]
