"""Few bodies: coordinates against time with the marks of events, and paths in the plane."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..analysis import experiment
from ..analysis.experiment import body_name
from ..errors import NotApplicableError
from ..files.events import PAIRS
from ..files.extent import Extent
from ..files.scene import shape_of
from . import shapes, walls
from .style import BLACK, CYCLE, GREY, headline, label, page

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..files.recording import Recording

MOST_BODIES = 24
IMPACTS = ("collision", "wall", "stick")
"""Events that change velocities at once."""
MOST_MARKS = 4000
_MARKS = {
    "collision": ("o", "collision"),
    "wall": ("^", "wall collision"),
    "rest": ("s", "comes to rest"),
    "settle": ("s", "comes to rest"),
    "slack": ("v", "string goes slack"),
    "taut": ("D", "string is taut again"),
    "release": ("<", "contact ends"),
    "lift": ("<", "contact ends"),
    "stick": ("P", "sticks"),
    "slide": ("p", "sliding ends"),
}


class Path(NamedTuple):
    """Flight of one body, dense enough to draw."""

    time: np.ndarray
    """``[M]`` [time]"""
    position: np.ndarray
    """``[M, 3]`` unwrapped centre [length]"""
    hits: np.ndarray
    """``[E]`` rows of the event log"""
    at: np.ndarray
    """``[E, 3]`` unwrapped centre at those events [length]"""


def flights(file: Recording) -> list[Path]:
    """Paths of all bodies between frames, exact where the event log has every change of velocity: not those by drives.

    From each frame a body flies freely (a parabola under gravity) to its next event, takes up the impulse
    of the log, and flies on, up to the next frame. Without a log, and for bodies with pendulums, springs or rods,
    frames without an event between them are joined by Hermite arcs, and so are those of a body on a wall with friction.
    """
    frames = file.frames
    if len(frames) < 2:
        raise NotApplicableError("fewer than two frames")
    if len(file) > MOST_BODIES:
        raise NotApplicableError(f"{len(file)} bodies: made for up to {MOST_BODIES}")
    t, x, v = frames.time, frames.array("unwrapped"), frames.array("velocity")
    if (shear := file.shear) is not None:
        # Paths are followed out of the box, where the flow is faster.
        rows = frames.array("image")[..., shear.gradient]
        v[..., shear.flow] += rows * (shear.rate * file.box.size[shear.gradient])
    gravity = experiment.gravity(file)
    log = None
    known = "events" in file and not file.scene.get("drive") and len(file.events) <= 50 * MOST_MARKS
    if known and not is_changed(file):
        events = file.events
        names = ["time", "kind", "i", "j"]
        # Of smooth bodies the impulse is along the normal, but at thermal walls, where the log has its vector, too.
        vectors = file.inertia is not None or "impulse_vector" in events.columns
        names += ["impulse_vector"] if vectors else ["impulse", "normal"]
        if set(names) <= set(events.columns):
            log = {n: events[n] for n in names}
            if "impulse" in log:
                log["impulse_vector"] = log["impulse"][:, None] * log["normal"]
            log["names"] = np.array([events.kinds.get(int(k), "") for k in log["kind"]])
    bent = any(file.scene.get(joint) for joint in ("pendulum", "spring", "rod"))
    return [_flight(body, t, x[:, body], v[:, body], file.mass[body], gravity, log, bent) for body in range(len(file))]


def is_changed(file: Recording) -> bool:
    """Whether velocities or gravity were changed from outside after the first frame: the log has not by how much."""
    events = file.events
    if not {"time", "kind"} <= set(events.columns):
        return False
    changes = [code for code, kind in events.kinds.items() if kind == "change"]
    return bool(np.any(np.isin(events["kind"], changes) & (events["time"] > file.frames.time[0])))


def _flight(body, t, x, v, mass, gravity, log, bent) -> Path:
    own = np.zeros(0, int)
    if log is not None:
        own = np.flatnonzero((log["i"] == body) | (np.isin(log["names"], PAIRS) & (log["j"] == body)))
    pull = gravity if np.isfinite(mass) else np.zeros(3)
    times, points, at = [], [], np.full((len(own), 3), np.nan)
    # In contact with a wall, which carries the weight; it may slide.
    # The first frame is taken before the impacts of its time, others after all events of theirs.
    at_start = np.zeros(0, bool) if log is None else (log["time"][own] == t[0]) & np.isin(log["names"][own], IMPACTS)
    before = np.flatnonzero((log["time"][own] <= t[0]) & ~at_start) if log is not None else own
    resting = len(before) > 0 and log["names"][own[before[-1]]] in ("rest", "slide")
    if len(before):
        at[before[log["time"][own[before]] == t[0]]] = x[0]
    for k in range(len(t) - 1):
        now, r, w = t[k], x[k].astype(float), v[k].astype(float)
        inside = np.zeros(0, int)
        if log is not None:
            inside = np.flatnonzero(
                ((log["time"][own] > t[k]) | (at_start & (k == 0))) & (log["time"][own] <= t[k + 1])
            )
        if log is None or (bent and not len(inside)):
            s = np.linspace(0, 1, 24)[:, None]
            times.append(now + s[:, 0] * (t[k + 1] - t[k]))
            points.append(_arc(s, t[k + 1] - t[k], x[k : k + 2], v[k : k + 2]))
            continue
        if resting and len(inside) and np.all(log["names"][own[inside]] == "slide"):
            marks = (log["time"][own[inside]] - now) / (t[k + 1] - now)
            s = np.sort(np.concatenate([np.linspace(0, 1, 24), marks]))[:, None]
            times.append(now + s[:, 0] * (t[k + 1] - now))
            points.append(_arc(s, t[k + 1] - now, x[k : k + 2], v[k : k + 2]))
            at[inside] = _arc(marks[:, None], t[k + 1] - now, x[k : k + 2], v[k : k + 2])
            continue
        for row in inside:
            until = log["time"][own[row]]
            name = log["names"][own[row]]
            dt = np.linspace(0, until - now, 20)[:, None]
            if resting or name == "rest":
                # End of a series of ever smaller bounces, which are too many and too small to draw.
                part = (until - now) / (t[k + 1] - now) if resting else 1.0
                arc = r + part * (x[k + 1] - r) * np.linspace(0, 1, 20)[:, None]
                w = v[k + 1].astype(float)
            else:
                arc = r + w * dt + 0.5 * pull * dt**2
            times.append(now + dt[:, 0])
            points.append(arc)
            r, now = arc[-1], until
            at[row] = r
            if name == "leave":
                break
            if name == "rest":
                resting = True
            elif not resting:
                w = w + pull * dt[-1]
                sign = -1.0 if log["i"][own[row]] == body else 1.0
                w = w + sign * log["impulse_vector"][own[row]] / mass
        if len(inside) and log["names"][own[inside[-1]]] == "leave":
            continue
        dt = np.linspace(0, t[k + 1] - now, 20)[:, None]
        if resting:
            lifted = np.linalg.norm(r + w * dt[-1] + 0.5 * pull * dt[-1] ** 2 - x[k + 1]) < 1e-9 * np.abs(x).max()
            resting = not (lifted and pull.any() and dt[-1, 0] > 0)
        if resting and not len(inside):
            points.append(_arc(np.linspace(0, 1, 20)[:, None], t[k + 1] - now, x[k : k + 2], v[k : k + 2]))
        elif resting:
            points.append(r + (x[k + 1] - r) * np.linspace(0, 1, 20)[:, None])
        else:
            points.append(r + w * dt + 0.5 * pull * dt**2)
        times.append(now + dt[:, 0])
    return Path(np.concatenate(times), np.concatenate(points), own, at)


def _spins(file: Recording, path: Path, body: int) -> tuple[np.ndarray, np.ndarray]:
    """Times ``[M]`` and angular velocities ``[M, 3]`` of a body, with their jumps in contacts of rough bodies.

    A body flies at a constant spin; what changes it otherwise, such as sliding, is joined by straight lines.
    """
    frames, inertia = file.frames, file.inertia
    t, spin = frames.time, frames.array("angular_velocity")[:, body]
    log, columns = {}, ("time", "kind", "j", "impulse_vector", "normal")
    if "events" in file and len(path.hits) <= MOST_MARKS and set(columns) <= set(file.events.columns):
        log = {name: file.events[name][path.hits] for name in columns}
        kinds = np.array([file.events.kinds.get(int(k), "") for k in log["kind"]])
        # The spin that a thermal wall gives is not in the log.
        thermal = [
            kind == "wall" and experiment.driven(file, int(j)) == "is thermal" for kind, j in zip(kinds, log["j"])
        ]
        impact = np.isin(kinds, ("collision", "wall")) & ~np.array(thermal, bool)
        log = {name: values[impact] for name, values in log.items()}
    times, values = [t[0]], [spin[0]]
    for k in range(len(t) - 1):
        now = spin[k]
        for row in np.flatnonzero((log["time"] > t[k]) & (log["time"] <= t[k + 1])) if log else ():
            times.append(log["time"][row])
            values.append(now)
            # The normal is that of the first body, the impulse acts on the second.
            now = now - np.cross(log["normal"][row], log["impulse_vector"][row]) / (
                inertia[body] * file.mass[body] * file.radius[body]
            )
            times.append(log["time"][row])
            values.append(now)
        times.append(t[k + 1])
        values.append(spin[k + 1])
    return np.array(times), np.array(values)


def _arc(s: np.ndarray, step: float, x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """``[M, 3]`` places on the cubic with two states, ``[2, 3]`` each, at the fractions ``s`` ``[M, 1]`` of a step."""
    arc = ((1 + 2 * s) * (1 - s) ** 2) * x[0] + (s * (1 - s) ** 2) * step * v[0]
    return arc + (s**2 * (3 - 2 * s)) * x[1] + (s**2 * (s - 1)) * step * v[1]


def _extent(path: Path) -> np.ndarray:
    """``[3]`` size of the region of a path; a body that is not there has no position."""
    known = path.position[np.isfinite(path.position).all(axis=1)]
    return np.ptp(known, axis=0) if len(known) else np.zeros(3)


def _moving_axes(file: Recording, paths: list[Path]) -> list[int]:
    ways = [_extent(path) for path in paths]
    size = max(float(way.max()) for way in ways)
    active = [k for k in range(3) if any(way[k] > 1e-9 * max(size, 1e-300) for way in ways)]
    if not active or size == 0:
        raise NotApplicableError("nothing moves")
    return active


def _turning(file: Recording) -> list[int]:
    """The components of angular velocities that are not zero throughout."""
    if file.inertia is None:
        return []
    return [int(c) for c in np.flatnonzero(np.any(file.frames.array("angular_velocity") != 0, axis=(0, 1)))]


def _subtitle(file: Recording) -> str:
    counts = file.summary
    hits = []
    for name in ("collisions", "wall_collisions"):
        if count := counts.get(name):
            words = name.replace("_", " ")
            hits.append(f"{count:,} {words if count > 1 else words.removesuffix('s')}")
    return "  ·  ".join([s for s in (label(file.title), ", ".join(hits)) if s])


def draw(file: Recording) -> Figure:
    """Every coordinate and component of the spin that changes, against time, with a mark at each event."""
    paths = flights(file)
    active = _moving_axes(file, paths)
    turning = _turning(file)
    rows = len(active) + len(turning)
    figure = Figure(figsize=(6.8, 1.4 + 2.4 * rows if rows > 1 else 4.4), layout="constrained")
    panels = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    few = len(paths) <= 7
    names = np.array([file.events.kinds.get(int(k), "") for k in file.events["kind"]]) if "events" in file else None
    used: set[str] = set()
    for axes, coordinate in zip(panels, active):
        for body, path in enumerate(paths):
            color = CYCLE[body % len(CYCLE)]
            axes.plot(path.time, path.position[:, coordinate], color=color, lw=1.3 if few else 0.9, zorder=2,
                      label=label(body_name(file, body)))  # fmt: skip
            if names is None or len(path.hits) > MOST_MARKS:
                continue
            for kind, (mark, _) in _MARKS.items():
                chosen = names[path.hits] == kind
                if chosen.any():
                    used.add(kind)
                    when, where = file.events["time"][path.hits[chosen]], path.at[chosen, coordinate]
                    size = 4 if few else 2.6
                    axes.plot(when, where, mark, ms=size, mfc="white", mec=color, mew=0.9, zorder=3)
        axes.set_ylabel(f"{'xyz'[coordinate]} of the centre  [length]")
        axes.margins(x=0.01, y=0.08)
    for body, path in enumerate(paths if turning else ()):
        when, spin = _spins(file, path, body)
        for axes, component in zip(panels[len(active) :], turning):
            axes.plot(when, spin[:, component], color=CYCLE[body % len(CYCLE)], lw=1.3 if few else 0.9, zorder=2)
            axes.set_ylabel(f"spin $\\omega_{'xyz'[component]}$  [1/time]")
            axes.margins(x=0.01, y=0.08)
    floor = _clearance(file, active)
    if floor is not None:
        panels[len(active) - 1].axhline(floor, color=GREY, lw=1, ls=":", zorder=1)
    panels[-1].set_xlabel("simulated time $t$  [scene’s unit of time]")
    bodies = panels[0].get_legend_handles_labels()
    handles = list(bodies[0]) if few and len(paths) > 1 else []
    labels = list(bodies[1]) if few and len(paths) > 1 else []
    for mark, meaning in dict.fromkeys(of for kind, of in _MARKS.items() if kind in used):
        handles.append(Line2D([], [], ls="", marker=mark, mfc="white", mec=BLACK, ms=5))
        labels.append(meaning)
    if floor is not None:
        handles.append(Line2D([], [], color=GREY, lw=1, ls=":"))
        labels.append("touching the floor")
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=min(len(handles), 5))
    headline(figure, "Motion and events", _subtitle(file))
    return figure


def _clearance(file: Recording, active: list[int]) -> float | None:
    """Height of the centre of a single ball in touch with a horizontal floor at z = 0."""
    planes = [w for w in file.scene.get("wall", []) if shape_of(w) == "plane"]
    floors = [w for w in planes if w["plane"]["normal"] == [0, 0, 1] and not w.get("passes")]
    at = experiment.vector(floors[0]["plane"]["point"])[2] if floors else 0.0
    if len(file) == 1 and active[-1] == 2 and (floors or file.box.boundary[2] == "wall"):
        return float(at + file.radius[0])
    return None


def draw_paths(file: Recording) -> Figure:
    """Paths in the plane of motion; bodies at the start (outline) and at the end (filled)."""
    paths = flights(file)
    active = _moving_axes(file, paths)
    if len(active) < 2:
        raise NotApplicableError("the motion is along one line")
    a, b = active[:2] if file.dimension == 2 or len(active) == 2 else (0, 2)
    region, scenery = _region(file, paths, (a, b))
    sides = region.size[[a, b]]
    figure = Figure(figsize=page(*sides, beside=0.8, below=1.6), layout="constrained")
    axes = figure.subplots()
    axes.set_aspect("equal")
    few = len(paths) <= 7
    for body, path in enumerate(paths):
        color = CYCLE[body % len(CYCLE)]
        track = path.position[:, [a, b]]
        axes.plot(
            *track.T,
            color=color,
            lw=1.0 if few else 0.8,
            alpha=0.9,
            zorder=2,
            label=label(body_name(file, body)),
        )
        radius = file.radius[body]
        for centre, filled in ((track[0], False), (track[-1], True)):
            axes.add_patch(mpl.patches.Circle(centre, radius, fc=color if filled else "none", ec=color, lw=1.0,
                                              ls="-" if filled else (0, (3, 2)), zorder=4))  # fmt: skip
    if all(file.box.boundary[k] == "wall" for k in (a, b)):
        axes.add_patch(
            mpl.patches.Rectangle((0, 0), file.box.size[a], file.box.size[b], fill=False, ec="#333333", lw=1.6)
        )
    _draw_walls(file, axes, scenery, (a, b), float(paths[0].position[0, 3 - a - b]))
    axes.update_datalim(np.stack([region.origin, region.origin + region.size])[:, [a, b]])
    axes.autoscale_view()
    axes.margins(0.04)
    axes.set_xlabel(f"{'xyz'[a]}  [length]")
    axes.set_ylabel(f"{'xyz'[b]}  [length]")
    if few:
        figure.legend(loc="outside lower center", ncols=min(len(paths), 5))
    headline(figure, "Paths", f"{_subtitle(file)}  ·  dashed: start, filled: end")
    return figure


def _region(file: Recording, paths: list[Path], shown: tuple[int, int]) -> tuple[Extent, shapes.Scenery]:
    """The region of the paths, and the walls at their end; none if the motion is in space."""
    points, radius = np.concatenate([path.position for path in paths]), float(file.radius.max())
    margin = radius + 0.08 * float(np.ptp(points, axis=0).max())
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    room = Extent(low, high - low, np.zeros(3, bool))
    across = 3 - sum(shown)
    if file.dimension == 3 and np.ptp(points[:, across]) > 1e-6 * np.ptp(points, axis=0).max():
        return room, shapes.Scenery([], room, [])
    scenery = shapes.find(file, room, float(file.frames.time[-1]), planes=True)
    return scenery.room, scenery


def _draw_walls(file: Recording, axes: Axes, scenery: shapes.Scenery, shown: tuple[int, int], height: float) -> None:
    """Walls: in space, where the plane of motion cuts them, which is at ``height`` along the third axis."""
    if file.dimension == 2:
        walls.draw_flat(axes, scenery.shapes, float(file.frames.time[-1]))
    else:
        lines = [line[:, shown] for line in walls.sections(scenery.shapes, 3 - sum(shown), height)]
        axes.add_collection(LineCollection(lines, colors=walls.WALL, linewidths=1.6, zorder=2.5), autolim=False)
    walls.tell_missing(axes, scenery)
