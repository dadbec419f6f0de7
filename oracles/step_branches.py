"""All branches of light through the solid of a STEP file, by OCCT's intersections with its faces."""

from __future__ import annotations

import numpy as np

from optics.light.tracing import FATES
from thbcad.cad.exchange import face_hits, read_step

PREFIX = {"front": "front_", "rear": ""}  # of fates, by the face that light left last; else "edges_"


def file_branches(path, rays, index, target, threshold, absorbing=()):
    """Return the flux of every ray by fate, (len(FATES), n), and x, y, flux of branches in the target plane,
    (3, k).

    path : of the STEP file.  target : as of `trace_nonsequential`, whose receiver is a plane across z.
    absorbing : the first words of names of faces at which light is blocked.
    """
    solid = read_step(path)
    names = np.array([name.split(" ")[0] for name in solid.face_names])
    by_ray, landings = np.zeros((len(FATES), len(rays.flux))), []

    def account(ray, flux, fates):
        np.add.at(by_ray, ([FATES.index(fate) for fate in fates], ray), flux)

    o, d, flux, ray = rays.origin.T, rays.direction.T, rays.flux, np.arange(len(rays.flux))
    inside, left = np.zeros(len(ray), dtype=bool), np.full(len(ray), "none", dtype="<U8")
    for _ in range(65):
        hits = face_hits(solid.shape, o, d)
        gone = hits.faces < 0
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
        landings.append(np.vstack([there[through].T, flux[gone][through]]))
        met = names[hits.faces]
        dark = ~gone & np.isin(met, absorbing)
        account(ray[dark], flux[dark], ["blocked"] * int(dark.sum()))
        on = ~(gone | dark)
        if not on.any():
            return by_ray, np.hstack(landings)
        point, normal, met = hits.points[on], hits.normals[on], met[on]
        d, flux, ray, inside, left = d[on], flux[on], ray[on], inside[on], left[on]
        onward, mirrored, passed = fresnel_split(d, normal, np.where(inside, index, 1 / index))
        first = np.where(inside, met, left), np.where(~inside & (left == "none"), "outside", left)
        o, d = np.concatenate([point, point]), np.concatenate([onward, mirrored])
        flux = np.concatenate([flux * passed, flux * (1 - passed)])
        ray, inside, left = np.tile(ray, 2), np.concatenate([~inside, inside]), np.concatenate(first)
        weak = flux <= threshold * rays.flux[ray]
        account(ray[weak], flux[weak], ["trapped"] * int(weak.sum()))
        o, d, flux, ray, inside, left = (a[~weak] for a in (o, d, flux, ray, inside, left))
    account(ray, flux, ["trapped"] * len(ray))
    return by_ray, np.hstack(landings)


def escape(left, forward, onto):
    """Return the fate of light that leaves."""
    if left in ("none", "outside"):
        return "beside_lens" if left == "none" else "reflected_outside"
    return PREFIX.get(left, "edges_") + ("on_target" if onto else "off_target") if forward else "back"


def fresnel_split(d, normal, eta):
    """Return refracted and reflected directions, and the transmittance, 0 of total reflection."""
    cosine = np.einsum("ij,ij->i", d, normal)
    normal, cosine = normal * np.sign(cosine)[:, None], np.abs(cosine)
    square = 1 - eta**2 * (1 - cosine**2)
    behind = np.sqrt(np.maximum(square, 0.0))
    r_s = (eta * cosine - behind) / (eta * cosine + behind)
    r_p = (cosine - eta * behind) / (cosine + eta * behind)
    onward = eta[:, None] * d + (behind - eta * cosine)[:, None] * normal
    onward /= np.linalg.norm(onward, axis=1, keepdims=True)
    return onward, d - 2 * cosine[:, None] * normal, np.where(square > 0, 1 - (r_s**2 + r_p**2) / 2, 0.0)
