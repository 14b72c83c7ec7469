"""Cooling of a granular gas against Haff's law: the temperature, its ratio to the law, and the measured time τ."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import AutoLocator, FuncFormatter, LogLocator, NullLocator

from ..analysis import CoolingLaw
from ..analysis.cooling import DEVIATION, Fit, fitted
from ..files.layout import Array
from .facts import facts
from .style import BLUE, GREY, ORANGE, RED, headline, number

if TYPE_CHECKING:
    from ..files.recording import Recording

ROTATION = r"rotation, $T_\mathrm{rot}$"


def draw(file: Recording, law: CoolingLaw) -> Figure:
    """T(t), log–log, with Haff's law of theory; below, their ratio. Shaded: times at which the law does not hold.

    In a file that goes on from another run, time and collisions count from its first sample.
    """
    table = file.samples
    known = (table["time"] > law.start) & (table["temperature"] > 0)
    t, T = table["time"][known] - law.start, table["temperature"][known]
    fit = fitted(file, law)
    figure = Figure(figsize=(6.4, 6.2), layout="constrained")
    top, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.6, 1))
    curve = np.geomspace(t[0], t[-1], 400)
    top.loglog(curve, law.temperature(curve + law.start), color=RED, lw=4.5, alpha=0.45,
               solid_capstyle="round",
               label=rf"Haff’s law  $T_0\,(1+t/\tau)^{{-2}}$,  $\tau$ = {number(law.tau)} in theory")  # fmt: skip
    stride = max(1, len(t) // 4000)
    marker = "." if len(t) < 80 else ""
    top.loglog(t[::stride], T[::stride], color=BLUE, marker=marker, lw=1.4, label=_measured(fit, law.start))
    if t[0] < law.tau < t[-1]:
        top.axvline(law.tau, color=GREY, lw=0.8, ls=":", zorder=0)
        top.text(law.tau, 0.985, r" $t=\tau$", transform=top.get_xaxis_transform(), color="#555555", va="top")
    rotation = rotational(table)[known]
    if np.any(rotation > 0):
        top.loglog(t[::stride], rotation[::stride], color=ORANGE, lw=1.4, label=ROTATION)
    if fit is not None and not fit.complete:
        for axes in (top, below):
            axes.axvspan(fit.until - law.start, t[-1] * 1.02, color=GREY, alpha=0.13, lw=0, zorder=0)
    top.set_ylabel(r"granular temperature $T$  [$k_\mathrm{B}=1$]")
    top.legend(loc="lower left", title=_remarks(file, law, fit), alignment="left", title_fontsize=8.8)
    # Space for the legend below the start of the curve, however little the gas has cooled.
    low, high = top.get_ylim()
    top.set_ylim(low / (high / low) ** 0.35, high)

    ratio = T / law.temperature(t + law.start)
    below.axhline(1, color=RED, lw=2.5, alpha=0.45)
    below.loglog(t[::stride], ratio[::stride], color=BLUE, lw=1.3, marker=marker)
    _ratio_axis(below, float(ratio.min()), float(ratio.max()))
    below.set_ylabel(r"$T\,/\,T_\mathrm{Haff}$")
    since = f" after {law.start:.6g}, where the file starts" if law.start > 0 else ""
    below.set_xlabel(f"simulated time $t${since}  [scene’s unit of time]")
    below.set_xlim(t[0], t[-1] * 1.02)
    particles = 2 * (table["collisions"] - table["collisions"][0]) / len(file) if "collisions" in table else None
    if particles is not None:
        _collisions_axis(top, table["time"] - law.start, particles)
    headline(figure, "Cooling by Haff’s law", facts(file))
    return figure


def rotational(table: dict[str, Array]) -> Array:
    """Rotational temperatures of the samples; NaN without spin."""
    return table.get("rotational_temperature", np.full(len(table["time"]), np.nan))


def _measured(fit: Fit | None, start: float) -> str:
    """Label of the curve of the simulation."""
    if fit is None:
        return "simulation"
    where = "" if fit.complete else f" up to $t$ = {number(fit.until - start, 3)}"
    return rf"simulation,  $\tau$ = {number(fit.tau)} measured{where}"


def _ratio_axis(axes: Axes, low: float, high: float) -> None:
    """A logarithmic axis of ratios from ``low`` to ``high`` and around 1, with plain numbers at its ticks."""
    low, high = min(low, 1 / 1.01), max(high, 1.01)
    air = (high / low) ** 0.08
    axes.set_ylim(low / air, high * air)
    wide = high / low > 4
    subs = (1.0,) if high / low > 300 else (1.0, 2.0, 5.0)
    axes.yaxis.set_major_locator(LogLocator(subs=subs, numticks=8) if wide else AutoLocator())
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _remarks(file: Recording, law: CoolingLaw, fit: Fit | None) -> str | None:
    """Whether the box is small enough for the gas to stay homogeneous, and until when the law holds."""
    found = []
    if np.isfinite(law.critical_length):
        side = file.box.size[: file.dimension].max()
        sign, so = ("<", "stays homogeneous") if side < law.critical_length else (">", "clusters in the end")
        found.append(rf"box {side:.3g} {sign} $L_c$ ≈ {law.critical_length:.3g} of a dilute gas: {so}")
    if not law.monodisperse:
        found.append("in theory all particles have one temperature")
    if fit is not None and not fit.complete:
        found.append(f"shaded: $T$ is off the law by more than {100 * DEVIATION:g} %")
    return "\n".join(found) or None


def _collisions_axis(axes, time: np.ndarray, particles: np.ndarray) -> None:
    """Second scale above: collisions per particle up to each time, at round numbers."""
    low, high = axes.get_xlim()
    wanted = [10.0**k for k in range(-3, 7)] + [3 * 10.0**k for k in range(-3, 7)]
    ticks, labels = [], []
    last = -np.inf
    for value in sorted(wanted):
        if particles[-1] < value or not np.any(particles >= value):
            continue
        at = float(np.interp(value, particles, time))
        if not max(low, float(time[1])) <= at <= high:
            continue
        place = np.log(at / low) / np.log(high / low)
        if place - last > 0.09:
            ticks.append(at)
            labels.append(f"{value:g}")
            last = place
    if len(ticks) < 2:
        return
    upper = axes.secondary_xaxis("top")
    upper.set_xticks(ticks, labels)
    upper.minorticks_off()
    upper.tick_params(direction="in", labelsize=8.5, colors="#555555")
    upper.set_xlabel("collisions per particle", fontsize=9, color="#555555", labelpad=3)
