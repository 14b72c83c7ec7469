"""Velocity distribution with its Sonine correction."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from .. import analysis, theory
from ..analysis import conditions, homogeneous
from ..errors import NotApplicableError
from ..files.layout import AXES
from .facts import facts
from .of_a_frame import drawn
from .structure import times
from .style import BLUE, GREEN, GREY, RED, headline, left_out, note, signed

if TYPE_CHECKING:
    from ..files.recording import Recording

MOST_FRAMES = 40
MOST_A2 = 0.5
"""Coefficients up to which the first Sonine polynomial is drawn; beyond it is no small correction."""


def draw(file: Recording, index: int | None = None) -> Figure:
    """Density of one scaled velocity component, log scale, and its ratio to Maxwell's below.

    The Sonine correction of theory is that of the homogeneous cooling state, or of a gas heated by white noise, where
    their conditions hold; elsewhere the figure says why there is none.
    In a sheared box velocities are relative to the flow, and the components have different temperatures.
    """
    if np.isfinite(file.mass).sum() < 200:
        raise NotApplicableError(f"{len(file)} particles are too few for a distribution")
    frames = [f for f in drawn(file, index, MOST_FRAMES) if analysis.temperature(f) > 0]
    if not frames:
        raise NotApplicableError("nothing moves in the recorded frames")
    d = file.dimension
    scaled = [analysis.scaled_velocities(frame) for frame in frames]
    c = np.abs(np.concatenate([s.ravel() for s in scaled]))
    square = np.concatenate([np.sum(s**2, axis=1) for s in scaled])
    measured = float(d * np.mean(square**2) / ((d + 2) * np.mean(square) ** 2) - 1)

    edges = np.concatenate([np.arange(0, 2.001, 0.1), np.arange(2.2, 5.001, 0.2)])
    counts, _ = np.histogram(c, edges)
    filled = counts >= 10
    counts, low, high = counts[filled], edges[:-1][filled], edges[1:][filled]
    centre = (low + high) / 2
    # Both sides of the symmetric density are folded on |c|.
    density = counts / (2 * len(c) * (high - low))
    error = density / np.sqrt(counts)
    # Bins against the mean of Maxwell's density over the bin, so that curvature does not show as a deviation.
    erf = np.vectorize(math.erf, otypes=[float])  # SciPy's takes 0.2 s to load
    maxwell = (erf(high) - erf(low)) / 2 / (high - low)
    line = np.linspace(0, centre[-1] * 1.03, 400)

    figure = Figure(figsize=(6.4, 6.2), layout="constrained")
    top, below = figure.subplots(2, 1, sharex=True, height_ratios=(1.9, 1.3))
    top.semilogy(line, theory.maxwell_component(line), color=GREY, lw=3.5, alpha=0.6, label="Maxwell")
    shape, state = _theory(file)
    if shape is not None:
        top.semilogy(line, theory.sonine_component(line, shape), color=RED, lw=1.2, ls="--",
                     label=rf"Sonine, {state} in theory  $a_2$ = {signed(shape)}")  # fmt: skip
    spread = np.std([analysis.sonine_a2(f) for f in frames], ddof=1) / np.sqrt(len(frames)) if len(frames) > 2 else None
    top.errorbar(centre, density, error, fmt="o", ms=3.4, color=BLUE, elinewidth=0.9,
                 label=f"simulation, {len(frames)} frames × {len(scaled[0]):,} particles")  # fmt: skip
    top.set_ylabel("probability density")
    top.legend(loc="lower left")
    if shape is None and state:
        left_out(top, "no theory drawn", state, x=0.98, y=0.96, ha="right")

    below.axhline(1, color=GREY, lw=3.5, alpha=0.6)
    if shape is not None:
        below.plot(line, 1 + shape * theory.sonine_polynomial(line**2, 1), color=RED, lw=1.4, ls="--")
    sheared, is_near = file.shear is not None, abs(measured) < MOST_A2
    if sheared:
        # Of all components together: the mean of normal densities with their variances, over Maxwell's.
        widths = np.mean([np.mean(s**2, axis=0) for s in scaled], axis=0)
        normal = np.mean([np.exp(-(line**2) / (2 * w)) / np.sqrt(2 * np.pi * w) for w in widths], axis=0)
        below.plot(line, normal / theory.maxwell_component(line), color=GREEN, lw=1.4)
    elif is_near:
        below.plot(line, 1 + measured * theory.sonine_polynomial(line**2, 1), color=GREEN, lw=1.4)
    below.errorbar(centre, density / maxwell, error / maxwell, fmt="o", ms=3.4, color=BLUE, elinewidth=0.9)
    sound = error / maxwell < 0.1
    seen = np.abs(density / maxwell - 1)[sound]
    reach = max(0.02, 1.25 * float(np.max(seen + (error / maxwell)[sound], initial=0.0)))
    below.set_ylim(1 - reach, 1 + reach)
    below.set_ylabel("ratio to Maxwell")
    relative = "velocity component relative to the flow" if sheared else "one velocity component"
    below.set_xlabel(rf"{relative}  $|c_x| = |v_x - {'u' if sheared else 'V'}_x|\,/\,\sqrt{{2T/m}}$")
    below.set_xlim(0, line[-1])
    margin = f" ± {spread:.4f}" if spread is not None else ""
    if sheared:
        ratios = ",  ".join(f"{2 * w:.3f} ({axis})" for axis, w in zip(AXES, widths))
        note(below, rf"green: normal densities with the measured $T_a/T$ = {ratios}")
    elif not is_near:
        note(below, rf"measured $a_2$ = {signed(measured)}{margin}: far from Maxwell")
    else:
        note(below, rf"green: $1 + a_2\,S_2(c_x^2)$ with the measured $a_2$ = {signed(measured)}{margin}")
    headline(figure, "Velocity distribution", f"{facts(file)}  ·  {times(frames)}")
    return figure


def _theory(file: Recording) -> tuple[float | None, str]:
    """a₂ and the state that it is of; or ``None``, and why there is none, empty for elastic particles."""
    if conditions.restitution(file) == 1:
        return None, ""
    e = conditions.restitution(file) or 0.0
    heated = any(drive["kind"] == "white_noise" for drive in file.scene.get("drive", ()))
    if why := conditions.unmet(file, conditions.HEATED_A2 if heated else homogeneous.COOLING_A2):
        return None, why
    if heated:
        return float(theory.sonine_a2_heated(e, file.dimension)), "heated gas"
    return float(theory.sonine_a2(e, file.dimension)), "cooling gas"
