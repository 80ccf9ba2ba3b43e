"""The boxes of an authored MuJoCo world, as obstacles."""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from engram.inputs import InputError, read_text
from engram.paths import relative


@dataclass(frozen=True)
class Boxes:
    """n boxes O in the world W (m)."""

    name: list[str]
    p_WO: np.ndarray  # (n, 3)
    R_WO: np.ndarray  # (n, 3, 3)
    half: np.ndarray  # (n, 3) half sizes along the box's axes

    def distance(self, p_W: np.ndarray) -> np.ndarray:
        """Signed distance of points to boxes: (m, 3) -> (m, n); negative inside."""
        local = np.einsum("nij,mni->mnj", self.R_WO, p_W[:, None, :] - self.p_WO)
        outside = np.abs(local) - self.half
        return np.linalg.norm(np.maximum(outside, 0.0), axis=2) + np.minimum(outside.max(axis=2), 0.0)


def read_boxes(path: Path) -> Boxes:
    """All box geoms of a world file. They must be named and lie in the worldbody itself. Raises InputError."""
    try:
        root = ElementTree.fromstring(read_text(path, "a task needs a world.xml beside its task.toml"))
    except ElementTree.ParseError as error:
        raise InputError(f"{relative(path)}: not valid XML: {error}") from None
    box_classes = {d.get("class") for d in root.iter("default") if any(g.get("type") == "box" for g in d.findall("geom"))}
    name, p_WO, R_WO, half = [], [], [], []
    for body in root.iter("worldbody"):
        if body.find(".//body//geom") is not None:
            raise InputError(f"{relative(path)}: a geom lies in a <body>; put obstacles into the worldbody itself")
        for geom in body.findall("geom"):
            if geom.get("type", "box" if geom.get("class") in box_classes else "sphere") != "box":
                continue
            label = geom.get("name")
            if label is None:
                raise InputError(f"{relative(path)}: a box geom has no name; give it one")
            for attribute in ("euler", "axisangle", "xyaxes", "zaxis", "fromto"):
                if attribute in geom.attrib:
                    raise InputError(f"{relative(path)}: box '{label}': orient it by quat (w x y z), not by {attribute}")
            name.append(label)
            p_WO.append(_numbers(path, label, "pos", geom.get("pos", "0 0 0"), 3))
            half.append(_numbers(path, label, "size", geom.get("size", ""), 3))
            w, x, y, z = _numbers(path, label, "quat", geom.get("quat", "1 0 0 0"), 4)
            R_WO.append(pin.Quaternion(w, x, y, z).normalized().toRotationMatrix())
            if np.any(half[-1] <= 0.0):
                raise InputError(f"{relative(path)}: box '{label}': half sizes must be positive")
    return Boxes(name, np.array(p_WO).reshape(-1, 3), np.array(R_WO).reshape(-1, 3, 3), np.array(half).reshape(-1, 3))


def _numbers(path: Path, label: str, attribute: str, text: str, n: int) -> np.ndarray:
    """n finite numbers of a geom's attribute."""
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.array([])
    if len(values) != n or not np.all(np.isfinite(values)):
        raise InputError(f"{relative(path)}: box '{label}': {attribute} must be {n} numbers, found '{text}'")
    return values
