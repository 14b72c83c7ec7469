"""Gaps between the surfaces of particles that are close, and between particles and the walls of the box."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..common import arguments
from ..errors import ArgumentError
from ..files.layout import Array
from ..text import quoted
from .trees import SLACK, folded, within

if TYPE_CHECKING:
    from ..files.box import Box

__all__ = ["Gaps", "close_gaps"]


class Gaps(NamedTuple):
    """Gaps of K close pairs and of W particles close to a wall of the box or to a container that shrinks with it."""

    pairs: NDArray[np.int64]
    """``[K, 2]`` rows of the particles, the lower one first, in ascending order. In a box of a few diameters the same
    two particles may touch through several images: each is a row. A particle and its own image: both rows are it."""
    gap: Array
    """``[K]`` (r − σ)/σ with the distance r and the contact distance σ = R_i + R_j; negative for an overlap."""
    vector: Array
    """``[K, 3]`` from the first center to the image of the second one that is close [length]."""
    wall_rows: NDArray[np.int64]
    """``[W]`` rows of the particles close to a wall."""
    wall_sides: NDArray[np.int64]
    """``[W, 2]`` the axis that the wall is normal to, and 0 for the lower face, 1 for the upper one.

    Of a container 3, and 0 for its side, 1 and 2 for its ends."""
    wall_gap: Array
    """``[W]`` (z − R)/2R with the distance z of the center from the wall."""
    wall_vector: Array
    """``[W, 3]`` from the center to the nearest point of the wall [length]."""

    def below(self, gap: float) -> Gaps:
        """Those below a gap."""
        near, at = self.gap < gap, self.wall_gap < gap
        return Gaps(
            self.pairs[near], self.gap[near], self.vector[near],
            self.wall_rows[at], self.wall_sides[at], self.wall_gap[at], self.wall_vector[at],
        )  # fmt: skip


def close_gaps(positions: ArrayLike, radii: ArrayLike, box: Box, cutoff: float) -> Gaps:
    """All gaps below a cutoff, across periodic faces too, those of a sheared box among them.

    Particles are sorted by size into classes of a factor of 2, and close pairs of each two classes are found by k-d
    trees: small particles are not compared with all that a large one would reach. Images are copies, so that a box may
    be of any width. Distances are computed in double precision from the positions given.

    Parameters
    ----------
    positions
        ``[N, 3]`` or, in two dimensions, ``[N, 2]`` centers [length], in the box or not.
    radii
        ``[N]`` [length].
    box
        The box: its edges, and which axes are periodic or between walls; ``haff.Box([L, L, L], ["periodic"] * 3, 3)``.
    cutoff
        Largest gap, relative to the contact distance R_i + R_j; of a wall relative to the diameter.

    Raises
    ------
    ArgumentError
        An array has another shape, a radius or the cutoff is not positive, or a number is not finite.
    NotApplicableError
        Gaps below the cutoff are more than about ten widths of the periodic box.

    Examples
    --------
    >>> import haff
    >>> box = haff.Box([4.0, 4.0, 4.0], ["periodic", "wall", "wall"], 3)
    >>> found = haff.analysis.close_gaps([[0.5, 2.0, 2.0], [3.25, 2.25, 3.5]], [0.5, 0.5], box, cutoff=1.0)
    >>> found.pairs.tolist(), found.gap.round(3).tolist(), found.vector.tolist()
    ([[0, 1]], [0.969], [[-1.25, 0.25, 1.5]])
    >>> found.wall_rows.tolist(), found.wall_sides.tolist(), found.wall_gap.tolist()
    ([1], [[2, 1]], [0.0])
    """
    return gaps_of(*particles(positions, radii, box), box, arguments.positive("cutoff", cutoff))


def gaps_of(position: Array, radius: Array, box: Box, cutoff: float) -> Gaps:
    """The same of :func:`particles`."""
    position = folded(box, position)
    rows, vectors = [np.empty((0, 2), np.int64)], [np.empty((0, 3))]
    classes = _classes(radius)
    for k, first in enumerate(classes):
        for second in classes[k:]:
            reach = (1 + cutoff) * float(radius[first].max() + radius[second].max()) * (1 + SLACK)
            found, vector = within(box, position, first, second, reach)
            # The search reaches for the largest of both classes, and for rounding.
            near = np.linalg.norm(vector, axis=1) < (1 + cutoff) * radius[found].sum(axis=1)
            rows.append(found[near])
            vectors.append(vector[near])
    pairs, vector = np.concatenate(rows), np.concatenate(vectors)
    turned = pairs[:, 0] > pairs[:, 1]
    pairs[turned], vector[turned] = pairs[turned, ::-1], -vector[turned]
    order = np.lexsort((*vector.T[::-1], pairs[:, 1], pairs[:, 0]))
    pairs, vector = pairs[order], vector[order]
    contact = radius[pairs].sum(axis=1)
    return Gaps(
        pairs, (np.linalg.norm(vector, axis=1) - contact) / contact, vector, *_walls(box, position, radius, cutoff)
    )


def particles(positions: object, radii: object, box: object) -> tuple[Array, Array]:
    """Centers ``[N, 3]`` and radii ``[N]``, checked; arguments of public functions."""
    if not (hasattr(box, "edges") and hasattr(box, "boundary")):
        raise ArgumentError(f"box = {quoted(box)}: must be a haff.Box, such as frame.box")
    given = arguments.reals("positions", positions)
    d: int = box.dimension
    if given.ndim != 2 or len(given) == 0 or given.shape[1] not in (d, 3):
        allowed = "[N, 3]" if d == 3 else "[N, 2] or [N, 3]"
        raise ArgumentError(f"positions = {quoted(positions)}, of shape {given.shape}: must be {allowed}")
    if not (np.abs(given) <= arguments.LARGEST).all():
        raise ArgumentError(f"positions = {quoted(positions)}: must be finite, of up to {arguments.LARGEST:g}")
    position = np.zeros((len(given), 3))
    position[:, :d] = given[:, :d]
    radius = np.array(arguments.shaped("radii", radii, [len(given)], f"one number, or [{len(given)}]"))
    if not ((radius >= arguments.SMALLEST) & (radius <= arguments.LARGEST)).all():
        allowed = f"from {arguments.SMALLEST:g} to {arguments.LARGEST:g}"
        raise ArgumentError(f"radii = {quoted(radii)}: must be positive, {allowed}")
    return position, radius


def _classes(radius: Array) -> list[NDArray[np.int64]]:
    """Rows of the particles by size, each class within a factor of 2."""
    octave = np.floor(np.log2(radius / radius.min()) + SLACK).astype(np.int64)
    return [np.flatnonzero(octave == k) for k in np.unique(octave)]


def _walls(
    box: Box, position: Array, radius: Array, cutoff: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array, Array]:
    """Particles close to the walls of the box, or to the container in it."""
    rows, sides, gaps = [np.empty(0, np.int64)], [np.empty((0, 2), np.int64)], [np.empty(0)]
    vectors = [np.empty((0, 3))]

    def add(wall: tuple[int, int], distance: Array, normal: Array) -> None:
        gap = (distance - radius) / (2 * radius)
        near = np.flatnonzero(gap < cutoff)
        rows.append(near)
        sides.append(np.tile(wall, (len(near), 1)))
        gaps.append(gap[near])
        vectors.append(-distance[near, None] * normal[near])

    for axis in range(box.dimension):
        if box.boundary[axis] == "wall":
            normal = np.tile(np.eye(3)[axis], (len(position), 1))
            add((axis, 0), position[:, axis], normal)
            add((axis, 1), box.size[axis] - position[:, axis], -normal)
    for k, part in enumerate([] if box.container is None else box.container.parts()):
        add((3, k), *part(position))
    return np.concatenate(rows), np.concatenate(sides), np.concatenate(gaps), np.concatenate(vectors)
