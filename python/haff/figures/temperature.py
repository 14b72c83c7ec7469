"""Granular temperature against time, with Haff's law where it applies."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from .. import analysis
from ..errors import NotApplicableError
from . import cooling
from .cooling import ROTATION, rotational
from .facts import sampled
from .style import BLACK, BLUE, CYCLE, ORANGE, RED, headline, label, left_out, number, zoom

if TYPE_CHECKING:
    from ..files.recording import Recording

# Fewer bodies have no meaningful distribution of velocities.
FEWEST = 30


def draw(file: Recording) -> Figure:
    """T(t), log–log against Haff's law with the ratio below; for other gases T(t), and why there is no law.

    A gas heated by white noise has the temperature of its steady state by theory; with spin there is T_rot(t), too.
    """
    table = file.samples
    if "temperature" not in table or not np.any(table["temperature"] > 0) or len(file) < FEWEST:
        raise NotApplicableError(f"{len(file):,} particle{'s'[: len(file) != 1]}: no temperature to speak of")
    if len(table["time"]) < 3:
        raise NotApplicableError("fewer than three samples")
    try:
        law = analysis.cooling_law(file)
    except NotApplicableError as reason:
        return _plain(file, str(reason), _heated(file))
    if law.restitution < 1:
        return cooling.draw(file, law)
    if len(file.species_names) < 2:
        raise NotApplicableError("an elastic gas of one species keeps its temperature")
    return _plain(file, "elastic: no cooling")


def _heated(file: Recording) -> float | None:
    """Temperature of the steady state by theory, if there is one."""
    try:
        T = analysis.heated_state(file).temperature
    except NotApplicableError:
        return None
    return T if np.isfinite(T) and T > 0 else None


def _plain(file: Recording, why: str, steady: float | None = None) -> Figure:
    table = file.samples
    t, T = table["time"], table["temperature"]
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    axes = figure.subplots()
    names = [n for n in table if n.startswith("species_temperature_")]
    cooled = T[-1] < 0.1 * T[0] and len(file) >= 100
    rotation = rotational(table)
    if len(names) > 1:
        for color, name in zip(CYCLE, names):
            values = table[name]
            if np.isfinite(values).any():
                axes.plot(t, values, color=color, lw=1.0, label=label(name.removeprefix("species_temperature_")))
        axes.plot(t, T, color=BLACK, lw=1.8, label="all")
    else:
        axes.plot(t, T, color=BLUE, lw=1.4, label="translation, $T$")
    if np.isfinite(rotation).any():
        axes.plot(t, rotation, color=BLACK if len(names) > 1 else ORANGE, lw=1.4, ls=(0, (4, 1.5)), label=ROTATION)
    if steady is not None:
        axes.axhline(steady, color=RED, lw=1.4, ls=(0, (5, 2)), label=f"steady state, Enskog,  {number(steady)}")
    if len(axes.lines) > 1:
        axes.legend(loc="best", ncols=2)
    if cooled:
        axes.set_yscale("log")
        later = t[t > 0]
        if len(later) > 1 and later[-1] > 1000 * later[0]:
            # Output at logarithmic times: a linear axis would show the last decade only.
            axes.set_xscale("log")
            axes.set_xlim(later[0], later[-1])
    else:
        shown = np.column_stack([*(table[name] for name in (*names, "temperature")), rotation])
        shown = np.append(shown, np.nan if steady is None else steady)
        zoom(axes, float(np.nanmin(shown)), float(np.nanmax(shown)), least=1e-3 * float(np.nanmax(T)))
        axes.ticklabel_format(axis="y", useOffset=False)
    axes.set_xlabel("simulated time $t$  [scene’s unit of time]")
    axes.set_ylabel(r"granular temperature $T$  [$k_\mathrm{B}=1$]")
    axes.margins(x=0)
    if steady is None and not why.startswith("elastic"):
        # A curve that falls ends in the right corner.
        x, ha = (0.02, "left") if cooled else (0.98, "right")
        if not cooled:
            low, high = axes.get_ylim()
            axes.set_ylim(low - 0.2 * (high - low), high)
        left_out(axes, "no closed form drawn", why, x=x, ha=ha)
    headline(figure, "Granular temperature", sampled(file, t))
    return figure
