"""Scenes at the limits, checked from their output."""

from __future__ import annotations

import tempfile
from pathlib import Path

from ..registry import Part
from ..rows import Row, at_most
from ..runs import Context
from ..stress import SCENES, judge


def one(binary: Path, scene: Path, short: bool) -> tuple[Path, list[tuple[str, float, float]], int]:
    with tempfile.TemporaryDirectory(prefix="haff-validate-") as directory:
        findings, events = judge(binary, scene, Path(directory) / "run.h5", short)
    return scene, [(f.name, f.found, f.limit) for f in findings], events


def stress(context: Context) -> list[Row]:
    """The scenes of configs/stress, checked from their frames and event logs by separate code
    (tests/validation/audit.py): extended precision for overlaps, exact sums for energy and momentum, every impulse from
    its law, every flight from the logged impulses, and exact fractions for grazing contacts."""
    rows = []
    for scene, findings, events in context.map(one, [(context.binary, scene, context.quick) for scene in SCENES]):
        context.collisions += events
        # Findings with a limit above zero, and violations: the rest are counts of zero.
        rows += [
            at_most(scene.stem, name, found, limit, "rounding")
            for name, found, limit in findings
            if limit > 0 or not found <= limit
        ]
    return rows


PARTS = [Part("stress", "Stress scenes", stress, order=900)]
