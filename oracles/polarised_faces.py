"""Unpolarised light through a sequence of smooth faces, by Mueller matrices.

Every face has a matrix in its own plane of incidence, made from Fresnel's complex amplitudes:

    M = f / 2 [[|s|^2 + |p|^2, |s|^2 - |p|^2, 0, 0], [|s|^2 - |p|^2, |s|^2 + |p|^2, 0, 0],
               [0, 0, 2 Re(s p*), -2 Im(s p*)], [0, 0, 2 Im(s p*), 2 Re(s p*)]]

with f = n_t cos_t / (n_i cos_i) for refraction and 1 for reflection.  Between two faces the Stokes vector is
turned by the angle from one plane of incidence to the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thbcad.checks import Floats

Fields = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class SmoothFace:
    """A face of bare glass, or a mirror.

    normal : (n, 3), unit vectors on the side to which light comes through.
    before, behind : indices.  reflects : whether the reflected light is followed.
    share : what a coating or a metal sends on, at any angle; None is bare glass.
    """

    normal: Floats
    before: float
    behind: float
    reflects: bool = False
    share: float | None = None


@dataclass(frozen=True, eq=False)
class FollowedLight:
    """Light behind the last face.

    direction : (n, 3).  stokes : (n, 4), I, Q, U, V for I = 1 at first.
    across : (n, 3), where Q is positive.
    """

    direction: Floats
    stokes: Floats
    across: Floats


def follow(direction: Floats, faces: Sequence[SmoothFace]) -> FollowedLight:
    """Follow unpolarised light of unit directions (n, 3) over faces."""
    stokes = np.zeros((len(direction), 4))
    stokes[:, 0] = 1.0
    helper = np.where(abs(direction[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    across = _unit(np.cross(direction, helper))
    for face in faces:
        plane = np.cross(direction, face.normal)
        oblique = np.linalg.norm(plane, axis=1) > 0
        s = np.where(oblique[:, None], plane, across)
        s = _unit(s)
        angle = np.arctan2(_dot(np.cross(across, s), direction), _dot(across, s))
        direction, matrix = _face(direction, face)
        stokes = np.einsum("nij,njk,nk->ni", matrix, _turn(angle), stokes)
        across = s
    return FollowedLight(direction, stokes, across)


def _face(direction: Floats, face: SmoothFace) -> tuple[Floats, Floats]:
    """Return the directions behind a face and its Mueller matrices, (n, 4, 4)."""
    cos_i, eta = _dot(direction, face.normal).astype(complex), face.before / face.behind
    cos_t = np.sqrt(1 - eta**2 * (1 - cos_i**2))  # imaginary beyond the critical angle
    cos_t = np.where(cos_t.imag < 0, -cos_t, cos_t)
    n_i, n_t = face.before, face.behind
    if face.reflects:
        onward = direction - 2 * cos_i.real[:, None] * face.normal
        s = (n_i * cos_i - n_t * cos_t) / (n_i * cos_i + n_t * cos_t)
        p = (n_t * cos_i - n_i * cos_t) / (n_t * cos_i + n_i * cos_t)
        scale = np.ones(len(direction))
    else:
        onward = eta * direction + (cos_t - eta * cos_i).real[:, None] * face.normal
        s = 2 * n_i * cos_i / (n_i * cos_i + n_t * cos_t)
        p = 2 * n_i * cos_i / (n_t * cos_i + n_i * cos_t)
        scale = (n_t * cos_t / (n_i * cos_i)).real
    if face.share is not None:  # a mirror turns the field round in its plane
        s, p = np.full(len(direction), -1.0 if face.reflects else 1.0), np.ones(len(direction))
        scale = np.full(len(direction), face.share)
    matrix, both = np.zeros((len(direction), 4, 4)), s * np.conj(p)
    matrix[:, 0, 0] = matrix[:, 1, 1] = (abs(s) ** 2 + abs(p) ** 2) / 2
    matrix[:, 0, 1] = matrix[:, 1, 0] = (abs(s) ** 2 - abs(p) ** 2) / 2
    matrix[:, 2, 2] = matrix[:, 3, 3] = both.real
    matrix[:, 3, 2], matrix[:, 2, 3] = both.imag, -both.imag
    return onward, scale[:, None, None] * matrix


def _turn(angle: Floats) -> Floats:
    """Return the matrices of Stokes vectors in a frame that is turned by angles (n,), (n, 4, 4)."""
    matrix = np.tile(np.eye(4), (len(angle), 1, 1))
    matrix[:, 1, 1] = matrix[:, 2, 2] = np.cos(2 * angle)
    matrix[:, 1, 2], matrix[:, 2, 1] = np.sin(2 * angle), -np.sin(2 * angle)
    return matrix


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.sum(a * b, axis=1))


def _unit(a: Floats) -> Floats:
    return np.asarray(a / np.linalg.norm(a, axis=1, keepdims=True))


def unpolarised(direction: Floats) -> Fields:
    """Return two fields of equal strength across each other and across directions (n, 3), (n, 2, 3)."""
    helper = np.where(abs(direction[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = _unit(np.cross(direction, helper))
    return np.stack([first, np.cross(direction, first)], axis=1).astype(complex)


def split_fields(
    fields: Fields, direction: Floats, normal: Floats, eta: Floats
) -> tuple[tuple[Floats, Fields, Floats], tuple[Floats, Fields]]:
    """Return (directions, fields, share) of refracted light, and (directions, fields) of reflected light.

    Fields keep their strength, and the share of what is refracted is 0 where all is reflected.

    fields : as of `unpolarised`.  normal : (n, 3), to the side to which light goes.  eta : index before /
    behind, (n,).
    """
    cos_i = _dot(direction, normal)
    square = 1 - eta**2 * (1 - cos_i**2)
    cos_t = np.sqrt(square.astype(complex))
    onward = _unit(eta[:, None] * direction + (cos_t.real - eta * cos_i)[:, None] * normal)
    mirrored = _unit(direction - 2 * cos_i[:, None] * normal)
    plane = np.cross(direction, normal)
    oblique = np.linalg.norm(plane, axis=1, keepdims=True) > 0
    s = _unit(np.where(oblique, plane, unpolarised(direction)[:, 0].real))
    along_s, along_p = (np.einsum("nkj,nj->nk", fields, a) for a in (s, np.cross(direction, s)))
    a, b = eta * cos_i + cos_t, cos_i + eta * cos_t

    def behind(ahead: Floats, s_part: Fields, p_part: Fields) -> Fields:
        parts = (along_s * s_part[:, None], s), (along_p * p_part[:, None], np.cross(ahead, s))
        return sum(amplitude[:, :, None] * axis[:, None, :] for amplitude, axis in parts)

    passing = behind(onward, 2 * eta * cos_i / a, 2 * eta * cos_i / b)
    staying = behind(mirrored, (eta * cos_i - cos_t) / a, (cos_i - eta * cos_t) / b)
    coming, going, back = ((abs(f) ** 2).sum(axis=(1, 2)) for f in (fields, passing, staying))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(square > 0, cos_t.real / (eta * cos_i) * going / coming, 0.0)
        passing, staying = (
            f * np.sqrt(coming / g)[:, None, None] for f, g in ((passing, going), (staying, back))
        )
    return (onward, passing, share), (mirrored, np.nan_to_num(staying))
