"""Profiles along an axis from frames: density, temperature and mean velocity against height."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..common.arguments import choice, count, reals
from ..errors import ArgumentError, NotApplicableError
from ..files.layout import AXES, Array, computing
from ..text import quoted
from .checked import checked
from .species import Species, mobile

if TYPE_CHECKING:
    from ..files.box import Box
    from ..files.frames import Frame
    from ..files.recording import Recording

__all__ = ["HeightProfile", "height_axis", "height_profile"]


class HeightProfile(NamedTuple):
    """Means in ``B`` layers; a layer without particles has no temperature and no velocity, NaN."""

    axis: str
    """``"x"``, ``"y"`` or ``"z"``."""
    edges: Array
    """``[B + 1]`` limits of the layers along the axis [length]."""
    density: Array
    """``[B]`` number density [1/length^d]."""
    density_error: Array
    """``[B]`` standard error: from the spread of the frames; of one frame √counts."""
    temperature: Array
    """``[B]`` T = Σ m|v − u|²/(d n), u the mean velocity of the layer, n its particles less one [energy]."""
    temperature_error: Array
    """``[B]`` standard error from the spread of the frames; of one frame T √(2/(d n))."""
    velocity: Array
    """``[B, 3]`` mean velocity u = Σ m v/Σ m [length/time]."""
    velocity_error: Array
    """``[B, 3]`` standard error from the spread of the frames; of one frame √(T/Σ m)."""
    count: NDArray[np.int64]
    """``[B]`` particles counted, in all frames together."""
    frames: int
    """Frames used."""

    @property
    def height(self) -> Array:
        """``[B]`` middles of the layers [length]."""
        return 0.5 * (self.edges[1:] + self.edges[:-1])


@checked
def height_axis(file: Recording) -> tuple[int, int]:
    """Axis of the height of a scene, and the sign of the direction upwards.

    It is that of gravity; without gravity the first one that ends in walls. Raises :class:`NotApplicableError` if there
    is neither, or if gravity is not along an axis.
    """
    gravity = np.zeros(3)
    given = file.scene.get("domain", {}).get("gravity", ())
    gravity[: len(given)] = given
    pulls = np.flatnonzero(gravity)
    if len(pulls) > 1:
        raise NotApplicableError(f"gravity is not along one axis: give one of {', '.join(AXES[: file.dimension])}")
    if len(pulls) == 1:
        return int(pulls[0]), -int(np.sign(gravity[pulls[0]]))
    between = [k for k in range(file.dimension) if file.box.boundary[k] == "wall"]
    if not between:
        raise NotApplicableError("no gravity and no walls: there is no height")
    return between[0], 1


@checked
def height_profile(
    frames: Iterable[Frame],
    bins: int,
    axis: str | None = None,
    limits: tuple[float, float] | None = None,
    species: Species | None = None,
) -> HeightProfile:
    """Number density, temperature and mean velocity in layers along an axis, averaged over frames.

    Parameters
    ----------
    frames
        Frames of one file, of a steady state and not too close to one another: errors take them as independent.
    bins
        Number of layers of equal thickness.
    axis
        ``"x"``, ``"y"`` or ``"z"``; by default that of gravity, or the first one between walls (:func:`height_axis`).
    limits
        Lowest and highest coordinate [length]; by default the box, along an open axis from its face or the lowest
        centers to the highest ones. Particles beyond are not counted.
    species
        Name or index of the species that is counted, and whose mean velocity is u; by default all.

    Bodies of infinite mass are not counted. In a sheared box velocities are relative to the flow.

    Raises
    ------
    ArgumentError
        An argument is not one of those allowed.
    NotApplicableError
        There are no frames or no axis of height, or another axis is open, so that a layer has no volume.
    """
    bins, chosen = count("bins", bins), list(frames)
    if not chosen:
        raise NotApplicableError("no frames")
    box = chosen[0].box
    k = AXES.index(choice("axis", axis, AXES[: box.dimension])) if axis is not None else height_axis(chosen[0].file)[0]
    area = _area(box, k)
    if not any(mobile(frame, species).any() for frame in chosen):
        raise NotApplicableError("no body of finite mass: there is no profile")
    low, high = _limits(chosen, k, limits)
    edges = np.linspace(low, high, bins + 1)
    layers = _Layers(bins, len(chosen))
    for row, frame in enumerate(chosen):
        with computing(frame.file.path, "height profile"):
            of = mobile(frame, species)
            layers.add(row, frame.mass[of], frame.position[of, k], frame.peculiar_velocity[of], edges)
    return layers.profile(AXES[k], edges, area * (edges[1] - edges[0]), box.dimension)


def _area(box: Box, axis: int) -> float:
    """Cross section of a layer [length^(d−1)]."""
    others = [k for k in range(box.dimension) if k != axis]
    for k in others:
        if box.boundary[k] == "open":
            raise NotApplicableError(f"the {AXES[k]} axis is open: a layer has no volume")
    return float(np.prod(box.size[others]))


def _limits(frames: list[Frame], axis: int, limits: tuple[float, float] | None) -> tuple[float, float]:
    if limits is not None:
        try:
            low, high = reals("limits", limits)
        except (TypeError, ValueError):
            low = high = np.nan
        if not (np.isfinite([low, high]).all() and low < high):
            raise ArgumentError(f"limits = {quoted(limits)}: must be two finite numbers, the lower one first")
        return float(low), float(high)
    box = frames[0].box
    if box.boundary[axis] != "open":
        return 0.0, float(box.size[axis])
    places = [frame.position[np.isfinite(frame.mass), axis] for frame in frames]
    low, high = min(float(at.min()) for at in places if len(at)), max(float(at.max()) for at in places if len(at))
    # A floor at 0 is usual; the highest center must be inside of the last layer.
    low = 0.0 if 0 <= low < 0.5 * high else low
    return low, max(high * (1 + 1e-12) if high > 0 else high, low + 1e-9 * max(1.0, abs(low)))


class _Layers:
    """Sums of each frame in each layer."""

    def __init__(self, bins: int, frames: int) -> None:
        self.bins = bins
        self.count = np.zeros((frames, bins))
        self.mass_sum = np.zeros((frames, bins))
        self.momentum = np.zeros((frames, bins, 3))
        self.energy = np.zeros((frames, bins))

    def add(self, row: int, mass: Array, place: Array, velocity: Array, edges: Array) -> None:
        at = np.searchsorted(edges, place, side="right") - 1
        # The upper limit belongs to the last layer.
        at[place == edges[-1]] = self.bins - 1
        inside = (at >= 0) & (at < self.bins)
        at, velocity, mass = at[inside], velocity[inside], mass[inside]
        self.count[row] = np.bincount(at, minlength=self.bins)
        self.mass_sum[row] = np.bincount(at, mass, self.bins)
        for c in range(3):
            self.momentum[row, :, c] = np.bincount(at, mass * velocity[:, c], self.bins)
        self.energy[row] = np.bincount(at, mass * np.einsum("ij,ij->i", velocity, velocity), self.bins)

    def profile(self, axis: str, edges: Array, volume: float, d: int) -> HeightProfile:
        frames = len(self.count)
        counted, mass = self.count.sum(axis=0), self.mass_sum.sum(axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            u = self.momentum.sum(axis=0) / mass[:, None]
            # Σ m|v − u|² of each frame, u the mean of all of them.
            thermal = self.energy - 2 * np.einsum("fbc,bc->fb", self.momentum, u)
            thermal += self.mass_sum * np.einsum("bc,bc->b", u, u)
            T = thermal.sum(axis=0) / (d * (counted - 1))
            T[counted < 2] = np.nan
            density = counted / (frames * volume)
            if frames == 1:
                density_error = np.sqrt(counted) / volume
                T_error = T * np.sqrt(2 / (d * (counted - 1)))
                u_error = np.sqrt(T / mass)[:, None] * np.ones(3)
            else:
                density_error = self.count.std(axis=0, ddof=1) / np.sqrt(frames) / volume
                # Of ratios of sums: the spread of the numerators about the ratio times the denominators.
                T_error = _ratio_error(thermal / d, self.count, T, counted)
                u_error = _ratio_error(self.momentum, self.mass_sum[..., None], u, mass[:, None])
        u_error[:, d:] = np.where(np.isfinite(u[:, d:]), 0.0, np.nan)
        return HeightProfile(
            *(axis, edges, density, density_error, T, T_error, u, u_error),
            *(counted.astype(np.int64), frames),
        )


def _ratio_error(above: Array, below: Array, ratio: Array, total: Array) -> Array:
    frames = len(above)
    return np.sqrt(np.sum((above - ratio * below) ** 2, axis=0) * frames / (frames - 1)) / total
