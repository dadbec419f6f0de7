"""Two traces of the same rays: what counts as another fate."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from optics.exchange.verification import RaysBehind
from optics.exchange.verification.reference_tracer import lens_faces, through_faces
from optics.exchange.verification.step_file import StepFile
from optics.exchange.verification.trace_comparison import compared, file_landing, light_checks
from optics.light.tracing import Tracer
from optics.scene.problem import Problem, load_problem
from optics.scene.sources import single_rays
from optics.scene.system import System, solvable_system
from tests.optics.cases import small_system, write_problem
from thbcad.cad import write_step
from thbcad.lens import placed_surfaces
from thbcad.surfaces import THBSurface


def faces_of(system):
    """Return the faces of a system's lens, as a file has them."""
    front, rear = placed_surfaces(system.base)
    return lens_faces(SimpleNamespace(front=front, rear=rear), system.path, system.own_faces)


@pytest.mark.parametrize("sigma", [0.05, 0.02, 0.01, 0.005])
def test_rays_too_weak_for_a_thread_have_no_other_fate(tmp_path, backend, sigma):
    """Threads of Dr.Jit may round subnormal numbers to none; those of numpy do not."""
    problem = load_problem(
        write_problem(tmp_path, {"source.profile": "gaussian", "source.sigma": [sigma, sigma]})
    )
    system = System(problem)
    faces = faces_of(system)
    subnormal = []

    def flushing(rays):
        seen = through_faces(faces, rays)
        weak = seen.flux < np.finfo(float).tiny
        subnormal.append(int((weak & (seen.flux > 0)).sum()))
        return replace(seen, flux=np.where(weak, 0.0, seen.flux))

    seen = compared(system, backend, (129, 129), flushing)
    assert seen.mismatched == 0
    assert seen.landing <= 1e-8
    assert (subnormal[0] > 0) == (sigma < 0.05)


def test_a_ray_with_light_that_arrives_in_one_trace_only_counts(tmp_path, backend):
    system = small_system(tmp_path)
    faces = faces_of(system)

    def losing(rays):
        seen = through_faces(faces, rays)
        flux = seen.flux.copy()
        flux[:3] = 0.0
        flux[3] *= 1e-13
        return replace(seen, flux=flux)

    assert compared(system, backend, (9, 9), losing).mismatched == 4


@pytest.mark.slow
@pytest.mark.parametrize(
    "source", [{"kind": "collimated", "half_width": (8, 8)}, {"kind": "point", "half_angle": 25}]
)
def test_the_independent_trace_blocks_the_same_rays(tmp_path, source):
    stops = (
        {"shape": "rectangle", "half_width": (6, 4), "position": (1, 0, -9), "tilt": (0, 35, 0)},
        {"shape": "ring", "half_width": (2, 1.5), "inner": (1, 0.5), "position": (1, 2, 30), "hole": False},
    )
    size = {"half_width": (10, 10)}
    problem = Problem(
        source={"distance": 20, **source},
        lens={"index": 1.5, "thickness": 6, "front": size, "rear": size, "outline": "round"},
        target={"kind": "tophat", "distance": 60, "half_width": (20, 20), "pixels": (16, 16)},
        stop=stops,
    ).with_(
        **{
            "lens.clear_aperture": (7, 7),
            "lens.rear.radius": -40.0,
            "lens.rear.freeform.degree": 5,  # a sphere by few poles
            "stop.1.tilt": (40, 0, 0),
        }
    )
    system = solvable_system(problem)
    lens, path = system.base, system.path
    write_step(lens, tmp_path / "lens.step")
    file = StepFile(tmp_path / "lens.step")
    landing = file_landing(system.with_lens(lens), file.solid, file)
    assert all(check.ok for check in light_checks(system.with_lens(lens), landing, system.backend))
    rays = single_rays(system.source.rays((101, 101)), lens)
    tracer = Tracer(system.backend, path, rays)
    _, landing = tracer.trace()
    faces = lens_faces(file.solid, path, system.own_faces, file.rims)
    behind = through_faces(faces, RaysBehind(rays.origin.T, rays.direction.T, rays.flux), path.stops)
    seen = behind.landing(path.receiver, path.stops)
    fates = tracer.fates(landing, (20, 20))
    assert fates.blocked > 0.5
    assert seen.flux.sum() == pytest.approx(fates.transmitted, abs=1e-12)


FLAT = {"freeform": None, "half_width": (12.0, 12.0)}
SPREADING = {"kind": "lens", "name": "L1", "index": 1.6, "thickness": 4.0, "position": (1, 0, -30)}
SPREADING |= {"front": {"half_width": (12.0, 12.0)}, "rear": FLAT | {"radius": 60.0, "conic": 0.5}}
FREE = {"kind": "lens", "name": "L2", "index": 1.5, "thickness": 5.0, "tilt": (0, 4, 0)}
FREE |= {"front": FLAT | {"radius": 90.0}, "rear": {"half_width": (12.0, 12.0)}}
FOLDING = {"kind": "mirror", "name": "M1", "position": (0, 0, 60), "tilt": (45, 0, 0), "thickness": 5.0}
FOLDING |= {"face": {"half_width": (30.0, 40.0), "radius": -300.0, "freeform": None}}
BESIDE = {"position": (0, 80, 60), "tilt": (-90, 0, 0)}
ROWS = {
    "through": ([SPREADING, FREE], [], {"position": (0, 0, 90)}),
    "onto a mirror": ([SPREADING, FREE, FOLDING], [], BESIDE),
    "from a mirror": (
        [FREE | {"position": (0, 80, 60), "tilt": (-90, 0, 0)}, FOLDING],
        ["M1", "L2.front", "L2.rear"],
        {"position": (0, 140, 60), "tilt": (-90, 0, 0)},
    ),
    "back from the rear": (
        [FREE],
        ["L2.front", "L2.rear:reflect", "L2.front"],
        {"position": (0, 0, -60), "tilt": (180, 0, 0)},
    ),
}


@pytest.mark.parametrize("name", ROWS)
@pytest.mark.parametrize("coats", [None, 0.3])
def test_independent_traces_go_along_a_row_of_elements(backend, name, coats):
    """With a rough sag, a stop between, and coatings: the same rays arrive at the same places."""
    elements, faces, target = ROWS[name]
    stop = {"shape": "rectangle", "half_width": (2, 3), "position": (2, 1, -20), "hole": False}
    problem = Problem(
        source={"kind": "collimated", "half_width": (9, 8), "distance": 50.0},
        element=[
            e | {"rear": e["rear"] | {"reflectance": coats}} if e["name"] == "L2" else e for e in elements
        ],
        path=({"faces": faces},) if faces else (),
        target={"kind": "tophat", "half_width": (60, 60), "pixels": (16, 16), **target},
        stop=(stop,),
    )
    system = System(problem)
    rng = np.random.default_rng(3)
    rough = [THBSurface(s.space, rng.normal(0, 0.03, s.space.dim)) for s in system.base.sags]
    lens = system.base.with_sags(rough)
    front, rear = placed_surfaces(lens)
    path = system.with_lens(lens).own_path
    own = lens_faces(SimpleNamespace(front=front, rear=rear), path, system.own_faces)
    seen = compared(
        system.with_lens(lens),
        backend,
        (41, 43),
        lambda rays: through_faces(own, rays, path.stops),
        blocked=True,
    )
    assert seen.mismatched == 0
    assert seen.landing < 1e-9
    assert seen.irradiance < 1e-9
