"""Fates of light along a path of several elements: named by element and face, ray by ray."""

from dataclasses import replace

import numpy as np
import pytest

from optics.light.tracing import Tracer, fate_sentences, transmittances
from optics.scene.paths import AIR, LightPath, Medium, Surface
from optics.scene.receivers import Plane
from optics.scene.sources import Rays
from thbcad import Conic, Pose
from thbcad.lens import FreeformSurface
from thbcad.outlines import Outline

INDEX = 1.5
FOLD = Pose.at((0.0, 0.0, 30.0), (-np.pi / 4, 0.0, 0.0))  # light along z goes on along -y
NAMES = "L1.front", "L1.rear", "M1.face", "M2.face"
# x of rays along z; behind the sphere of 10 mm those beyond 6.67 mm are reflected totally
ENDS = {
    "L1.front missed": 12.0,
    "L1.rear blocked": -8.5,
    "L1.rear total reflection": 7.5,
    "M1.face missed": 6.0,
    "M2.face missed": -3.0,
    "off_target": 2.0,
    "on_target": 0.5,
}


def scene():
    """A lens whose round rear bends much, a mirror at 45 degrees beside its focus, and another one."""
    rear = FreeformSurface((9.0, 3.0), Conic(-10.0))
    lens = (
        Surface(FreeformSurface((10.0, 10.0))),
        Surface(rear, Pose.at((0, 0, 12.0)), clear=Outline((8.0, 3.0))),
    )
    first = Surface(FreeformSurface((3.0, 30.0)), FOLD, "reflect", 0.9)
    second = Surface(
        FreeformSurface((2.2, 30.0)), Pose.at((0.0, -20.0, 30.0), (np.pi / 4, 0.0, 0.0)), "reflect", 0.8
    )
    receiver = Plane(Pose.at((0.0, -20.0, 8.0), (np.pi, 0.0, 0.0)))  # light comes down to it
    media = AIR, Medium(INDEX), AIR, AIR, AIR
    return LightPath((*lens, first, second), media, receiver).named(NAMES)


def rays_along_z(x):
    return Rays(np.stack([x, 0.1 + 0 * x, -5.0 + 0 * x]), np.tile([[0.0], [0.0], [1.0]], x.size), 1.0 + 0 * x)


def fates_of(backend, path, x):
    """Return (fates, rays by fate) of rays along z."""
    tracer = Tracer(backend, path, rays_along_z(np.array(x)))
    _, landing = tracer.trace()
    return tracer.fates(landing, (2.0, 5.0)), tracer.counts(landing, (2.0, 5.0))


@pytest.mark.parametrize("end", ENDS)
def test_light_ends_at_the_face_that_geometry_says(backend, end):
    """What goes on at every face is by Fresnel at the sphere's angle of incidence, or a mirror's share."""
    fates, counts = fates_of(backend, scene(), [ENDS[end]])
    incidence = np.arcsin(min(np.hypot(ENDS[end], 0.1) / 10.0, 0.66))  # beyond it light is reflected totally
    through = np.mean([t[0] for t in transmittances(INDEX, 1.0, incidence)])
    left, known = 1.0, {}
    for face, share in zip(NAMES, (0.96, through, 0.9, 0.8)):
        if end.startswith(face):
            break
        known[f"{face} {'absorbed' if face[0] == 'M' else 'reflected'}"] = left * (1 - share)
        left *= share
    assert fates.by_name == pytest.approx(
        {"on_target": 0.0, "off_target": 0.0} | known | {end: left}, abs=1e-12
    )
    assert counts == {"on_target": 0, "off_target": 0} | {end: 1}


def test_weights_of_rays_are_as_much_flux_and_other_rays_share_the_path(backend):
    """Fates of weighted rays are those of rays with so much flux, traced by a tracer of rays with none."""
    x, path = np.array([*ENDS.values()]), scene()
    weights = np.linspace(0, 3, x.size)
    tracer = Tracer(backend, path, rays_along_z(x))
    weighed = tracer.fates(tracer.landed(), (2.0, 5.0), backend.array(weights))
    heavy = replace(rays_along_z(x), flux=weights)
    fresh = Tracer(backend, path, heavy)
    other = Tracer(backend, path, rays_along_z(x[:2] + 0.3)).with_rays(heavy)
    expected, landing = fresh.fates(fresh.landed(), (2.0, 5.0)), other.landed()
    assert weighed.by_name == pytest.approx(expected.by_name, abs=1e-13)
    assert other.fates(landing, (2.0, 5.0)).by_name == expected.by_name
    for name in ("x", "y", "flux"):
        np.testing.assert_array_equal(getattr(landing, name).numpy(), getattr(fresh.landed(), name).numpy())


def test_fates_of_many_rays_are_sums_and_have_their_sentences(backend):
    fates, counts = fates_of(backend, scene(), [*ENDS.values()])
    assert fates.total == pytest.approx(len(ENDS), rel=1e-14)
    assert fates.missed_rear == pytest.approx(
        fates.by_name["M1.face missed"] + fates.by_name["M2.face missed"], rel=1e-15
    )
    assert counts == dict.fromkeys(ENDS, 1)
    sentences = fate_sentences(fates.by_name)
    assert sentences["L1.rear total reflection"] == "is reflected totally at L1.rear"
    assert sentences["M2.face missed"] == "misses M2.face"
    assert set(fates.by_name) <= set(sentences)


def test_surfaces_without_names_have_the_fates_of_a_lens(backend):
    """The same flux, under the names of a front and a rear."""
    named, plain = (
        fates_of(backend, path, [*ENDS.values()])[0] for path in (scene(), scene().named([""] * 4))
    )
    assert plain.by_name["missed_rear"] == named.missed_rear
    ends = {name: name for name in ("absorbed", "blocked", "on_target", "off_target")}
    ends |= {"beside_lens": "L1.front missed", "rear_reflected": "L1.rear reflected"}
    for name, end in (ends | {"total_internal": "total reflection"}).items():
        of_faces = sum(flux for fate, flux in named.by_name.items() if fate.endswith(end))
        assert plain.by_name[name] == pytest.approx(of_faces, rel=1e-15)
