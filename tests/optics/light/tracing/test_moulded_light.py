"""The light of lenses with outlines and of bodies for a mould, against all branches through the faces of
their STEP files by OCCT, walls included."""

from dataclasses import replace

import numpy as np
import pytest

from optics.light.intersections import DeviceRays
from optics.light.tracing import FATES, TargetArea, trace_nonsequential
from optics.light.tracing.body_faces import body_faces, plate_faces
from optics.light.tracing.branches import EDGE, FRONT, REAR, Branches, ClosedLens, split
from optics.light.tracing.lens_faces import lens_faces
from optics.scene.receivers import receiver_at
from optics.scene.sources import Rays
from oracles.step_branches import file_branches
from tests.optics.cases import rough, small_space
from thbcad.cad.exchange import step_bytes
from thbcad.lens import FreeformSurface, Lens
from thbcad.moulds import BodyOptions, MouldedBody, Plate
from thbcad.sags import Conic
from thbcad.surfaces import THBSurface

TARGET = TargetArea(receiver_at(60.0), (30.0, 20.0))
LEAST = 1e-3  # of a ray's flux: weaker branches end
RAYS = 400


def lens_of(front, rear, corner, height=0.02):
    """Return a lens of a rough rear.  front, rear : half-widths, of which corners are the share `corner`."""

    def outlined(half, conic, sag=None):
        return FreeformSurface((half, half), conic, sag, corners=(corner * half, corner * half))

    space = small_space()
    sag = THBSurface(space, rough(space, height))
    front, rear = outlined(front, Conic(-40.0, -1.0)), outlined(rear, Conic(-60.0, -1.0), sag)
    return Lens(front, rear, 6.0, 1.5)


def body_of(front, rear, corner, height=0.02, **options):
    """Return a body of such a lens."""
    return MouldedBody.of(lens_of(front, rear, corner, height), BodyOptions(**options))


LENSES = {"cylinder": (10.0, 10.0, 1.0), "cone": (10.0, 8.0, 1.0), "prism": (8.0, 10.0, 0.4)}


BODIES = {
    "dome, land at the rim": (5.0, 10.0, 1.0, {"draft": 3.0, "annulus": True}),
    "dome, cavity deeper than the land": (5.0, 10.0, 1.0, {"draft": 5.0, "annulus": True, "land": -1.5}),
    "dome, cavity above the land": (5.0, 10.0, 1.0, {"draft": 5.0, "annulus": True, "land": 1.0}),
    "larger front": (10.0, 6.0, 0.4, {"draft": 3.0, "annulus": True, "parting": 1.0}),
    "rectangle": (10.0, 10.0, 0.0, {"draft": 10.0}),
    "rounded": (10.0, 10.0, 0.3, {"draft": 10.0, "parting": 3.0}),
    "upright": (5.0, 10.0, 0.3, {"annulus": True}),
}
QUICK = "dome, cavity above the land", "rounded"


def rays_around(count, size=10.0):
    """Return rays from below to points of the body and beside it, some along z."""
    rng = np.random.default_rng(5)
    origin = np.vstack([rng.uniform(-size, size, (2, count)), np.full(count, -8.0)])
    towards = np.vstack([rng.uniform(-size, size, (2, count)), rng.uniform(-2.0, 6.0, count)])
    towards[:2, : count // 5] = origin[:2, : count // 5]
    direction = towards - origin
    return Rays(origin, direction / np.linalg.norm(direction, axis=0), np.ones(count))


def irradiance(x, y, flux):
    edges = [np.linspace(-h, h, 13) for h in TARGET.half_width]
    return np.histogram2d(x, y, edges, weights=flux)[0]


def compared(backend, body, rays, path, absorbing=(), within=1e-8):
    """Return the trace of a body; its fates, its landing points, to `within` mm, and its irradiance are those
    of its STEP file."""
    path.write_bytes(step_bytes(body))
    result = trace_nonsequential(backend, body, rays, TARGET, threshold=LEAST)
    by_ray, landings = file_branches(path, rays, body.index, TARGET, LEAST, absorbing)
    # front, rear and fitted rims by other arithmetic; flat angles of incidence enlarge that
    assert result.by_ray == pytest.approx(by_ray, abs=1e-6)
    through = np.char.endswith(np.array(FATES)[result.fate], "_target")
    own = *result.landings.points[through].T, result.landings.flux[through], result.ray[through]
    image = irradiance(*own[:3])
    assert np.linalg.norm(image - irradiance(*landings[:3])) <= 1e-6 * np.linalg.norm(image)
    x, y, *names = (a[np.lexsort(own[2:])] for a in own)  # the branches of a ray by their flux
    there = landings[:, np.lexsort(landings[2:])]
    assert names[1].tolist() == there[3].tolist()
    near = (abs(x) <= TARGET.half_width[0]) & (abs(y) <= TARGET.half_width[1])
    assert (abs(np.array([x, y]) - there[:2])[:, near] <= within).all()
    assert result.by_ray.sum(axis=0) == pytest.approx(rays.flux, rel=1e-12)
    assert result.fates.failed == 0
    return result


@pytest.mark.every(2)
@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in BODIES]
)
def test_every_branch_is_that_of_the_file(backend, tmp_path, name):
    front, rear, corner, options = BODIES[name]
    fates = compared(
        backend, body_of(front, rear, corner, **options), rays_around(RAYS), tmp_path / "s.step"
    ).fates
    assert min(fates.edges_on_target + fates.edges_off_target, fates.back) > 1


@pytest.mark.slow
@pytest.mark.parametrize("name", LENSES)
def test_every_branch_of_a_lens_is_that_of_the_file(backend, tmp_path, name):
    """Between rims of unlike half-widths a file's walls are splines, within 1e-9 mm over spans of 0.1 mm:
    their normals are off by 1e-8, and 60 mm behind a few of them light by 1e-6 mm and more."""
    file, within = tmp_path / "s.step", 1e-8 if name == "cylinder" else 5e-6
    fates = compared(backend, lens_of(*LENSES[name]), rays_around(RAYS), file, within=within).fates
    assert fates.edges_on_target + fates.edges_off_target > 1


@pytest.mark.slow
def test_rounded_edges_absorb_what_meets_them_from_within(backend, tmp_path):
    """A point source before the middle: no ray passes between the rounded and the sharp edge."""
    body = body_of(10.0, 10.0, 0.3, 0.002, draft=5.0, edge_radius=0.4)
    rng = np.random.default_rng(7)
    towards = np.vstack([rng.uniform(-7, 7, (2, RAYS)), np.full(RAYS, 4.0)])
    rays = Rays(
        np.zeros((3, RAYS)) - [[0], [0], [4]], towards / np.linalg.norm(towards, axis=0), np.ones(RAYS)
    )
    assert compared(backend, body, rays, tmp_path / "s.step", ("radius",)).fates.blocked > 1


PLATES = {"upright": (10.0, 10.0, 20.7), "slanted": (7.0, 10.0, 20.7), "larger front": (9.0, 6.5, 19.0)}


@pytest.mark.slow
@pytest.mark.parametrize("name", PLATES)
def test_every_branch_through_a_plate_is_that_of_the_file(backend, tmp_path, name):
    """Walls are cut at the land by level curves within 1e-9 mm, and slanted ones are splines as of a lens."""
    front, rear, pitch = PLATES[name]
    plate = Plate.of(lens_of(front, rear, 0.0), (2, 2), (pitch, pitch))
    rays = rays_around(RAYS, 25.0)
    fates = compared(backend, plate, rays, tmp_path / "s.step", within=5e-6).fates
    assert min(fates.crosstalk, fates.edges_on_target + fates.edges_off_target, fates.back) > 1


SOLIDS = {
    **{name: lambda size=size: lens_of(*size) for name, size in LENSES.items()},
    "walls": lambda: lens_of(10.0, 10.0, 0.0),
    "slanted walls": lambda: lens_of(8.0, 10.0, 0.0),
    **{
        name: lambda case=case: body_of(*case[:3], **case[3])
        for name, case in BODIES.items()
        if name in ("dome, land at the rim", "larger front", "rounded")
    },
    "plate": lambda: Plate.of(lens_of(7.0, 10.0, 0.0), (2, 1), (20.7, 20.7)),
}


@pytest.mark.every(3)
@pytest.mark.parametrize("name", SOLIDS)
def test_no_ray_meets_a_face_before_it_can_reach_it(backend, name):
    """Rays from everywhere in air and glass, along axes too, and branches that start on faces."""
    dr, solid = backend.dr, SOLIDS[name]()
    if isinstance(solid, Plate):
        faces = [face for part in plate_faces(backend, solid) for face in part.faces]
    else:
        faces = (body_faces if isinstance(solid, MouldedBody) else lens_faces)(backend, solid)
    rng = np.random.default_rng(3)
    origin, direction = rng.uniform(-12, 12, (3, 4000)), rng.normal(size=(3, 4000))
    direction[:2, :400], direction[2, 400:800] = 0.0, 0.0
    direction /= np.linalg.norm(direction, axis=0)
    sets = [replace(Branches.start(Rays(origin, direction, np.ones(4000))), inside=rng.random(4000) < 0.5)]
    branches, closed = Branches.start(rays_around(500)), ClosedLens(backend, solid)
    for _ in range(4):
        meetings = closed.meet(branches)
        met = np.isin(meetings.face, (FRONT, REAR, EDGE))
        refracted, reflected = split(branches[met], meetings[met])
        branches = refracted[meetings.transmittance[met] > 0] + reflected
        sets.append(branches)
    found = 0
    for branches in sets:
        vectors = ([backend.array(a) for a in v] for v in (branches.origin, branches.direction))
        rays = DeviceRays(*map(tuple, vectors), inside=backend.array(branches.inside) > 0)
        for face in faces:
            meeting, reach = face.meet(rays), face.reach(rays)
            assert dr.all((reach <= meeting.path) & (reach <= meeting.doubt))
            found += dr.count(dr.isfinite(meeting.path))
    assert found > 2000
