"""Energy lost per event."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from .. import theory
from ..analysis import conditions, homogeneous
from ..analysis.phases import phase_note
from ..errors import NotApplicableError
from ..files.scene import is_rough
from .facts import facts
from .style import BLUE, GREEN, GREY, ORANGE, RED, headline, label, left_out

if TYPE_CHECKING:
    from ..files.recording import Recording

_COLORS = {"collision": BLUE, "wall": ORANGE, "rest": GREEN}
_NAMES = {
    "collision": "sphere–sphere",
    "wall": "sphere–wall",
    "rest": "coming to rest",
    "settle": "settling on a sphere",
    "taut": "strings becoming taut",
    "stick": "sticking",
    "slide": "sliding",
}


def draw(file: Recording) -> Figure:
    """Histogram of ΔT per kind of event; for a homogeneous gas also ΔT in units of (1 − e²)T against e^{-x}.

    Of rough contacts the second panel has the part of ΔT by the normal impulse. Where the exponential law does not
    hold, the first panel says why.
    """
    events = file.events
    if not {"kind", "energy_loss", "time"} <= set(events.columns):
        raise NotApplicableError("the event log has no energy losses")
    if len(events) < 5:
        raise NotApplicableError(f"{len(events)} events make no histogram")
    why = _unmet(file)
    e = None if why else conditions.restitution(file)
    rough = "tangential_loss" in events.columns
    low, high, lossy = _range(file)
    if not lossy:
        raise NotApplicableError("no event loses energy (elastic)")
    # Ten bins a decade resolve the shape; rare tiny losses are left out, since they only stretch the axis.
    low = max(low, high * 1e-14)
    most = min(140.0, max(8.0, 2 * np.sqrt(len(events))))
    edges = np.geomspace(low * 0.999, high * 1.001, int(np.clip(10 * np.log10(high / low), 8, most)) + 1)
    scaled_edges = np.linspace(0, 14, 71)
    counts = {name: np.zeros(len(edges) - 1) for name in events.kinds.values()}
    scaled = np.zeros(len(scaled_edges) - 1)
    number = 0
    table = file.samples if e is not None else None
    for block in events.blocks(columns=("time", "kind", "energy_loss", *(("tangential_loss",) if rough else ()))):
        for code, name in events.kinds.items():
            if np.any(chosen := block["kind"] == code):
                counts[name] += np.histogram(block["energy_loss"][chosen], edges)[0]
        if e is not None and table is not None:
            T = _temperature_at(block["time"], table)
            lost = block["energy_loss"] - block["tangential_loss"] if rough else block["energy_loss"]
            with np.errstate(divide="ignore", invalid="ignore"):
                x = lost / ((1 - e**2) * T)
            scaled += np.histogram(x, scaled_edges)[0]
            number += len(lost)

    panels = 2 if e is not None else 1
    figure = Figure(figsize=(8.6 if panels == 2 else 6.4, 4.4), layout="constrained")
    axes = figure.subplots(1, panels, squeeze=False)[0]
    raw = axes[0]
    for name, values in counts.items():
        if values.any():
            raw.stairs(values, edges, color=_COLORS.get(name, GREY), lw=1.4, label=_NAMES.get(name, label(name)))
            raw.stairs(values, edges, color=_COLORS.get(name, GREY), fill=True, alpha=0.15)
    raw.set_xscale("log")
    raw.set_yscale("log")
    raw.set_ylim(bottom=0.7)
    raw.set_xlabel(r"energy lost per event  $\Delta T$  [mass · length² / time²]")
    raw.set_ylabel("events per bin")
    raw.set_title("as recorded")
    raw.legend(loc="upper left")
    if e is None:
        left_out(raw, "not in units of the temperature", why)
    else:
        _scaled_panel(axes[1], scaled, scaled_edges, number, rough)
    headline(figure, "Energy lost per event", f"{facts(file)}  ·  {len(events):,} events")
    return figure


def _scaled_panel(axes, counts: np.ndarray, edges: np.ndarray, number: int, rough: bool) -> None:
    width = np.diff(edges)
    filled = counts > 0
    centre = (edges[:-1] + edges[1:]) / 2
    density = counts / (number * width)
    axes.semilogy(edges, theory.loss_distribution(edges), color=RED, lw=3.5, alpha=0.45, label=r"theory  $e^{-x}$")
    axes.errorbar(centre[filled], density[filled], (density / np.sqrt(np.maximum(counts, 1)))[filled], fmt="o", ms=3,
                  color=BLUE, elinewidth=0.8, label="simulation")  # fmt: skip
    last = centre[filled][-1] if filled.any() else 10
    axes.set_xlim(0, min(edges[-1], last + 0.5))
    axes.set_ylim(0.4 * density[filled].min() if filled.any() else 1e-6, 2)
    loss, part = (r"\Delta T_n", ", normal part") if rough else (r"\Delta T", "")
    axes.set_xlabel(rf"$x = {loss}\,/\,[(1 - e^2)\,T(t)]${part}")
    axes.set_ylabel("probability density")
    axes.set_title("in units of the temperature")
    axes.legend(loc="upper right")


def _unmet(file: Recording) -> str:
    """Why losses have not the exponential distribution in units of the temperature, or why these are not known."""
    if why := conditions.unmet(file, homogeneous.LOSSES):
        return why
    if is_rough(file.scene) and "tangential_loss" not in file.events.columns:
        return "needs the tangential losses of rough contacts in the event log"
    table = file.samples if "observables" in file else {}
    if len(table.get("temperature", ())) < 3 or not table["temperature"][0] > 0:
        return "needs samples of the temperature"
    if note := phase_note(file, table["time"]):
        return f"needs temperatures of all phases, and samples are {note}"
    return ""


def _temperature_at(time: np.ndarray, table) -> np.ndarray:
    # T^{-1/2} is linear in time by Haff's law: interpolate that.
    T = table["temperature"]
    with np.errstate(divide="ignore"):
        return np.interp(time, table["time"], 1 / np.sqrt(T)) ** -2


def _range(file: Recording) -> tuple[float, float, bool]:
    low, high = np.inf, 0.0
    for block in file.events.blocks(columns=("energy_loss",)):
        loss = block["energy_loss"]
        loss = loss[loss > 0]
        if len(loss):
            low, high = min(low, float(loss.min())), max(high, float(loss.max()))
    return low, high, high > 0
