"""Triangle meshes as STL, 3MF, OBJ and PLY files; the same mesh gives the same bytes.

STL and 3MF hold float32: their meshes must have been rounded to it (`tessellated(..., single=True)`).
OBJ and PLY hold float64: every number reads back bit for bit.

Sources: 3MF Core Specification 1.3; G. Turk, The PLY polygon file format, 1994.
"""

import io
import zipfile

import numpy as np

from thbcad.lens import Tessellation

TYPES = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" '
    'ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>\n'
)
RELATIONS = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    '<Relationship Target="/3D/3dmodel.model" Id="rel0" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>'
    "</Relationships>\n"
)
MODEL = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<model unit="millimeter" xml:lang="en-US" '
    'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
    '<metadata name="Title">lens</metadata><metadata name="Application">thbcad</metadata>'
    '<resources><object id="1" name="lens" type="model"><mesh><vertices>\n',
    "</vertices><triangles>\n",
    '</triangles></mesh></object></resources><build><item objectid="1"/></build></model>\n',
)
STAMP = (2000, 1, 1, 0, 0, 0)


def stl_bytes(mesh: Tessellation) -> bytes:
    """Return a binary STL file, mm; the facets keep their order.

    Raises ValueError : vertices that float32 does not hold.
    """
    require_single(mesh, "STL")
    corners = mesh.vertices[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facets = np.zeros(
        len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]
    )
    facets["normal"] = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    facets["corners"] = corners
    head = f"thbcad lens, mm, chord error at most {mesh.chord:.3g} mm".encode().ljust(80)
    result: bytes = head + np.uint32(len(facets)).astype("<u4").tobytes() + facets.tobytes()
    return result


def threemf_bytes(mesh: Tessellation) -> bytes:
    """Return a 3MF package with one object, mm.

    Raises ValueError : vertices that float32 does not hold.
    """
    require_single(mesh, "3MF")
    model = io.BytesIO()
    model.write(MODEL[0].encode())
    # nine digits distinguish all float32
    np.savetxt(model, mesh.vertices, '<vertex x="%.9g" y="%.9g" z="%.9g"/>')
    model.write(MODEL[1].encode())
    np.savetxt(model, mesh.triangles, '<triangle v1="%d" v2="%d" v3="%d"/>')
    model.write(MODEL[2].encode())
    package = io.BytesIO()
    with zipfile.ZipFile(package, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in (
            ("[Content_Types].xml", TYPES),
            ("_rels/.rels", RELATIONS),
            ("3D/3dmodel.model", model.getvalue()),
        ):
            entry = zipfile.ZipInfo(name, STAMP)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3
            archive.writestr(entry, data)
    return package.getvalue()


def obj_bytes(mesh: Tessellation) -> bytes:
    """Return a Wavefront OBJ file with 17 digits, mm."""
    text = io.BytesIO()
    text.write(f"# thbcad lens, mm, chord error at most {mesh.chord:.3g} mm\no lens\n".encode())
    np.savetxt(text, mesh.vertices, "v %.17g %.17g %.17g")
    np.savetxt(text, mesh.triangles + 1, "f %d %d %d")
    return text.getvalue()


def ply_bytes(mesh: Tessellation) -> bytes:
    """Return a binary PLY file with float64 coordinates, mm."""
    head = (
        "ply\nformat binary_little_endian 1.0\ncomment thbcad lens, mm, chord error at most "
        f"{mesh.chord:.3g} mm\n"
        f"element vertex {len(mesh.vertices)}\nproperty double x\nproperty double y\nproperty double z\n"
        f"element face {len(mesh.triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    faces = np.empty(len(mesh.triangles), dtype=[("count", "u1"), ("vertices", "<i4", 3)])
    faces["count"], faces["vertices"] = 3, mesh.triangles
    return head.encode() + mesh.vertices.astype("<f8").tobytes() + faces.tobytes()


def require_single(mesh: Tessellation, name: str) -> None:
    """Raise ValueError unless float32 holds the vertices; name : of the format, for the sentence."""
    if (mesh.vertices != mesh.vertices.astype(np.float32)).any():
        raise ValueError(f"{name} holds float32: the mesh must be tessellated with single=True")
