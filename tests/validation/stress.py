"""The stress scenes of configs/stress: conditions on each, beside those on every run (:mod:`.audit`)."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import nnls

import haff

from .audit import EPS, LEAST, Finding, Scene, audit, audit_without_events, close_pairs
from .runs import ROOT, toml

SCENES = sorted((ROOT / "configs" / "stress").glob("*.toml"))

SHORT: Mapping[str, Mapping[str, Any]] = {
    "cutoff_gas": {"run.until": 4.0},
    "elongated": {"run.until": 4.0, "output.frames": 2.0},
    "fcc_073": {"run.until": 0.02},
    "many_walls": {"run.until": 3.0, "output.frames": 1.0},
    "nearly_plastic_gas": {"run.until": 4.0},
    "plastic_gas": {"run.until": 4.0},
    "random_064": {"run.until": 0.001, "output.frames": 0.0005},
    "settling": {"species.grain.count": 120, "domain.size": [4.2, 4.2, 40.0], "output.frames": 1.0},
    "slab": {"run.until": 0.02, "output.frames": 0.01},
}
"""What to `--set` for the form that the tests run."""

ENDS: Mapping[str, tuple[int, tuple[str, ...]]] = {
    "collapse": (3, ("collapse at t = 70", "particle 0", "wall piston", "contact.tc")),
}
"""Exit status and parts of the message of the runs that must end with an error."""


SLOPE = 1e-3
"""Slopes below this count as horizontal for grains at rest: docs/rest.md."""


def stays(file: haff.File) -> list[Finding]:
    """No particle leaves the cage of its neighbors."""
    first, last = file.frames[0].unwrapped, file.frames[-1].unwrapped
    return [
        Finding("way from the place at the start [diameters]", float(np.linalg.norm(last - first, axis=1).max()), 0.5)
    ]


def cools(file: haff.File) -> list[Finding]:
    """The kinetic energy never rises."""
    energy = np.array([np.sum(0.5 * file.mass[:, None] * frame.velocity**2) for frame in file.frames])
    return [Finding("rise of the kinetic energy", float(np.max(np.diff(energy), initial=0) / energy[0]), 0)]


def cradle(file: haff.File) -> list[Finding]:
    """The last ball takes all momentum."""
    velocity = file.frames[-1].velocity
    expected = np.zeros_like(velocity)
    expected[-1, 0] = 1.0
    return [Finding("speed off the exact one", float(np.abs(velocity - expected).max()), LEAST)]


def breaks(file: haff.File) -> list[Finding]:
    """Every disk moves."""
    return [Finding("disks at rest", float(np.sum(~file.frames[-1].velocity.any(axis=1))), 0)]


def pairs_meet(file: haff.File) -> list[Finding]:
    """Every pair (0, 1), (2, 3), … collides."""
    collided = set(zip(file.events["i"].tolist(), file.events["j"].tolist()))
    return [Finding("pairs that miss", sum((i, i + 1) not in collided for i in range(0, len(file), 2)), 0)]


def grazing(file: haff.File) -> list[Finding]:
    """Backward error of each shot in exact arithmetic: the outcome is exact for an initial state that many ulp away."""
    first = file.frames[0]
    x = [[Fraction(c) for c in row] for row in first.position.tolist()]
    v = [[Fraction(c) for c in row] for row in first.velocity.tolist()]
    times = {int(j): Fraction(t) for t, j in zip(file.events["time"].tolist(), file.events["j"].tolist())}
    worst = 0.0
    for target in range(0, len(x), 2):
        shot = target + 1
        r = [b - a for a, b in zip(x[target], x[shot])]
        w = [b - a for a, b in zip(v[target], v[shot])]
        sigma = Fraction(float(file.radius[target])) + Fraction(float(file.radius[shot]))
        closest = -sum(a * b for a, b in zip(r, w)) / sum(b * b for b in w)
        time = times.get(shot, closest)
        square = sum((a + b * time) ** 2 for a, b in zip(r, w))
        # |r|² − σ² = (|r| − σ)(|r| + σ): distance of the exact position from contact; a miss may be wider.
        off = (square - sigma**2) / (2 * sigma)
        off = abs(off) if shot in times else max(-off, Fraction(0))
        ulp = EPS * float(max(map(abs, x[shot])) + max(map(abs, w)) * time)
        worst = max(worst, float(off) / ulp)
        # At the contact they must still approach: the first of the two roots, or the closest approach itself.
        late = float((time - closest) * max(map(abs, w)))
        worst = max(worst, late / ulp)
    return [Finding("backward error of a grazing shot [ulp of the way]", worst, 4)]


def in_plane(file: haff.File) -> list[Finding]:
    """Heights stay at half a diameter."""
    off = max(float(np.abs(frame.position[:, 2] - 0.5).max()) for frame in file.frames)
    return [Finding("height off the middle", off, 4 * EPS)]


def flies_apart(file: haff.File) -> list[Finding]:
    """The final cluster is wider than the initial one."""
    spread = [float(frame.position.std()) for frame in (file.frames[0], file.frames[-1])]
    return [Finding("extent at the start over that in the end", spread[0] / spread[1], 0.9)]


def unsupported(file: haff.File, gap: float) -> np.ndarray:
    """For every grain at the end, the fraction of its weight not balanced by contact forces, `[N]`: 0 if supported.

    Contacts are those with other grains and with walls that are narrower than `gap`.
    """
    scene, position = Scene(file), file.frames[-1].position
    down = scene.gravity / np.linalg.norm(scene.gravity)
    wider = Scene(file)
    wider.radius = scene.radius + gap
    pairs = close_pairs(wider, position)
    apart = position[pairs[:, 1]] - position[pairs[:, 0]]
    apart -= np.where(scene.periodic, np.rint(apart / scene.size) * scene.size, 0.0)
    distance = np.linalg.norm(apart, axis=1)
    near = distance <= scene.radius[pairs].sum(axis=1) + gap
    normals: list[list[np.ndarray]] = [[] for _ in position]
    for (i, j), normal in zip(pairs[near], apart[near] / distance[near, None]):
        normals[i].append(-normal)
        normals[j].append(normal)
    for wall in scene.walls:
        for i in np.flatnonzero((position - wall.point) @ wall.normal <= scene.radius + gap):
            normals[i].append(wall.normal)
    return np.array([nnls(np.transpose(n), -down)[1] if n else 1.0 for n in normals])


def supported(file: haff.File) -> list[Finding]:
    """At the end nothing moves, and every grain is supported by its contacts."""
    speed, g = file.scene["contact"]["rest_speed"], float(np.linalg.norm(file.scene["domain"]["gravity"]))
    taken = file.observables["rest_energy"].iloc[-1]
    return [
        Finding("grains that move in the end", float(np.sum(file.frames[-1].velocity.any(axis=1))), 0),
        Finding("part of a weight that nothing bears", float(unsupported(file, speed**2 / (4 * g)).max()), SLOPE),
        Finding("energy that rest has given, not taken", max(0.0, -float(taken)), 0),
    ]


def side_by_side(file: haff.File) -> list[Finding]:
    """Three particles on a line end at rest relative to each other, in contact."""
    last = file.frames[-1]
    speeds, gaps = np.diff(last.velocity[:, 0]), np.diff(last.position[:, 0]) - 1.0
    return [
        Finding("relative speed in the end", float(np.abs(speeds).max()), LEAST),
        Finding("gap in the end", float(np.abs(gaps).max()), LEAST),
        Finding("kinetic energy in the end", float(np.sum(last.velocity**2)), LEAST),
    ]


OWN: Mapping[str, Callable[[haff.File], list[Finding]]] = {
    "breakshot": breaks,
    "cradle": cradle,
    "cutoff_gas": cools,
    "fcc_073": stays,
    "grazing": grazing,
    "huge_box": pairs_meet,
    "nearly_plastic_gas": cools,
    "plastic_gas": cools,
    "random_064": stays,
    "settling": supported,
    "three_on_a_line": side_by_side,
    "touching": flies_apart,
    "touching_slab": in_plane,
}


def judge(binary: Path | str, scene: Path, output: Path, short: bool = False) -> tuple[list[Finding], int]:
    """Runs a scene with its file at `output`; returns all findings, and the number of events."""
    command = [str(binary), "run", str(scene), "--json", "--quiet", "--threads", "1", "-o", str(output), "--overwrite"]
    for key, value in SHORT.get(scene.stem, {}).items() if short else ():
        command += ["--set", f"{key}={toml(value)}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    status, words = ENDS.get(scene.stem, (0, ()))
    if done.returncode != status:
        raise RuntimeError(f"{' '.join(command)}\nexit {done.returncode}, not {status}\n{done.stderr}")
    missing = [word for word in words if word not in done.stderr]
    findings = [Finding("words that the message lacks", len(missing), 0)] if words else []
    with haff.open(output) as file:
        findings += audit(file) if "events" in file else audit_without_events(file)
        findings += OWN.get(scene.stem, lambda _: [])(file)
    return findings, json.loads(done.stdout)["events"]
