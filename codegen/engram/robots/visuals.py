"""What a robot looks like: meshes and primitives of its URDF, as OBJ files and placements for MuJoCo.

Coal reads every mesh format and applies scales; it drops colours. For COLLADA files the parts and their colours are read again,
and used only if their triangles agree with coal's.
"""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

from engram.robots.spec import RobotSpec
from engram.robots.tree import Tree, full_model

SMALL_PART = 100  # triangles; smaller parts take the colour of the link's largest (MuJoCo refuses flat meshes)
CELL = 0.006  # m, of the grid in which vertices are merged: a pixel of the video; software rendering takes half the time
SAME_PLACE = 1e-6  # m: two readings of one mesh differ by the text precision of the file
SAME_COUNT = 1e-3  # relative: coal's reader drops degenerate triangles


@dataclass(frozen=True)
class Visual:
    """One coloured shape on a body. `size` as MuJoCo states it; empty for a mesh."""

    name: str
    joint: int  # index in Tree; -1: world
    R_JG: np.ndarray
    p_JG: np.ndarray
    rgba: np.ndarray
    kind: str  # mesh, box, cylinder, sphere
    size: tuple[float, ...] = ()
    vertices: np.ndarray | None = None  # (n, 3) m
    triangles: np.ndarray | None = None  # (m, 3)


def load_visuals(spec: RobotSpec, tree: Tree) -> list[Visual]:
    """All visual shapes of the URDF, placed in the joint frames of `tree`."""
    model = full_model(spec)
    geometry = pin.buildGeomFromUrdf(model, str(spec.urdf), pin.GeometryType.VISUAL, package_dirs=spec.package_dirs)
    visuals = []
    for shape in geometry.geometryObjects:
        link = model.frames[shape.parentFrame]
        kept = tree.model.frames[tree.model.getFrameId(link.name)]  # locked joints move frames to other joints
        placement = kept.placement * link.placement.inverse() * shape.placement
        joint = kept.parentJoint - 1
        R_turn = np.eye(3) if joint < 0 else tree.R_turn[joint]
        place = {"joint": joint, "R_JG": R_turn.T @ placement.rotation, "p_JG": R_turn.T @ placement.translation}
        solid = shape.geometry
        if isinstance(solid, coal.Box):
            visuals.append(Visual(shape.name, rgba=shape.meshColor, kind="box", size=tuple(solid.halfSide), **place))
        elif isinstance(solid, coal.Cylinder):
            size = (solid.radius, solid.halfLength)
            visuals.append(Visual(shape.name, rgba=shape.meshColor, kind="cylinder", size=size, **place))
        elif isinstance(solid, coal.Sphere):
            visuals.append(Visual(shape.name, rgba=shape.meshColor, kind="sphere", size=(solid.radius,), **place))
        else:
            for n, (vertices, triangles, rgba) in enumerate(_parts(shape)):
                name = f"{shape.name}_{n}"
                vertices, triangles = merged(vertices, triangles)
                visuals.append(Visual(name, rgba=rgba, kind="mesh", vertices=vertices, triangles=triangles, **place))
    return visuals


def obj_text(visual: Visual) -> str:
    """A mesh in Wavefront OBJ format, rounded to a micrometre."""
    vertices = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in visual.vertices]
    faces = [f"f {a} {b} {c}" for a, b, c in visual.triangles + 1]
    return "\n".join([*vertices, *faces]) + "\n"


def merged(vertices: np.ndarray, triangles: np.ndarray, cell: float = CELL) -> tuple[np.ndarray, np.ndarray]:
    """The mesh (n, 3) m, (m, 3) with the vertices of each grid cell merged into their mean; small meshes stay as they are."""
    _, member = np.unique(np.floor(vertices / cell), axis=0, return_inverse=True)
    member = member.ravel()
    means = np.stack([np.bincount(member, column) for column in vertices.T], axis=1) / np.bincount(member)[:, None]
    coarse = member[triangles]
    coarse = coarse[(coarse[:, 0] != coarse[:, 1]) & (coarse[:, 1] != coarse[:, 2]) & (coarse[:, 2] != coarse[:, 0])]
    _, first = np.unique(np.sort(coarse, axis=1), axis=0, return_index=True)
    return (means, coarse[np.sort(first)]) if len(first) >= SMALL_PART else (vertices, triangles)


def _parts(shape: pin.GeometryObject) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Vertices, triangles and colour of each part of a mesh."""
    mesh = shape.geometry
    vertices = np.array(mesh.vertices())
    triangles = np.array([[t[0], t[1], t[2]] for t in (mesh.tri_indices(i) for i in range(mesh.num_tris))])
    if np.prod(shape.meshScale) < 0.0:  # a mirrored mesh is inside out
        triangles = triangles[:, ::-1]
    whole = [(vertices, triangles, np.array(shape.meshColor))]
    if shape.overrideMaterial or Path(shape.meshPath).suffix.lower() != ".dae":
        return whole
    parts = _collada_parts(Path(shape.meshPath))
    if abs(sum(len(t) for _, t, _ in parts) - len(triangles)) > SAME_COUNT * len(triangles):
        return whole
    corners = np.array([[v.min(0), v.max(0)] for v, _, _ in parts]) * shape.meshScale
    agrees = np.allclose([corners[:, 0].min(0), corners[:, 1].max(0)], [vertices.min(0), vertices.max(0)], atol=SAME_PLACE)
    return _group([(v * shape.meshScale, t, c) for v, t, c in parts]) if agrees else whole


def _group(parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Parts of one colour joined, small ones with the largest."""
    largest = max(parts, key=lambda part: len(part[1]))
    groups: dict[tuple[float, ...], list] = {}
    for part in parts:
        colour = part[2] if len(part[1]) >= SMALL_PART else largest[2]
        groups.setdefault(tuple(colour), []).append(part)
    joined = []
    for colour, members in sorted(groups.items()):
        offsets = np.cumsum([0, *(len(v) for v, _, _ in members)])
        vertices = np.concatenate([v for v, _, _ in members])
        triangles = np.concatenate([t + offset for (_, t, _), offset in zip(members, offsets)])
        joined.append((vertices, triangles, np.array(colour)))
    return joined


def _collada_parts(path: Path) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Vertices in the file's root axes, triangles and diffuse colour of each instance in a COLLADA file (triangle lists only)."""
    root = ElementTree.parse(path).getroot()
    ns = {"c": root.tag[1:].partition("}")[0]}
    effects = {e.get("id"): e.findtext(".//c:diffuse/c:color", "0.9 0.9 0.9 1", ns) for e in root.iterfind(".//c:effect", ns)}
    colours = {
        m.get("id"): np.array(effects[m.find("c:instance_effect", ns).get("url")[1:]].split(), float)
        for m in root.iterfind(".//c:material", ns)
    }
    geometries = {g.get("id"): g.find("c:mesh", ns) for g in root.iterfind(".//c:geometry", ns)}
    parts = []

    def descend(node: ElementTree.Element, R: np.ndarray) -> None:
        for matrix in node.iterfind("c:matrix", ns):
            R = R @ np.array(matrix.text.split(), float).reshape(4, 4)
        for instance in node.iterfind("c:instance_geometry", ns):
            mesh = geometries[instance.get("url")[1:]]
            positions = mesh.find("c:vertices/c:input[@semantic='POSITION']", ns).get("source")[1:]
            text = mesh.find(f"c:source[@id='{positions}']/c:float_array", ns).text
            vertices = np.array(text.split(), float).reshape(-1, 3) @ R[:3, :3].T + R[:3, 3]
            bound = {b.get("symbol"): b.get("target")[1:] for b in instance.iterfind(".//c:instance_material", ns)}
            for group in mesh.iterfind("c:triangles", ns):
                inputs = group.findall("c:input", ns)
                stride = 1 + max(int(i.get("offset")) for i in inputs)
                offset = next(int(i.get("offset")) for i in inputs if i.get("semantic") == "VERTEX")
                corners = np.array(group.findtext("c:p", "", ns).split(), int).reshape(-1, stride)[:, offset]
                used, triangles = np.unique(corners, return_inverse=True)
                colour = colours[bound.get(group.get("material"), group.get("material"))]
                parts.append((vertices[used], triangles.reshape(-1, 3), colour))
        for child in node.iterfind("c:node", ns):
            descend(child, R)

    for scene in root.iterfind(".//c:visual_scene", ns):
        for node in scene.iterfind("c:node", ns):
            descend(node, np.eye(4))
    return parts
