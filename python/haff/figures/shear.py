"""Sheared runs: temperature, viscosity, normal stresses and velocities, with the theory of uniform shear flow."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .. import analysis, theory
from ..analysis import conditions
from ..errors import NotApplicableError
from ..files.box import Shear
from ..files.header import packing_fraction
from ..files.layout import AXES
from ..files.measure import Rows, profile_rows
from .facts import facts
from .profiles import curve, later_half
from .style import BLUE, CYCLE, GREY, RED, headline, left_out, number

if TYPE_CHECKING:
    from ..files.recording import Recording

MOST_POINTS = 200
"""Points of a curve; of more samples each point is a mean of several."""


class _Steady(NamedTuple):
    """The steady state of theory, in the units of the scene."""

    temperature: float
    viscosity: float
    normal: tuple[float, float, float]
    """Over the pressure: along the flow, along the gradient, and the third."""


def draw(file: Recording) -> Figure:
    """Temperature, viscosity and normal stresses against strain; with a profile along the gradient the velocity.

    Dashed lines are the steady state by :func:`haff.theory.uniform_shear_enskog`, where its conditions
    (:data:`.conditions.SHEAR_FLOW`) hold.
    """
    shear = file.shear
    if shear is None:
        raise NotApplicableError("no shear (set domain.shear in the scene)")
    found, table = analysis.rheology(file), file.samples
    if "temperature" not in table:
        raise NotApplicableError("the file has no temperature")
    expected, why = _theory(file, shear)
    third = 3 - shear.flow - shear.gradient
    axes_of_flow = [shear.flow, shear.gradient, *([third] if file.dimension == 3 else [])]
    letters = [AXES[k] for k in axes_of_flow]
    profile = _profile(file, AXES[shear.gradient])

    figure = Figure(figsize=(8.8, 6.2) if profile is not None else (6.4, 7.4), layout="constrained")
    panels = figure.subplots(2, 2).ravel() if profile is not None else figure.subplots(3, 1)
    temperature, viscosity, normal = panels[:3]
    rate = abs(shear.rate)
    strain = rate * table["time"]
    lines: tuple = (None, None, ()) if expected is None else expected

    T = table["temperature"]
    late = T[table["time"] >= found.start]
    temperature.plot(*_thinned(strain, T), color=BLUE, lw=1.3, label=f"simulation,  {number(float(late.mean()))}")
    _level(temperature, lines[0], RED, "Enskog")
    temperature.set_ylabel("temperature $T$  [energy]")

    strain = rate * found.time
    seen = found.mean_viscosity
    viscosity.plot(*_thinned(strain, found.viscosity), color=BLUE, lw=1.3,
                   label=rf"simulation,  {number(seen.mean)} ± {seen.error:.1g}")  # fmt: skip
    _level(viscosity, lines[1], RED, "Enskog")
    flow, gradient = letters[:2]
    unit = "mass/(length time)" if file.dimension == 3 else "mass/time"
    viscosity.set_ylabel(rf"$\eta = -P_{{{gradient}{flow}}}/\dot\gamma$  [{unit}]")

    tensor = np.stack([table[f"pressure_tensor_{a}{a}"] for a in letters])
    known = np.isfinite(tensor).all(axis=0) & (tensor.sum(axis=0) > 0)
    mean = tensor[:, known].mean(axis=0)
    for k, letter in enumerate(letters):
        points = _thinned(rate * table["time"][known], tensor[k, known] / mean)
        normal.plot(*points, color=CYCLE[k], lw=1.2, label=f"$P_{{{letter}{letter}}}$")
        _level(normal, lines[2][k] if lines[2] else None, CYCLE[k], None)
    normal.axhline(1, color=GREY, lw=0.6, ls=":", zorder=0)
    normal.set_ylabel("normal stresses over pressure")

    for panel in (temperature, viscosity, normal):
        panel.set_xlim(0, rate * found.time[-1])
        panel.axvspan(rate * found.start, rate * found.time[-1], color=GREY, alpha=0.1, lw=0, zorder=0)
        panel.set_xlabel(r"strain $|\dot\gamma|\,t$")
        panel.legend(loc="best", ncols=3 if panel is normal else 1)
    # The first samples, before the stresses have relaxed, must not set the scale.
    for panel in (temperature, viscosity):
        panel.set_ylim(bottom=0)
    if profile is not None:
        _velocity(panels[3], profile, shear, float(file.box.size[shear.gradient]))
    if why:
        left_out(temperature, "no theory drawn", why)
    headline(figure, "Simple shear", rf"{facts(file)},  $\dot\gamma$ = {shear.rate:g}  ·  means over the shaded times")
    return figure


def _theory(file: Recording, shear: Shear) -> tuple[_Steady | None, str]:
    """The steady state by Enskog's equation, or why there is none."""
    if why := conditions.unmet(file, conditions.SHEAR_FLOW):
        return None, why
    e, phi = conditions.restitution(file) or 0.0, packing_fraction(file)
    sigma, mass, rate = 2 * float(file.radius[0]), float(file.mass[0]), abs(shear.rate)
    flow = theory.uniform_shear_enskog(e, phi)
    normal = np.diag(flow.pressure_tensor) / flow.pressure
    return _Steady(
        float(flow.temperature) * mass * (sigma * rate) ** 2,
        float(flow.viscosity) * mass * rate / sigma,
        (float(normal[0]), float(normal[1]), float(normal[2])),
    ), ""


def _level(axes: Axes, value: float | None, color: str, name: str | None) -> None:
    if value is not None:
        text = None if name is None else f"{name},  {number(value)}"
        axes.axhline(value, color=color, lw=1.4, ls=(0, (5, 2)), label=text)


def _thinned(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means of as many samples as leave about ``MOST_POINTS``."""
    width = max(1, len(x) // MOST_POINTS)
    kept = len(x) // width * width
    return tuple(values[len(values) - kept :].reshape(-1, width).mean(axis=1) for values in (x, y))  # type: ignore


def _profile(file: Recording, axis: str) -> Rows | None:
    """Later half of the rows of a profile along the gradient, if there is one."""
    profile = profile_rows(file).get(axis) if "profiles" in file else None
    return None if profile is None or len(profile.time) == 0 else later_half(profile)


def _velocity(axes: Axes, late: Rows, shear: Shear, edge: float) -> None:
    flow, gradient = AXES[shear.flow], AXES[shear.gradient]
    place, values = late.centers[gradient], late.fields["velocity"][..., shear.flow]
    ends = np.array([0.0, edge])
    axes.plot(ends, shear.rate * ends, color=RED, lw=4, alpha=0.4, label=rf"$\dot\gamma\,{gradient}$")
    curve(axes, place, values, BLUE, "simulation, late rows")
    axes.set_xlabel(f"${gradient}$  [length]")
    axes.set_ylabel(f"velocity $u_{flow}$  [length/time]")
    axes.margins(x=0.01)
    axes.legend(loc="best")
