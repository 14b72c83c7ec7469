"""The states between which a page interpolates: frames of the file, or the states at all events of few bodies."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..errors import MissingDataError, NotApplicableError
from ..figures import trajectories
from ..files.events import PAIRS
from ..files.frames import Frames
from ..reader import File

MOST = 20_000
"""Key frames of exact paths; if there were more, the recorded frames are taken."""

State = tuple[np.ndarray, np.ndarray, np.ndarray]


class Keyframes(NamedTuple):
    """States at given times, computed or read on access."""

    time: np.ndarray
    """``[K]`` [time]"""
    state: Callable[[int], State]
    """Position in the box, velocity and image, ``[N, 3]`` each, of a row"""
    exact: bool
    """Whether there are so many that straight lines between them are the paths"""
    displacement: np.ndarray | None = None
    """``[K]`` displacement along the flow of the images across the upper face of a sheared box [length]"""
    spin: Callable[[int], np.ndarray] | None = None
    """Angular velocity ``[N, 3]`` of a row [1/time], NaN where it is not known; ``None`` without spin"""


def recorded(frames: Frames) -> Keyframes:
    """The recorded frames; each is read on access."""

    def state(k: int) -> State:
        frame = frames[k]
        return frame.spread(frame.position), frame.spread(frame.velocity), frame.spread(frame.image)

    displacement = None
    if frames.file.shear is not None:
        displacement = np.array([frame.box.displacement[2] for frame in frames if frame.box.displacement])

    def spin(k: int) -> np.ndarray:
        frame = frames[k]
        assert frame.angular_velocity is not None
        return frame.spread(frame.angular_velocity)

    return Keyframes(np.asarray(frames.time, float), state, False, displacement, spin if _spinning(frames) else None)


def _spinning(frames: Frames) -> bool:
    """Whether frames have angular velocities; files of other programs may have moments of inertia without them."""
    return frames.file.inertia is not None and len(frames) > 0 and frames[0].angular_velocity is not None


def along_flights(file: File, frames: Frames) -> Keyframes | None:
    """Exact paths of few bodies from the event log; ``None`` without a complete log, or if they are too long.

    The log lacks changes of velocities by drives and from outside, and images of a box that changes with time slide.
    """
    if len(frames) < 2 or "events" not in file or file.scene.get("drive") or file.compression is not None or file.flows:
        return None
    try:
        paths = trajectories.flights(file)
    except (NotApplicableError, MissingDataError):
        return None
    if trajectories.is_changed(file):
        return None
    first, last = float(frames.time[0]), float(frames.time[-1])
    if any(file.scene.get("domain", {}).get("gravity", ())):
        corners = [path.time for path in paths]
    else:  # straight from event to event
        corners = [frames.time, file.events["time"]]
    time = np.unique(np.concatenate(corners))
    time = time[(time >= first) & (time <= last)]
    if not 2 <= len(time) <= MOST:
        return None
    position = np.stack([_interpolate(time, path.time, path.position) for path in paths], axis=1)
    velocity = np.gradient(position, time, axis=0)
    size = np.where(file.box.periodic, file.box.size, np.inf)
    image = np.where(file.box.periodic, np.floor(position / size), 0.0)
    displacement = None
    if (shear := file.shear) is not None:
        # Rows of images slide: along the flow a particle is in the box after it was moved to the row of the box.
        edge, speed = float(size[shear.flow]), shear.rate * float(size[shear.gradient])
        start = frames[0].box.displacement
        displacement = (start[2] if start else 0.0) + speed * (time - first)
        displacement -= np.round(displacement / edge) * edge
        rows = image[..., shear.gradient]
        velocity[..., shear.flow] -= rows * speed
        position[..., shear.flow] -= rows * displacement[:, None]
        image[..., shear.flow] = np.floor(position[..., shear.flow] / edge)
    inside = position - image * np.where(file.box.periodic, file.box.size, 0.0)
    spin = _spins(file, time)
    return Keyframes(
        time,
        lambda k: (inside[k], velocity[k], image[k]),
        True,
        displacement,
        None if spin is None else lambda k: spin[k],
    )


def _spins(file: File, time: np.ndarray) -> np.ndarray | None:
    """Angular velocities ``[K, N, 3]`` at given times, which change with events only; ``None`` without spin.

    Those of the recorded frame before, if the body has had no event since, or of the frame after, if it has none up
    to there; between two events of one interval NaN.
    """
    if not _spinning(file.frames) or not {"kind", "i", "j"} <= set(file.events.columns):
        return None
    recorded, log = file.frames.time, file.events.to_pandas()
    values = file.frames.array("angular_velocity")
    pairs = log["kind"].isin(PAIRS)
    before = np.clip(np.searchsorted(recorded, time, side="right") - 1, 0, len(recorded) - 1)
    after = np.minimum(before + 1, len(recorded) - 1)
    spin = np.full((len(time), len(file), 3), np.nan)
    for body in range(len(file)):
        own = np.sort(log["time"][(log["i"] == body) | (pairs & (log["j"] == body))].to_numpy())
        count = np.searchsorted(own, time, side="right")
        # An event at the time of a frame precedes it.
        late = count == np.searchsorted(own, recorded[after], side="right")
        spin[late, body] = values[after[late], body]
        early = count == np.searchsorted(own, recorded[before], side="right")
        spin[early, body] = values[before[early], body]
    return spin


def _interpolate(time: np.ndarray, known: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(time, known, values[:, axis]) for axis in range(3)], axis=-1)
