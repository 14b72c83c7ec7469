"""Identifies which of the chapter's worked systems a run is: its characteristic quantity and closed form."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import mechanics
from ..analysis import conditions, experiment
from ..analysis.experiment import body_name
from ..errors import NotApplicableError
from ..files.scene import shaped_walls

if TYPE_CHECKING:
    from ..files.recording import Recording

__all__ = ["Worked", "worked"]

Array = NDArray[np.float64]
# Relative tolerance of the conditions on a scene's numbers.
CLOSE = 1e-9


class Worked(NamedTuple):
    """One quantity of a few bodies against time."""

    title: str
    unit: str
    """Label of the axis."""
    names: list[str]
    """``[C]`` what each curve is of."""
    time: Array
    """``[F]`` times of the frames [time]."""
    seen: Array
    """``[C, F]`` as recorded."""
    law: Callable[[Array], Array] | None
    """Closed form at ``[M]`` times, ``[C, M]``; NaN where it does not hold any more."""
    levels: list[tuple[float, str]]
    """Values that the closed form names."""
    why: str
    """Why there is no closed form."""


def worked(run: Recording) -> Worked:
    """The system of a run. Raises :class:`NotApplicableError` if it is none of the chapter's systems.

    There is a closed form where the conditions of :data:`.conditions.CLOSED_FORM` and those of the system hold.
    """
    found = _system(run)
    if why := conditions.unmet(run, conditions.CLOSED_FORM):
        return found._replace(law=None, levels=[], why=why)
    return found


def _system(run: Recording) -> Worked:
    if len(run) > 24:
        raise NotApplicableError(f"{len(run)} bodies: made for a few")
    if len(run.frames) < 2:
        raise NotApplicableError("fewer than two frames")
    if run.scene.get("pendulum"):
        return _pendulums(run)
    if run.scene.get("spring"):
        return _springs(run)
    if run.scene.get("rod"):
        return _rods(run)
    if len(run) == 1 and np.any(experiment.gravity(run)):
        return _ball(run)
    if len(run) <= 2 and not np.any(experiment.gravity(run)):
        return _impact(run)
    raise NotApplicableError("neither pendulums, springs, rods, a bouncing ball nor an impact of two bodies")


def _holds_until(law: Callable[[Array], Array], end: float) -> Callable[[Array], Array]:
    return lambda t: np.where(t <= end, law(t), np.nan)


def _next_event(run: Recording, after: float, slow: float = 0.0) -> float:
    """Time of the first impact after ``after`` that is faster than ``slow``; infinite if none, or none was recorded."""
    if "events" not in run:
        return np.inf
    log = run.events.to_pandas(["time", "approach_speed"])
    later = log[(log["time"] > after * (1 + CLOSE)) & (log["approach_speed"] > slow)]["time"]
    return float(later.iloc[0]) if len(later) else np.inf


# --- pendulums ----------------------------------------------------------------------------------------


def _pendulums(run: Recording) -> Worked:
    hangs = experiment.pendulums(run)
    bobs = sorted(hangs)
    pull = experiment.gravity(run)
    g = float(np.linalg.norm(pull))
    if g == 0:
        raise NotApplicableError("without gravity pendulums do not swing")
    down = pull / g
    side = np.eye(3)[0] - down * down[0]
    side = side / np.linalg.norm(side) if np.linalg.norm(side) > CLOSE else np.eye(3)[1]
    arms = [run.frames.array("position")[:, bob] - hangs[bob][0] for bob in bobs]
    seen = np.array([np.arctan2(arm @ side, arm @ down) for arm in arms])
    law, levels, why = None, [], ""
    try:
        law, levels = _pendulum_law(run, hangs, bobs, seen[:, 0], side, g)
    except NotApplicableError as reason:
        why = str(reason)
    names = [body_name(run, bob) for bob in bobs]
    in_degrees = None if law is None else lambda t: np.degrees(law(t))
    return Worked(
        "Angles of the pendulums", "angle from hanging  [°]", names, run.frames.time, np.degrees(seen), in_degrees,
        levels, why,
    )  # fmt: skip


def _pendulum_law(run: Recording, hangs: dict, bobs: list[int], start: Array, side: Array, g: float):
    lengths = [hangs[bob][1] for bob in bobs]
    length = lengths[0]
    if len(run) != len(bobs) or not np.allclose(lengths, length, rtol=CLOSE):
        raise NotApplicableError("the pendulums are not alike, or other bodies are about")
    first = run.frames[0]
    if np.any(np.abs(first.velocity[bobs]) > 0):
        raise NotApplicableError("the pendulums are not released from rest")
    order = np.argsort([hangs[bob][0] @ side for bob in bobs])
    for a, b in pairwise(order):
        gap = hangs[bobs[b]][0] - hangs[bobs[a]][0] - (run.radius[bobs[a]] + run.radius[bobs[b]]) * side
        if np.linalg.norm(gap) > CLOSE * length:
            raise NotApplicableError("the bobs do not touch as they hang")
    raised = np.flatnonzero(np.abs(start) > CLOSE)
    if not len(raised) or not np.allclose(np.abs(start[raised]), np.abs(start[raised[0]]), rtol=CLOSE):
        raise NotApplicableError("the pendulums are not released at one angle")
    if len(bobs) == 1:
        return lambda t: mechanics.swing(t, start[0], length, g)[None], []
    names = [run.species_names[run.species[bob]] for bob in bobs]
    laws = [experiment.restitution(run, a, b) for a, b in pairwise(names)]
    e, masses = laws[0], run.mass[bobs]
    if not isinstance(e, (int, float)) or any(law != e for law in laws):
        raise NotApplicableError("restitution is not one number")
    if np.any(np.diff(start[order]) < 0):
        raise NotApplicableError("the bobs meet before they hang")
    if e == 1 and np.allclose(masses, masses[0], rtol=CLOSE):
        # Equal elastic bobs exchange velocities: positions are those of bobs that pass through each other, sorted.
        place = np.empty(len(bobs), int)
        place[order] = np.arange(len(bobs))
        return lambda t: np.sort([mechanics.swing(t, angle, length, g) for angle in start], axis=0)[place], []
    if len(bobs) != 2 or len(raised) != 1:
        raise NotApplicableError("for several inelastic or unequal bobs")
    a, b = int(raised[0]), int(1 - raised[0])
    alpha, sign = abs(start[a]), -np.sign(start[a])
    m1, m2 = masses[a], masses[b]
    beta = float(mechanics.pendulum_rise(alpha, e, m1, m2))
    hit = float(mechanics.quarter_period(alpha, length, g))
    # Velocity of the released bob after the impact, as a fraction of that before.
    kept = (m1 - e * m2) / (m1 + m2)
    amplitude = 2 * np.arcsin(abs(kept) * np.sin(alpha / 2))

    def law(t: Array) -> Array:
        def after(angle: float, way: float) -> Array:
            return way * mechanics.swing(t - hit - mechanics.quarter_period(angle, length, g), angle, length, g)

        angles = np.empty((2, len(t)))
        angles[a] = np.where(t < hit, mechanics.swing(t, start[a], length, g), after(amplitude, sign * np.sign(kept)))
        angles[b] = np.where(t < hit, 0.0, after(beta, sign))
        return angles

    label = rf"$\beta$ = {np.degrees(beta):.2f}°"
    return _holds_until(law, _next_event(run, hit)), [(float(np.degrees(sign * beta)), label)]


# --- springs ------------------------------------------------------------------------------------------


def _springs(run: Recording) -> Worked:
    x = run.frames.array("position")
    names = [run.species_names[s] for s in run.species]
    seen, labels, natural = [], [], []
    for one in run.scene["spring"]:
        ends = [x[:, experiment.body(run, name)] for name in one["between"]]
        if "point" in one:
            ends.append(np.broadcast_to(experiment.vector(one["point"]), ends[0].shape))
        if len(ends) != 2:
            raise NotApplicableError("a spring has only one end")
        length = np.linalg.norm(ends[1] - ends[0], axis=1)
        natural.append(one.get("length", length[0]))
        seen.append(natural[-1] - length)
        labels.append("–".join([*one["between"], *(["point"] if "point" in one else [])]))
    law, levels, why = None, [], ""
    try:
        law, levels = _spring_law(run, names, natural[0])
    except NotApplicableError as reason:
        why = str(reason)
    return Worked("Compression of the spring", "compression  [length]", labels, run.frames.time, np.array(seen), law,
                  levels, why)  # fmt: skip


def _spring_law(run: Recording, names: list[str], natural: float):
    springs = run.scene["spring"]
    if len(run) != 3 or len(springs) != 1 or len(springs[0]["between"]) != 2 or np.any(experiment.gravity(run)):
        raise NotApplicableError("not the three bodies of Problem 2.4")
    b, c = (experiment.body(run, name) for name in springs[0]["between"])
    (a,) = {0, 1, 2} - {b, c}
    x, w = run.frames[0].position, run.frames[0].velocity
    if np.linalg.norm(x[c] - x[a]) < np.linalg.norm(x[b] - x[a]):
        b, c = c, b
    axis = (x[b] - x[a]) / np.linalg.norm(x[b] - x[a])
    v = float(w[a] @ axis)
    in_line = np.linalg.norm(np.cross(x[c] - x[b], axis)) <= CLOSE * natural
    at_rest = np.all(np.abs(w[[b, c]]) <= 0) and abs(np.linalg.norm(x[c] - x[b]) - natural) <= CLOSE * natural
    if not (in_line and at_rest and v > 0 and np.linalg.norm(w[a] - v * axis) <= CLOSE * v):
        raise NotApplicableError("the spring is not hit along its line, at rest")
    if not np.allclose(run.mass, run.mass[0], rtol=CLOSE) or experiment.restitution(run, names[a], names[b]) != 0:
        raise NotApplicableError("the masses are not equal, or the impact is not plastic")
    m, k = float(run.mass[0]), float(springs[0]["stiffness"])
    hit = (np.linalg.norm(x[b] - x[a]) - run.radius[a] - run.radius[b]) / v
    most = mechanics.spring_impact(m, v, k).largest_compression
    law = _holds_until(lambda t: mechanics.spring_compression(t - hit, m, v, k)[None], _next_event(run, hit))
    return law, [(most, rf"$v\sqrt{{m/6k}}$ = {most:.4g}")]


# --- rods ---------------------------------------------------------------------------------------------


def _rods(run: Recording) -> Worked:
    x = run.frames.array("position")
    names = [run.species_names[s] for s in run.species]
    flying = int(np.argmax(np.linalg.norm(run.frames[0].velocity, axis=1)))
    w = run.frames[0].velocity[flying]
    v = float(np.linalg.norm(w))
    ahead = w / v if v > 0 else np.eye(3)[0]
    seen, labels = [], []
    for one in run.scene["rod"]:
        ends = [experiment.body(run, name) for name in one["between"]]
        arm = x[:, ends[1]] - x[:, ends[0]]
        if np.any(np.abs(arm[:, 2]) > CLOSE):
            raise NotApplicableError("the rod leaves the xy plane")
        across = np.array([-ahead[1], ahead[0], 0.0])
        seen.append(np.unwrap(np.arctan2(arm @ across, arm @ ahead)))
        labels.append("–".join(one["between"]))
    law, levels, why = None, [], ""
    try:
        law, levels = _rod_law(run, names, flying, v, ahead, seen[0][0])
    except NotApplicableError as reason:
        why = str(reason)
    in_degrees = None if law is None else lambda t: np.degrees(law(t))
    return Worked("Angle of the rod", "angle to the line of flight  [°]", labels, run.frames.time, np.degrees(seen),
                  in_degrees, levels, why)  # fmt: skip


def _rod_law(run: Recording, names: list[str], flying: int, v: float, ahead: Array, theta: float):
    rods = run.scene["rod"]
    if len(run) != 3 or len(rods) != 1 or np.any(experiment.gravity(run)) or not v > 0:
        raise NotApplicableError("not the particle and rod of Sets 2.2 and 2.3")
    hit, far = (experiment.body(run, name) for name in rods[0]["between"])
    x, w = run.frames[0].position, run.frames[0].velocity
    gap = x[hit] - x[flying]
    if (
        flying in (hit, far)
        or np.any(w[[hit, far]] != 0)
        or np.linalg.norm(np.cross(gap, ahead)) > CLOSE * (gap @ ahead)
    ):
        raise NotApplicableError("the particle does not fly squarely at the first end of a rod at rest")
    if not np.allclose(run.mass, run.mass[0], rtol=CLOSE):
        raise NotApplicableError("the masses are not equal")
    m, length = float(run.mass[0]), float(np.linalg.norm(x[far] - x[hit]))
    law = experiment.restitution(run, names[flying], names[hit])
    if law == "sticks":
        after = mechanics.rod_stick(m, v, length, theta)
    elif isinstance(law, (int, float)):
        after = mechanics.rod_impact(m, v, length, theta, law)
    else:
        raise NotApplicableError("restitution is not one number")
    when = (gap @ ahead - run.radius[flying] - run.radius[hit]) / v
    turn = _holds_until(
        lambda t: (theta + after.angular_velocity * np.maximum(t - when, 0.0))[None], _next_event(run, when)
    )
    return turn, [(float(np.degrees(theta)), rf"$\omega$ = {after.angular_velocity:.5g} rad/time")]


# --- balls --------------------------------------------------------------------------------------------


def _ball(run: Recording) -> Worked:
    pull = experiment.gravity(run)
    g = float(np.linalg.norm(pull))
    below = [(wall, *experiment.plane(run, wall)) for wall in range(experiment.count_walls(run))]
    below = [one for one in below if one[2] @ pull < -(1 - CLOSE) * g]
    if len(below) != 1:
        raise NotApplicableError("there is no one floor below")
    wall, point, normal = below[0]
    seen = (run.frames.array("position")[:, 0] - point) @ normal - run.radius[0]
    law, levels, why = None, [], ""
    e = experiment.wall_restitution(run, run.species_names[run.species[0]], wall)
    others = [
        experiment.plane(run, other)[1] @ pull / g for other in range(experiment.count_walls(run)) if other != wall
    ]
    if run.frames[0].velocity[0] @ normal != 0:
        why = "the ball is not dropped from rest"
    elif driven := experiment.driven(run, wall):
        why = f"the floor {driven}"
    elif any(CLOSE < abs(slope) < 1 - CLOSE for slope in others):
        why = "there is an inclined wall"
    elif not isinstance(e, (int, float)):
        why = "restitution is not one number"
    else:
        height = float(seen[0])
        law = lambda t: mechanics.bounce_position(t, height, e, g)[None]  # noqa: E731
        levels = [(float(mechanics.bounce_height(k, height, e)), f"$H_{k}$") for k in (1, 2, 3) if e > 0]
        if e == 1:
            levels = [(levels[0][0], r"$H_1 = H_2 = \dots$")]
    return Worked("Height of the ball", "clear height  [length]", [body_name(run, 0)], run.frames.time, seen[None], law,
                  levels, why)  # fmt: skip


def _impact(run: Recording) -> Worked:
    frames = run.frames
    start, w = frames[0].position, frames[0].velocity
    if len(run) == 2:
        names = [run.species_names[s] for s in run.species]
        e, m2, w2 = experiment.restitution(run, *names), run.mass[1], w[1]
        beta, friction = experiment.roughness(run, *names)
        r, u, sigma = start[1] - start[0], w[1] - w[0], run.radius.sum()
        # Smaller root of |r + u t| = σ.
        b, c = r @ u, r @ r - sigma**2
        square = b * b - (u @ u) * c
        if b >= 0 or square < 0:
            raise NotApplicableError("the two do not meet")
        hit = c / (np.sqrt(square) - b)
        bounded = experiment.count_walls(run) > 0 or bool(run.box.periodic.any())
        if bounded and not np.isclose(_next_event(run, 0.0), hit, rtol=CLOSE):
            raise NotApplicableError("something else comes before the impact of the two, or there is no event log")
        n = (r + u * hit) / sigma
    elif experiment.count_walls(run) == 1:
        if (driven := experiment.driven(run, 0)) and "velocity" not in driven:
            raise NotApplicableError(f"the wall {driven}")
        point, normal = experiment.plane(run, 0)
        name = run.species_names[run.species[0]]
        e, m2 = experiment.wall_restitution(run, name, 0), np.inf
        beta, friction = experiment.wall_roughness(run, name, 0)
        w2 = experiment.vector(shaped_walls(run.scene)[0].get("velocity", (0, 0, 0)))
        approach = (w2 - w[0]) @ normal
        if approach <= 0:
            raise NotApplicableError("the ball does not meet the wall")
        hit, n = ((start[0] - point) @ normal - run.radius[0]) / approach, -normal
    else:
        raise NotApplicableError("neither two bodies nor a body and a wall")
    if not isinstance(e, (int, float)):
        raise NotApplicableError("restitution is not one number")
    after: mechanics.Impact | mechanics.RoughImpact
    spins, q = frames[0].angular_velocity, run.inertia
    if spins is None or q is None:
        after = mechanics.impact(run.mass[0], m2, w[0], w2, n, e)
    else:
        # The second body, or the wall, whose spin counts with its radius, 0.
        other, radius = (1, run.radius[1]) if len(run) == 2 else (0, 0.0)
        radii, inertias = (run.radius[0], radius), (q[0], q[other])
        after = mechanics.rough_impact(
            run.mass[0], m2, w[0], w2, spins[0], spins[other], n, e, beta, friction, radii, inertias
        )
    before = [w[0], w2][: len(run)]
    later = [after.velocity_1, after.velocity_2][: len(run)]
    speed = after.approach_speed
    # Components that are not zero throughout.
    shown = [(b, k) for b in range(len(run)) for k in range(run.dimension)
             if max(abs(before[b][k]), abs(later[b][k])) > CLOSE * speed]  # fmt: skip
    seen = np.array([frames.array("velocity")[:, b, k] for b, k in shown])
    labels = [f"{body_name(run, b)}, {'xyz'[k]}" for b, k in shown]
    law = _holds_until(
        lambda t: np.array([np.where(t < hit, before[b][k], later[b][k]) for b, k in shown]),
        _next_event(run, hit, CLOSE * speed),
    )
    return Worked("Velocities in the impact", "velocity  [length / time]", labels, frames.time, seen, law, [], "")
