"""Observables against time, with their means, standard errors and stationary parts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from ..common.compiled import compiled
from ..errors import NotApplicableError
from ..files import samples
from .facts import sampled
from .style import BLUE, RED, headline, label, number

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from ..files.recording import Recording

FEWEST = 16
"""Samples below which a mean has no error to speak of."""
FEWEST_PARTICLES = 10
"""Of fewer, each can be followed: figures of trajectories have more of them than means."""


def averaged(file: Recording) -> list[str]:
    """Observables that are one real number and no sum since the start, of which a mean has a meaning."""
    _, _, values = samples.arrays(file)
    sums = {*compiled().names_without_means(), *samples.balance(file)}
    return [n for n, value in values.items() if value.ndim == 1 and value.dtype.kind == "f" and n not in sums]


def draw(file: Recording) -> Figure:
    """A panel for each observable that varies: its stationary part shaded, and its mean with its standard error."""
    if len(file) < FEWEST_PARTICLES:
        raise NotApplicableError(f"fewer than {FEWEST_PARTICLES} particles")
    table = file.samples
    if len(table["time"]) < FEWEST:
        raise NotApplicableError(f"fewer than {FEWEST} samples")
    means = file.means
    names = [name for name in averaged(file) if name in means.index and means.loc[name, "error"] > 0]
    if not names:
        raise NotApplicableError("no observable varies")
    figure = Figure(figsize=(6.4, 0.9 + 1.35 * len(names)), layout="constrained")
    panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(panels, names):
        _panel(axes, table["time"], table[name], means.loc[name])
        unit = samples.unit_of(file, name)
        unit = f"\n[{label(unit)}]" if unit not in (None, "1") else ""
        axes.set_ylabel(label(name.replace("_", " ")) + unit, fontsize=8)
    panels[-1].set_xlabel("simulated time $t$  [scene’s unit of time]")
    headline(figure, "Means ± standard errors of the stationary parts", sampled(file, table["time"]))
    return figure


def _panel(axes: Axes, time: np.ndarray, values: np.ndarray, found: pd.Series) -> None:
    axes.plot(time, values, color=BLUE, lw=0.8)
    axes.margins(x=0)
    axes.ticklabel_format(axis="y", useOffset=False)
    start, mean, error = float(found["start"]), float(found["mean"]), float(found["error"])
    if found["drifts"]:
        axes.set_title("drifts: no stationary part", loc="right", fontsize=8, fontweight="normal")
        return
    axes.axvspan(start, time[-1], color=BLUE, alpha=0.08, lw=0)
    axes.plot([start, time[-1]], [mean, mean], color=RED, lw=1.0)
    axes.fill_between([start, time[-1]], mean - error, mean + error, color=RED, alpha=0.25, lw=0)
    text = f"{rounded(mean, error)}  from t = {number(start)}"
    axes.set_title(text, loc="right", fontsize=8, fontweight="normal")


def rounded(mean: float, error: float) -> str:
    """A mean with as many digits as two of its error allow."""
    if not (np.isfinite(mean) and np.isfinite(error) and error > 0):
        return number(mean)
    digits = 1 - int(np.floor(np.log10(error)))
    if abs(digits) > 6 and not 1e-4 <= abs(mean) < 1e7:
        return f"{mean:.6g} ± {error:.2g}"
    return f"{mean:.{max(digits, 0)}f} ± {error:.{max(digits, 0)}f}"
