"""The static structure factor against time: its peak and the length that follows from its long waves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from .. import analysis
from ..errors import NotApplicableError
from .facts import facts, is_geometric, spans
from .structure import times
from .style import BLUE, RED, headline, note

if TYPE_CHECKING:
    from ..files.recording import Recording

MOST_FRAMES = 40
MOST_PHASES = 2e8
"""Phases computed, about, at 3 ns each."""
SHELLS = 30
LONG = np.pi
"""Waves up to this wave number are longer than the distances of neighbors [1/mean diameter]."""


def draw(file: Recording) -> Figure:
    """The largest S(k) of waves longer than two diameters, and 2π/⟨k⟩ of them, in frames spread over the file."""
    if not file.box.fully_periodic:
        raise NotApplicableError("S(k) needs a periodic box")
    if len(file) < 100:
        raise NotApplicableError(f"{len(file)} particles are too few for S(k)")
    frames = file.frames
    if len(frames) < 3:
        raise NotApplicableError("fewer than three frames")
    sigma = float(np.mean(2 * file.radius))
    k_max = LONG / sigma
    if k_max * float(file.box.size[: file.dimension].max()) < 4 * np.pi:
        raise NotApplicableError("the box is too small for waves longer than two diameters")
    rows = np.unique(np.round(np.linspace(0, len(frames) - 1, MOST_FRAMES)).astype(int))
    chosen = [frames[int(row)] for row in rows]
    waves = int(np.clip(MOST_PHASES / (len(file) * SHELLS * len(chosen)), 10, 200))
    found = analysis.structure_history(chosen, k_max, SHELLS, most_waves=waves)

    figure = Figure(figsize=(6.4, 5.6), layout="constrained")
    top, below = figure.subplots(2, 1, sharex=True)
    top.errorbar(found["time"], found["peak"], found["peak_error"], color=BLUE, marker="o", ms=4, elinewidth=0.9)
    top.set_ylabel(r"largest $S(k)$")
    if spans(found["peak"]):
        top.set_yscale("log", nonpositive="clip")
        top.set_ylim(0.5 * found["peak"].min(), 2.5 * (found["peak"] + found["peak_error"].fillna(0)).max())
    else:
        top.set_ylim(bottom=0)
    below.plot(found["time"], found["length"] / sigma, color=RED, marker="o", ms=4)
    below.set_ylabel(r"length $2\pi/\langle k\rangle$  [mean diameters]")
    below.set_xlabel("simulated time $t$  [scene’s unit of time]")
    if is_geometric(found["time"]):
        below.set_xscale("log")
    note(top, r"waves longer than two diameters, $k\sigma < \pi$", x=0.02, y=0.96, va="top")
    headline(figure, "Static structure factor against time", f"{facts(file)}  ·  {times(chosen)}")
    return figure
