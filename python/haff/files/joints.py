"""Strings, rods and springs of the scene, as lines between bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import FileError

if TYPE_CHECKING:
    from .layout import Array
    from .recording import Recording


def find(file: Recording) -> list[dict[str, Any]]:
    """Each joint: ``kind`` (``string``, ``rod`` or ``spring``), its ends (a particle's row or a point), its length."""
    scene = file.scene
    if not any(scene.get(kind) for kind in ("pendulum", "spring", "rod")):
        return []
    explicit = scene.get("particle", [])
    if len(explicit) > len(file):
        raise FileError(f"{file.path}: parameters/scene: has {len(explicit)} particles; the file has {len(file)}")
    rows = {particle.get("name"): len(file) - len(explicit) + k for k, particle in enumerate(explicit)}

    def point(values) -> list[float]:
        return [*map(float, values), 0.0, 0.0][:3]

    found: list[dict[str, Any]] = []
    for pendulum in scene.get("pendulum", []):
        kind = "rod" if pendulum.get("tether") == "rod" else "string"
        ends = [point(pendulum["pivot"]), rows.get(pendulum.get("bob"))]
        found.append({"kind": kind, "ends": ends, "length": pendulum.get("length")})
    for kind in ("spring", "rod"):
        for joint in scene.get(kind, []):
            ends = [rows.get(name) for name in joint.get("between", [])]
            if "point" in joint:
                ends.append(point(joint["point"]))
            found.append({"kind": kind, "ends": ends, "length": joint.get("length")})
    return [joint for joint in found if len(joint["ends"]) == 2 and None not in joint["ends"]]


def anchors(found: list[dict[str, Any]]) -> Array:
    """``[A, 3]`` the ends of joints that are fixed points [length]."""
    return np.array([end for joint in found for end in joint["ends"] if not isinstance(end, int)]).reshape(-1, 3)
