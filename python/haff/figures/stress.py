"""The pressure tensor against time, and the shear viscosity from its fluctuations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from .. import analysis
from ..analysis import conditions
from ..errors import NotApplicableError
from ..files.layout import AXES
from ..files.measure import correlation_columns
from .facts import facts
from .style import BLACK, BLUE, CYCLE, GREEN, GREY, RED, headline, left_out, number

if TYPE_CHECKING:
    from ..files.recording import Recording


def draw(file: Recording) -> Figure:
    """Components of the pressure tensor; with ``measure.stress_correlation`` the running viscosity below.

    Fluctuations give the viscosity of an equilibrium only (:func:`haff.analysis.shear_viscosity`); elsewhere the figure
    says why there is none.
    """
    table = file.samples if "observables" in file else None
    tensor = table is not None and "pressure_tensor_xx" in table
    measured = "correlations" in file and "stress" in correlation_columns(file)
    if not tensor and not measured:
        raise NotApplicableError("no pressure tensor (set measure.stress or stress_correlation in the scene)")
    why = conditions.unmet(file, conditions.VISCOSITY) if measured else ""
    correlated = measured and not why
    if not tensor and why:
        raise NotApplicableError(f"the viscosity of an equilibrium {why}")
    rows = int(tensor) + int(correlated)
    figure = Figure(figsize=(6.4, 3.2 * rows + 0.6), layout="constrained")
    axes = figure.subplots(rows, 1, squeeze=False)[:, 0]
    if tensor:
        _components(file, axes[0])
        if why:
            left_out(axes[0], "no viscosity", why)
    if correlated:
        _viscosity(file, axes[-1])
    headline(figure, "Pressure tensor", facts(file))
    return figure


def _components(file: Recording, axes) -> None:
    table = {name: values[1:] for name, values in file.samples.items()}
    time = table["time"]
    letters = AXES[: file.dimension]
    # As many blocks as make the noise of the curves small.
    width = max(1, len(time) // 200)
    blocks = len(time) // width

    def mean(values: np.ndarray) -> np.ndarray:
        return values[: blocks * width].reshape(blocks, width).mean(axis=1)

    if blocks < 2:
        raise NotApplicableError("fewer than two samples of the pressure tensor")
    for k, a in enumerate(letters):
        axes.plot(mean(time), mean(table[f"pressure_tensor_{a}{a}"]), color=CYCLE[k], lw=1.1,
                  label=f"$P_{{{a}{a}}}$")  # fmt: skip
    for a, b in [("x", "y"), ("x", "z"), ("y", "z")][: 1 if len(letters) == 2 else 3]:
        axes.plot(mean(time), mean(table[f"pressure_tensor_{a}{b}"]), color=GREY, lw=0.8,
                  label="off the diagonal" if (a, b) == ("x", "y") else None)  # fmt: skip
    axes.axhline(0, color=BLACK, lw=0.6)
    if "pressure" in table:
        axes.plot(mean(time), mean(table["pressure"]), color=BLACK, lw=0.9, ls=":", label="$P$")
    axes.set_xlabel("simulated time $t$  [scene’s unit of time]")
    axes.set_ylabel("$P_{ab}$  [energy/length$^d$]")
    axes.margins(x=0)
    axes.legend(ncols=5, loc="best")


def _viscosity(file: Recording, axes) -> None:
    result = analysis.shear_viscosity(file)
    scale = analysis.viscosity_scale(file)
    found = correlation_columns(file)
    helfand, stress = found["helfand"], found["stress"]
    lag = helfand["lag"]
    axes.semilogx(lag, np.gradient(helfand["value"], lag) * scale / 2, color=BLUE, lw=1.3,
                  label="Einstein (Helfand)")  # fmt: skip
    times, integral = analysis.running_integral(stress)
    axes.semilogx(times[1:], integral[1:] * scale, color=GREEN, lw=1.3, label="Green–Kubo")
    axes.axvspan(result.start, result.end, color=GREY, alpha=0.15, lw=0)
    axes.axhline(result.einstein, color=RED, lw=1, alpha=0.7,
                 label=rf"$\eta$ = {number(result.einstein)} ± {result.einstein_error:.1g}")  # fmt: skip
    axes.set_ylim(0, 2 * result.einstein if result.einstein > 0 else None)
    axes.set_xlabel("lag $t$  [scene’s unit of time]")
    axes.set_ylabel(r"$\eta(t)$  [mass/(length$^{d-2}$ time)]")
    axes.legend(loc="upper left")
