"""A scene as files that the program `mitsuba` renders: XML, PLY meshes with vertex normals, PFM bitmaps.

The source is brighter than the problem's, so that the picture of the screen goes from 0 to about 1: see
`irradiance_of_one`.  A second camera looks past the lens at the screen.
"""

import tempfile
from collections.abc import Callable, Mapping
from math import pi
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from optics.base.runtime import Check
from optics.exchange.mitsuba.cameras import overview_camera
from optics.exchange.mitsuba.loading import current_mitsuba
from optics.exchange.mitsuba.mesh import FACES
from optics.exchange.mitsuba.scene import REFLECTANCE, body_meshes, face_surfaces, scene_dictionary
from optics.scene.system import System

PLUGINS = {  # that `scene_dictionary` names, by their tags
    "scene": ("scene",),
    "integrator": ("ptracer",),
    "sensor": ("perspective",),
    "sampler": ("independent",),
    "film": ("hdrfilm",),
    "rfilter": ("box",),
    "shape": ("ply", "rectangle", "disk"),
    "bsdf": ("dielectric", "conductor", "diffuse", "null"),
    "emitter": ("area", "directionalarea", "point", "spot"),
    "texture": ("uniform", "bitmap"),
}
TAGS = {plugin: tag for tag, plugins in PLUGINS.items() for plugin in plugins}
VERSION = "3.0.0"  # of the XML dialect
BITMAP = ".pfm"  # Mitsuba writes EXR by its own threads, and waits for ever where there is one
SAMPLES = {"sensor": 256, "overview": 16}  # light paths per pixel: the overview has 640 x 480 pixels
SINGLE = 2.0**-22  # relative, of coordinates in float32


def scene_file_names(system: System, out: Path) -> list[Path]:
    """Return the files of a scene: the XML, its meshes, and what may be pictures of its sources."""
    optics = system.problem.optics
    called = [f"{optic.called}_" for optic in optics] if system.problem.element else [""]
    names = [f"{name}{face}.ply" for name in called for face in FACES]
    numbers = [f"_{k}" for k in range(1, len(system.source.each) + 1)] if system.source.several else [""]
    names += [f"source{number}{BITMAP}" for number in numbers]
    return [out, *(out.with_name(f"{out.stem}_{name}") for name in names)]


def scene_files(system: System, out: Path) -> dict[Path, bytes]:
    """Return the files of a system's scene by their paths; see `scene_dictionary`.

    Raises UserError : as `scene_dictionary`.
    """
    lens = system.designed
    mi, meshes = current_mitsuba(), body_meshes(system)
    brighter = pi / (REFLECTANCE * irradiance_of_one(system))
    scene = scene_dictionary(system, brighter=brighter)
    middle = system.pose.points(np.array([0.0, 0.0, lens.thickness / 2]))
    size = max(lens.rear.half_width)
    receiver = system.target.receiver
    scene["overview"] = overview_camera(mi, system.target.screen(), receiver.pose, middle, size)
    for name, count in SAMPLES.items():
        scene[name]["sampler"] = {"type": "independent", "sample_count": count}
    files: dict[Path, bytes] = {}
    with tempfile.TemporaryDirectory() as folder:

        def kept(name: str, write: Callable[[str], object]) -> str:
            path = out.with_name(f"{out.stem}_{name}")
            write(str(Path(folder) / path.name))
            files[path] = (Path(folder) / path.name).read_bytes()
            return path.name

        for name, surface in face_surfaces(system, meshes).items():
            file = kept(f"{name}.ply", scene[name].write_ply)
            scene[name] = {"type": "ply", "filename": file, "bsdf": surface}
            if name.endswith("edges"):
                scene[name]["face_normals"] = True
        for name in scene:
            texture = scene[name].get("emitter", {}).get("radiance", {}) if name.startswith("source") else {}
            if "bitmap" in texture:
                texture["filename"] = kept(f"{name}{BITMAP}", texture.pop("bitmap").write)
    root = _element(scene, "", mi.ScalarTransform4f)
    root.set("version", VERSION)
    for child in root:  # by which they are found again
        child.set("id", child.attrib.pop("name"))
    ElementTree.indent(root)
    return {out: ElementTree.tostring(root, "utf-8", xml_declaration=True) + b"\n", **files}


def irradiance_of_one(system: System) -> float:
    """Return the irradiance that is 1 in the pictures of a scene's files, W/mm^2: the greatest of the target,
    were all light of the source there."""
    screen = system.target.screen()
    return float(system.target.irradiance(screen, system.problem.flux).max())


def scene_checks(system: System, path: Path) -> list[Check]:
    """Return how far the vertices that Mitsuba reads in a scene's file are from the surfaces."""
    mi = current_mitsuba()
    parameters = mi.traverse(mi.load_file(str(path), optimize=False))
    checks = []
    for mesh in body_meshes(system):
        for face, surface, vertex in mesh.lens.faces:
            positions = np.array(parameters[f"{mesh.named(face)}.vertex_positions"], dtype=np.float64)
            placed = positions.reshape(-1, 3).T
            x, y, z = mesh.pose.inverse().points(placed)
            x, y = (np.clip(a, -h, h) for a, h in zip((x, y), surface.half_width))
            off = np.abs(vertex + surface(x, y) - z).max()
            limit = SINGLE * float(np.abs(placed).max())
            name = f"vertices of the {mesh.named(face).replace('_', '.')}, read by Mitsuba"
            checks.append(Check(name, float(off), limit, "mm"))
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
