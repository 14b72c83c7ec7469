"""The container of a box that is compressed: a cylinder, a sphere or a cone that shrinks with it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .layout import Array
from .scene import shape_of, shaped_walls

__all__ = ["Container", "container_of", "scaled"]

_LENGTHS = {
    "cylinder": ("point", "radius", "length"),
    "sphere": ("center", "radius"),
    "cone": ("apex", "length", "start"),
}
"""Keys of shapes that are lengths."""


class Container(NamedTuple):
    """A closed wall that the particles are in."""

    wall: dict[str, Any]
    """Its entry of ``[[wall]]``, at its present size."""
    dimension: int

    @property
    def kind(self) -> str:
        """``"cylinder"``, ``"sphere"`` or ``"cone"``."""
        return str(shape_of(self.wall))

    def scaled(self, scale: float) -> Container:
        """The same with all lengths multiplied by a number."""
        return Container(scaled(self.wall, scale), self.dimension)

    @property
    def turns(self) -> int:
        """Number of axes about which it turns in itself."""
        if self.dimension == 2:
            return int(self._is_circle)
        return 3 if self.kind == "sphere" else 1

    @property
    def _is_circle(self) -> bool:
        return self.kind == "sphere" or (self.kind == "cylinder" and abs(self._axis[2]) == 1.0)

    @property
    def _axis(self) -> Array:
        axis = np.array([*self.wall[self.kind].get("axis", [0.0, 0.0, 1.0]), 0.0][:3], float)
        return axis / np.linalg.norm(axis)

    def _profile(self) -> tuple[Array, float, float, float, float]:
        """Of a cylinder or a cone: origin, radius there, growth of the radius along the axis, both ends."""
        shape = self.wall[self.kind]
        if self.kind == "cylinder":
            low, high = (0.0, shape["length"]) if "length" in shape else (-math.inf, math.inf)
            return _vector(shape["point"]), shape["radius"], 0.0, low, high
        return _vector(shape["apex"]), 0.0, math.tan(shape["angle"]), shape.get("start", 0.0), shape["length"]

    def parts(self) -> list[Callable[[Array], tuple[NDArray[np.float64], NDArray[np.float64]]]]:
        """Its smooth parts: functions of positions inside, ``[N, 3]``, to distances ``[N]`` and normals ``[N, 3]``.

        Lengths [length]; the normals point inside.
        """
        if self.kind == "sphere":
            center, radius = _vector(self.wall["sphere"]["center"]), self.wall["sphere"]["radius"]

            def shell(position: Array) -> tuple[Array, Array]:
                r = position - center
                rho = np.linalg.norm(r, axis=1)
                return radius - rho, -r / np.where(rho > 0, rho, 1.0)[:, None]

            return [shell]
        origin, radius, slope, low, high = self._profile()
        axis, cosine = self._axis, 1 / math.hypot(1.0, slope)

        def side(position: Array) -> tuple[Array, Array]:
            r = position - origin
            z = r @ axis
            across = r - z[:, None] * axis
            rho = np.linalg.norm(across, axis=1)
            outward = across / np.where(rho > 0, rho, 1.0)[:, None]
            return cosine * (radius + slope * z - rho), cosine * (slope * axis - outward)

        def end(height: float, sign: float) -> Callable[[Array], tuple[Array, Array]]:
            def disk(position: Array) -> tuple[Array, Array]:
                z = (position - origin) @ axis
                return sign * (z - height), np.tile(sign * axis, (len(position), 1))

            return disk

        ends = [(low, 1.0), (high, -1.0)]
        is_flat = [math.isfinite(height) and radius + slope * height > 0 for height, _ in ends]
        return [side, *(end(*one) for one, flat in zip(ends, is_flat) if flat)]

    def circular(self, size: Array) -> tuple[Array, Array, float, float | None] | None:
        """Of a cylinder, a sphere or a circle: center, axis, radius and length, in a box with these edges.

        The axis of a sphere and of a circle is 0, and they have no length. ``None`` for other shapes.
        """
        shape = self.wall[self.kind]
        if self.kind == "sphere" or (self.dimension == 2 and self._is_circle):
            return _vector(shape["center" if self.kind == "sphere" else "point"]), np.zeros(3), shape["radius"], None
        if self.kind == "cone" or self.dimension == 2:
            return None
        return _vector(shape["point"]), self._axis, shape["radius"], self._length(size)

    def _length(self, size: Array) -> float:
        """Along the axis of a cylinder or a cone; one without end is the same along an axis of the box."""
        *_, low, high = self._profile()
        return high - low if math.isfinite(high) else float(np.abs(self._axis) @ size)

    def volume(self, size: Array) -> float:
        """Volume [length³] in a box with these edges, in two dimensions the area [length²]."""
        if (circular := self.circular(size)) is not None:
            _, _, radius, length = circular
            if self.dimension == 2:
                return math.pi * radius**2
            return 4 / 3 * math.pi * radius**3 if length is None else math.pi * radius**2 * length
        _, radius, slope, low, high = self._profile()
        a, b = (radius, radius) if slope == 0 else (radius + slope * low, radius + slope * high)
        length = self._length(size)
        return (a + b) * length if self.dimension == 2 else math.pi / 3 * (a * a + a * b + b * b) * length


def container_of(scene: dict[str, Any], dimension: int) -> Container | None:
    """The container of a scene whose box is compressed, at its size at time 0; ``None`` if there is none."""
    given = scene.get("domain", {}).get("compression", {})
    if "growth" not in scene and not np.any(given.get("rates", given.get("rate", 0.0))):
        return None
    walls = shaped_walls(scene)
    if len(walls) != 1 or (kind := shape_of(walls[0])) not in _LENGTHS:
        return None
    shape = walls[0][kind]
    is_closed = shape.get("side", "inside") == "inside" and (kind != "cone" or "length" in shape)
    return Container(walls[0], dimension) if is_closed else None


def scaled(wall: dict[str, Any], scale: float) -> dict[str, Any]:
    """An entry of ``[[wall]]`` with all lengths of its shape multiplied by a number."""
    kind = str(shape_of(wall))
    shape = {
        key: (np.multiply(value, scale).tolist() if key in _LENGTHS[kind] else value)
        for key, value in wall[kind].items()
    }
    return {**wall, kind: shape}


def _vector(values: Any) -> Array:
    return np.array([*values, 0.0][:3], float)
