"""A scene as files that the program `mitsuba` renders: XML, PLY meshes with vertex normals, PFM bitmaps.

The source is brighter than the problem's, so that the picture of the screen goes from 0 to about 1: see
`irradiance_of_one`.  A second camera looks past the lens at the screen.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from math import pi
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from optics.base.runtime import Check
from optics.exchange.mitsuba.loading import current_mitsuba
from optics.exchange.mitsuba.mesh import FACES, LensMesh
from optics.exchange.mitsuba.scene import BLACK, REFLECTANCE, VERTICES, overview_camera, scene_dictionary
from optics.scene.system import OpticalSystem
from thbcad.lens import Lens

TAGS = {  # of the plugins that `scene_dictionary` names
    "scene": "scene",
    "ptracer": "integrator",
    "perspective": "sensor",
    "independent": "sampler",
    "hdrfilm": "film",
    "box": "rfilter",
    "ply": "shape",
    "rectangle": "shape",
    "disk": "shape",
    "dielectric": "bsdf",
    "diffuse": "bsdf",
    "null": "bsdf",
    "area": "emitter",
    "directionalarea": "emitter",
    "point": "emitter",
    "spot": "emitter",
    "uniform": "texture",
    "bitmap": "texture",
}
VERSION = "3.0.0"  # of the XML dialect
SOURCE = "source.pfm"  # Mitsuba writes EXR by its own threads, and waits for ever where there is one
SAMPLES = {"sensor": 256, "overview": 16}  # light paths per pixel: the overview has 640 x 480 pixels
SINGLE = 2.0**-22  # relative, of coordinates in float32


def scene_file_names(out: Path) -> list[Path]:
    """Return the files of a scene: the XML, and beside it its meshes and what may be its source's picture."""
    return [out, *(out.with_name(f"{out.stem}_{name}") for name in (*(f"{f}.ply" for f in FACES), SOURCE))]


def scene_files(system: OpticalSystem, lens: Lens, out: Path) -> dict[Path, bytes]:
    """Return the files of a system's scene by their paths; see `scene_dictionary`.

    Raises UserError : as `scene_dictionary`.
    """
    mi, mesh = current_mitsuba(), LensMesh.uniform(lens, VERTICES)
    brighter = pi / (REFLECTANCE * irradiance_of_one(system))
    flux = brighter * system.problem.flux
    lit = OpticalSystem(system.problem.with_(**{"source.flux": flux}), shapes=system.shapes)
    scene = scene_dictionary(lit, mesh)
    z = float(system.target.receiver.pose.shift[2])
    scene["overview"] = overview_camera(mi, system.target.screen(), z, lens)
    for name, count in SAMPLES.items():
        scene[name]["sampler"] = {"type": "independent", "sample_count": count}
    glass = {"type": "dielectric", "int_ior": lens.index, "ext_ior": 1.0}
    files: dict[Path, bytes] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, path in zip(FACES, scene_file_names(out)[1:]):
            place = Path(folder) / path.name
            scene[name].write_ply(str(place))
            files[path] = place.read_bytes()
            scene[name] = {"type": "ply", "filename": path.name, "bsdf": glass}
        scene["edges"]["face_normals"] = True
        if system.problem.optic.wall == "absorbing":
            scene["edges"]["bsdf"] = BLACK
        bitmap = scene["source"].get("emitter", {}).get("radiance", {}).pop("bitmap", None)
        if bitmap is not None:
            path = scene_file_names(out)[-1]
            bitmap.write(str(Path(folder) / path.name))
            files[path] = (Path(folder) / path.name).read_bytes()
            scene["source"]["emitter"]["radiance"]["filename"] = path.name
    root = _element(scene, "", mi.ScalarTransform4f)
    root.set("version", VERSION)
    for child in root:  # by which they are found again
        child.set("id", child.attrib.pop("name"))
    ElementTree.indent(root)
    return {out: ElementTree.tostring(root, "utf-8", xml_declaration=True) + b"\n", **files}


def irradiance_of_one(system: OpticalSystem) -> float:
    """Return the irradiance that is 1 in the pictures of a scene's files, W/mm^2: the greatest of the target,
    were all light of the source there."""
    screen = system.target.screen()
    return float(system.target.irradiance(screen, system.problem.flux).max())


def scene_checks(lens: Lens, path: Path) -> list[Check]:
    """Return how far the vertices of a scene's file are from the surfaces of a lens, as Mitsuba reads it."""
    mi = current_mitsuba()
    parameters = mi.traverse(mi.load_file(str(path), optimize=False))
    checks = []
    for name, surface, vertex in (("front", lens.front, 0.0), ("rear", lens.rear, lens.thickness)):
        positions = np.array(parameters[f"{name}.vertex_positions"], dtype=np.float64).reshape(-1, 3)
        off = np.abs(vertex + surface(positions[:, 0], positions[:, 1]) - positions[:, 2]).max()
        size = float(np.abs(positions).max())
        checks.append(Check(f"vertices of the {name}, read by Mitsuba", float(off), SINGLE * size, "mm"))
    return checks


def _element(value: Any, name: str, transform: Any) -> ElementTree.Element:
    """Return an entry of a scene's dictionary as an element of Mitsuba's XML."""
    if isinstance(value, Mapping):
        element = ElementTree.Element(TAGS[value["type"]])
        if value["type"] != "scene":
            element.attrib |= {"type": value["type"], "name": name}
        element.extend(_element(v, k, transform) for k, v in value.items() if k != "type")
        return element
    if isinstance(value, transform):
        element = ElementTree.Element("transform", name=name)
        numbers = np.array(value.matrix).reshape(-1)
        ElementTree.SubElement(element, "matrix", value=" ".join(repr(float(a)) for a in numbers))
        return element
    if isinstance(value, list):
        return ElementTree.Element("point", name=name, value=", ".join(repr(float(a)) for a in value))
    tags = {bool: "boolean", int: "integer", float: "float", str: "string"}
    text = str(value).lower() if isinstance(value, bool) else str(value)
    return ElementTree.Element(tags[type(value)], name=name, value=text)
