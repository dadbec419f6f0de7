"""Faces that light meets one after the other at random angles, and rays for them."""

from dataclasses import replace

import numpy as np

from optics.scene.paths import AIR, LightPath, Medium, Surface
from optics.scene.receivers import FarField
from optics.scene.sources import Rays
from oracles.polarised_faces import SmoothFace, follow
from thbcad import Pose
from thbcad.lens import FreeformSurface

RAYS = 1000
SHEET = FreeformSurface((1e4, 1e4))
APART = 50.0  # mm, from face to face
GLASS, DENSE = 1.5, 2.0
# what comes after air, face by face: the index behind a refraction, and behind a mirror of bare glass
SEQUENCES = {
    "two refractions": [("refract", GLASS), ("refract", 1.0)],
    "three refractions": [("refract", DENSE), ("refract", GLASS), ("refract", 1.0)],
    "four refractions": [("refract", GLASS), ("refract", 1.0), ("refract", DENSE), ("refract", 1.0)],
    "a reflection outside": [("reflect", GLASS), ("refract", GLASS), ("refract", 1.0)],
    "a partial reflection within": [("refract", GLASS), ("reflect", 1.4), ("refract", 1.0)],
    "a total reflection": [("refract", GLASS), ("total", 1.0), ("refract", 1.0)],
    "two total reflections": [("refract", GLASS), ("total", 1.0), ("total", 1.0), ("refract", 1.0)],
    "a mirror between": [("refract", GLASS), ("refract", 1.0), ("mirror", 0.9), ("refract", GLASS)],
    "a coating between": [("refract", GLASS), ("coating", 1.0), ("refract", DENSE), ("refract", 1.0)],
}
TILTS = {"refract": (0.6, 1.1), "reflect": (0.5, 1.2), "total": (0.85, 1.2), "mirror": (0.3, 1.2)}


def frame(normal):
    """Return a rotation whose third column is a unit vector."""
    helper = np.eye(3)[np.argmin(abs(normal))]
    across = np.cross(helper, normal)
    across /= np.linalg.norm(across)
    return np.column_stack([across, np.cross(normal, across), normal])


def random_path(steps, seed):
    """Return the LightPath and the faces of the oracle: each face meets the middle ray at a random angle."""
    rng = np.random.default_rng(seed)
    direction, point, index = np.array([0.0, 0.0, 1.0]), np.zeros(3), 1.0
    surfaces, media, faces = [], [AIR], []
    for kind, value in steps:
        point = point + APART * direction
        least, most = TILTS.get(kind, TILTS["refract"])
        angle, turn = rng.uniform(least, most), rng.uniform(0, 2 * np.pi)
        if kind in ("refract", "coating") and value < index:  # below the critical angle
            angle *= 0.8 * np.arcsin(value / index) / most
        own = frame(direction)
        normal = own @ [np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)]
        pose, bounces = Pose(frame(normal), point), kind in ("reflect", "total", "mirror")
        share = {"mirror": value, "coating": 0.8}.get(kind)
        behind = 1.0 if kind == "mirror" else value
        surface = Surface(SHEET, pose, "reflect" if bounces else "refract", share)
        surfaces.append(replace(surface, beyond=Medium(behind)) if bounces else surface)
        face = SmoothFace(normal[None, :], index, behind, bounces, share)
        faces.append(face)
        direction = follow(direction[None, :], [face]).direction[0]
        index = index if bounces else behind
        media.append(Medium(index))
    receiver = FarField(Pose(frame(direction), point))
    return LightPath(tuple(surfaces), tuple(media), receiver), faces


def random_rays(seed, spread=0.1):
    rng = np.random.default_rng(seed)
    direction = np.vstack([rng.uniform(-spread, spread, (2, RAYS)), np.ones(RAYS)])
    return Rays(np.zeros((3, RAYS)), direction / np.linalg.norm(direction, axis=0), np.ones(RAYS))
