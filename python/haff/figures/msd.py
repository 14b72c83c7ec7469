"""Mean square displacement and velocity autocorrelation, with the coefficient of self-diffusion."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .. import analysis
from ..analysis import conditions
from ..errors import NotApplicableError
from ..files.measure import correlation_columns, curves
from .facts import facts, sampled
from .style import CYCLE, GREEN, GREY, RED, headline, label, left_out, number

if TYPE_CHECKING:
    from ..files.recording import Recording


def draw(file: Recording) -> Figure:
    """⟨|Δr|²⟩ against lag with its slope, and the running coefficients of Einstein and of Green and Kubo below.

    Where there is no coefficient of self-diffusion (:func:`haff.analysis.self_diffusion`), ⟨|Δr|²⟩ alone and why. With
    curves of species there is one of each.
    """
    found = correlation_columns(file)
    if "msd" not in found:
        raise NotApplicableError("no mean square displacement (set measure.msd in the scene)")
    d = file.dimension
    msd = {name: curve for name, curve in curves(found["msd"]).items() if len(curve["lag"]) and curve["value"][-1] > 0}
    lag = found["msd"]["lag"]
    if len(lag) < 8 or not msd:
        raise NotApplicableError("fewer than eight lags of the mean square displacement")
    if why := conditions.unmet(file, conditions.DIFFUSION):
        figure = Figure(figsize=(6.4, 4.4), layout="constrained")
        axes = figure.subplots()
        for color, (name, curve) in zip(CYCLE, msd.items()):
            _displacements(axes, curve, name, color)
        axes.set_xlabel("lag $t$  [scene’s unit of time]")
        axes.legend(loc="upper left")
        left_out(axes, "no coefficient", why, x=0.98, ha="right")
        headline(figure, "Mean square displacement", facts(file))
        return figure
    # In a sheared box the displacements are those across the flow.
    axes_seen = d if file.shear is None else d - 1
    known = curves(found["vacf"]) if "vacf" in found and file.shear is None else {}
    # Those of the same particles alone belong beside the displacements.
    vacf = known if list(known) == list(curves(found["msd"])) else {}

    figure = Figure(figsize=(6.4, 6.2), layout="constrained")
    top, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.6, 1))
    highest = 0.0
    for color, (name, curve) in zip(CYCLE, msd.items()):
        result = analysis.self_diffusion(file, species=name or None)
        highest = max(highest, result.einstein)
        value, one = curve["value"], len(msd) == 1
        _displacements(top, curve, name, color)
        window = np.array([result.start, result.end])
        slope = 2 * axes_seen * result.einstein
        offset = np.interp(result.end, lag, value) - slope * result.end
        top.loglog(window, offset + slope * window, color=RED if one else color, lw=2.5, alpha=0.7,
                   label=rf"slope ${2 * axes_seen}D$,  "
                         rf"$D$ = {number(result.einstein)} ± {result.einstein_error:.1g}")  # fmt: skip
        if name in vacf and one:
            start = float(vacf[name]["value"][0])
            early = lag[lag <= max(lag[0], np.sqrt(np.interp(result.start, lag, value) / start))]
            top.loglog(early, start * early**2, color=GREY, lw=1.2, ls="--", label=r"$\langle v^2\rangle t^2$")
        running = np.gradient(value, lag) / (2 * axes_seen)
        of = f"{label(name)}: " if name else ""
        below.semilogx(lag, running, color=color, lw=1.3, label=f"{of}Einstein{', slope of the above' if one else ''}")
        if name in vacf:
            times, integral = analysis.running_integral(vacf[name])
            below.semilogx(times[1:], integral[1:] / d, color=GREEN if one else color, lw=1.3,
                           ls="-" if one else ":", label=f"{of}Green–Kubo")  # fmt: skip
        below.axhline(result.einstein, color=RED if one else color, lw=1, alpha=0.7)
    top.legend(loc="upper left")
    below.axvspan(*window, color=GREY, alpha=0.15, lw=0)
    below.set_ylim(0, 1.6 * highest if highest > 0 else None)
    below.set_xlabel("lag $t$  [scene’s unit of time]")
    below.set_ylabel("$D(t)$  [length²/time]")
    below.legend(loc="best" if len(msd) > 1 else "lower right")
    # States are taken at multiples of the shortest lag.
    headline(figure, "Self-diffusion", sampled(file, lag[0] * np.arange(100.0)))
    return figure


def _displacements(axes: Axes, msd: Mapping[str, np.ndarray], name: str, color: str) -> None:
    """⟨|Δr|²⟩ against lag, with two standard errors."""
    lag, value, error = (msd[name] for name in ("lag", "value", "error"))
    axes.loglog(lag, value, "o", color=color, ms=3, label=label(name) if name else "simulation")
    known = np.isfinite(error)
    axes.fill_between(lag[known], *_band(value[known], error[known]), color=color, alpha=0.25, lw=0)
    axes.set_ylabel(r"$\langle|\mathbf{r}(t)-\mathbf{r}(0)|^2\rangle$  [length²]")


def _band(value: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two errors to both sides, positive for the logarithmic axis."""
    return np.maximum(value - 2 * error, 1e-3 * value), value + 2 * error
