"""Pair distributions of mixtures, one for each pair of species."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from .. import analysis, theory
from ..analysis import conditions, homogeneous
from ..errors import NotApplicableError
from .facts import facts
from .structure import sample, sampled, times
from .style import CYCLE, GREY, headline, label, left_out

if TYPE_CHECKING:
    from ..files.recording import Recording

MOST_PAIRS = 8e6
MOST_SPECIES = 3
"""Species whose pairs are drawn, the most numerous ones."""
FEWEST = 10
"""Fewest particles of a species."""


def draw(file: Recording, index: int | None = None) -> Figure:
    """g_ab(r) of each pair of species with the contact distance and, of homogeneous fluids, the value of theory there.

    Of inelastic particles that value is seen (1 + e)/2e times as large, as in the figure of one species.
    """
    counts = np.bincount(file.species, minlength=len(file.species_names))
    drawn = [int(s) for s in np.argsort(-counts, kind="stable")[:MOST_SPECIES] if counts[s] >= FEWEST]
    if len(drawn) < 2:
        raise NotApplicableError("fewer than two species of ten particles or more: their g(r) is the figure structure")
    frames, sigma, r_max, bins = sampled(file, MOST_PAIRS, index)
    found = analysis.pair_distributions(frames, r_max, bins, most_pairs=MOST_PAIRS)
    why = conditions.unmet(file, homogeneous.CONTACT_VALUE)
    contacts = {} if why else _contact_values(file, counts)

    figure = Figure(figsize=(6.8, 5.0), layout="constrained")
    axes = figure.subplots()
    axes.axhline(1, color=GREY, lw=0.8, ls=":")
    pairs = [(a, b) for k, a in enumerate(sorted(drawn)) for b in sorted(drawn)[k:]]
    top = 1.35
    for color, (a, b) in zip(CYCLE, pairs):
        g = found.partial[found.species.index(a), found.species.index(b)]
        name = f"{label(file.species_names[a], 24)} – {label(file.species_names[b], 24)}"
        axes.plot(found.r / sigma, g, color=color, lw=1.3, label=name)
        top = max(top, 1.1 * float(np.nanmax(g)))
        if (a, b) in contacts:
            contact, value = contacts[a, b]
            axes.plot([contact / sigma], [value], "D", color=color, mec="white", mew=0.6, ms=6, zorder=5)
    if why:
        left_out(axes, "no contact values of theory", why, x=0.98, ha="right")
    if contacts:
        seen = "" if conditions.restitution(file) == 1 else r", × $(1 + e)/2e$"
        axes.plot([], [], "D", color=GREY, ms=6, label=_EQUATIONS[file.dimension] + seen)
    axes.set_xlabel(rf"distance of the centers  $r/\bar\sigma$,  $\bar\sigma$ = {sigma:.4g}, mean of the diameters")
    axes.set_ylabel("partial pair distribution  $g_{ab}(r)$")
    axes.set_xlim(0, r_max / sigma)
    axes.set_ylim(0, top)
    figure.legend(loc="outside lower center", ncols=3)
    headline(figure, "Partial pair distributions", f"{facts(file)}  ·  {sample(file, found)}, {times(frames)}")
    return figure


_EQUATIONS = {2: "contact, Jenkins–Mancini", 3: "contact, BMCSL"}


def _contact_values(file: Recording, counts: np.ndarray) -> dict[tuple[int, int], tuple[float, float]]:
    """Contact distance and value of each pair of species by theory; none unless each has one size."""
    sizes = [np.unique(file.radius[file.species == s]) for s in range(len(counts))]
    if any(len(size) > 1 for size in sizes):
        return {}
    present = [s for s in range(len(counts)) if counts[s]]
    sigma = np.array([2 * float(sizes[s][0]) for s in present])
    g = theory.mixture_contact_values(counts[present] / file.box.volume, sigma, file.dimension)
    g = theory.contact_value_after_collision(g, conditions.restitution(file) or 1.0)
    return {
        (a, b): (0.5 * float(sigma[i] + sigma[j]), float(g[i, j]))
        for i, a in enumerate(present)
        for j, b in enumerate(present)
    }
