"""The line of facts above a figure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..analysis.phases import phase_note
from ..files.header import packing_fraction
from ..files.scene import law_name, law_of, roughness
from .style import label

if TYPE_CHECKING:
    from ..files.recording import Recording


def facts(file: Recording) -> str:
    """One line that describes the gas."""
    parts = [f"N = {len(file):,}"]
    phi = packing_fraction(file)
    if np.isfinite(phi):
        last = packing_fraction(file, file.frames[-1].box) if file.compression is not None and "frames" in file else phi
        parts.append(f"packing fraction {phi:.3g}" + (f" to {last:.3g}" if last != phi else ""))
    parts += _restitutions(file)
    beta, friction = roughness(file.scene)
    if beta > -1 and friction > 0:
        parts += [f"β = {beta:g}"] + ([f"μ = {friction:g}"] if np.isfinite(friction) else [])
    return f"{label(file.title) + '  ·  ' if file.title else ''}{',  '.join(parts)}"


def sampled(file: Recording, time: np.ndarray) -> str:
    """:func:`facts`, and whether the samples at these times are at one phase of an oscillation."""
    note = phase_note(file, time)
    return facts(file) + (f"  ·  samples {label(note)}" if note else "")


def is_geometric(time: Sequence[float] | np.ndarray) -> bool:
    """Whether the positive times, at least four, grow by about one factor, and by more than 30 in all."""
    after = np.asarray(time, float)
    after = after[after > 0]
    if len(after) < 4 or after[-1] < 30 * after[0]:
        return False
    steps = np.diff(np.log(after))
    return bool(np.std(steps) < 0.5 * np.mean(steps))


def spans(values: Sequence[float] | np.ndarray, factor: float = 10.0) -> bool:
    """Whether positive values span more than a factor, so that they need a logarithmic axis."""
    known = np.asarray(values, float)
    known = known[np.isfinite(known)]
    return len(known) > 1 and known.min() > 0 and bool(known.max() > factor * known.min())


def _restitutions(file: Recording) -> list[str]:
    """Restitution of the contacts that can happen: between particles, and with walls where it differs."""

    def name(law: object) -> str:
        return label(law_name(law))

    scene, walls = file.scene, file.scene.get("wall", [])
    between, general = law_of(scene), law_of(scene, wall=True)
    at_walls = {name(law_of(scene, wall, wall=True)) for wall in walls}
    if "wall" in file.box.boundary:
        at_walls.add(name(general))
    found = [f"e = {name(between)}"] if len(file) > 1 else []
    if (at_walls and at_walls != {name(between)}) or not found:
        found.append(f"{'walls ' if found else 'e = '}{', '.join(sorted(at_walls)) or name(between)}")
    return found
