"""Meshes of walls as triangles, with their sharp edges and sections as lines; of large ones the box around them."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..files.layout import Array
from ..files.mesh import Triangles
from .solids import Form, cut, unit, vector

__all__ = ["MOST_FACES", "mesh"]

MOST_FACES = 200_000
"""Triangles of a mesh up to which it is drawn; of larger ones the edges of the box around it."""
FEW_FACES = 500
"""Triangles up to which all edges between faces of different planes are drawn."""
_SHARP, _FLAT = math.cos(math.radians(25)), math.cos(math.radians(1))
"""Cosines of the angle between two faces from which on their edge is drawn: of many faces, and of few."""
_BOX = [(a, a | 1 << k) for a in range(8) for k in range(3) if not a >> k & 1]
"""Pairs of corners of a box that are ends of its edges."""

Faces = NDArray[np.int64]


def mesh(given: dict[str, Any], side: str, shift: Array, triangles: Triangles) -> Form:
    """A mesh in its place, displaced by ``shift`` ``[3]`` [length]. Raises :class:`MeshFault`."""
    vertices, faces, edges = _prepared(_Key(triangles(given)), side)
    scale, point = float(given.get("scale", 1.0)), vector(given.get("point", ())) + shift
    turn = _rotation(*given["rotation"]) if "rotation" in given else np.eye(3)
    placed = scale * vertices @ turn.T + point
    wires: list[Array] = []
    if len(faces) > FEW_FACES:
        # Smooth meshes have no edges: three sections through the middle show their form.
        middle = (placed.min(axis=0) + placed.max(axis=0)) / 2
        wires = [line for k in range(3) for line in cut(placed[faces], k, middle[k])]
    edges = [placed[edge] for edge in edges]
    return Form(placed, faces, edges, wires, [], [], (point, np.array([0.0, 0.0, 1.0])))


def _rotation(axis: list[float], angle: float) -> Array:
    """``[3, 3]`` matrix of a rotation about an axis by an angle [rad]."""
    x, y, z = n = unit(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.cos(angle) * np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * np.outer(n, n)


class _Key:
    """Triangles ``[F, 3, 3]`` that are kept where they are read, as a key: they are the same if they are one object."""

    def __init__(self, corners: Array) -> None:
        self.corners = corners

    def __hash__(self) -> int:
        return id(self.corners)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and self.corners is other.corners


@lru_cache(maxsize=4)
def _prepared(key: _Key, side: str) -> tuple[Array, Faces, Faces]:
    """Vertices ``[V, 3]``, faces ``[F, 3]`` and the ends ``[E, 2]`` of the edges that are drawn."""
    corners = key.corners.reshape(-1, 3)
    if len(corners) > 3 * MOST_FACES:
        low, high = corners.min(axis=0), corners.max(axis=0)
        bits = np.arange(8)[:, None] >> np.arange(3) & 1
        return np.where(bits, high, low), np.zeros((0, 3), np.int64), np.array(_BOX)
    # Corners are one vertex if they are equal; 0 and −0 are.
    vertices, number = np.unique(corners + 0.0, axis=0, return_inverse=True)
    faces = number.reshape(-1, 3)
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    edges, first, second, same = _joints(faces)
    if side != "both":
        faces = _outward(vertices, faces, first, second, same)
    return vertices, faces, edges[_drawn(vertices, faces, first, second)]


def _joints(faces: Faces) -> tuple[Faces, Faces, Faces, NDArray[np.bool_]]:
    """Edges ``[E, 2]``, and the two faces of each; −1 where there is one face only, or more than two.

    The last array says whether both faces run through the edge in the same direction: then one is turned over.
    """
    ends = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    owner = np.repeat(np.arange(len(faces)), 3)
    forward = ends[:, 0] < ends[:, 1]
    edges, number, count = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(number.ravel(), kind="stable")
    start = np.cumsum(count) - count
    paired = count == 2
    at = order[start], order[np.minimum(start + 1, len(order) - 1)]
    first, second = (np.where(paired, owner[k], -1) for k in at)
    return edges, first, second, paired & (forward[at[0]] == forward[at[1]])


def _outward(vertices: Array, faces: Faces, first: Faces, second: Faces, same: NDArray[np.bool_]) -> Faces:
    """The faces of closed bodies, turned so that they run counterclockwise as seen from outside."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    count, paired = len(faces), first >= 0
    # Each face is two nodes, as it is and turned over; those of neighbors that fit are linked.
    a, b, turned = first[paired], second[paired], same[paired]
    rows = np.concatenate([a, a + count])
    columns = np.concatenate([np.where(turned, b + count, b), np.where(turned, b, b + count)])
    links = coo_matrix((np.ones(len(rows), np.int8), (rows, columns)), (2 * count, 2 * count))
    label = connected_components(links, directed=False)[1]
    over = label[:count] > label[count:]
    faces = np.where(over[:, None], faces[:, ::-1], faces)
    body = np.minimum(label[:count], label[count:])
    corners = vertices[faces] - vertices.mean(axis=0)
    volume = np.bincount(body, np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])))
    return np.where((volume < 0)[body][:, None], faces[:, ::-1], faces)


def _drawn(vertices: Array, faces: Faces, first: Faces, second: Faces) -> NDArray[np.bool_]:
    """``[E]`` which edges are drawn: those of open ends, and sharp ones."""
    a, b, c = vertices[faces.T]
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    cosine = np.einsum("ei,ei->e", normal[first], normal[second])
    # Neighbors that are turned over have the opposite normal; then angles are only known up to 90°.
    return (first < 0) | (np.abs(cosine) < (_FLAT if len(faces) <= FEW_FACES else _SHARP))
