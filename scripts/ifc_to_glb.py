#!/usr/bin/env python3
"""Turns a building in IFC into a GLB that `mapfold-server import` takes: scripts/ifc_to_glb.py IN.ifc OUT.glb

Needs the package ifcopenshell, which the product does not. Walls are taken whole; a door becomes a doorway, the box that its
frame fills, which opens the wall when the model is cut. Lengths are metres, y is up.
"""

import json
import struct
import sys

import ifcopenshell
import ifcopenshell.geom

KINDS = {
    "IfcWall": "wall",
    "IfcCurtainWall": "wall",
    "IfcColumn": "wall",
    "IfcDoor": "doorway",
    "IfcSlab": "corridor",
    "IfcFurnishingElement": "furniture",
    "IfcFlowTerminal": "furniture",
}
# A doorway is deeper than its wall, metres on either side.
DEEPER = 0.1


def box(points):
    low = [min(p[k] for p in points) for k in range(3)]
    high = [max(p[k] for p in points) for k in range(3)]
    low[1] -= DEEPER
    high[1] += DEEPER
    corners = [[(low, high)[i >> k & 1][k] for k in range(3)] for i in range(8)]
    faces = [0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5]
    return corners, faces


def main(source, target):
    model = ifcopenshell.open(source)
    settings = ifcopenshell.geom.settings()
    settings.set("disable-opening-subtractions", True)
    settings.set("weld-vertices", True)
    nodes, meshes, accessors, binary = [{"name": "site", "children": []}], [], [], bytearray()
    views = []

    def put(data, kind, count, target, **more):
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(data), "target": target})
        binary.extend(data)
        binary.extend(b"\0" * (-len(binary) % 4))
        component = 5126 if kind == "VEC3" else 5125
        accessors.append({"bufferView": len(views) - 1, "componentType": component, "count": count, "type": kind, **more})
        return len(accessors) - 1

    for word, kind in KINDS.items():
        for product in model.by_type(word):
            if not product.Representation:
                continue
            shape = ifcopenshell.geom.create_shape(settings, product)
            flat = shape.geometry.verts
            points = [list(flat[i : i + 3]) for i in range(0, len(flat), 3)]
            faces = list(shape.geometry.faces)
            if not faces:
                continue
            if kind == "doorway":
                points, faces = box(points)
            m = shape.transformation.matrix
            m = list(getattr(m, "data", m))
            place = [[m[4 * column + row] for column in range(4)] for row in range(3)]
            # Into the level, then from z up to y up.
            placed = [[sum(row[k] * p[k] for k in range(3)) + row[3] for row in place] for p in points]
            placed = [[x, z, -y] for x, y, z in placed]
            single = [list(struct.unpack("<3f", struct.pack("<3f", *p))) for p in placed]
            low = [min(p[k] for p in single) for k in range(3)]
            high = [max(p[k] for p in single) for k in range(3)]
            position = put(b"".join(struct.pack("<3f", *p) for p in single), "VEC3", len(single), 34962, min=low, max=high)
            indices = put(struct.pack(f"<{len(faces)}I", *faces), "SCALAR", len(faces), 34963)
            meshes.append({"primitives": [{"attributes": {"POSITION": position}, "indices": indices}]})
            nodes[0]["children"].append(len(nodes))
            extras = {"kind": kind, "ifc": product.is_a(), "guid": product.GlobalId}
            nodes.append({"name": product.Name or product.is_a(), "mesh": len(meshes) - 1, "extras": extras})

    gltf = {
        "asset": {"version": "2.0", "generator": "ifc_to_glb"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
        "meshes": meshes,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(binary)}],
    }
    text = json.dumps(gltf, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    with open(target, "wb") as file:
        file.write(struct.pack("<III", 0x46546C67, 2, 28 + len(text) + len(binary)))
        file.write(struct.pack("<II", len(text), 0x4E4F534A) + text)
        file.write(struct.pack("<II", len(binary), 0x004E4942) + bytes(binary))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
