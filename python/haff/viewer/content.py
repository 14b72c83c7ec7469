"""Contents of a page: frames, losses, collisions, curves, walls and joints of a file, in compact form."""

from __future__ import annotations

import json
import math
from typing import Any

import matplotlib as mpl
import numpy as np

from ..errors import ArgumentError, NotApplicableError
from ..figures import shapes
from ..figures.style import CYCLE, SPEED_MAP
from ..files import joints
from ..files.extent import Extent, extent
from ..files.selection import choose
from ..reader import File
from ..text import escaped
from . import collisions, curves, turns, walls
from .blobs import Blobs
from .coloring import Coloring
from .keyframes import Keyframes, along_flights, recorded

EXACT = 2_000_000
"""Coordinates of all frames up to which they are stored as 4-byte floats, not as 65536ths of the room."""
MOST = 20_000
"""Frames of a page, however small they are."""
CHUNK = 1 << 20  # bytes of frames in one blob, about
BASE64 = 4 / 3


def write(
    file: File, blobs: Blobs, frames: str | slice | int | None, size: float, coloring: Coloring, notes: list[str]
) -> None:
    """Writes the arrays of a page, and its header last. ``notes`` gets a line for everything left out."""
    if not size > 0:
        raise ArgumentError(f"size {size}: must be positive [MB]")
    chosen = choose(file, frames)
    linked = joints.find(file)
    keys: Keyframes | None = None if linked else along_flights(file, chosen)
    log = collisions.Log.of(file)
    if keys is None:
        chosen = _thin(file, chosen, size, log is not None, notes)
        keys = recorded(chosen)
    room = extent(chosen)
    start, end = float(keys.time[0]), float(keys.time[-1])
    scenery = shapes.find(file, room, start, end)
    notes += scenery.missing
    if file.compression is not None and len(chosen) > 1:
        notes.append("the box changes with time, and is drawn with its longest edges; one frame has its own")
    losses = None if log is None else log.losses(keys.time)
    if losses is None:
        coloring.require_no_losses(file)
    header: dict[str, Any] = {
        "title": escaped(file.title or file.path.stem),
        "count": len(file),
        "dimension": file.dimension,
        "gravity": walls.vector(file.scene.get("domain", {}).get("gravity", ())),
        "room": {"origin": room.origin.tolist(), "size": room.size.tolist(), "bounded": room.bounded.tolist()},
        "shown": [scenery.room.origin.tolist(), (scenery.room.origin + scenery.room.size).tolist()],
        "periodic": (file.box.periodic & (np.arange(3) < file.dimension)).tolist(),
        "shear": _shear(file, keys),
        "boundary": list(file.box.boundary),
        "species": [escaped(name) for name in file.species_names],
        "palette": [mpl.colors.to_hex(color) for color in CYCLE],
        "speed_map": (np.asarray(mpl.colormaps[SPEED_MAP](np.linspace(0, 1, 256)))[:, :3] * 255).astype(int).tolist(),
        "flight": "line" if keys.exact else "arc" if linked else "kink",
        "bodies": blobs.add(
            file.radius.astype(np.float32),
            np.minimum(file.species, 255).astype(np.uint8),
            (~np.isfinite(file.mass)).astype(np.uint8),
            file.mass,
        ),
        "coloring": coloring.header(),
        "losses": None if losses is None else {"largest": losses.largest, "decades": collisions.DECADES},
        "walls": walls.planes(file, start),
        "shapes": walls.shapes(scenery.shapes, blobs, file.dimension, start, _shrinking(file)),
        "motions": walls.of_box(file, "motion"),
        "displacements": walls.of_box(file, "displacement"),
        "rotations": walls.of_box(file, "rotation"),
        "joints": linked,
        "curves": curves.find(file),
        "collisions": None if log is None else log.sample(blobs, start, end, notes),
    }
    header["served"] = escaped(_served(file))
    turned = turns.find(keys, len(file))
    header["turns"] = None if turned is None else blobs.add(turned)
    header["frames"] = _frames(file, blobs, keys, room, losses)
    header["notes"] = notes
    blobs.header(header)


def _shrinking(file: File) -> float:
    """The rate at which the container of the box shrinks [1/time]; 0 without one."""
    rates = file.compression
    return 0.0 if rates is None or file.box.container is None else float(rates[0])


def _shear(file: File, keys: Keyframes) -> dict[str, Any] | None:
    """How images slide across the faces of the gradient axis: their velocity, and their displacement at each frame."""
    shear = file.shear
    if shear is None or keys.displacement is None:
        return None
    return {
        "flow": shear.flow,
        "gradient": shear.gradient,
        "rate": shear.rate,
        "speed": shear.rate * float(file.box.size[shear.gradient]),
        "displacement": keys.displacement.tolist(),
    }


def _served(file: File) -> str:
    """How many threads have served the run, as `haff run` prints it; empty for a run that is not complete."""
    try:
        summary = json.loads(file.stored.text("parameters/summary") or "{}")
        return f"threads: {int(summary['threads'])}; {summary['blocks']['text']}"
    except (ValueError, TypeError, KeyError):
        return ""


def _thin(file: File, chosen, size: float, losses: bool, notes: list[str]):
    """A selection of the frames that fits into a page of this size."""
    d = file.dimension
    spin = 2 * _spins(d) if file.inertia is not None else 0
    # Fixed bodies, the same in all frames, shrink to nothing when the page is compressed.
    first = chosen[0]
    fixed = np.isinf(first.mass) & ~np.any(first.velocity, axis=1)
    moving = max(1, len(file) - int(fixed.sum()))
    # Single precision where particles come and go: it has a number for those that are not there.
    frame = (
        moving
        * ((8 if file.flows else 4) * d + spin + (3 if file.box.periodic.any() else 0) + (2 if losses else 0))
        * BASE64
    )
    fits = int(size * 1e6 / frame)
    if fits < 2 and len(chosen) > fits:
        raise NotApplicableError(
            f"{len(file):,} particles: two frames would make a page of {2 * frame / 1e6:,.3g} MB; allow a larger "
            "size, or export to vtkhdf for ParaView"
        )
    every = math.ceil(len(chosen) / min(fits, MOST))
    if every == 1:
        return chosen
    kept = chosen[::every]
    reason = f"all would need {frame * len(chosen) / 1e6:,.3g} MB" if fits < MOST else f"a page has up to {MOST:,}"
    notes.append(f"{len(kept):,} of {len(chosen):,} frames, one in {every}: {reason}")
    return kept


def _frames(
    file: File, blobs: Blobs, keys: Keyframes, room: Extent, losses: collisions.Losses | None
) -> dict[str, Any]:
    """Writes the frames in chunks; positions as floats if they are few, otherwise as 65536ths of the extent."""
    d, count = file.dimension, len(file)
    periodic = (file.box.periodic & (np.arange(3) < d))[:d]
    quantized = len(keys.time) * count * d > EXACT and not file.flows
    # A periodic edge has 65536 coordinates, which wrap around.
    unit = np.where(room.size > 0, room.size, 1.0)[:d] / 65536
    mobile = np.isfinite(file.mass)
    per_chunk = max(1, CHUNK // (count * 4 * d))
    chunks, speeds, units = [], [], []
    pending: list[list[np.ndarray]] = []
    spins: list[np.ndarray] = []
    spin_units: list[float] = []
    before, rounded = None, np.zeros((count, d), bool)
    shear, wraps = file.shear, periodic.copy()
    if shear is not None:
        # The upper face of the gradient axis has no place in the lower one, where images are displaced.
        wraps[shear.gradient] = False
    for k in range(len(keys.time)):
        position, velocity, image = keys.state(k)
        position, velocity = position[:, :d], velocity[:, :d]
        peculiar = velocity.copy()
        if shear is not None:
            peculiar[:, shear.flow] -= shear.rate * position[:, shear.gradient]
        norm = np.linalg.norm(peculiar, axis=1)[mobile]
        norm = norm[np.isfinite(norm)]
        speeds.append(float(np.quantile(norm, 0.99) if len(norm) > 100 else norm.max(initial=0.0)))
        # Periodic faces that a particle crossed since the last frame, so that its path continues through them.
        crossed = np.zeros(0, np.int8)
        if periodic.any():
            crossed = np.zeros((count, d), np.int8)
            if before is not None:
                edges = image - before
                if shear is not None:
                    edges[:, shear.flow] += before[:, shear.gradient] * _leaps(file, keys, k)
                crossed = np.clip(edges, -127, 127)[:, :d]
            before = image
        if quantized:
            places = np.rint((position - room.origin[:d]) / unit)
            # A coordinate that rounds up to the upper face goes to the lower face of the next image.
            over = wraps & (places >= 65536)
            places = np.clip(np.where(over, places - 65536, places), 0, 65535).astype(np.uint16)
            if periodic.any():
                crossed = crossed + over.astype(np.int16) - rounded
                rounded = over
            moves, unit_of_velocity = _shortened(velocity)
            units.append(unit_of_velocity)
            arrays = [places, moves]
        else:
            arrays = [position.astype(np.float32), velocity.astype(np.float32)]
        arrays.append(crossed.astype(np.int8))
        arrays += [np.zeros(0, np.uint8)] * 2 if losses is None else [losses.total[k], losses.recent[k]]
        pending.append(arrays)
        if keys.spin is not None:
            spin = keys.spin(k)[:, 3 - _spins(d) :]
            if quantized:
                spin, unit_of_spin = _shortened(spin)
                spin_units.append(unit_of_spin)
            spins.append(spin if quantized else spin.astype(np.float32))
        if len(pending) == per_chunk or k == len(keys.time) - 1:
            written = blobs.add(*(array for frame in pending for array in frame))
            chunks.append({"first": k + 1 - len(pending), **written})
            pending = []
            if spins:
                chunks[-1]["spin"] = blobs.add(*spins)
                spins = []
    return {
        "time": keys.time.tolist(),
        "spacing": "linear" if keys.exact else _spacing(keys.time),
        "speed": speeds,
        "unit": unit.tolist() if quantized else None,
        "velocity_unit": units,
        "spin_unit": spin_units,
        "chunks": chunks,
    }


def _leaps(file: File, keys: Keyframes, k: int) -> int:
    """Edges that the displacement of a sheared box gained between frame k - 1 and frame k beside its even growth.

    It is kept within half an edge, and images along the flow are counted from there.
    """
    shear, slid = file.shear, keys.displacement
    assert shear is not None and slid is not None
    even = shear.rate * float(file.box.size[shear.gradient]) * float(keys.time[k] - keys.time[k - 1])
    return round((slid[k] - slid[k - 1] - even) / float(file.box.size[shear.flow]))


def _spins(d: int) -> int:
    """Components of an angular velocity."""
    return 1 if d == 2 else 3


def _shortened(values: np.ndarray) -> tuple[np.ndarray, float]:
    """Values as 2-byte multiples of a unit, and the unit."""
    largest = float(np.abs(values).max(initial=0.0)) or 1.0
    return np.rint(values / largest * 32767).astype(np.int16), largest / 32767


def _spacing(time: np.ndarray) -> str:
    """The scale on which frames are about equally far apart, except the last: linear, log, or neither ("frames")."""
    if _even(time):
        return "linear"
    positive = time[time > 0]
    # A frame at the start has no logarithm.
    if len(positive) >= len(time) - 1 and len(positive) > 3 and _even(np.log(positive)):
        return "log"
    return "frames"


def _even(time: np.ndarray) -> bool:
    steps = np.diff(time)[:-1]
    return len(steps) < 2 or float(steps.max()) < 3 * float(steps.min())
