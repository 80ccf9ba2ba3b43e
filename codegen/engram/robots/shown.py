"""The robot as it looks: meshes as OBJ files, and the MuJoCo model that shows them. Both lie in build/ and are not committed."""

from pathlib import Path

from engram.paths import relative
from engram.robots.emit_mjcf import robot_mjcf
from engram.robots.spec import RobotSpec
from engram.robots.tree import Tree
from engram.robots.visuals import load_visuals, obj_text


def write_shown(spec: RobotSpec, tree: Tree, build: Path) -> Path:
    """Write <build>/meshes/<robot>/*.obj and <build>/scene/<robot>.xml; returns the latter and prints what was done."""
    meshes, scene = build / "meshes" / tree.name, build / "scene"
    meshes.mkdir(parents=True, exist_ok=True)
    scene.mkdir(parents=True, exist_ok=True)
    visuals = load_visuals(spec, tree)
    drawn = [visual for visual in visuals if visual.kind == "mesh"]
    for visual in drawn:
        (meshes / f"{visual.name}.obj").write_text(obj_text(visual), encoding="utf-8")
    path = scene / f"{tree.name}.xml"
    path.write_text(robot_mjcf(tree, visuals, f"../meshes/{tree.name}/"), encoding="utf-8")
    faces = sum(len(visual.triangles) for visual in drawn)
    print(f"robot:  {relative(path)}  {len(drawn)} meshes, {faces} triangles in {relative(meshes)}/")
    return path
