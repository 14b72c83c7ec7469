"""Quantities of an experiment, from a recorded run: heights and times of bounces, angles of pendulums."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FileError, MissingDataError, NotApplicableError
from ..files.scene import law_of, mean_point, shape_of, shaped_walls
from ..files.scene import roughness as roughness_of
from ..text import quoted
from . import conditions

if TYPE_CHECKING:
    import pandas as pd

    from ..files.recording import Recording

__all__ = [
    "angles",
    "body",
    "count_walls",
    "driven",
    "gravity",
    "heights",
    "pendulums",
    "plane",
    "restitution",
    "roughness",
    "times",
    "vector",
    "wall_restitution",
    "wall_roughness",
]

Array = NDArray[np.float64]


def times(run: Recording) -> pd.DataFrame:
    """Column ``time``: the impacts of the one body that bounces on a wall [time].

    Raises :class:`NotApplicableError` if none does, or several do, or the wall moves or is thermal, so that flights do
    not become shorter by the factor e.
    """
    import pandas as pd

    return pd.DataFrame({"time": _bounces(run)["time"].to_numpy()})


def heights(run: Recording) -> pd.DataFrame:
    """Column ``height``: clear heights over the wall at the top of every flight between bounces [length].

    Computed from the energy in any frame of the flight; NaN for a flight without a frame. Raises
    :class:`NotApplicableError` if no body, or several, bounce on a wall, gravity does not pull onto it, or it moves or
    is thermal.
    """
    import pandas as pd

    bounces = _bounces(run)
    body, wall = int(bounces["i"].iloc[0]), int(bounces["j"].iloc[0])
    point, normal = plane(run, wall)
    pull = -float(gravity(run) @ normal)
    if not pull > 0:
        raise NotApplicableError(f"{run.path}: no gravity pulls onto the wall: there are no heights of bounces")
    frames = run.frames
    clear = (frames.array("unwrapped")[:, body] - point) @ normal - run.radius[body]
    top = clear + (frames.array("velocity")[:, body] @ normal) ** 2 / (2 * pull)
    # The flight before bounce k is the k-th; frames are taken after all events at their time.
    impacts = bounces["time"].to_numpy()
    flight = np.searchsorted(impacts, frames.time, side="right")
    found = np.full(len(impacts), np.nan)
    for k in range(len(impacts)):
        inside = np.flatnonzero(flight == k)
        if len(inside):
            found[k] = top[inside[0]]
    return pd.DataFrame({"height": found})


def angles(run: Recording) -> pd.DataFrame:
    """Columns ``alpha``, ``beta``: a row with the angles of release and of the struck bob's rise [rad].

    From the first impact of two bobs, of which the second hangs at rest, and the frames before and after it, by their
    energies. ``attrs["masses"]`` holds the masses of the two. Raises :class:`NotApplicableError` if there is no
    such impact.
    """
    import pandas as pd

    log = _events(run)
    collisions = log[log["kind"] == "collision"]
    hangs = pendulums(run)
    if collisions.empty or not {int(collisions[c].iloc[0]) for c in "ij"} <= set(hangs):
        raise NotApplicableError(f"{run.path}: no two pendulums meet")
    first = collisions.iloc[0]
    # Of two colliding bobs, the one that moved was released.
    frames = run.frames
    before, after = frames.time < first["time"], frames.time >= first["time"]
    speed = np.linalg.norm(frames.array("velocity"), axis=2)
    struck, released = sorted((int(first["i"]), int(first["j"])), key=lambda body: speed[before, body].max(initial=0.0))
    if speed[before, struck].max(initial=0.0) > 0:
        raise NotApplicableError(f"{run.path}: both pendulums move when they meet; one must hang at rest")
    later = log[(log["time"] > first["time"]) & ((log["i"] == struck) | (log["j"] == struck))]["time"]
    after &= frames.time < later.min() if len(later) else True
    if not before.any() or not after.any():
        raise MissingDataError(f"{run.path}: no frame on either side of the first impact (output.frames)")
    alpha = _amplitude(run, released, hangs[released], int(np.flatnonzero(before)[0]))
    beta = _amplitude(run, struck, hangs[struck], int(np.flatnonzero(after)[0]))
    table = pd.DataFrame({"alpha": [alpha], "beta": [beta]})
    table.attrs["masses"] = (float(run.mass[released]), float(run.mass[struck]))
    return table


def gravity(run: Recording) -> Array:
    """``[3]`` acceleration of the scene [length/time²]."""
    return vector(run.scene.get("domain", {}).get("gravity", ()))


def vector(given: Sequence[float]) -> Array:
    """A vector of a scene, which has one number per dimension, as ``[3]``."""
    return np.pad(np.asarray(given, float), (0, 3 - len(given)))


def restitution(run: Recording, first: str, second: str) -> float | dict[str, object] | str:
    """The scene's law for two particles by their names: a number, a model, or ``"sticks"``."""
    rule = _rule(run, first, second)
    return "sticks" if any(pair.get("sticks") for pair in rule) else law_of(run.scene, *rule)


def wall_restitution(run: Recording, name: str, wall: int) -> float | dict[str, object] | str:
    """The scene's law for a particle by its name on a wall by its row."""
    called, of = _wall(run, wall)
    rule = _rule(run, name, called)
    sticks = any(pair.get("sticks") for pair in rule) or (of.get("sticks") and not rule)
    return "sticks" if sticks else law_of(run.scene, *rule, of, wall=True)


def roughness(run: Recording, first: str, second: str) -> tuple[float, float]:
    """The scene's β and μ for two particles by their names; β = -1 is smooth, and μ infinite where β alone counts."""
    return roughness_of(run.scene, *_rule(run, first, second))


def wall_roughness(run: Recording, name: str, wall: int) -> tuple[float, float]:
    """The scene's β and μ for a particle by its name on a wall by its row; see :func:`roughness`."""
    called, of = _wall(run, wall)
    return roughness_of(run.scene, *_rule(run, name, called), of)


def _rule(run: Recording, first: str, second: str) -> list[dict[str, Any]]:
    """The entry of ``contact.pair`` for two names, or nothing."""
    pairs = run.scene.get("contact", {}).get("pair", ())
    return [pair for pair in pairs if sorted(pair["between"]) == sorted((first, second))][:1]


def _wall(run: Recording, wall: int) -> tuple[str, dict[str, Any]]:
    """Name of a wall by its row, and its entry of ``[[wall]]``, empty if there is none."""
    sides = _sides(run)
    if wall < 2 * len(sides):
        called = "xyz"[sides[wall // 2]] + "-+"[wall % 2]
        own = (entry for entry in run.scene.get("wall", ()) if shape_of(entry) is None)
        entries = (entry for entry in own if entry.get("name") == called)
        return called, next(entries, {})
    of = shaped_walls(run.scene)[wall - 2 * len(sides)]
    return of.get("name", ""), of


def driven(run: Recording, wall: int) -> str:
    """How a wall, by its row, gives energy to what hits it: such as "oscillates"; empty if it does not."""
    _, of = _wall(run, wall)
    if "motion" in of:
        return "oscillates"
    if "mass" in of:
        return "is a piston"
    if of.get("rotation", {}).get("rate"):
        return "rotates"
    if any(of.get("velocity", ())):
        return "has a velocity"
    return "is thermal" if "temperature" in of else ""


def body(run: Recording, name: str) -> int:
    """Row of the first particle of a name of the scene. Raises :class:`FileError` if there is none."""
    if name in run.species_names:
        rows = np.flatnonzero(run.species == run.species_names.index(name))
        if len(rows):
            return int(rows[0])
    raise FileError(f"{run.path}: parameters/scene: no particle has the name {quoted(name)}")


def body_name(run: Recording, body: int) -> str:
    """Name of a body, with its row where several share one."""
    name = run.species_names[run.species[body]]
    return name if np.count_nonzero(run.species == run.species[body]) == 1 else f"{name} {body}"


def pendulums(run: Recording) -> dict[int, tuple[Array, float]]:
    """Pivot ``[3]`` and length [length] of every pendulum by the row of its bob."""
    start = run.frames[0].position
    found = {}
    for one in run.scene.get("pendulum", ()):
        bob, pivot = body(run, one["bob"]), vector(one["pivot"])
        found[bob] = pivot, float(one.get("length", np.linalg.norm(start[bob] - pivot)))
    return found


def _amplitude(run: Recording, body: int, hangs: tuple[Array, float], frame: int) -> float:
    """Angle at which a pendulum would come to rest, from its energy in a frame; NaN if it goes over the top."""
    pivot, length = hangs
    g = gravity(run)
    strength = float(np.linalg.norm(g))
    if strength == 0:
        raise NotApplicableError(f"{run.path}: without gravity pendulums do not swing")
    r, v = run.frames[frame].position[body] - pivot, run.frames[frame].velocity[body]
    rise = length - float(r @ g) / strength + float(v @ v) / (2 * strength)
    with np.errstate(invalid="ignore"):
        return float(2 * np.arcsin(np.sqrt(rise / (2 * length))))


def _events(run: Recording) -> pd.DataFrame:
    return run.events.to_pandas(["time", "kind", "i", "j"])


def _bounces(run: Recording) -> pd.DataFrame:
    """Impacts on the wall that one body bounces on, in order of time."""
    log = _events(run)
    bounces = log[log["kind"] == "wall"]
    if bounces.empty:
        raise NotApplicableError(f"{run.path}: nothing bounces on a wall")
    if len(bounces[["i", "j"]].drop_duplicates()) > 1 or (log["kind"] == "collision").any():
        raise NotApplicableError(f"{run.path}: more happens than that one body bounces on one wall")
    wall = int(bounces["j"].iloc[0])
    if not wall < count_walls(run):
        raise FileError(f"{run.path}: events/j = {wall}: must be one of {count_walls(run)} walls")
    if moves := driven(run, wall):
        raise NotApplicableError(f"{run.path}: the wall that the body bounces on {moves}")
    conditions.require(run, f"{run.path}: a bounce", conditions.BOUNCES)
    return bounces


def _sides(run: Recording) -> list[int]:
    """Axes that end in walls."""
    return [k for k in range(run.dimension) if run.box.boundary[k] == "wall"]


def count_walls(run: Recording) -> int:
    """Number of walls: those of the box and those of the scene."""
    return 2 * len(_sides(run)) + len(shaped_walls(run.scene))


def plane(run: Recording, wall: int) -> tuple[Array, Array]:
    """A point of a wall in the first frame and its normal, which points to the inside, by its row.

    Those of the box are first. The point of a wall that oscillates is that of its mean position. Raises
    :class:`NotApplicableError` for a wall that is no plane without end, or through which some particles pass.
    """
    sides = _sides(run)
    if wall < 2 * len(sides):
        axis, upper = sides[wall // 2], wall % 2
        normal = np.zeros(3)
        normal[axis] = -1.0 if upper else 1.0
        point = np.zeros(3)
        point[axis] = run.box.size[axis] if upper else 0.0
        return point + float(_wall(run, wall)[1].get("displacement", 0.0)) * normal, normal
    given = shaped_walls(run.scene)[wall - 2 * len(sides)]
    if shape_of(given) != "plane":
        raise NotApplicableError(f"the wall {quoted(given.get('name', ''))} is no plane without end")
    if given.get("passes"):
        raise NotApplicableError(f"particles pass through the wall {quoted(given.get('name', ''))}")
    normal = vector(given["plane"]["normal"])
    start = float(run.frames.time[0]) if len(run.frames) else 0.0
    return np.array(mean_point(given, start)), normal / np.linalg.norm(normal)
