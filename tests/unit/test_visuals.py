"""Visual meshes, made coarser for software rendering."""

from __future__ import annotations

import numpy as np

from engram.robots.visuals import merged


def sphere(n: int, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """A sphere of n x 2n quadrilaterals, each two triangles, seams not closed."""
    theta, phi = np.meshgrid(np.linspace(0.0, np.pi, n + 1), np.linspace(0.0, 2.0 * np.pi, 2 * n + 1), indexing="ij")
    vertices = radius * np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    index = np.arange((n + 1) * (2 * n + 1)).reshape(n + 1, 2 * n + 1)
    a, b, c, d = index[:-1, :-1].ravel(), index[1:, :-1].ravel(), index[1:, 1:].ravel(), index[:-1, 1:].ravel()
    return vertices.reshape(-1, 3), np.vstack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def test_fine_mesh_gets_coarser_and_keeps_its_shape() -> None:
    radius, cell = 0.1, 0.01
    vertices, triangles = sphere(60, radius)
    coarse, faces = merged(vertices, triangles, cell)
    assert 100 < len(faces) < len(triangles) / 4
    # a mean of points of the sphere within one cell lies below it by at most the sagitta of the cell's diagonal
    depth = radius - np.linalg.norm(coarse, axis=1)
    assert depth.min() > -1e-12 and depth.max() < 3.0 * cell**2 / (2.0 * radius)
    # faces still look outwards
    a, b, c = (coarse[faces[:, i]] for i in range(3))
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a + b + c)
    assert (outward > 0.0).mean() > 0.97  # a few slivers may flip
    assert len(np.unique(np.sort(faces, axis=1), axis=0)) == len(faces)


def test_small_mesh_stays() -> None:
    vertices, triangles = np.vstack([np.zeros(3), 0.001 * np.eye(3)]), np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    coarse, faces = merged(vertices, triangles)
    assert np.array_equal(coarse, vertices) and np.array_equal(faces, triangles)
