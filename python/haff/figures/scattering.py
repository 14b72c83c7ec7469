"""Static structure factor S(k), with its error."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from .. import analysis
from ..errors import NotApplicableError
from .facts import facts, is_geometric, spans
from .of_a_frame import drawn
from .structure import times
from .style import BLUE, GREY, headline, note

if TYPE_CHECKING:
    from ..files.recording import Recording

MOST_FRAMES = 20
MOST_PHASES = 1e8
"""Phases computed, about, at 3 ns each."""
FEWEST_WAVES = 60
"""Waves of a shell, where there are as many: the error of a shell is about S(k)/√(waves · frames)."""
SHELLS = 60
LARGEST = 15.0
"""Largest wave number drawn [1/mean diameter]."""


def draw(file: Recording, index: int | None = None) -> Figure:
    """S(k) up to k σ = 15, with two standard errors: of several frames, or of the last one of a gas that changes."""
    d = file.dimension
    if not file.box.fully_periodic:
        raise NotApplicableError("S(k) needs a periodic box")
    if len(file) < 100:
        raise NotApplicableError(f"{len(file)} particles are too few for S(k)")
    sigma = float(np.mean(2 * file.radius))
    phases = MOST_PHASES / (len(file) * SHELLS)
    if index is None and _changes(file):
        index = -1
    frames = drawn(file, index, int(np.clip(phases / FEWEST_WAVES, 1, MOST_FRAMES)))
    if not frames:
        raise NotApplicableError("no frames")
    waves = int(max(FEWEST_WAVES, phases / len(frames)))
    k_max = max(LARGEST / sigma, 3 * 2 * np.pi / float(file.box.size[:d].min()))
    found = analysis.static_structure(frames, k_max, SHELLS, most_waves=waves)

    figure = Figure(figsize=(6.4, 4.6), layout="constrained")
    axes = figure.subplots()
    several = f"{len(frames)} frames" if len(frames) > 1 else "one frame"
    x, error = found.k * sigma, np.nan_to_num(2 * found.error)
    axes.axhline(1, color=GREY, lw=0.8, ls=":")
    axes.fill_between(x, np.maximum(found.value - error, 0), found.value + error, color=BLUE, alpha=0.25, lw=0,
                      label="two standard errors")  # fmt: skip
    axes.plot(
        x,
        found.value,
        color=BLUE,
        lw=1.3,
        marker=".",
        ms=4,
        label=f"simulation, {several}",
    )
    axes.set_xlim(0, float(x[-1]))
    axes.set_ylim(0, 1.08 * float(np.max(found.value + error)))
    mean = r"\sigma" if len(np.unique(file.radius)) == 1 else r"\bar\sigma"
    axes.set_xlabel(rf"wave number  $k{mean}$" + ("" if mean == r"\sigma" else rf",  ${mean}$ = {sigma:.4g}"))
    axes.set_ylabel(r"static structure factor  $S(k)$")
    note(axes, f"up to {waves:,} waves of the box in a shell", x=0.98, ha="right")
    figure.legend(loc="outside lower center", ncols=2)
    headline(figure, "Static structure factor", f"{facts(file)}  ·  {times(frames)}")
    return figure


def _changes(file: Recording) -> bool:
    """Whether a mean over frames is of different states: their times grow by a factor, or the gas cools or heats up."""
    if is_geometric(file.frames.time):
        return True
    return "observables" in file and "temperature" in file.samples and spans(file.samples["temperature"])
