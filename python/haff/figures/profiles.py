"""Profiles: density, temperature and pressure along an axis, or maps on a plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from ..errors import NotApplicableError
from ..reader import File
from ..wording import say
from .facts import facts
from .style import BLUE, CYCLE, RED, SPEED_MAP, headline

if TYPE_CHECKING:
    import xarray

MOST_ARROWS = 24
"""Arrows along an axis of a map."""


def draw(file: File) -> Figure:
    """Means over the later half of the rows: curves with two standard errors, or maps with arrows of the flow."""
    found = file.profiles
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
    if len(profile["time"]) == 0:
        raise NotApplicableError("no complete row of a profile")
    late = profile.isel(time=slice(len(profile["time"]) // 2, None))
    figure = _lines(late, name) if lines else _map(late, name)
    times = late["time"].to_numpy()
    span = f"t = {times[0]:.4g} … {times[-1]:.4g}" if len(times) > 1 else f"t = {times[0]:.4g}"
    headline(figure, f"Profile along {' and '.join(name)}", f"{facts(file)}  ·  {len(times)} rows, {span}")
    return figure


def _lines(late: xarray.Dataset, axis: str) -> Figure:
    figure = Figure(figsize=(6.4, 7.0), layout="constrained")
    density, temperature, pressure = figure.subplots(3, 1, sharex=True)
    x = late[axis].to_numpy()
    curve(density, x, late["density"].to_numpy(), BLUE, None)
    density.set_ylabel("number density $n$  [1/length$^d$]")
    density.set_ylim(bottom=0)
    curve(temperature, x, late["temperature"].to_numpy(), RED, None)
    temperature.set_ylabel("temperature $T$  [energy]")
    temperature.set_ylim(bottom=0)
    for k, letter in enumerate(late["row"].to_numpy()):
        values = late["pressure"].sel(row=letter, column=letter).to_numpy()
        curve(pressure, x, values, CYCLE[k], f"$P_{{{letter}{letter}}}$")
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


def _map(late: xarray.Dataset, name: str) -> Figure:
    figure = Figure(figsize=(9.2, 4.4), layout="constrained")
    x, y = (late[axis].to_numpy() for axis in name)
    for axes, field, words in zip(figure.subplots(1, 2), ("density", "temperature"), ("$n$", "$T$")):
        values = late[field].mean("time").to_numpy().T
        picture = axes.pcolormesh(x, y, values, cmap=SPEED_MAP, shading="nearest", rasterized=True)
        figure.colorbar(picture, ax=axes, label=f"{late[field].attrs['long_name']} {words}")
        axes.set_aspect("equal")
        axes.set_xlabel(f"${name[0]}$  [length]")
        axes.set_ylabel(f"${name[1]}$  [length]")
        if field == "density":
            step = max(1, -(-max(len(x), len(y)) // MOST_ARROWS))
            flow = late["velocity"].mean("time")
            u, v = (flow.sel(component=axis).to_numpy().T[::step, ::step] for axis in name)
            axes.quiver(x[::step], y[::step], u, v, color="white", width=0.004)
    return figure
