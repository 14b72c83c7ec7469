"""Density, temperature and mean velocity against height, from frames."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from .. import analysis
from ..errors import NotApplicableError
from ..files.layout import AXES
from .facts import facts
from .of_a_frame import chosen as of_index
from .structure import times
from .style import BLUE, CYCLE, GREY, RED, headline

if TYPE_CHECKING:
    from ..files.recording import Recording

MOST_FRAMES = 100
MOST_PARTICLES = 4_000_000
"""Particles of all frames together, about."""
FEWEST = 30


def draw(file: Recording, index: int | None = None) -> Figure:
    """Means over the later half of the frames, with two standard errors of the frames as independent ones."""
    axis, _ = analysis.height_axis(file)
    if len(file) < FEWEST:
        raise NotApplicableError(f"{len(file)} particles are too few for profiles")
    frames = file.frames
    if len(frames) == 0:
        raise NotApplicableError("no frames")
    late = np.flatnonzero(frames.time >= 0.5 * (frames.time[0] + frames.time[-1]))
    most = int(np.clip(MOST_PARTICLES // len(file), 1, MOST_FRAMES))
    rows = np.unique(np.round(np.linspace(late[-1], late[0], min(most, len(late)))).astype(int))
    chosen = [frames[int(row)] for row in rows] if index is None else [of_index(file, index)]
    bins = int(np.clip(len(file) * len(chosen) // 400, 8, 60))
    found = analysis.height_profile(chosen, bins, limits=_limits(chosen, axis))

    figure = Figure(figsize=(6.4, 7.0), layout="constrained")
    density, temperature, velocity = figure.subplots(3, 1, sharex=True)
    z, letter = found.height, found.axis
    _curve(density, z, found.density, found.density_error, BLUE, None)
    density.set_ylabel("number density $n$  [1/length$^d$]")
    density.set_ylim(bottom=0)
    # A layer that few particles have been in has no meaningful temperature.
    few = found.count < max(10, found.frames // 10)
    T, u = np.where(few, np.nan, found.temperature), np.where(few[:, None], np.nan, found.velocity)
    _curve(temperature, z, T, found.temperature_error, RED, None)
    temperature.set_ylabel("temperature $T$  [energy]")
    temperature.set_ylim(bottom=0)
    velocity.axhline(0, color=GREY, lw=0.8, ls=":")
    for k in range(file.dimension):
        _curve(velocity, z, u[:, k], found.velocity_error[:, k], CYCLE[k], f"$u_{AXES[k]}$")
    velocity.set_ylabel("mean velocity  [length/time]")
    velocity.legend(ncols=3)
    velocity.set_xlabel(f"height ${letter}$  [length]")
    velocity.set_xlim(found.edges[0], found.edges[-1])
    count = f"{found.frames} frame{'s'[: found.frames != 1]}, {times(chosen)}"
    headline(figure, f"Profiles along {letter}", f"{facts(file)}  ·  {count}")
    return figure


def _limits(frames: list, axis: int) -> tuple[float, float] | None:
    """Along an open axis what all but a thousandth of the particles are in: a few fly far."""
    box = frames[0].box
    if box.boundary[axis] != "open":
        return None
    places = np.concatenate([frame.position[np.isfinite(frame.mass), axis] for frame in frames])
    low, high = (float(value) for value in np.quantile(places, [0.0, 0.999]))
    low = 0.0 if 0 <= low < 0.5 * high else low
    return (low, high) if low < high else None


def _curve(axes, z: np.ndarray, value: np.ndarray, error: np.ndarray, color: str, label: str | None) -> None:
    axes.plot(z, value, color=color, lw=1.4, marker=".", label=label)
    axes.fill_between(z, value - 2 * error, value + 2 * error, color=color, alpha=0.2, lw=0)
