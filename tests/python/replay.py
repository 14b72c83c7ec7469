"""Replays a run from its first frame and its event log in NumPy, and recomputes its observables.

Flights are straight, or parabolas under gravity; under shear the velocity relative to the flow changes along it by −γ̇
times its component along the gradient. Each row of the log changes velocities by its impulse. The means between samples
are closed forms of each flight, added up.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import haff


class Replay:
    """Observables of a run of smooth particles at its samples. The log has only ``collision`` and ``wall`` rows."""

    def __init__(self, run: haff.File, scene: dict[str, Any], conserved: tuple[bool, ...]) -> None:
        self.run, self.scene = run, scene
        d = run.dimension
        self.conserved = np.array([*conserved, False, False, False][:3])
        self.mass, self.radius = run.mass, run.radius
        self.mobile = np.isfinite(self.mass)
        self.velocity = np.array(run.frames[0].peculiar_velocity)
        self.time = np.zeros(len(run))
        self.acceleration = np.zeros(3)
        self.acceleration[:d] = scene.get("domain", {}).get("gravity", np.zeros(d))
        self.shear = run.shear
        self.walls = len(run.wall_names)
        self.found: dict[str, list] = {}
        self._begin()
        self.work = {"wall_work": 0.0, "shear_work": 0.0}
        self._play()

    def _begin(self) -> None:
        self.kinetic, self.collisional = np.zeros((3, 3)), np.zeros((3, 3))
        self.momentum, self.force = np.zeros(3), np.zeros((self.walls, 3))

    def _falling(self, i: int) -> np.ndarray:
        """Acceleration of the velocity relative to the flow."""
        if not self.mobile[i]:
            return np.zeros(3)
        a = self.acceleration.copy()
        if self.shear is not None:
            a[self.shear.flow] -= self.shear.rate * self.velocity[i, self.shear.gradient]
        return a

    def _fly(self, i: int, time: float) -> None:
        """Moves a particle to a time, and adds its flight to the sums."""
        span = time - self.time[i]
        self.time[i] = time
        if not self.mobile[i] or span == 0:
            return
        a = self._falling(i)
        middle = self.velocity[i] + 0.5 * span * a
        flown = self.mass[i] * span * (np.outer(middle, middle) + span**2 / 12 * np.outer(a, a))
        self.kinetic += flown
        self.momentum += self.mass[i] * span * middle
        if self.shear is not None:
            self.work["shear_work"] -= self.shear.rate * flown[self.shear.gradient, self.shear.flow]
        self.velocity[i] += span * a

    def _wall_velocity(self, wall: int, normal: np.ndarray, time: float) -> np.ndarray:
        """Velocity of a wall of this normal into it."""
        name = self.run.wall_names[wall]
        entry: dict = next((w for w in self.scene.get("wall", []) if w["name"] == name), {})
        found = np.zeros(3)
        found[: len(entry.get("velocity", []))] = entry.get("velocity", [])
        if "motion" in entry:
            motion = entry["motion"]
            angle = 2 * math.pi * motion["frequency"] * time + motion.get("phase", 0.0)
            found -= normal * motion["amplitude"] * 2 * math.pi * motion["frequency"] * math.cos(angle)
        return found

    def _play(self) -> None:
        run, table = self.run, self.run.samples
        events = {name: run.events[name] for name in run.events.columns}
        events["kind"] = np.array([run.events.kinds[code] for code in events["kind"]])
        vectors = events.get("impulse_vector", events["impulse"][:, None] * events["normal"])
        assert set(events["kind"]) <= {"collision", "wall"}, "rests and other changes are not replayed"
        row = 0
        for sample, time in enumerate(table["time"]):
            while row < len(events["time"]) and events["time"][row] <= time:
                self._event(events, vectors, row)
                row += 1
            for i in range(len(run)):
                self._fly(i, time)
            self._sample(time, time - table["time"][sample - 1] if sample else 0.0)
            self._begin()

    def _event(self, events: dict[str, np.ndarray], vectors: np.ndarray, row: int) -> None:
        i, j, time = int(events["i"][row]), int(events["j"][row]), float(events["time"][row])
        impulse, normal = vectors[row], events["normal"][row]
        self._fly(i, time)
        is_wall = events["kind"][row] == "wall"
        if not is_wall:
            self._fly(j, time)
        if self.mobile[i]:
            self.velocity[i] -= impulse / self.mass[i]
        if is_wall:
            self.force[j] += impulse
            self.work["wall_work"] -= impulse @ self._wall_velocity(j, normal, time)
            return
        if self.mobile[j]:
            self.velocity[j] += impulse / self.mass[j]
        for k, sign in ((i, 1.0), (j, -1.0)):
            if not self.mobile[k]:
                # A body of infinite mass takes part with its velocity.
                self.work["wall_work"] += sign * impulse @ self.velocity[k]
        branch = (self.radius[i] + self.radius[j]) * normal
        self.collisional += np.outer(branch, impulse)
        if self.shear is not None:
            self.work["shear_work"] -= self.shear.rate * branch[self.shear.gradient] * impulse[self.shear.flow]

    def _sample(self, time: float, span: float) -> None:
        run, d, mobile = self.run, self.run.dimension, self.mobile
        mass, velocity = self.mass[mobile], self.velocity[mobile]
        total = mass.sum()
        momentum = mass @ velocity
        common = np.where(self.conserved, momentum / total, 0.0)
        square = mass * np.sum((velocity - common) ** 2, axis=1)
        species = run.species[mobile]
        chosen = [square[species == k] for k in range(len(run.species_names))]
        per_species = [one.sum() / (d * len(one)) if len(one) else np.nan for one in chosen]
        # V is constant where it counts.
        mean, carried = self.kinetic / span if span else self.kinetic * np.nan, self.momentum / span if span else 0.0
        flow = np.outer(common, carried) + np.outer(carried, common) - total * np.outer(common, common)
        volume = run.box.volume
        kinetic = (mean - flow)[:d, :d] / volume
        collisional = self.collisional[:d, :d] / (span * volume) if span else kinetic * np.nan
        values = {
            "temperature": square.sum() / (d * mobile.sum()),
            "species_temperature": per_species,
            "kinetic_energy": 0.5 * mass @ np.sum(velocity**2, axis=1),
            "momentum": momentum,
            "pressure": np.trace(kinetic + collisional) / d,
            "pressure_tensor_kinetic": kinetic,
            "pressure_tensor_collisional": collisional,
            "pressure_tensor": kinetic + collisional,
            "wall_force": self.force / span if span else self.force * np.nan,
            **self.work,
        }
        for name, value in values.items():
            self.found.setdefault(name, []).append(np.array(value))
