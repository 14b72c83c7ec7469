"""Pistons, walls of finite mass: where they are at a time, from the frames of a file and the events between them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .layout import Array
from .scene import pistons

if TYPE_CHECKING:
    from .recording import Recording

__all__ = ["Path", "path"]

MOST = 20_000
"""Impacts up to which a path has the flight between any two of them."""
LONGEST = 5_000_000
"""Rows of an event log up to which it is read for them."""


class Path(NamedTuple):
    """The path of a piston along its normal: flights of constant acceleration from knot to knot."""

    time: Array
    """``[K]`` times of the knots [time]"""
    displacement: Array
    """``[K]`` from ``plane.point`` of the scene [length]"""
    speed: Array
    """``[K]`` at the start of the flight after each knot [length/time]"""

    def at(self, time: float) -> float:
        """Displacement at a time [length]: that of the first knot before it, and of the last one after it."""
        k = int(np.searchsorted(self.time, time, side="right")) - 1
        if k < 0 or k + 1 >= len(self.time):
            return float(self.displacement[max(k, 0)])
        step, since = self.time[k + 1] - self.time[k], time - self.time[k]
        straight = self.displacement[k] + self.speed[k] * since
        # What is left is by the acceleration.
        bend = self.displacement[k + 1] - self.displacement[k] - self.speed[k] * step
        return float(straight + bend * (since / step) ** 2)


def path(file: Recording, wall: dict[str, Any], *, exact: bool = True) -> Path | None:
    """The path of the piston of an entry of ``[[wall]]``; ``None`` for other walls, and if the file has no frames.

    With an event log it is exact: impacts start flights anew. Without one, for very many events, and unless ``exact``,
    there is one flight from frame to frame, which is exact at the times of the frames.
    """
    index = next((k for k, other in enumerate(pistons(file.scene)) if other is wall), None)
    if index is None or index >= len(file.pistons) or "frames" not in file or len(file.frames) == 0:
        return None
    frames = file.frames
    normal = _unit(wall["plane"]["normal"])
    point = np.array([*map(float, wall["plane"]["point"]), 0.0][:3])
    displacement = (frames.array("piston_position")[:, index] - point) @ normal
    speed = frames.array("piston_velocity")[:, index] @ normal
    recorded = Path(np.asarray(frames.time, float), displacement, speed)
    return (_with_impacts(file, index, wall, recorded) if exact else None) or recorded


def _with_impacts(file: Recording, index: int, wall: dict[str, Any], recorded: Path) -> Path | None:
    """The path with a knot at each impact between the frames; ``None`` without a log that has them."""
    needed = ("time", "kind", "j", "impulse", "normal")
    if "events" not in file or len(file.events) > LONGEST or not set(needed) <= set(file.events.columns):
        return None
    events, row = file.events, file.wall_names.index(file.pistons[index])
    codes = [code for code, kind in events.kinds.items() if kind == "wall"]
    normal = _unit(wall["plane"]["normal"])
    gravity = np.array([*map(float, file.scene.get("domain", {}).get("gravity", ())), 0.0, 0.0, 0.0][:3])
    mass = float(wall["mass"])
    acceleration = float(wall.get("force", 0.0)) / mass + float(gravity @ normal)
    hits, gains = [], []
    count = 0
    for block in events.blocks(columns=needed):
        chosen = np.isin(block["kind"], codes) & (block["j"] == row)
        count += int(chosen.sum())
        if count > MOST:
            return None
        hits.append(block["time"][chosen])
        # The impulse on the wall is along the normal of the row, into the wall.
        gains.append(block["impulse"][chosen] * (block["normal"][chosen] @ normal) / mass)
    hit, gain = (np.concatenate([np.zeros(0), *parts]) for parts in (hits, gains))
    first, last = recorded.time[0], recorded.time[-1]
    knots: list[tuple[float, float, float]] = []
    k = 0
    for t, x, v in zip(*recorded):
        # A frame is taken after the impacts of its time, but the first one before those of the start.
        while k < len(hit) and hit[k] <= t and (hit[k] < first or knots):
            if first <= hit[k] < last and hit[k] < t:
                since, at, speed = knots[-1]
                dt = float(hit[k]) - since
                knots.append(
                    (float(hit[k]), at + (speed + acceleration * dt / 2) * dt, speed + acceleration * dt + gain[k])
                )
            k += 1
        knots.append((float(t), float(x), float(v)))
    return Path(*(np.array(column) for column in zip(*knots)))


def _unit(normal: Any) -> Array:
    """``[3]``"""
    given = np.array([*map(float, normal), 0.0][:3])
    return given / np.linalg.norm(given)
