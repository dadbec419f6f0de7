"""Bodies in the way of light: ray by ray against OCCT on STEP files of all solids, and by closed forms."""

import numpy as np
import pytest
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
from OCP.gp import gp_Pnt

from optics.light.analysis import cell_irradiance
from optics.light.tracing import Tracer
from optics.scene.paths import AIR
from optics.scene.problem import Problem
from optics.scene.sources import Rays
from optics.scene.system import System
from tests.optics.cases import flat_problem, roughened
from thbcad import Pose, write_step
from thbcad.cad.exchange import face_hits, read_step

FREE = {"spans": (4, 4), "max_level": 1, "z_freedom": 3.0}
COUNT = 240  # rays


def element(name, position, tilt, half, *, free=False, radius=np.inf, conic=0.0, kind="mirror"):
    """Return a mirror, or a lens of parallel faces but for its rear."""
    face = {"half_width": half, "radius": radius, "conic": conic, "freeform": FREE if free else False}
    own = {"kind": kind, "name": name, "position": position, "tilt": tilt, "thickness": 8.0}
    if kind == "mirror":
        return own | {"face": face, "reflectance": 1.0}
    return own | {"index": 1.5, "front": {"half_width": half}, "rear": face}


def scene(elements, position, tilt, half=(20, 20), beam=(20, 20), distance=150):
    source = {"kind": "collimated", "half_width": beam, "distance": distance}
    target = {"kind": "tophat", "position": position, "tilt": tilt, "half_width": half, "pixels": (16, 16)}
    return System(Problem(source=source, element=elements, target=target))


SCENES = {
    # the back of the second mirror, and the rim of its blank, stand in the beam
    "second mirror in the beam": lambda: scene(
        [
            element("M1", (0, 0, 0), (0, 0, 0), (30, 30), free=True, radius=-400.0, conic=-1.0),
            element("M2", (3, 2, -60), (185, 10, 0), (12, 9)),
        ],
        (0, 0, 30),
        (0, 0, 0),
    ),
    # the light from the second mirror to the screen passes the blank of the first
    "blank before the screen": lambda: scene(
        [
            element("L1", (0, 0, -60), (0, 0, 0), (25, 25), radius=-90.0, conic=-1.0, kind="lens"),
            element("M1", (0, 0, 0), (45, 0, 0), (24, 30), free=True),
            element("M2", (0, 90, 10), (-100, 0, 0), (35, 35)),
        ],
        (0, -60, 25),
        (90, 0, 0),
        half=(40, 40),
    ),
    "screen in the beam": lambda: scene(
        [element("M1", (0, 0, 0), (20, 0, 0), (25, 30), free=True)],
        (0, 30, -40),
        (-140, 0, 0),
    ),
    # light that meets a deep mirror beside its middle meets it twice
    "deep mirror": lambda: scene(
        [element("M1", (0, 0, 0), (30, 0, 0), (20, 20), free=True, radius=-14.0, conic=-1.0)],
        (0, 0, -100),
        (180, 0, 0),
        half=(4, 2),
    ),
}


def beam(system, count):
    """Return random rays from the plane of the source."""
    (hx, hy), z = system.problem.source.half_width, -system.problem.source.distance
    x, y = np.random.default_rng(5).uniform(-1, 1, (2, count)) * [[hx], [hy]]
    along = np.zeros((3, count))
    along[2] = 1.0
    return Rays(np.stack([x, y, np.full(count, z)]), along, np.full(count, 1 / count))


def solids(system, lens, folder):
    """Return (pose, solid) of every element, of the STEP file of each, and of the screen."""
    placed = []
    for k, (optic, blank) in enumerate(system.with_lens(lens).elements):
        write_step(blank, folder / f"{k}.step")
        placed.append((Pose.tilted(optic.position, optic.tilt), read_step(folder / f"{k}.step").shape))
    target = system.problem.target
    hx, hy = target.half_width
    plate = BRepPrimAPI_MakeBox(gp_Pnt(-hx, -hy, 0), gp_Pnt(hx, hy, 1e-3 * max(hx, hy))).Shape()
    return [*placed, (Pose.tilted(target.position, target.tilt), plate)]


def ends_of_light(receiver, landing, start):
    """Return where rays end, (3, n): on the plane receiver, or far away where they go away from it.

    start : where they set out, in the frame of the receiver's pose.
    """
    ends = np.array(np.broadcast_arrays(*receiver.points(landing.x.numpy(), landing.y.numpy())))
    p, q = landing.p.numpy(), landing.q.numpy()
    away = receiver.pose.directions((p, q, -np.sqrt(np.maximum(0, 1 - p * p - q * q))))
    return np.where(landing.definite.numpy(), ends, start + 1e5 * np.array(away))


def met_before(solid, starts, ends):
    """Return which segments, (3, n), meet a solid between their ends."""
    pose, shape = solid
    o, end = (pose.inverse().points(points) for points in (starts, ends))
    length = np.linalg.norm(end - o, axis=0)
    hits = face_hits(shape, o.T, ((end - o) / length).T, after=1e-5)
    return np.linalg.norm(hits.points.T - o, axis=0) < length - 1e-5  # NaN of no meeting is none


@pytest.mark.every(2)
@pytest.mark.parametrize("name", SCENES)
def test_rays_are_taken_where_their_ways_meet_a_solid_of_a_file(name, backend, tmp_path):
    system = SCENES[name]()
    lens = roughened(system.base, 0.05)
    rays, bare = beam(system, COUNT), system.with_lens(lens).path
    free = Tracer(backend, bare, rays)
    points = [rays.origin]
    for k, surface in enumerate(bare.surfaces):
        hits, _, _ = free.at(k)
        points.append(surface.pose.points(np.array([a.numpy() for a in (hits.x, hits.y, hits.z)])))
    landing, shaded = free.landed(), Tracer(backend, system.with_lens(lens).shaded_path, rays).landed()
    points.append(ends_of_light(bare.receiver, landing, points[-1]))
    alive, total = np.ones(COUNT, dtype=bool), 0
    passages = [*((p.hit, q.blocked) for p, q in zip(landing.passages, shaded.passages))]
    for k, (meets, taken) in enumerate([*passages, (landing.passages[-1].goes_on, shaded.blocked)]):
        found = alive & (np.zeros(COUNT, dtype=bool) if taken is False else taken.numpy())
        alive &= meets.numpy()
        wanted = np.zeros(COUNT, dtype=bool)
        if bare.media[k] == AIR:
            for solid in solids(system, lens, tmp_path):
                wanted[alive] |= met_before(solid, points[k][:, alive], points[k + 1][:, alive])
        np.testing.assert_array_equal(found, wanted)
        total += int(wanted.sum())
        alive &= ~wanted
    assert COUNT / 25 < total < 0.6 * COUNT


@pytest.mark.parametrize("name", ["deep mirror", "screen in the beam"])
def test_light_that_hits_a_face_twice_is_counted_apart(name, backend, tmp_path):
    """A ray that leaves the face of a STEP file and first meets that very face, before its end."""
    system = SCENES[name]()
    lens, rays, back = roughened(system.base, 0.05), beam(system, COUNT), system.pose.inverse()
    tracer = Tracer(backend, system.with_lens(lens).shaded_path, rays)
    with backend.dr.suspend_grad():
        (hits,), landing = tracer.trace()
    start = np.array([a.numpy() for a in (hits.x, hits.y, hits.z)])
    end = ends_of_light(system.target.receiver, landing, system.pose.points(start))
    way = back.points(end) - start
    length = np.linalg.norm(way, axis=0)
    write_step(lens, tmp_path / "lens.step")
    met = face_hits(read_step(tmp_path / "lens.step").shape, start.T, (way / length).T, after=1e-5).points.T
    again = np.linalg.norm(met - start, axis=0) < length - 1e-5  # NaN of no meeting is none
    x, y, z = np.nan_to_num(met)
    on_face = (
        np.abs(z - lens.front(*(np.clip(a, -h, h) for a, h in zip((x, y), lens.front.half_width)))) < 1e-6
    )
    twice = rays.flux[landing.passages[0].hit.numpy() & again & on_face].sum()
    fates, counts = (f(landing, (1e3, 1e3)) for f in (tracer.fates, tracer.counts))
    assert fates.by_name.get("M1.face hit twice", 0.0) == pytest.approx(twice, rel=1e-12)
    assert (twice > 0) == (name == "deep mirror") == (counts.get("M1.face hit twice", 0) > 0)
    assert fates.blocked >= twice
    assert fates.total == pytest.approx(rays.total, rel=1e-12)
    assert sum(counts.values()) == COUNT


def test_a_screen_in_the_beam_takes_the_shadow_of_its_plate(backend):
    """Its corners in the plan tell the strip of the beam; all other light arrives."""
    system = SCENES["screen in the beam"]()
    cells = system.source.cells((48, 48))
    _, fates = cell_irradiance(system.shaded_path, system.target.screen(), cells, backend)
    pose = system.target.receiver.pose
    least = min(float(pose.points(np.array([0.0, y, z]))[1]) for y in (-20, 20) for z in (0, 0.02))
    assert fates.by_name["M1.face blocked"] == pytest.approx((20 - least) / 40, abs=1e-9)
    assert fates.total == pytest.approx(1, abs=1e-12)


def test_a_screen_before_a_plane_front_takes_its_own_area_of_a_beam(backend):
    """Rays along z are not searched for at a plane front, and have numbers for directions."""
    lens = element("L1", (0, 0, 0), (0, 0, 0), (25, 25), free=True, kind="lens")
    system = scene([lens], (0, 0, -100), (180, 0, 0), half=(5, 4))
    faces = ["L1.front", "L1.rear:reflect", "L1.front"]
    system = System(system.problem.with_(path=[{"faces": faces}]))
    _, fates = cell_irradiance(
        system.shaded_path, system.target.screen(), system.source.cells((40, 40)), backend
    )
    assert fates.by_name["L1.front blocked"] == pytest.approx(4 * 5 * 4 / 40**2, abs=1e-9)


def test_a_body_behind_the_source_takes_nothing(backend):
    """The beam is traced from well before the first surface on, but comes from its source."""
    mirror = element("M1", (0, 0, 0), (0, 0, 0), (25, 25), free=True)
    taken = []
    for distance in (30, 150):
        system = scene([mirror], (0, 0, -100), (180, 0, 0), half=(5, 4), distance=distance)
        tracer = Tracer(backend, system.shaded_path, system.source.rays((40, 40)))
        _, landing = tracer.trace()
        taken.append(tracer.fates(landing, (5, 4)).by_name.get("M1.face blocked", 0.0))
    assert taken == [0.0, pytest.approx(4 * 5 * 4 / 40**2, abs=2 * (5 + 4) / 40 / 40)]  # half a row of rays


def test_all_of_a_wide_beam_lights_a_mirror_beside_the_axis(backend):
    """Before a screen behind the source, beside the axis in x, and short in y by its tilt of 5 degrees."""
    mirror = element("M1", (6, 0, 0), (5, 0, 0), (10, 10), free=True)
    system = scene([mirror], (0, 17.6, -100), (180, 0, 0), beam=(14, 14), distance=40)
    cells = system.source.cells((24, 24))
    _, fates = cell_irradiance(system.shaded_path, system.target.screen(), cells, backend)
    lit = 18 * 20 * np.cos(np.radians(5)) / 28**2
    # chords of the finest cells leave a part of theirs of the rim
    assert fates.by_name["M1.face missed"] == pytest.approx(1 - lit, abs=2 * 40 / 2000 / 28)
    assert fates.blocked == 0


def test_bodies_that_no_light_meets_change_no_bit(backend):
    system = scene(
        [element("M1", (0, 0, 0), (45, 0, 0), (30, 40), free=True)], (0, 60, 0), (-90, 0, 0), (30, 30)
    )
    cells, screen = system.source.cells((24, 24)), system.target.screen()
    lens = roughened(system.base, 0.05)
    bare, shaded = (
        cell_irradiance(path, screen, cells, backend)
        for path in (system.with_lens(lens).path, system.with_lens(lens).shaded_path)
    )
    assert system.with_lens(lens).shaded_path.bodies
    assert bare[1].by_name == shaded[1].by_name
    np.testing.assert_array_equal(bare[0], shaded[0])


def test_a_lens_on_the_axis_has_no_body_in_its_way():
    system = System(flat_problem({"kind": "point", "half_angle": 20, "distance": 20}))
    assert not system.shaded_path.bodies
