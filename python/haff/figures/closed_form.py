"""Few bodies against the closed form of their system: heights, angles, compression of a spring, velocities."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..errors import NotApplicableError
from .ledger import FLOOR, floored_axis
from .style import CYCLE, GREY, headline, label, number
from .worked import worked

if TYPE_CHECKING:
    from ..files.recording import Recording


def draw(file: Recording) -> Figure:
    """The characteristic quantity of the system against time with its closed form; below, their difference."""
    found = worked(file)
    if np.ptp(found.seen) == 0:
        raise NotApplicableError("nothing moves")
    panels = 1 if found.law is None else 2
    figure = Figure(figsize=(6.8, 4.2 if panels == 1 else 5.8), layout="constrained")
    axes = figure.subplots(panels, 1, sharex=True, squeeze=False, height_ratios=(2.6, 1)[:panels])[:, 0]
    top, last = axes[0], axes[-1]
    handles, facts = [], [label(file.title)] if file.title else []
    fine = np.linspace(found.time[0], found.time[-1], 4000)
    law = None if found.law is None else found.law(fine)
    for k, name in enumerate(found.names):
        color = CYCLE[k % len(CYCLE)]
        if law is not None:
            top.plot(fine, law[k], color=color, lw=5, alpha=0.3, solid_capstyle="butt")
        (line,) = top.plot(found.time, found.seen[k], color=color, lw=1.2, label=label(name))
        handles.append(line)
    for value, text in found.levels:
        top.axhline(value, color=GREY, lw=0.9, ls=":", zorder=0)
        top.annotate(text, (1, value), (-3, 2), xycoords=("axes fraction", "data"), textcoords="offset points",
                     ha="right", va="bottom", color="#444444", fontsize=8.8)  # fmt: skip
    top.set_ylabel(found.unit)
    top.margins(x=0, y=0.1)
    if found.law is None:
        facts.append(f"no closed form drawn: {label(found.why)}")
    else:
        handles.append(Line2D([], [], color=GREY, lw=5, alpha=0.4, label="closed form"))
        difference = np.abs(found.seen - found.law(found.time))
        scale = np.nanmax(np.abs(found.seen))
        for k in range(len(found.names)):
            last.semilogy(found.time, np.maximum(difference[k] / scale, FLOOR), color=CYCLE[k % len(CYCLE)], lw=0.9)
        last.axhline(1e-10, color=GREY, lw=1, ls="--")
        floored_axis(last, max(1e-9, 10 * float(np.nanmax(difference / scale))))
        last.set_ylabel("|difference|\nof the largest")
        facts.append(f"largest difference {number(float(np.nanmax(difference / scale)), 2)}")
    last.set_xlabel("simulated time $t$  [scene’s unit of time]")
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 6))
    headline(figure, found.title, "  ·  ".join(facts))
    return figure
