"""Mirrors, prisms, folds and bare light as values of a light path alone, against what is known exactly."""

from dataclasses import replace

import numpy as np
import pytest

from optics.light.measuring import MappedCells
from optics.light.tracing import Tracer, transmittances
from optics.scene.paths import AIR, LightPath, Medium, Surface
from optics.scene.receivers import Cylinder, FarField, Plane, Screen, Sphere
from optics.scene.sources import (
    Profile,
    Rays,
    SourceCells,
    collimated_beam,
    cone_cells,
    point_rays,
)
from tests.optics.cases import TARGET_Z, lambertian_parts, rough, small_lens, small_space
from thbcad import Conic, Pose, THBSurface
from thbcad.lens import FreeformSurface, Lens

SPACE = small_space((10.0, 10.0))
STEP = 1e-5  # mm, of the central differences
BACK = Pose.at(rotation_vector=(0.0, np.pi, 0.0))  # what looks to -z
FOLD = Pose.at((0.0, 0.0, 30.0), (-np.pi / 4, 0.0, 0.0))  # its normal is between +y and +z
SHEET = FreeformSurface((60.0, 60.0))


def cone(half_angle, distance, counts=(21, 21)):
    """Rays of a point, in no symmetric places."""
    return point_rays(
        distance=distance, flux=1.0, half_angle=half_angle, exponent=0.0, counts=counts, shift=(0.3, 0.2)
    )


def traced(backend, path, rays):
    """Return (x, y, flux, fates) of a path that loses no ray beside its surfaces."""
    tracer = Tracer(backend, path, rays)
    landing = tracer.landed()
    every = np.zeros(rays.flux.size)
    assert landing.arrives.numpy().all()
    x, y, flux = (a.numpy() + every for a in (landing.x, landing.y, landing.flux))
    return x, y, flux, tracer.fates(landing, (1e3, 1e3))


def mirrored(pose, receiver):
    """Return the receiver that a plane mirror makes of one: its picture has x turned round."""
    mirror = pose.rotation @ np.diag([1.0, 1.0, -1.0]) @ pose.rotation.T
    rotation = mirror @ receiver.pose.rotation @ np.diag([-1.0, 1.0, 1.0])
    shift = mirror @ (receiver.pose.shift - pose.shift) + pose.shift
    return replace(receiver, pose=Pose(rotation, shift))


def folded(path):
    """Return a path with an ideal plane mirror before its receiver."""
    mirror = Surface(SHEET, FOLD, "reflect", 1.0)
    return replace(
        path,
        surfaces=(*path.surfaces, mirror),
        media=(*path.media, AIR),
        receiver=mirrored(FOLD, path.receiver),
    )


FREE = small_lens(Conic(60.0), sag=rough(SPACE))
SOURCES = {
    "beam": lambda: collimated_beam((9.0, 9.0), 1.0, (10.0, 10.0), (23, 21)),
    "point": lambda: cone(5.0, 80.0),
}
RECEIVERS = {
    "screen": Plane(Pose.at((0.0, 0.0, TARGET_Z))),
    "tilted": Plane(Pose.at((2.0, 1.0, TARGET_Z), (0.2, -0.3, 0.1))),
    "far": FarField(),
    "cylinder": Cylinder(Pose.at((2.0, 1.0, TARGET_Z), (0.2, -0.3, 0.1)), radius=-90.0),
    "sphere": Sphere(Pose.at((2.0, 1.0, TARGET_Z), (0.2, -0.3, 0.1)), radius=120.0),
}


@pytest.mark.parametrize("receiver", RECEIVERS)
@pytest.mark.parametrize("source", SOURCES)
def test_a_fold_mirror_gives_the_unfolded_landing_points_with_one_axis_flipped(backend, source, receiver):
    path, rays = LightPath.through(FREE, RECEIVERS[receiver], 0.01), SOURCES[source]()
    x, y, flux, fates = traced(backend, path, rays)
    fx, fy, folded_flux, folded_fates = traced(backend, folded(path), rays)
    np.testing.assert_allclose(-fx, x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(fy, y, rtol=0, atol=1e-12)
    np.testing.assert_allclose(folded_flux, flux, rtol=1e-13)
    assert folded_fates.on_target == pytest.approx(fates.on_target, rel=1e-12)


def irradiance(backend, path, cells, screen):
    """Return the light of cells on a screen, (rows, columns) W per unit area."""
    rays = cells.rays()
    landing = Tracer(backend, path, rays).landed()
    with backend.dr.suspend_grad():
        mapped = MappedCells(backend, screen, cells.emitted, rays.flux, cells.turned)
        every = backend.dr.zeros(backend.Float, rays.flux.size)
        image = mapped(landing.x + every, landing.y + every, landing.flux + every, landing.arrives)
    return image.numpy().reshape(screen.shape, order="F")


def test_a_fold_mirror_gives_the_unfolded_irradiance_turned_round(backend):
    path, screen = LightPath.through(FREE, RECEIVERS["screen"], 0.0), Screen((20.0, 20.0), (40, 40))
    cells = cone_cells(80.0, 1.0, 5.0, 0.0, (96, 96))
    straight = irradiance(backend, path, cells, screen)
    found = irradiance(backend, folded(path), cells, screen)[:, ::-1]
    assert straight.min() >= 0 < straight.max()
    np.testing.assert_allclose(found, straight, rtol=0, atol=1e-9 * straight.mean())


POINT = np.array([1.0, -2.0, 3.0])
WALL = Pose.at((4.0, 1.0, 50.0), (0.5, -0.4, 0.2))
SCREENS = {
    "tilted": Plane(WALL),
    "cylinder": Cylinder(WALL, radius=60.0),
    "hollow cylinder": Cylinder(WALL, radius=-45.0),
    "sphere": Sphere(WALL, radius=70.0),
    "hollow sphere": Sphere(WALL, radius=-40.0),
}


@pytest.mark.parametrize("receiver", SCREENS.values(), ids=SCREENS)
def test_bare_light_on_any_screen_is_intensity_times_cosine_over_square(backend, receiver):
    """E = I / |d(u, v) / d Omega|, with d Omega = dp dq / r, by derivatives of the landing; over the area."""
    dr = backend.dr
    rays = cone(20.0, 0.0, (10, 10)).posed(Pose.at(POINT))
    u, v, flux, _ = traced(backend, LightPath((), (AIR,), receiver), rays)
    assert flux.sum() == pytest.approx(1.0, rel=1e-14)
    p, q = (backend.array(row) for row in rays.direction[:2])
    columns = []
    for k in range(2):
        direction = [backend.Float(p), backend.Float(q)]
        dr.enable_grad(direction[k])
        third = dr.sqrt(1 - direction[0] ** 2 - direction[1] ** 2)
        landed = receiver.land([backend.Float(x) for x in POINT], (*direction, third), dr)
        np.testing.assert_allclose(landed.u.numpy(), u, rtol=0, atol=1e-12)
        np.testing.assert_allclose(landed.v.numpy(), v, rtol=0, atol=1e-12)
        dr.set_grad(direction[k], 1.0)
        columns.append([g.numpy() for g in dr.forward_to(landed.u, landed.v)])
    (uu, vu), (uv, vv) = columns
    found = 1 / np.abs(uu * vv - uv * vu) / rays.direction[2]
    there = np.stack(np.broadcast_arrays(*receiver.toward(POINT, u, v)))
    distance = np.linalg.norm(there, axis=0)
    cosine = (np.stack(np.broadcast_arrays(*receiver.normal(u, v))) * there).sum(axis=0) / distance
    np.testing.assert_allclose(
        found / receiver.area(u, v), cosine / distance**2, rtol=1e-12 if type(receiver) is Plane else 1e-11
    )


def solid_angles(corners):
    """Return the solid angles of triangles seen from 0, (3 corners, 3, ...), by Van Oosterom and Strackee."""
    a, b, c = corners
    x, y, z = (np.linalg.norm(v, axis=0) for v in corners)

    def dot(v, w):
        return (v * w).sum(axis=0)

    triple = dot(a, np.cross(b, c, axis=0))
    return 2 * np.arctan2(np.abs(triple), x * y * z + dot(a, b) * z + dot(b, c) * x + dot(c, a) * y)


def solid_angles_of_cells(grid):
    """Return the solid angles of quadrilaterals between points, (3, n + 1, m + 1), seen from 0."""
    a, b, c, d = grid[:, 1:, :-1], grid[:, 1:, 1:], grid[:, :-1, 1:], grid[:, :-1, :-1]
    return solid_angles((a, b, c)) + solid_angles((a, c, d))


def cells_of_slopes(count, widest):
    """Return cells of a point of intensity 1 in 0, equally wide in the slopes s and t of its rays."""
    s = np.linspace(-widest, widest, count + 1)

    def at(s, t, flux):
        direction = np.stack([s, t, np.ones_like(s)])
        return Rays(np.zeros_like(direction), direction / np.linalg.norm(direction, axis=0), flux)

    borders = np.stack([*np.meshgrid(s, s, indexing="ij"), np.ones((count + 1, count + 1))])
    return SourceCells(s, s, solid_angles_of_cells(borders), at, lambda s, t: (1 + s * s + t * t) ** -1.5)


@pytest.mark.every(3)
@pytest.mark.parametrize("receiver", SCREENS.values(), ids=SCREENS)
def test_bare_light_in_cells_is_intensity_times_solid_angle_to_second_order(backend, receiver):
    """Solid angles are those of 64 x 64 flat parts of every pixel: a radius of 40 mm bends them by 1e-7."""
    screen, parts = Screen((8.0, 8.0), (7, 7), receiver=receiver), 64
    edges = np.linspace(-8.0, 8.0, 7 * parts + 1)
    grid = np.stack(np.broadcast_arrays(*receiver.points(*np.meshgrid(edges, edges[::-1]))))
    wanted = solid_angles_of_cells(grid).reshape(7, parts, 7, parts).sum(axis=(1, 3))
    errors = []
    for count in (96, 192, 384, 768):
        path, cells = LightPath((), (AIR,), receiver), cells_of_slopes(count, 0.3)
        found = irradiance(backend, path, cells, screen) * screen.pixel_area
        errors.append(np.abs(found / wanted - 1).max())
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    # a cell's borders are straight in u and v: those of a curved screen bend more of them
    assert errors[-1] < (1e-6 if type(receiver) is Plane else 5e-6)
    assert orders.mean() > 1.8


def wavy(shape, height):
    """Return the surface with a rough sag, at most so many mm high."""
    return shape.with_sag(THBSurface(SPACE, rough(SPACE, height)))


def mirror(radius, conic, half_width=20.0, height=0.0):
    """Return a mirror that looks to -z; a negative radius is concave there."""
    shape = FreeformSurface((half_width, half_width), Conic(radius, conic))
    return Surface(wavy(shape, height), kind="reflect", share=1.0)


def test_a_paraboloid_turns_a_point_at_its_focus_into_parallel_light(backend):
    focus = 12.0
    path = LightPath((mirror(-2 * focus, -1.0),), (AIR, AIR), FarField(BACK))
    u, v, flux, _ = traced(backend, path, cone(40.0, focus))
    assert max(np.abs(u).max(), np.abs(v).max()) < np.degrees(1e-12)
    assert flux.sum() == pytest.approx(1.0, rel=1e-14)


@pytest.mark.parametrize("eccentricity", [0.3, 0.6, 0.9])
def test_an_ellipsoid_images_focus_to_focus(backend, eccentricity):
    near = 10.0
    half_axis = near / (1 - eccentricity)
    far = half_axis * (1 + eccentricity)
    face = mirror(-half_axis * (1 - eccentricity**2), -(eccentricity**2), half_width=9.0)
    for source, image in ((near, far), (far, near)):
        path = LightPath((face,), (AIR, AIR), Plane(Pose.at((0.0, 0.0, -image)) @ BACK))
        u, v, _, _ = traced(backend, path, cone(np.degrees(np.arctan(4.0 / source)), source))
        assert max(np.abs(u).max(), np.abs(v).max()) < 1e-10


def test_a_plano_hyperboloid_makes_a_point_parallel(backend):
    """K = -n^2 with the vertex radius f (n - 1), met first: a point in air at f."""
    index, focus = 1.5, 20.0
    front = FreeformSurface((10.0, 10.0), Conic(focus * (index - 1), -(index**2)))
    lens = Lens(front, FreeformSurface((10.0, 10.0)), 12.0, index)
    u, v, _, _ = traced(backend, LightPath.through(lens, FarField(), 0.0), cone(20.0, focus))
    assert max(np.abs(u).max(), np.abs(v).max()) < np.degrees(1e-12)


def test_an_ellipsoid_of_glass_makes_a_point_within_it_parallel(backend):
    """K = -1 / n^2: the point is the far focus, in glass."""
    index, half_axis = 1.5, 18.0
    e = 1 / index
    face = Surface(FreeformSurface((9.0, 9.0), Conic(-half_axis * (1 - e**2), -(e**2))))
    path = LightPath((face,), (Medium(index), AIR), FarField())
    u, v, _, fates = traced(backend, path, cone(15.0, half_axis * (1 + e)))
    assert max(np.abs(u).max(), np.abs(v).max()) < np.degrees(1e-12)
    assert fates.by_name["total_internal"] == 0


def prism(index):
    """Return the path through a right-angle prism, which turns light along z to -y."""
    leg = FreeformSurface((12.0, 12.0))
    hypotenuse = Surface(SHEET, Pose.at((0.0, 0.0, 10.0), (-np.pi / 4, 0.0, 0.0)), "reflect")
    aside = Pose.at((0.0, 0.0, 10.0), (np.pi / 2, 0.0, 0.0))
    exit_face = Surface(leg, aside @ Pose.at((0.0, 0.0, 10.0)))
    glass = Medium(index)
    receiver = Plane(aside @ Pose.at((0.0, 0.0, 50.0)))
    return LightPath((Surface(leg), hypotenuse, exit_face), (AIR, glass, glass, AIR), receiver)


def test_a_right_angle_prism_reflects_totally_and_flips_one_axis(backend):
    beam = collimated_beam((5.0, 5.0), 1.0, (12.0, 12.0), (9, 8))
    single = beam.rays(-20.0)
    x, y, flux, fates = traced(backend, prism(1.5), beam)
    np.testing.assert_allclose(x, single.origin[0], rtol=0, atol=1e-13)
    np.testing.assert_allclose(y, -single.origin[1], rtol=0, atol=1e-13)
    assert flux.sum() == pytest.approx(0.96**2, rel=1e-14)
    assert fates.total == pytest.approx(1.0, rel=1e-14)


def test_below_the_critical_index_a_prism_reflects_what_fresnel_says(backend):
    index = 1.35
    _, _, flux, fates = traced(backend, prism(index), collimated_beam((5.0, 5.0), 1.0, (12.0, 12.0), (9, 8)))
    let_out = np.mean([t[0] for t in transmittances(index, 1.0, np.pi / 4)])
    straight = transmittances(1.0, index, 0.0)[0][0]
    assert 0.5 < let_out < 1
    assert flux.sum() == pytest.approx(straight**2 * (1 - let_out), rel=1e-12)
    assert fates.by_name["total_internal"] == 0


def test_shares_of_a_splitter_add_up(backend):
    """What a plate reflects and what it lets pass are two paths of one surface."""
    pose, rays = Pose.at((0.0, 0.0, 10.0), (-np.pi / 4, 0.0, 0.0)), cone(5.0, 20.0)
    through = LightPath((Surface(SHEET, pose, share=0.3),), (AIR, AIR), Plane(Pose.at((0, 0, 40.0))))
    aside = replace(through, surfaces=(Surface(SHEET, pose, "reflect", 0.7),))
    aside = aside.onto(mirrored(pose, through.receiver))
    fluxes = [traced(backend, path, rays)[2] for path in (through, aside)]
    np.testing.assert_allclose(sum(fluxes), rays.flux, rtol=1e-14)
    np.testing.assert_allclose(fluxes[0], 0.3 * rays.flux, rtol=1e-14)


def test_no_path_makes_light_denser_than_pi_times_its_radiance(backend):
    """A Lambertian disk in the far focus of an ellipsoid, made five times smaller in the near one."""
    eccentricity, near, count, radius = 2 / 3, 10.0, 1 << 17, 0.5
    half_axis = near / (1 - eccentricity)
    far = half_axis * (1 + eccentricity)
    face = mirror(-half_axis * (1 - eccentricity**2), -(eccentricity**2), half_width=12.0)
    path = LightPath((face,), (AIR, AIR), Plane(Pose.at((0.0, 0.0, -near)) @ BACK))
    (rays,) = lambertian_parts((radius, radius), far, 1.0, 12.0, Profile("round"), count, 3, 1 << 30)
    landing = Tracer(backend, path, rays).landed()
    points = [a.numpy() for a in (landing.x, landing.y)]
    edges = np.linspace(-0.2, 0.2, 9)
    flux = np.histogram2d(*points, bins=[edges, edges], weights=landing.flux.numpy())[0]
    found, error = flux / 0.05**2, np.sqrt(flux / count) / 0.05**2
    radiance = 1 / (np.pi * (2 * radius) ** 2 * np.sin(np.radians(12.0)) ** 2)
    assert (found <= np.pi * radiance + 5 * error).all()
    assert found.max() > 0.5 * np.pi * radiance


def worst_gradient(backend, path, rays):
    """Return the greatest error of a derivative along random directions, by central differences.

    Of sum_i (a_i x_i + b_i y_i) + sum_i c_i flux_i with random weights, relative to the usual derivative.
    """
    dr, rng = backend.dr, np.random.default_rng(2)
    tracer = Tracer(backend, path, rays)
    weights = [backend.array(rng.standard_normal(rays.flux.size)) for _ in range(3)]
    coefficients = [sag.coefficients for sag in path.sags]
    ends = np.cumsum([c.size for c in coefficients])[:-1]

    def value(vector):
        hits, landing = tracer.trace(np.split(vector, ends))
        terms = landing.x, landing.y, landing.flux * rays.flux.size
        return hits, dr.sum(sum(w * t for w, t in zip(weights, terms)))

    at = np.concatenate(coefficients)
    hits, total = value(at)
    dr.backward(total)
    gradient = np.concatenate(tracer.pull_back(hits))
    usual, errors = np.linalg.norm(gradient) / np.sqrt(at.size), []
    for _ in range(5):
        direction = rng.standard_normal(at.size)
        direction /= np.linalg.norm(direction)
        with dr.suspend_grad():
            up, down = (value(at + step * direction)[1].numpy()[0] for step in (STEP, -STEP))
        errors.append(abs((up - down) / (2 * STEP) - gradient @ direction))
    assert usual > 1
    return max(errors) / usual


def free(path, surface):
    """Return a path of which one surface is rough."""
    shapes = [s.shape for s in path.surfaces]
    shapes[surface] = wavy(shapes[surface], 0.01)
    return replace(path, surfaces=tuple(replace(s, shape=h) for s, h in zip(path.surfaces, shapes)))


FOCUS = 12.0
LENS_PATH = LightPath.through(FREE, RECEIVERS["tilted"], 0.01)
GRADIENTS = {
    "a lens before a fold": (folded(LENS_PATH), cone(5.0, 80.0)),
    "a beam on a lens before a fold": (folded(LENS_PATH), SOURCES["beam"]()),
    "a lens before a free mirror": (free(folded(LENS_PATH), 2), cone(5.0, 80.0)),
    "a paraboloid": (
        LightPath((mirror(-2 * FOCUS, -1.0, height=0.01),), (AIR, AIR), FarField(BACK)),
        cone(40.0, FOCUS),
    ),
    "an ellipsoid": (
        LightPath((mirror(-16.0, -0.36, 9.0, 0.01),), (AIR, AIR), Plane(Pose.at((0.0, 0.0, -40.0)) @ BACK)),
        cone(10.0, 10.0),
    ),
    "glass around a point": (
        LightPath(
            (Surface(wavy(FreeformSurface((9.0, 9.0), Conic(-10.0, -0.44)), 0.01)),),
            (Medium(1.5), AIR),
            Plane(Pose.at((0.0, 0.0, 50.0))),
        ),
        cone(15.0, 30.0),
    ),
    "a prism": (free(prism(1.5), 1), cone(5.0, 60.0)),
    "a prism that leaks": (free(prism(1.3), 1), cone(5.0, 60.0)),
}


@pytest.mark.parametrize("scene", GRADIENTS)
def test_gradients_of_scenes_are_those_of_differences(backend, scene):
    assert worst_gradient(backend, *GRADIENTS[scene]) < 1e-8
