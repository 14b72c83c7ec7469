"""Pair distribution g(r)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from .. import analysis, theory
from ..analysis import conditions, homogeneous
from ..analysis.phases import phase_note
from ..errors import NotApplicableError
from ..files.frames import Frame
from ..files.header import packing_fraction
from .facts import facts
from .of_a_frame import drawn
from .style import BLUE, GREEN, GREY, RED, headline, label, left_out

if TYPE_CHECKING:
    from ..files.recording import Recording

MOST_FRAMES = 20
MOST_PAIRS = 4e6
"""Distances counted, about: the error at contact is 1 to 3 % then, and counting takes a fifth of a second."""


class Range(NamedTuple):
    """Frames and bins of a pair distribution."""

    frames: list[Frame]
    sigma: float
    """Mean diameter [length]."""
    r_max: float
    bins: int


def draw(file: Recording, index: int | None = None) -> Figure:
    """g(r) from contact on, with the contact value of theory for a homogeneous fluid of equal particles."""
    d, sizes = file.dimension, np.unique(2 * file.radius)
    frames, sigma, r_max, bins = sampled(file, MOST_PAIRS, index)
    found = analysis.pair_distributions(frames, r_max, bins, most_pairs=MOST_PAIRS)
    r, g, alike = found.r, found.total, len(sizes) == 1

    figure = Figure(figsize=(6.4, 4.6), layout="constrained")
    axes = figure.subplots()
    x = r / sigma
    axes.axhline(1, color=GREY, lw=0.8, ls=":")
    axes.plot(x, g, color=BLUE, lw=1.4, label=f"simulation, {sample(file, found)}")
    if alike:
        _contact(file, axes, d, 1.5 * float(g.max()))
        axes.axvspan(0, 1, color=GREY, alpha=0.12, lw=0)
        axes.text(0.5, 0.25, "excluded", transform=axes.get_xaxis_transform(), ha="center", color="#666666")
        axes.set_xlabel(r"distance of the centers  $r/\sigma$")
    else:
        axes.set_xlabel(rf"distance of the centers  $r/\bar\sigma$,  mean diameter $\bar\sigma$ = {sigma:.4g}")
        if len(sizes) <= 3:
            _mixture_contacts(axes, sizes, sigma)
    axes.set_ylabel("pair distribution  $g(r)$")
    axes.set_xlim(0, x[-1])
    axes.set_ylim(0, max(1.35, 1.12 * float(g.max())))
    figure.legend(loc="outside lower center", ncols=2)
    headline(figure, "Pair distribution", f"{facts(file)}  ·  {times(frames)}")
    return figure


def sampled(file: Recording, most_pairs: float, index: int | None = None) -> Range:
    """The frames and bins of a figure, for up to about ``most_pairs`` distances; of one frame if an index is given."""
    box, d = file.box, file.dimension
    if not box.fully_periodic:
        raise NotApplicableError("g(r) needs a periodic box")
    if len(file) < 100:
        raise NotApplicableError(f"{len(file)} particles are too few for g(r)")
    sigma = float(np.unique(2 * file.radius).mean())
    reach = min(4.5 * sigma, 0.499 * box.size[:d].min())
    neighbors = len(file) / box.volume * (4.2 * reach**3 if d == 3 else 3.2 * reach**2)
    most = int(np.clip(most_pairs / (len(file) * neighbors), 1, MOST_FRAMES))
    frames = drawn(file, index, most)
    if not frames:
        raise NotApplicableError("no frames")
    # A sheared box is narrower at times.
    reach = min([reach, *(0.499 * frame.box.widths[:d].min() for frame in frames)])
    # Contact lies on a bin edge, so that no bin mixes the forbidden and the allowed side.
    per_sigma = 50 if len(file) * neighbors * len(frames) > 2e6 else 25
    bins = int(reach / sigma * per_sigma)
    if bins < 1:
        raise NotApplicableError("the box is too small for g(r)")
    return Range(frames, sigma, bins * sigma / per_sigma, bins)


def sample(file: Recording, found: analysis.PairDistributions) -> str:
    """What the distances are counted from, in words."""
    frames = f"{found.frames} frame{'s'[: found.frames != 1]}"
    each = found.centers // found.frames
    return frames if each == len(file) else f"{frames}, from {each:,} particles to all"


def times(frames: list[Frame]) -> str:
    """The times of some frames, in words, and whether all of them are at one phase of an oscillation."""
    span = f"t = {frames[0].time:.4g} … {frames[-1].time:.4g}" if len(frames) > 1 else f"t = {frames[0].time:.4g}"
    note = phase_note(frames[0].file, np.array([frame.time for frame in frames]))
    return span + (f", {label(note)}" if note else "")


def _contact(file: Recording, axes, d: int, top: float) -> None:
    """Marks the contact values of theory; one above ``top``, of nearly plastic spheres, is in the legend only."""
    if why := conditions.unmet(file, homogeneous.CONTACT_VALUE):
        left_out(axes, "no contact value of theory", why, x=0.98, ha="right")
        return
    eta = packing_fraction(file)
    name = "Carnahan–Starling" if d == 3 else "Henderson"
    g0 = float(theory.contact_value(eta, d))
    axes.plot([1], [g0], "D", color=RED, ms=6, zorder=5, clip_on=False,
              label=rf"$g(\sigma^+)$ = {g0:.3f}, {name}")  # fmt: skip
    e = conditions.restitution(file)
    if e is not None and 0 < e < 1:
        seen = float(theory.contact_value_after_collision(g0, e))
        axes.plot([1], [seen if seen <= top else np.nan], "s", color=GREEN, ms=6, zorder=5, clip_on=False,
                  label=rf"× $(1 + e)/2e$ = {seen:.3f}, inelastic")  # fmt: skip


def _mixture_contacts(axes, sizes: np.ndarray, sigma: float) -> None:
    contacts = sorted({float((a + b) / 2) for a in sizes for b in sizes})
    for k, contact in enumerate(contacts):
        axes.axvline(contact / sigma, color=RED, lw=0.8, ls="--", zorder=0,
                     label="contact distances" if k == 0 else None)  # fmt: skip
