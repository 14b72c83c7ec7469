"""The observables that a page draws."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..figures.style import ENERGIES, GREEN, GREY, ORANGE, YELLOW
from ..files.samples import balance
from ..reader import File

MOST = 1500
"""Samples of a curve; of more, every second, third, … is drawn."""
FEW = 30
"""Bodies below which a temperature or a collision rate says little."""
COUNTED = 20_000
"""Events up to which a page has the time of each, so that their number is exact at any time."""
_OTHERS = (ORANGE, GREEN, YELLOW, GREY)
"""Colors of energies without one of their own."""


def find(file: File) -> dict[str, Any] | None:
    """Temperature, energies and collision rate over time, thinned; ``None`` if there are no samples."""
    if "observables" not in file or len(file.samples["time"]) < 2:
        return None
    every = -(-len(file.samples["time"]) // MOST)
    # The last sample is kept, so that the curves reach the end.
    table = {name: np.concatenate([values[:-1:every], values[-1:]]) for name, values in file.samples.items()}
    panels = []
    if "temperature" in table and len(file) >= FEW:
        panels.append(_panel("Temperature", [("", table["temperature"])]))
    energies = [
        (label, table[name])
        for label, name in (
            ("kinetic", "kinetic_energy"),
            ("rotational", "rotational_energy"),
            ("pistons", "piston_energy"),
            ("potential", "potential_energy"),
            ("dissipated", "dissipated_energy"),
            *((label, name) for name, (label, _) in balance(file).items()),
        )
        if name in table and np.ptp(table[name]) > 0
    ]
    if energies:
        panels.append(_panel("Energy ledger", energies))
        rest = [label for label, _ in energies if label not in ENERGIES]
        for series in panels[-1]["series"]:
            label = series["label"]
            series["color"] = ENERGIES.get(label) or _OTHERS[rest.index(label) % len(_OTHERS)]
    if "ledger_residual" in table and table["ledger_residual"].any():
        panels.append(_panel("Ledger residual", [("", table["ledger_residual"])]))
    counts = [table[name] for name in ("collisions", "wall_collisions") if name in table]
    total = np.sum(counts, axis=0)
    if counts and total[-1] > 0:
        if len(file) < FEW:
            panels.append(_panel("Collisions so far", [("", total)], counted=True))
            panels[-1]["events"] = _times(file, total)
        else:
            with np.errstate(divide="ignore", invalid="ignore"):
                rate = np.diff(total) / np.diff(table["time"])
            panels.append(_panel("Collisions per time", [("", np.append(np.nan, rate))]))
    if not panels:
        return None
    return {"time": table["time"].tolist(), "panels": panels}


def _times(file: File, total: np.ndarray) -> list[float] | None:
    """Times of the collisions that the log of events has, if it has all of them."""
    events = file.events if "events" in file else None
    if events is None or len(events) > COUNTED or not {"time", "kind"} <= set(events.columns):
        return None
    log = events.to_pandas(columns=["time", "kind"])
    times = np.sort(log["time"][log["kind"].isin(("collision", "wall", "stick"))].to_numpy())
    return times.tolist() if len(times) == total[-1] - total[0] else None


def _panel(title: str, series, counted: bool = False) -> dict[str, Any]:
    values = [np.asarray(column, float) for _, column in series]
    shown = np.concatenate([column[np.isfinite(column)] for column in values])
    positive = shown[shown > 0]
    # The energies of a ledger are stacked, so only single curves may be logarithmic.
    wide = len(positive) > 0 and bool((shown >= 0).all() and positive.max() > 30 * positive.min())
    log = len(series) == 1 and wide and not counted
    if log:
        values = [np.where(column > 0, column, np.nan) for column in values]
    return {
        "title": title,
        "log": log,
        "series": [{"label": label, "values": _plain(column)} for (label, _), column in zip(series, values)],
    }


def _plain(values: np.ndarray) -> list[float | None]:
    return [float(f"{value:.7g}") if np.isfinite(value) else None for value in values]
