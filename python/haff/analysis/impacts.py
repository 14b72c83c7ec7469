"""A table of the impacts of a few bodies, as a student would check them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..common.arguments import count
from ..errors import NotApplicableError
from ..files.layout import AXES, Array
from .checked import checked
from .experiment import body_name, driven, gravity, pendulums

if TYPE_CHECKING:
    import pandas as pd

    from ..files.recording import Recording

__all__ = ["impacts"]

KINDS = ("collision", "wall", "stick")
"""Events that are impacts."""
UNKNOWN = ("rest", "slide", "settle", "release", "wake", "lift", "loose", "taut")
"""Events that change a velocity by more than the impulse in the log."""
AGREES = 1e-6
"""Largest difference of a speed of approach from that of the log, in parts of the velocities."""


@checked
def impacts(run: Recording, most: int = 10_000) -> pd.DataFrame:
    """The impacts of a run in the order of their times, with the equations that they obey.

    Parameters
    ----------
    most
        The largest number of events that is worked through.

    Returns
    -------
    pandas.DataFrame
        ``time``; ``first`` and ``second``: names of the bodies, or of the body and the wall; ``first_before_x`` …,
        ``second_after_y``: their velocities before and after the impact [length/time]; ``angle_before``,
        ``angle_after``: angles of the relative velocity to the normal [degrees]; ``approach_speed``; ``e``: the speed
        of separation over that of approach; ``impulse`` along the normal [mass·length/time]; ``energy_loss``: ΔT of the
        normal component [energy]; ``carnot_energy``: the energy E_c of the lost velocities [energy]; ``carnot_check``:
        what is missing in Carnot's theorem ΔT = E_c (1 − e)/(1 + e), in units of the energy before the impact along
        the normal, 0 to rounding.

        In a scene with spin also ``first_spin_before`` …, ``second_spin_after``: angular velocities [1/time], in three
        dimensions with ``_x``, ``_y`` and ``_z``; ``slip_before``, ``slip_after``: the speed at which the surfaces
        slide on each other at the contact [length/time]; and ``tangential_impulse`` [mass·length/time]. Spins follow as
        velocities do.

        Velocities follow from the last frame before the impact, free flight, and the impulses of the log since: they
        are NaN for bodies at springs and rods, after a body came to rest on a wall, and for walls that move.

    Raises
    ------
    MissingDataError
        There is no event log or no frame.
    NotApplicableError
        There are more events than ``most``; a drive that kicks, or a box that deforms, changes velocities in a way that
        is not in the log.
    """
    import pandas as pd

    most = count("most", most)
    events = run.events
    if len(events) > most:
        raise NotApplicableError(f"{run.path}: {len(events):,} events are more than most = {most:,}")
    if run.shear is not None or run.compression is not None:
        raise NotApplicableError(f"{run.path}: the velocities in a box that deforms are not in the event log")
    kinds = [drive["kind"] for drive in run.scene.get("drive", ())]
    if set(kinds) - {"drag"}:
        raise NotApplicableError(f"{run.path}: the kicks of drives are not in the event log")
    log = events.to_pandas(
        ["time", "kind", "i", "j", "approach_speed", "impulse", "energy_loss", "carnot_energy", "normal"]
    )
    vector = events["impulse_vector"] if "impulse_vector" in events.columns else None
    tangential = events["tangential_loss"] if "tangential_loss" in events.columns else np.zeros(len(log))
    bodies = _Bodies(run)
    axes, rows = AXES[: run.dimension], []
    normals = log[[f"normal_{axis}" for axis in "xyz"]].to_numpy()
    for k, event in enumerate(log.itertuples(index=False)):
        i, j, n = int(event.i), int(event.j), normals[k]
        impulse = event.impulse * n if vector is None else vector[k]
        of_pair = event.kind in ("collision", "stick") and j < len(run)
        pair = [i, j] if of_pair else [i]
        if event.kind in ("slack", "taut"):
            bodies.set_slack(i, event.kind == "slack")
        if event.kind == "change":
            bodies.changed = event.time
        if event.kind not in KINDS:
            for body in pair if event.kind in UNKNOWN and i < len(run) else ():
                bodies.forget(body, event.time)
            continue
        signs = (-1, 1)
        mass = 1 / sum(bodies.inverse_mass(body, event.time, sign * n) for body, sign in zip(pair, signs))
        before = [bodies.velocity(body, event.time) for body in pair]
        # The velocity of a wall that moves is not in the log, nor the spin that a thermal wall gives.
        drive = "" if of_pair else driven(run, j)
        still = np.zeros(3) if drive in ("", "is thermal") else np.full(3, np.nan)
        approach = float((before[0] - (before[1] if of_pair else still)) @ n)
        if abs(approach - event.approach_speed) > AGREES * np.linalg.norm(before):
            # Something else has changed a velocity: gravity or a velocity from outside.
            for body in pair:
                bodies.forget(body, event.time)
            before = [np.full(3, np.nan) for _ in pair]
        spins = [bodies.spin(body, event.time) for body in pair]
        for body, sign in zip(pair, signs):
            bodies.push(body, event.time, sign * impulse)
            bodies.turn(body, event.time, n, impulse)
            if drive == "is thermal":
                bodies.spins[body] = (event.time, np.full(3, np.nan))
        after = [bodies.velocity(body, event.time) for body in pair]
        turned = [bodies.spin(body, event.time) for body in pair]
        if not of_pair:
            before, after = [*before, still], [*after, still]
            spins, turned = [*spins, np.zeros(3)], [*turned, np.zeros(3)]
        with np.errstate(invalid="ignore", divide="ignore"):
            # The rod of a body takes part in its impact.
            e = np.nan if bodies.on_rods & set(pair) else float(event.impulse / (mass * event.approach_speed) - 1)
            loss = event.energy_loss - tangential[k]
            check = (loss - event.carnot_energy * (1 - e) / (1 + e)) / (0.5 * mass * event.approach_speed**2)
        row = {
            "time": event.time,
            "first": body_name(run, i),
            "second": body_name(run, j) if of_pair else run.wall_names[j],
            **{
                f"{who}_before_{axis}": v[a]
                for who, v in zip(("first", "second"), before)
                for a, axis in enumerate(axes)
            },
            **{
                f"{who}_after_{axis}": v[a] for who, v in zip(("first", "second"), after) for a, axis in enumerate(axes)
            },
            "angle_before": _angle(before[0] - before[1], n),
            "angle_after": _angle(after[1] - after[0], n),
            "approach_speed": event.approach_speed,
            "e": e,
            "impulse": event.impulse,
            "energy_loss": loss,
            "carnot_energy": event.carnot_energy,
            "carnot_check": check,
        }
        if run.inertia is not None:
            radii = [*run.radius[pair], 0.0][:2]
            row |= _spins(run.dimension, "before", spins) | _spins(run.dimension, "after", turned)
            row["slip_before"] = _slip(before, spins, radii, n)
            row["slip_after"] = _slip(after, turned, radii, n)
            row["tangential_impulse"] = float(np.linalg.norm(impulse - (impulse @ n) * n))
        rows.append(row)
    if not rows:
        raise NotApplicableError(f"{run.path}: there are no impacts")
    return pd.DataFrame(rows)


def _spins(dimension: int, when: str, spins: list[Array]) -> dict[str, float]:
    """Columns of the angular velocities; disks turn about the third axis."""
    names = ("first", "second")
    if dimension == 2:
        return {f"{who}_spin_{when}": float(spin[2]) for who, spin in zip(names, spins)}
    return {
        f"{who}_spin_{when}_{axis}": float(spin[a])
        for who, spin in zip(names, spins)
        for a, axis in enumerate(AXES[:dimension])
    }


def _slip(velocities: list[Array], spins: list[Array], radii: list[float], n: Array) -> float:
    """Speed along the contact of the first surface relative to the second, with n from the first body to it."""
    first = velocities[0] + np.cross(spins[0], radii[0] * n)
    second = velocities[1] - np.cross(spins[1], radii[1] * n)
    relative = first - second
    return float(np.linalg.norm(relative - (relative @ n) * n))


def _angle(velocity: Array, n: Array) -> float:
    """Angle of a velocity to the normal [degrees]; 0 for a head-on impact."""
    along = float(velocity @ n)
    return float(np.degrees(np.arctan2(np.linalg.norm(velocity - along * n), along)))


class _Bodies:
    """Velocities of bodies between frames."""

    def __init__(self, run: Recording) -> None:
        self.run, self.frames = run, run.frames
        if len(self.frames) == 0:
            raise NotApplicableError(f"{run.path}: no frames, from which velocities follow (output.frames)")
        self.time = self.frames.time
        self.gravity = gravity(run)
        drags = [drive["time"] for drive in run.scene.get("drive", ()) if drive["kind"] == "drag"]
        self.drag = float(drags[0]) if drags else np.inf
        self.hangs = pendulums(run)
        joined = {name for joint in ("spring", "rod") for one in run.scene.get(joint, ()) for name in one["between"]}
        self.joined = {body for body in range(len(run)) if run.species_names[run.species[body]] in joined}
        rods = {name for one in run.scene.get("rod", ()) for name in one["between"]}
        self.on_rods = {body for body in self.joined if run.species_names[run.species[body]] in rods}
        tethers = {one["bob"]: one.get("tether", "string") for one in run.scene.get("pendulum", ())}
        self.strings = {body for body in self.hangs if tethers[run.species_names[run.species[body]]] == "string"}
        self.slack: set[int] = set()
        # Of each body: time, position and velocity at its last frame or event.
        self.state: dict[int, tuple[float, Array, Array]] = {}
        # And time and angular velocity.
        self.spins: dict[int, tuple[float, Array]] = {}
        # When velocities were last changed from outside: only later frames have them.
        self.changed = -np.inf
        turns_slower = any(drive.get("rotational") for drive in run.scene.get("drive", ()))
        self.has_spin = run.inertia is not None and not turns_slower

    def _frame(self, time: float, start: float) -> int | None:
        """The last frame before what happens at a time, if it is later than a state at ``start``.

        Frames are taken after the events of their time, but the first one before those of the start.
        """
        frame = int(np.searchsorted(self.time, time)) - 1
        if start == -np.inf:
            return max(frame, 0)
        is_later = frame >= 0 and (self.time[frame] > start or (frame > 0 and self.time[frame] == start))
        return frame if is_later else None

    def _recorded(self, frame: int, body: int, name: str) -> Array:
        """A vector of a body in a frame; NaN if it is not there."""
        found = self.frames[frame]
        row = int(np.searchsorted(found.id, body))
        if row == len(found.id) or found.id[row] != body:
            return np.full(3, np.nan)
        return getattr(found, name)[row].astype(float)

    def _at(self, body: int, time: float) -> tuple[Array, Array]:
        """Position and velocity of a body before what happens at a time."""
        start, r, v = self.state.get(body, (-np.inf, np.zeros(3), np.zeros(3)))
        if (frame := self._frame(time, start)) is not None:
            start = float(self.time[frame])
            r, v = (self._recorded(frame, body, name) for name in ("position", "velocity"))
            if body in self.joined:
                v = np.full(3, np.nan)
        if start <= self.changed:
            v = np.full(3, np.nan)
        return self._flown(body, r, v, time - start)

    def _flown(self, body: int, r: Array, v: Array, dt: float) -> tuple[Array, Array]:
        if body in self.hangs and body not in self.slack:
            return _swung(r, v, *self.hangs[body], self.gravity, dt)
        if np.isinf(self.run.mass[body]):
            return r + v * dt, v
        if np.isfinite(self.drag):
            return r - v * self.drag * np.expm1(-dt / self.drag), v * np.exp(-dt / self.drag)
        return r + (v + 0.5 * self.gravity * dt) * dt, v + self.gravity * dt

    def velocity(self, body: int, time: float) -> Array:
        """Velocity ``[3]`` of a body after what has been pushed so far."""
        return self._at(body, time)[1]

    def spin(self, body: int, time: float) -> Array:
        """Angular velocity ``[3]`` of a body after what has been pushed so far; NaN where it is not known."""
        if not self.has_spin:
            return np.full(3, np.nan)
        start, w = self.spins.get(body, (-np.inf, np.zeros(3)))
        if (frame := self._frame(time, start)) is not None:
            start, w = float(self.time[frame]), self._recorded(frame, body, "angular_velocity")
        return w if start > self.changed else np.full(3, np.nan)

    def turn(self, body: int, time: float, n: Array, impulse: Array) -> None:
        """Gives a body the spin of an impulse on its surface; n and the impulse are the same for both bodies."""
        if self.has_spin:
            radius, mass = self.run.radius[body], self.run.mass[body]
            moment = self.run.inertia[body] * mass * radius**2
            change = radius / moment * np.cross(n, impulse) if moment > 0 else np.zeros(3)
            self.spins[body] = (time, self.spin(body, time) - change)

    def set_slack(self, body: int, slack: bool) -> None:
        """Notes that the string of a body is slack from now on, or taut."""
        (self.slack.add if slack else self.slack.discard)(body)

    def _holds(self, body: int, r: Array, push: Array) -> bool:
        """Whether the tether of a body resists such a push: a string only one away from its pivot."""
        if body not in self.hangs or body in self.slack:
            return False
        return body not in self.strings or float(push @ (r - self.hangs[body][0])) > 0

    def push(self, body: int, time: float, impulse: Array) -> None:
        """Gives a body an impulse."""
        r, v = self._at(body, time)
        v = v + impulse / self.run.mass[body]
        if self._holds(body, r, v):
            rod = (r - self.hangs[body][0]) / np.linalg.norm(r - self.hangs[body][0])
            v = v - rod * (v @ rod)
        self.state[body] = (time, r, v)

    def inverse_mass(self, body: int, time: float, n: Array) -> float:
        """What an impulse along n adds to the velocity along it, per impulse: less than 1/m on a tether."""
        free = 1.0
        r = self._at(body, time)[0]
        if self._holds(body, r, n):
            arm = r - self.hangs[body][0]
            free = 1.0 - float(arm @ n) ** 2 / float(arm @ arm)
        return free / float(self.run.mass[body])

    def forget(self, body: int, time: float) -> None:
        """The velocity of a body is unknown from a time on, up to the next frame."""
        r, _ = self._at(body, time)
        self.state[body] = (time, r, np.full(3, np.nan))
        self.spins[body] = (time, np.full(3, np.nan))


def _swung(r: Array, v: Array, pivot: Array, length: float, g: Array, dt: float) -> tuple[Array, Array]:
    """A pendulum after a time."""
    from scipy.integrate import solve_ivp

    if dt <= 0 or not np.isfinite(v).all():
        return r, v

    def rates(_: float, state: Array) -> Array:
        arm, w = state[:3] - pivot, state[3:]
        return np.concatenate([w, g - arm * ((g @ arm + w @ w) / (arm @ arm))])

    end = solve_ivp(rates, (0.0, dt), np.concatenate([r, v]), method="DOP853", rtol=1e-12, atol=1e-13 * length).y[:, -1]
    return end[:3], end[3:]
