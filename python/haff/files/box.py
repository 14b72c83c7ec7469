"""The simulation box of a file or a frame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..common import arguments
from ..common.readonly import ReadOnly
from ..errors import ArgumentError
from ..text import quoted
from .container import Container
from .layout import AXES, Array

__all__ = ["Box", "Shear"]


class Shear(NamedTuple):
    """Simple shear of a box that is periodic along all axes (A. W. Lees, S. F. Edwards, J. Phys. C 5, 1921 (1972)).

    The mean velocity is ``rate`` times the coordinate along ``gradient``, and points along ``flow``.
    """

    flow: int
    """Axis of the flow: 0, 1 or 2."""
    gradient: int
    """Axis along which the velocity of the flow grows; another one."""
    rate: float
    """Shear rate [1/time]."""


class Box(ReadOnly):
    """The simulation box [0, L) per axis.

    In a sheared box the image across the upper face of the gradient axis is displaced along the flow, by at most half
    an edge: the edge vector along the gradient has that component along the flow. It changes with time. Positions are
    within [0, L) all the same.

    Attributes
    ----------
    size : ``[3]`` edge lengths L [length], of a sheared box those along the axes; a placeholder along open axes
    boundary : per axis ``"periodic"``, ``"wall"`` or ``"open"``
    dimension : 2 or 3
    edges : ``[3, 3]`` edge vectors, one a row [length]
    displacement : gradient axis, flow axis and displacement [length] of the images of a sheared box; else ``None``
    container : the wall that shrinks with a box that is compressed, and that all particles are in; else ``None``
    """

    _why = "cannot be changed: a run keeps the box of its scene (domain)"

    def __init__(
        self,
        size: Array,
        boundary: Sequence[str],
        dimension: int,
        displacement: tuple[int, int, float] | None = None,
        container: Container | None = None,
    ) -> None:
        lengths = np.array(arguments.shaped("size", size, [3], "three edges"))
        if np.ndim(size) != 1 or not (lengths > 0).all() or not np.isfinite(lengths).all():
            raise ArgumentError(f"size = {quoted(size)}: must be three positive numbers")
        sides = tuple(arguments.names("boundary", boundary))
        if len(sides) != 3 or not set(sides) <= {"periodic", "wall", "open", "none"}:
            raise ArgumentError(f"boundary = {quoted(boundary)}: must be three of periodic, wall, open")
        edges = np.diag(lengths)
        if displacement is not None:
            gradient, flow, length = _displaced(displacement)
            edges[gradient, flow] = length
            displacement = gradient, flow, length
        for array in (lengths, edges):
            array.flags.writeable = False
        self.size, self.boundary, self.edges, self.displacement = lengths, sides, edges, displacement
        self.dimension = arguments.count("dimension", dimension, 2, 3)
        if container is not None and not isinstance(container, Container):
            raise ArgumentError(f"container = {quoted(container)}: must be None, or that of another box")
        self.container = container
        self._made = True

    @property
    def widths(self) -> NDArray[np.float64]:
        """``[3]`` distances of opposite faces [length]; those of a sheared box are closer along the flow."""
        widths = self.size.copy()
        if self.displacement is not None:
            gradient, flow, length = self.displacement
            widths[flow] /= np.hypot(1.0, length / self.size[gradient])
        return widths

    def unwrap(self, position: Array, image: Array) -> NDArray[np.float64]:
        """Positions that do not jump at periodic faces: position + Σ image · edge vector [length]; ``[..., 3]``."""
        position, image = _triples("position", position), _triples("image", image)
        found = position + image * np.where(self.periodic, self.size, 0.0)
        if self.displacement is not None:
            gradient, flow, length = self.displacement
            found[..., flow] += image[..., gradient] * length
        return found

    def nearest(self, apart: Array) -> NDArray[np.float64]:
        """The nearest images of differences of positions, ``[..., 3]`` [length].

        In a sheared box this holds for images that are less than half an edge away along the gradient.
        """
        found = np.array(_triples("apart", apart))
        if self.displacement is not None:
            gradient, flow, length = self.displacement
            found[..., flow] -= np.round(found[..., gradient] / self.size[gradient]) * length
        sides = np.where(self.periodic, self.size, 1.0)
        return found - np.where(self.periodic, np.round(found / sides) * sides, 0.0)

    @property
    def periodic(self) -> NDArray[np.bool_]:
        """``[3]``, true where the axis is periodic."""
        return np.array([b == "periodic" for b in self.boundary])

    @property
    def fully_periodic(self) -> bool:
        """Whether every axis that particles move along is periodic."""
        return bool(self.periodic[: self.dimension].all())

    @property
    def volume(self) -> float:
        """Volume [length³] of the box, or of the container in it; area [length²] in 2D."""
        if self.container is not None:
            return self.container.volume(self.size)
        return float(np.prod(self.size[: self.dimension]))

    def __repr__(self) -> str:
        sides = " × ".join(f"{s:g} ({b})" for s, b in zip(self.size[: self.dimension], self.boundary))
        if self.container is not None:
            sides += f", {self.container.kind} inside"
        if self.displacement is None:
            return f"Box({self.dimension}D, {sides})"
        gradient, flow, length = self.displacement
        return f"Box({self.dimension}D, {sides}, {AXES[gradient]} edge displaced along {AXES[flow]} by {length:g})"


def _triples(name: str, value: object) -> Array:
    """Vectors ``[..., 3]``."""
    array = arguments.reals(name, value)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise ArgumentError(f"{name} = {quoted(value)}, of shape {array.shape}: must be [..., 3]")
    return array


def _displaced(displacement: object) -> tuple[int, int, float]:
    """Gradient axis, flow axis and displacement of a sheared box."""
    allowed = "must be two different axes from 0 to 2 and a length"
    try:
        gradient, flow, length = displacement  # type: ignore[misc]
        found = (
            arguments.count("displacement[0]", gradient, 0, 2),
            arguments.count("displacement[1]", flow, 0, 2),
            arguments.number("displacement[2]", length),
        )
    except Exception:
        raise ArgumentError(f"displacement = {quoted(displacement)}: {allowed}") from None
    if gradient == flow:
        raise ArgumentError(f"displacement = {quoted(displacement)}: {allowed}")
    return found
