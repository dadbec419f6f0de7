"""Triangle meshes as GLB (glTF 2.0): metres, y upwards, one material per face; the same mesh gives the same
bytes.

Positions are float32 in mm; the node scales them to the metres of the standard, so that nothing is rounded
twice.

Source: Khronos Group, glTF 2.0 specification, chapters 3 and 4.
"""

import json
import struct

import numpy as np

from thbcad.checks import require_type
from thbcad.io import require_single
from thbcad.lens import Tessellation, face_colour

METRES = 1e-3  # per mm
FLOAT, UNSIGNED = 5126, 5125  # glTF's component types
VERTICES, INDICES = 34962, 34963  # glTF's targets of buffers
JSON, BINARY = b"JSON", b"BIN\0"


def glb_bytes(mesh: Tessellation, name: str = "lens") -> bytes:
    """Return a GLB file whose primitives are the faces of the mesh, with names and colours.

    Raises ValueError : no Tessellation; vertices that float32 does not hold.
    """
    require_type("mesh", mesh, Tessellation)
    require_single(mesh, "GLB")
    positions = mesh.vertices.astype("<f4")
    order = np.argsort(mesh.faces, kind="stable")
    indices = mesh.triangles[order].astype("<u4")
    present, counts = np.unique(mesh.faces, return_counts=True)
    names = [mesh.names[face] for face in present]
    starts = positions.nbytes + 12 * (np.cumsum(counts) - counts)
    binary = positions.tobytes() + indices.tobytes()
    header = {
        "asset": {"version": "2.0", "generator": "thbcad"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": name, "mesh": 0, "scale": [METRES] * 3}],
        "meshes": [
            {
                "name": name,
                "primitives": [
                    {"attributes": {"POSITION": 0}, "indices": k + 1, "material": k}
                    for k in range(len(names))
                ],
                "extras": {"chord_error_mm": mesh.chord, "faces": names},
            }
        ],
        "materials": [_material(face) for face in names],
        "accessors": [
            _positions(positions),
            *(
                {"componentType": UNSIGNED, "count": 3 * int(n), "type": "SCALAR", "bufferView": k + 1}
                for k, n in enumerate(counts)
            ),
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": positions.nbytes, "target": VERTICES},
            *(
                {"buffer": 0, "byteOffset": int(start), "byteLength": 12 * int(n), "target": INDICES}
                for start, n in zip(starts, counts)
            ),
        ],
        "buffers": [{"byteLength": len(binary)}],
    }
    text = json.dumps(header, separators=(",", ":")).encode()
    chunks = _chunk(JSON, text, b" ") + _chunk(BINARY, binary, b"\0")
    return struct.pack("<4s2I", b"glTF", 2, 12 + len(chunks)) + chunks


def _positions(positions: np.ndarray[tuple[int, ...], np.dtype[np.float32]]) -> dict[str, object]:
    return {
        "bufferView": 0,
        "componentType": FLOAT,
        "count": len(positions),
        "type": "VEC3",
        "min": positions.min(axis=0).tolist(),
        "max": positions.max(axis=0).tolist(),
    }


def _material(face: str) -> dict[str, object]:
    """Return the material of a face: its sRGB colour as the linear one that glTF wants, not metallic."""
    colour = np.array(face_colour(face))
    linear = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    factors = {"baseColorFactor": [*linear.round(6).tolist(), 1.0], "metallicFactor": 0.0}
    return {"name": face, "pbrMetallicRoughness": {**factors, "roughnessFactor": 0.3}}


def _chunk(kind: bytes, data: bytes, padding: bytes) -> bytes:
    data += padding * (-len(data) % 4)
    return struct.pack("<I4s", len(data), kind) + data
