"""Clusters of particles near contact: the largest one against time, and the distribution of sizes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from .. import analysis
from ..errors import NotApplicableError
from .facts import facts, is_geometric, spans
from .of_a_frame import chosen as of_index
from .style import BLUE, GREEN, RED, headline, note

if TYPE_CHECKING:
    from ..files.recording import Recording

DISTANCE = 1.1
"""Linked are particles whose centers are closer than this many contact distances."""
MOST_FRAMES = 40
MOST_PARTICLES = 300_000
"""Particles of all frames together, about, at 4 µs each."""
FEWEST = 30


def draw(file: Recording, index: int | None = None) -> Figure:
    """Sizes of clusters against time: the largest and two means; and the distribution in the last frame.

    Or in the frame of an index, and then without the time. Where the times of frames grow by a factor, so does their
    axis.
    """
    if len(file) < FEWEST:
        raise NotApplicableError(f"{len(file)} particles are too few for clusters")
    frames = file.frames
    if len(frames) == 0:
        raise NotApplicableError("no frames")
    most = int(np.clip(MOST_PARTICLES / len(file), 1, min(MOST_FRAMES, len(frames))))
    # The last one always, and before it those at equal distances.
    rows = np.unique(np.round(np.linspace(len(frames) - 1, 0, most)).astype(int))
    chosen = [frames[int(row)] for row in rows] if index is None else [of_index(file, index)]
    found = [analysis.clusters(frame, DISTANCE) for frame in chosen]
    time = [frame.time for frame in chosen]

    several = len(chosen) > 1
    figure = Figure(figsize=(6.4, 6.4 if several else 4.2), layout="constrained")
    panels = np.atleast_1d(figure.subplots(2 if several else 1, 1))
    if several:
        top = panels[0]
        squares = [float(one.sizes.astype(float) @ one.sizes / one.sizes.sum()) for one in found]
        means = [float(np.mean(one.sizes)) for one in found]
        for color, values, name in (
            (BLUE, [float(one.largest) for one in found], "the largest"),
            (GREEN, squares, r"that of a particle, $\Sigma n^2/N$"),
            (RED, means, "mean of all"),
        ):
            top.plot(time, values, color=color, marker="o", ms=4, label=name)
        if spans([*means, *(one.largest for one in found)]):
            top.set_yscale("log")
        else:
            top.set_ylim(bottom=0)
        if is_geometric(time):
            top.set_xscale("log")
        top.set_xlabel("simulated time $t$  [scene’s unit of time]")
        top.set_ylabel("particles in a cluster")
        top.legend(loc="best")
    sizes, counts = np.unique(found[-1].sizes, return_counts=True)
    below = panels[-1]
    below.loglog(sizes, counts, "o", color=BLUE, ms=4)
    below.set_xlim(0.8, max(12.0, 1.3 * sizes[-1]))
    below.set_ylim(0.7, 1.6 * counts.max())
    if counts.max() < 10:
        below.set_yscale("linear")
        below.set_ylim(0, counts.max() + 1)
        below.yaxis.set_major_locator(MaxNLocator(integer=True))
    below.set_xlabel("particles in a cluster")
    below.set_ylabel("number of clusters")
    note(below, f"t = {time[-1]:.4g}: {len(found[-1].sizes):,} clusters, the largest of {found[-1].largest:,}",
         x=0.98, y=0.96, ha="right", va="top")  # fmt: skip
    headline(figure, f"Clusters: centers closer than {DISTANCE:g} contact distances", facts(file))
    return figure
