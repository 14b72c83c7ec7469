"""The energy ledger: the terms of the energy balance, and its residual."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from ..errors import NotApplicableError
from ..files.samples import balance
from .facts import sampled
from .style import BLACK, BLUE, ENERGIES, GREEN, GREY, ORANGE, PURPLE, RED, YELLOW, headline, label, number

if TYPE_CHECKING:
    from ..files.recording import Recording

# Residuals below this are within the last bit of the sums and drawn on the lowest line.
FLOOR = 1e-17


def draw(file: Recording) -> Figure:
    """Stacked energies against time with the line of E₀ + W on top; below, the residual of the ledger.

    E₀ is the energy at the first sample, and what was lost and given counts from there: a file of a run that went on
    with changed keys starts in the middle of it.
    """
    table = file.samples
    needed = ("kinetic_energy", "potential_energy", "dissipated_energy")
    if missing := [n for n in needed if n not in table]:
        raise NotApplicableError(f"the file has no {', '.join(missing)}")
    if len(table["time"]) < 2 or not table["time"][-1] > table["time"][0]:
        raise NotApplicableError("fewer than two samples")
    t = table["time"]
    kinetic, potential, lost = (table[n] for n in needed)
    lost = lost - lost[0]
    rotation = table["rotational_energy"] if "rotational_energy" in table else np.zeros_like(t)
    terms = {name: sign for name, (_, sign) in balance(file).items() if name in table}
    since = {name: table[name] - table[name][0] for name in terms}
    # What is given raises the line of the supply; what is taken is a layer.
    work = np.sum([since[name] for name, sign in terms.items() if sign > 0] or [np.zeros_like(t)], axis=0)
    rest = np.sum([since[name] for name, sign in terms.items() if sign < 0] or [np.zeros_like(t)], axis=0)
    scale = max(np.max(np.abs(energy)) for energy in (kinetic, rotation, potential, lost))
    if not scale > 0:
        raise NotApplicableError("there is no energy in this scene")

    layers: list[tuple[str, str, np.ndarray]] = [("kinetic", ENERGIES["kinetic"], kinetic)]
    if rotation.max() > 1e-12 * scale:
        layers = [("translation", ENERGIES["kinetic"], kinetic), ("rotation", ENERGIES["rotational"], rotation)]
    pistons = table["piston_energy"] if "piston_energy" in table else np.zeros_like(t)
    if pistons.max() > 1e-12 * scale:
        layers.append(("pistons", ENERGIES["pistons"], pistons))
    springs = table["spring_energy"] if "spring_energy" in table else np.zeros_like(t)
    gravity = potential - springs
    shift = min(0.0, float(gravity.min()))
    if np.abs(gravity).max() > 1e-12 * scale:
        name = "gravity" if springs.any() else "potential"
        layers.append((name + (" (from its lowest)" if shift < 0 else ""), ENERGIES["potential"], gravity - shift))
    if springs.max() > 1e-12 * scale:
        layers.append(("springs", GREEN, springs))
    for name, color, values in _dissipated(file, t, lost, rest):
        if values.max() > 1e-12 * scale:
            layers.append((name, color, values))

    figure = Figure(figsize=(6.4, 6.0), layout="constrained")
    top, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.6, 1))
    logarithmic = _log_time(t, kinetic + rotation, file)
    shown = t > 0 if logarithmic else np.full(len(t), True)
    top.stackplot(t[shown], *[v[shown] for _, _, v in layers], colors=[c for _, c, _ in layers], lw=0, alpha=0.85,
                  labels=[n for n, _, _ in layers])  # fmt: skip
    supply = kinetic[0] + rotation[0] + pistons[0] + potential[0] - shift + work
    given = [label for name, (label, sign) in balance(file).items() if name in terms and sign > 0 and since[name].any()]
    first = r"initial energy $E_0$" if t[0] == 0 else f"energy $E_0$ at $t$ = {number(float(t[0]))}"
    supplied = " + ".join([r"$E_0$" if t[0] == 0 else first, *given]) if given else first
    top.plot(t[shown], supply[shown], color=BLACK, lw=1.4, ls=(0, (5, 2)), label=supplied)
    top.set_ylabel("energy  [mass · length² / time²]")
    top.set_ylim(0, 1.02 * max(float(supply.max()), float(np.sum([v for _, _, v in layers], axis=0).max())))
    handles, labels = top.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels) if sum(map(len, labels)) < 58 else 2)

    residual = np.abs(table["ledger_residual"]) if "ledger_residual" in table else np.full(len(t), np.nan)
    below.axhline(1e-12, color=RED, lw=1, ls="--")
    below.text(0.99, 1e-12, "accepted: 10$^{-12}$", color=RED, ha="right", va="bottom", fontsize=8.5,
               transform=below.get_yaxis_transform())  # fmt: skip
    below.axhline(np.finfo(float).eps, color=GREY, lw=0.8, ls=":")
    below.text(1.005, np.finfo(float).eps, "ε", color="#555555", ha="left", va="center", fontsize=9,
               transform=below.get_yaxis_transform())  # fmt: skip
    below.semilogy(t[shown], np.maximum(residual[shown], FLOOR), color=BLUE, lw=0.9, marker=".", ms=3)
    largest = float(np.nanmax(residual, initial=0.0))
    floored_axis(below, max(1e-11, 10 * largest))
    below.set_ylabel("|residual|\nof the ledger")
    below.set_xlabel("simulated time $t$  [scene’s unit of time]")
    if logarithmic:
        below.set_xscale("log")
    below.set_xlim(t[shown][0], t[-1])
    headline(figure, "Where the energy went", f"{sampled(file, t)}  ·  largest residual {number(largest, 2)}")
    return figure


def floored_axis(axes: Axes, top: float) -> None:
    """A logarithmic axis of differences from ``FLOOR``, which stands for 0, to ``top``."""
    axes.set_ylim(FLOOR / 2, top)
    axes.yaxis.set_major_locator(LogLocator(numticks=5))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(
        FuncFormatter(lambda v, _: "0" if v <= 1.5 * FLOOR else f"10$^{{{round(np.log10(v))}}}$")
    )


def _log_time(t: np.ndarray, kinetic: np.ndarray, file: Recording) -> bool:
    """Logarithmic time for a gas whose cooling spans decades."""
    decades = len(t) > 3 and t[-1] > 50 * t[1]
    return decades and len(file) >= 100 and 0 < kinetic[-1] < 0.1 * kinetic[0]


def _dissipated(
    file: Recording, t: np.ndarray, lost: np.ndarray, rest: np.ndarray
) -> list[tuple[str, str, np.ndarray]]:
    """Σ ΔT at the sample times, split into collisions and wall collisions if the event log allows it."""
    whole = [("dissipated in collisions", ENERGIES["dissipated"], lost), ("taken in putting to rest", GREEN, rest)]
    if "events" not in file or len(file.events) == 0:
        return whole
    events = file.events
    if not {"time", "kind", "energy_loss"} <= set(events.columns):
        return whole
    parts: dict[str, np.ndarray] = {name: np.zeros(len(t)) for name in events.kinds.values()}
    for block in events.blocks(columns=("time", "kind", "energy_loss")):
        # Samples are taken after all events at their time.
        upto = np.searchsorted(block["time"], t, side="right")
        for code, name in events.kinds.items():
            if np.any(chosen := block["kind"] == code):
                parts[name] += np.append(0.0, np.cumsum(np.where(chosen, block["energy_loss"], 0.0)))[upto]
    parts = {name: v for name, v in parts.items() if v.any()}
    total = sum(parts.values(), np.zeros(len(t)))
    close = 1e-6 * np.abs(lost + rest) + 1e-9 * max(lost.max(), 1e-300)
    if "slide" in parts:
        # What friction takes is in the log when the slide ends, and in the samples before.
        ahead = lost + rest - total
        if np.all((ahead >= -close) & (ahead <= parts["slide"][-1] - parts["slide"] + close)):
            parts["slide"] = parts["slide"] + ahead
            total = total + ahead
    if np.any(np.abs(total - (lost + rest)) > close):
        return whole  # the log covers a part of the run only
    names = {
        "collision": ("dissipated, sphere–sphere", ENERGIES["dissipated"]),
        "wall": ("dissipated at walls", ORANGE),
        "rest": ("dissipated coming to rest", GREEN),
        "settle": ("dissipated settling", PURPLE),
        "taut": ("dissipated by strings", PURPLE),
        "stick": ("dissipated by sticking", YELLOW),
        "slide": ("dissipated by sliding", YELLOW),
    }
    return [(*names.get(n, (f"dissipated, {label(n)}", GREY)), v) for n, v in parts.items()]
