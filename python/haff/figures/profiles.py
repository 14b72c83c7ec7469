"""Profiles: density, temperature and pressure along an axis, or maps on a plane."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from ..analysis.phases import phase_note, profile_times
from ..common.words import say
from ..errors import NotApplicableError
from ..files.layout import AXES
from ..files.measure import Rows, profile_rows
from .facts import facts
from .style import BLACK, BLUE, CYCLE, RED, SPEED_MAP, headline, label

if TYPE_CHECKING:
    from ..files.recording import Recording

MOST_ARROWS = 24
"""Arrows along an axis of a map."""


def draw(file: Recording) -> Figure:
    """Means over the later half of the rows: curves with two standard errors, or maps with arrows of the flow."""
    found = profile_rows(file)
    lines = [name for name in found if len(name) == 1]
    maps = [name for name in found if len(name) == 2]
    if lines:
        name = lines[0]
    elif maps:
        name = maps[0]
    else:
        where = say("File.profiles", "haff.open(FILE).profiles in Python")
        raise NotApplicableError(f"profiles in three dimensions have no figure; {where} has their numbers")
    profile = found[name]
    if len(profile.time) == 0:
        raise NotApplicableError("no complete row of a profile")
    late = later_half(profile)
    figure = _lines(late, name) if lines else _map(late, name)
    times = late.time
    span = f"t = {times[0]:.4g} … {times[-1]:.4g}" if len(times) > 1 else f"t = {times[0]:.4g}"
    if note := phase_note(file, profile_times(file, name, times)):
        span += f", states {label(note)}"
    headline(figure, f"Profile along {' and '.join(name)}", f"{facts(file)}  ·  {len(times)} rows, {span}")
    return figure


def later_half(profile: Rows) -> Rows:
    """The later half of the rows, and the one in the middle."""
    start = len(profile.time) // 2
    fields = {name: values[start:] for name, values in profile.fields.items()}
    return profile._replace(time=profile.time[start:], fields=fields)


def _lines(late: Rows, axis: str) -> Figure:
    figure = Figure(figsize=(6.4, 7.0), layout="constrained")
    density, temperature, pressure = figure.subplots(3, 1, sharex=True)
    x = late.centers[axis]
    every = "all" if late.species else None
    curve(density, x, late.fields["density"], BLUE if not late.species else BLACK, every)
    for k, (color, name) in enumerate(zip(CYCLE, late.species)):
        curve(density, x, late.fields["species_density"][:, k], color, label(name))
        curve(temperature, x, late.fields["species_temperature"][:, k], color, None)
    if late.species:
        density.legend(ncols=4)
    density.set_ylabel("number density $n$  [1/length$^d$]")
    density.set_ylim(bottom=0)
    curve(temperature, x, late.fields["temperature"], RED if not late.species else BLACK, None)
    temperature.set_ylabel("temperature $T$  [energy]")
    temperature.set_ylim(bottom=0)
    tensor = late.fields["pressure"]
    for k, letter in enumerate(AXES[: tensor.shape[-1]]):
        curve(pressure, x, tensor[..., k, k], CYCLE[k], f"$P_{{{letter}{letter}}}$")
    pressure.set_ylabel("pressure  [energy/length$^d$]")
    pressure.set_ylim(bottom=0)
    pressure.legend(ncols=3)
    pressure.set_xlabel(f"${axis}$  [length]")
    pressure.margins(x=0.01)
    return figure


def curve(axes, x: np.ndarray, rows: np.ndarray, color: str, label: str | None) -> None:
    """Mean of the rows with two standard errors, for independent rows. Empty cells are left out."""
    known = np.isfinite(rows).sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.nansum(rows, axis=0) / known
        spread = np.sqrt(np.nansum((rows - mean) ** 2, axis=0) / (known - 1) / known)
    axes.plot(x, mean, color=color, lw=1.4, marker="." if len(x) < 80 else "", label=label)
    axes.fill_between(x, mean - 2 * spread, mean + 2 * spread, color=color, alpha=0.2, lw=0)


def _map(late: Rows, name: str) -> Figure:
    figure = Figure(figsize=(9.2, 4.4), layout="constrained")
    x, y = (late.centers[axis] for axis in name)
    about = ("number density $n$", "granular temperature $T$")
    for axes, field, words in zip(figure.subplots(1, 2), ("density", "temperature"), about):
        values = _mean(late.fields[field]).T
        picture = axes.pcolormesh(x, y, values, cmap=SPEED_MAP, shading="nearest", rasterized=True)
        figure.colorbar(picture, ax=axes, label=words)
        axes.set_aspect("equal")
        axes.set_xlabel(f"${name[0]}$  [length]")
        axes.set_ylabel(f"${name[1]}$  [length]")
        if field == "density":
            step = max(1, -(-max(len(x), len(y)) // MOST_ARROWS))
            flow = _mean(late.fields["velocity"])
            u, v = (flow[..., AXES.index(axis)].T[::step, ::step] for axis in name)
            axes.quiver(x[::step], y[::step], u, v, color="white", width=0.004)
    return figure


def _mean(rows: np.ndarray) -> np.ndarray:
    """Mean over the rows in which a cell was not empty; NaN for one that always was."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return np.nanmean(rows, axis=0)
