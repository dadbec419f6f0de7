"""Small problems for the tests: a picture, a problem file, and the objects behind it."""

import json
import re

import numpy as np
import pytest
from PIL import Image

from optics.base.runtime import load_backend
from optics.exchange.results import ResultFolder, ResultWriter
from optics.light.tracing import Tracer
from optics.scene.paths import LightPath
from optics.scene.problem import Problem, load_problem
from optics.scene.receivers import receiver_at
from optics.scene.sources import Divergence, area_parts, collimated_beam
from optics.scene.system import System
from tests.cases import EXAMPLES
from thbcad.hierarchy import THBSpace
from thbcad.lens import FreeformSurface, Lens
from thbcad.sags import Conic
from thbcad.splines import KnotVector
from thbcad.surfaces import THBSurface

THREADS = 1, 2, 4


def failing(checks):
    """Return the names of the checks that fail."""
    return [check.name for check in checks if not check.ok]


def lambertian_parts(half_width, distance, flux, half_angle, *rest):
    """Yield the rays of a Lambertian source within a cone of so many degrees; the rest is as of
    `area_parts`."""
    return area_parts(half_width, distance, flux, Divergence("lambertian", half_angle), *rest)


def on_threads(threads, work, *arguments):
    """Return what work(*arguments) returns with so many threads of Dr.Jit."""
    load_backend("double", threads)
    try:
        return work(*arguments)
    finally:
        load_backend("double", 1)


def store_result(path, problem, lens):
    """Write a result without a solid, as a design that was not verified would."""
    path.mkdir()
    folder = ResultFolder(path)
    writer = ResultWriter(folder, System(problem).with_lens(lens))
    writer.write_design(())
    writer.finish(problem, {"ok": True, "verdict": "", "notes": []})
    return folder


SMALL = {
    "title": "small",
    "source.kind": "collimated",
    "source.half_width": [9.5, 9.5],
    "lens.index": 1.5,
    "lens.thickness": 6.0,
    "lens.front.half_width": [10.0, 10.0],
    "lens.rear.half_width": [10.0, 10.0],
    "lens.rear.radius": 40.0,
    "lens.rear.conic": -1.0,
    "lens.rear.freeform.spans": [4, 4],
    "lens.rear.freeform.max_level": 2,
    "lens.rear.freeform.z_freedom": 1.0,
    "target.kind": "image",
    "target.image": "picture.png",
    "target.distance": 60.0,
    "target.half_width": [20.0, 20.0],
    "target.pixels": [48, 48],
    "optimizer.iterations": [6],
    "verify.rays": 17,
    "verify.rel_l2": 0.5,  # a few iterations on few pixels
    "verify.contrast_error": 10.0,
    "run.threads": 1,
}

WIDE = {  # far field in whose corners an irradiance is 0.77 of the intensity
    "target.kind": "tophat",
    "target.distance": np.inf,
    "target.half_width": [40.0, 40.0],
    "target.lit": [1.0, 1.0],
    "target.pixels": [24, 24],
    "lens.rear.radius": 11.0,
    "lens.rear.conic": -2.5,
}
FRONT = SMALL | {  # the front free in place of the rear
    "lens.front.freeform.spans": [4, 4],
    "lens.front.freeform.max_level": 2,
    "lens.front.freeform.z_freedom": 3.0,
    "lens.rear.freeform": False,
}
FREE_REAR = ("lens.rear.freeform.spans", "lens.rear.freeform.max_level", "lens.rear.freeform.z_freedom")

HOLLOW = {  # the problem of `hollow_lens`
    "lens.thickness": 5.0,
    "lens.front.half_width": [5.0, 5.0],
    "lens.front.radius": -5.0,
    "lens.front.conic": -1.0,
    "lens.rear.half_width": [8.0, 8.0],
    "lens.rear.radius": -10.0,
    "lens.rear.freeform.spans": [2, 2],
    "target.distance": 1000.0,
}
DOME = HOLLOW | {  # thesis Table 6.3: a square Lambertian emitter of 1 mm in the hollow of a dome
    "source.kind": "lambertian",
    "source.half_width": [0.5, 0.5],
    "source.distance": 2.0,
    "target.kind": "tophat",
    "target.half_width": [2000.0, 1500.0],
    "target.lit": [0.6, 0.4],
    "target.pixels": [40, 30],
}
GLOWING = {
    "source.kind": "lambertian",
    "source.half_width": [0.5, 0.5],
    "source.distance": 8.0,
    "source.half_angle": 30.0,
}
PLANE, PARABOLOID = Conic(), Conic(40.0, -1.0)
TARGET_Z = 66.0  # of a plane 60 mm behind the small lens


def picture(rows=48, columns=48):
    """Return a grey picture without symmetry, (rows, columns) uint8: a blob and a bright corner."""
    y, x = np.linspace(0, 1, rows)[:, None], np.linspace(0, 1, columns)[None, :]
    light = 0.3 + 0.5 * np.exp(-((x - 0.35) ** 2 + (y - 0.4) ** 2) / 0.05) + 0.2 * (x > 0.6) * (y > 0.5)
    return np.round(255 * light / light.max()).astype(np.uint8)


KINDS = ("point", "rays", "tophat", "function", "zones")  # other than those of SMALL
OWN_KEYS = {  # keys of SMALL that only some kinds have
    "source.half_width": ("source.kind", ("collimated", "lambertian", "luminaire")),
    "target.image": ("target.kind", ("image",)),
    "verify.contrast_error": ("target.kind", ("image", "function")),
}


def toml_text(values):
    """Return TOML for {"table.key": value}; written without the package's own writer.

    Keys that SMALL or DOME has, and a problem of another kind has not, are left out.
    """
    rows = {}
    for key, value in values.items():
        if key in OWN_KEYS and value in (SMALL[key], DOME.get(key)):
            other, kinds = OWN_KEYS[key]
            if isinstance(kind := values.get(other), str) and kind in KINDS and kind not in kinds:
                continue
        table, _, name = key.rpartition(".")
        rows.setdefault(table, []).append(f"{name} = {toml_value(value)}")
    return "".join(
        (f"[{table}]\n" if table else "") + "\n".join(lines) + "\n" for table, lines in rows.items()
    )


def toml_value(value):
    """Return a value as TOML; strings are escaped to ASCII."""
    if isinstance(value, str):
        return (
            '"'
            + "".join(c if " " <= c <= "~" and c not in '"\\' else f"\\U{ord(c):08x}" for c in value)
            + '"'
        )
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml_value(k)} = {toml_value(v)}" for k, v in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    return json.dumps(value).replace("Infinity", "inf").replace("NaN", "nan")


def write_problem(folder, changes=None, image=None, drop=(), name="problem.toml"):
    """Write the small problem with its picture into a folder and return the problem file's path.

    changes : {"table.key": value}.  image : uint8 array, or None for `picture()`.  drop : keys left out.
    """
    Image.fromarray(picture() if image is None else image).save(folder / "picture.png")
    values = {k: v for k, v in (SMALL | (changes or {})).items() if k not in drop}
    path = folder / name
    path.write_text(toml_text(values), "utf-8")
    return path


def example_system(name, changes=None):
    """Return the System of an example; changes : {"table.key": value}."""
    return System(load_problem(EXAMPLES / f"{name}.toml", changes))


def small_problem(folder, changes=None, image=None, **more):
    """Return the small problem, written into a folder and loaded, see `write_problem`."""
    return load_problem(write_problem(folder, changes, image, **more))


def small_system(folder, changes=None, image=None, **more):
    """Return the system of the small problem, see `small_problem`."""
    return System(small_problem(folder, changes, image, **more))


def flat_problem(source, target=(), lens=(), **more):
    """Return the problem of a lens of plane faces, 20 mm wide, 60 mm before an even target.

    source, target, lens : what their tables hold, or hold otherwise.  more : other tables.
    """
    size = {"half_width": (10, 10)}
    lens = {"index": 1.5, "thickness": 6, "front": size, "rear": size} | dict(lens)
    target = {"kind": "tophat", "distance": 60, "half_width": (12, 12), "pixels": (16, 16)} | dict(target)
    return Problem(source=source, lens=lens, target=target, **more)


def alone(system, wavelength):
    """Return the system of a problem in light of one wavelength of a spectrum, with all of the flux."""
    medium = wavelength.media[1]
    light = {"source.spectrum": (), "source.wavelength": wavelength.nm, "lens.indices": ()}
    glass = {"lens.index": medium.index, "lens.absorption": medium.absorption, "lens.absorptions": ()}
    return System(system.problem.with_(**light, **glass))


def small_space(half_width=(10.0, 10.0), degree=3, refined=True):
    """Return a THB space of three levels (or one) on a rectangle, without symmetry."""
    space = THBSpace(*(KnotVector.uniform(degree, 4, -h, h) for h in half_width))
    if not refined:
        return space
    return space.refine({0: [(i, j) for i in range(4) for j in range(3)]}).refine(
        {1: [(2, 3), (2, 2), (3, 3), (3, 2), (0, 0)]}
    )


def small_lens(
    front=PLANE, rear=PARABOLOID, sag=None, rear_half_width=(10.0, 10.0), thickness=6.0, space=None
):
    """Return a lens of index 1.5 and half-width 10 mm; sag : coefficients on `space`, or None for zeros."""
    space = space or small_space(rear_half_width)
    sag = THBSurface(space, np.zeros(space.dim) if sag is None else sag)
    return Lens(
        FreeformSurface((10.0, 10.0), front), FreeformSurface(rear_half_width, rear, sag), thickness, 1.5
    )


def hollow_lens(rear=None, front=None, spans=(2, 2)):
    """Return the lens of thesis Table 6.3, in whose hollow front a source of 1 mm glows 2 mm before the
    vertex.

    rear, front : functions of a space that give the sag's coefficients on it; None is a sag of zeros on the
        rear, none on the front.
    """
    rear_space, front_space = (
        THBSpace(*(KnotVector.uniform(3, n, -h, h) for n in spans)) for h in (8.0, 5.0)
    )
    sags = [
        THBSurface(rear_space, np.zeros(rear_space.dim) if rear is None else rear(rear_space)),
        None if front is None else THBSurface(front_space, front(front_space)),
    ]
    surfaces = (
        FreeformSurface((5.0, 5.0), Conic(-5.0, -1.0), sags[1]),
        FreeformSurface((8.0, 8.0), Conic(-10.0, -1.0), sags[0]),
    )
    return Lens(*surfaces, 5.0, 1.5)


def coefficients(lens):
    """Return the THB coefficients of the lens's free surfaces, front first, as the tracer takes them."""
    return [sag.coefficients for sag in lens.sags]


def rough(space, height=0.02, seed=5):
    """Return random coefficients of at most `height` mm."""
    return np.random.default_rng(seed).uniform(-height, height, space.dim)


def roughened(lens, height=0.02, seeds=(5, 5)):
    """Return a lens with the coefficients of `rough` on its sags, front first."""
    return lens.with_sags(
        [THBSurface(sag.space, rough(sag.space, height, seed)) for sag, seed in zip(lens.sags, seeds)]
    )


def moved_point(text, point, change):
    """Return the text with the one CARTESIAN_POINT at these coordinates changed."""
    pattern = re.compile(r"(CARTESIAN_POINT\('',\()([^)]*)(\)\))")
    found = [m for m in pattern.finditer(text) if [float(v) for v in m[2].split(",")] == list(point)]
    assert len(found) == 1
    numbers = ",".join(f"{a:#.17G}" for a in np.asarray(point) + change)
    return text[: found[0].start(2)] + numbers + text[found[0].end(2) :]


def target_z(problem):
    """z of a target across the axis, mm; inf of the far field."""
    return problem.lens.thickness + problem.throw


def tracer_to(backend, lens, rays, target_z, soft_rim=0.0, proven=True, fresnel=True, absorption=0.0):
    """Return the Tracer of a lens alone, to a plane; inf is the far field."""
    path = LightPath.through(lens, receiver_at(target_z), absorption).with_soft_rims(soft_rim)
    return Tracer(backend, path if fresnel else path.without_reflection(), rays, proven)


def traced(backend, lens, source=(9.5, 9.5), rays=(41, 37), target_z=TARGET_Z, target=(20.0, 20.0)):
    """Return (Hits of the rear, Landing, SequentialFates, RayGrid) of a lens in a collimated beam."""
    beam = collimated_beam(source, 1.0, lens.front.half_width, rays)
    tracer = tracer_to(backend, lens, beam, target_z)
    hits, landing = tracer.trace(coefficients(lens))
    return hits[-1], landing, tracer.fates(landing, target), beam


def mesh(beam):
    """Return the rays' x and y, (n,), in the order of the tracer: y first."""
    return np.repeat(beam.x, len(beam.y)), np.tile(beam.y, len(beam.x))


def landing_points(landing):
    return np.column_stack([landing.x.numpy(), landing.y.numpy()])


def grazing_rays(surface, count, seed=0, least=0.02):
    """Return (origin, direction), (3, n) each: rays that start in the glass below the surface, up to grazing
    (cos theta >= least)."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-5, 5, (2, count))
    z = np.minimum(rng.uniform(-7, -1, count), surface(x, y) - 0.01)
    cosine, turn = rng.uniform(least, 1, count), rng.uniform(0, 2 * np.pi, count)
    sine = np.sqrt(1 - cosine**2)
    return np.stack([x, y, z]), np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine])


def front_problem(folder, changes=None):
    """Return the small problem with the front free in place of the rear."""
    return load_problem(write_problem(folder, FRONT | (changes or {}), drop=FREE_REAR))


def assert_gradient_of_loss(system, rays, window="cells"):
    """At rough surfaces of level 1, along the gradient, by central differences of 1e-6 mm."""
    given = system.space(level=1)
    several = isinstance(given, tuple)
    spaces = given if several else (given,)
    model = system.model(given, rays=rays, window=window)
    at = np.concatenate([rough(space, 0.02, seed=k) for k, space in enumerate(spaces)])
    cuts = np.cumsum([space.dim for space in spaces])[:-1]

    def loss(c):
        value, gradient = model.loss(tuple(np.split(c, cuts)) if several else c)
        return value, np.concatenate(gradient) if several else gradient

    _, gradient = loss(at)
    along = gradient / np.linalg.norm(gradient)
    ahead, behind = (loss(at + step * along)[0] for step in (1e-6, -1e-6))
    assert (ahead - behind) / 2e-6 == pytest.approx(gradient @ along, rel=1e-8)
