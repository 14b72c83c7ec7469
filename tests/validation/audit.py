"""Conditions on every run, checked from its output by an independent computation.

Positions, velocities and events are compared with each other and with the scene: overlaps with all periodic images and
walls in extended precision, energy and momentum by exact sums, each event's impulse and loss from its law, and each
flight between two events of a particle from the velocity that the impulses give it. Of rough contacts the tangential
impulses and losses follow from the spins that the impulses give. In a sheared box images slide, energies and momenta
are those of velocities relative to the flow, and the work of the shear follows from flights and impulses. The program's
sums are not used.
Only for a run without event log losses and the number of events are taken from its observables
(:func:`audit_without_events`): energies of the frames must then balance with them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

import haff
from haff.files import samples as observables

Array = NDArray[Any]
EPS = 2.0**-52
LEAST = 1e-12
"""Overlaps up to this part of the contact distance are rounding in any box, and so are sums of energies."""
STALL = 110_000
"""Events at one time, beside ten per particle, that the engine reports as a collapse."""


@dataclass(frozen=True)
class Finding:
    """A worst case, and its limit."""

    name: str
    found: float
    limit: float

    @property
    def passed(self) -> bool:
        """Whether the value is within the limit; NaN is not."""
        return bool(self.found <= self.limit)

    def __str__(self) -> str:
        return f"{self.name}: {self.found:.2e}, at most {self.limit:.2e}"


@dataclass
class Wall:
    """A plane wall: a point at time 0, the unit normal to the inside, its velocity."""

    name: str
    point: Array
    normal: Array
    velocity: Array
    entry: dict[str, Any] = field(default_factory=dict)
    """Its table in the scene."""


@dataclass
class Sliding:
    """Images of a sheared box: the one across the upper face of the gradient axis is displaced along the flow."""

    flow: int
    gradient: int
    rate: float
    offset: float
    size: Array

    @property
    def speed(self) -> float:
        """Velocity of that image."""
        return self.rate * float(self.size[self.gradient])

    def displacement(self, time: float) -> np.longdouble:
        """Displacement at a time, at most half an edge in size; in extended precision."""
        edge = np.longdouble(self.size[self.flow])
        turns = np.longdouble(self.rate) * self.size[self.gradient] / edge * np.longdouble(time) + self.offset / edge
        return (turns - np.rint(turns)) * edge

    def nearest(self, apart: Array, time: float) -> Array:
        """Vectors moved by the images across the faces of the gradient axis, to the nearest one along it."""
        up = np.rint(apart[:, self.gradient] / self.size[self.gradient])
        apart = apart.copy()
        apart[:, self.flow] -= up * self.displacement(time)
        return apart


def vector(values: Any) -> Array:
    """A vector of three, of two or three numbers of a scene."""
    return np.array([*values, 0.0][:3], float)


class Scene:
    """A recorded scene, parsed from its TOML."""

    def __init__(self, file: haff.File) -> None:
        scene = file.scene
        domain = scene.get("domain", {})
        self.dimension = file.dimension
        self.size = np.array(file.box.size, float)
        self.periodic = np.array(file.box.periodic, bool)
        self.gravity = vector(domain.get("gravity", (0, 0, 0)))
        self.mass, self.radius = file.mass, file.radius
        self.finite = np.isfinite(self.mass)
        names = file.species_names
        self.name = [names[s] for s in file.species]
        self.contact = scene.get("contact", {})
        self.tc = float(self.contact.get("tc", 0.0))
        self.pairs = {frozenset(p["between"]): p for p in self.contact.get("pair", ())}
        self.inertia = None if file.inertia is None else file.inertia.tolist()
        shear = domain.get("shear")
        self.sliding: Sliding | None = None
        if shear is not None:
            flow, gradient = "xyz".index(shear["flow"]), "xyz".index(shear["gradient"])
            self.sliding = Sliding(flow, gradient, float(shear["rate"]), float(shear.get("offset", 0.0)), self.size)
        self.walls: list[Wall] = []
        for axis in range(self.dimension):
            if file.box.boundary[axis] == "wall":
                unit, label = np.eye(3)[axis], "xyz"[axis]
                self.walls.append(Wall(f"{label}-", np.zeros(3), unit, np.zeros(3)))
                self.walls.append(Wall(f"{label}+", unit * self.size[axis], -unit, np.zeros(3)))
        for wall in scene.get("wall", ()):
            if "plane" not in wall:
                next(side for side in self.walls if side.name == wall["name"]).entry = wall
                continue
            normal = vector(wall["plane"]["normal"])
            velocity = vector(wall.get("velocity", (0, 0, 0)))
            self.walls.append(
                Wall(
                    wall.get("name", "wall"),
                    vector(wall["plane"]["point"]),
                    normal / np.linalg.norm(normal),
                    velocity,
                    wall,
                )
            )

    def law(self, i: int, j: int, wall: bool) -> Any:
        """The restitution of a contact: a number or a table with its model."""
        general = self.contact.get("restitution", 1.0)
        if wall:
            general = self.contact.get("wall_restitution", general)
        return self.key("restitution", general, i, j, wall)

    def roughness(self, i: int, j: int, wall: bool) -> tuple[float, float]:
        """β and μ of a contact."""
        found = [
            self.key(name, self.contact.get(name, default), i, j, wall)
            for name, default in (("tangential_restitution", -1.0), ("friction", math.inf))
        ]
        return float(found[0]), float(found[1])

    def key(self, name: str, general: Any, i: int, j: int, wall: bool) -> Any:
        """A key of the pair, or else of the wall; `general` if neither has it."""
        other = self.walls[j].name if wall else self.name[j]
        found = self.pairs.get(frozenset((self.name[i], other)), {}).get(name)
        if found is None and wall:
            found = self.walls[j].entry.get(name)
        return general if found is None else found

    def peculiar(self, frame: Any) -> Array:
        """Velocities relative to the flow of a sheared box."""
        velocity = np.array(frame.velocity, float)
        if self.sliding is not None:
            velocity[:, self.sliding.flow] -= self.sliding.rate * frame.position[:, self.sliding.gradient]
        return velocity

    def compliance(self, k: int) -> float:
        """(1 + 1/q)/m of a particle: its part of the change of the slip by a tangential impulse."""
        assert self.inertia is not None
        return (1 + 1 / self.inertia[k]) / float(self.mass[k])

    def moments(self) -> Array | None:
        """Moments of inertia q m R² of the bodies of finite mass; None without spin."""
        if self.inertia is None:
            return None
        return (np.array(self.inertia) * self.mass * self.radius**2)[self.finite]


class Log:
    """The event log: an array for each column, kinds by name."""

    def __init__(self, events: haff.Events) -> None:
        self.time, self.i, self.j = events["time"], events["i"], events["j"]
        self.speed, self.impulse = events["approach_speed"], events["impulse"]
        self.loss, self.carnot = events["energy_loss"], events["carnot_energy"]
        self.normal, self.position = events["normal"], events["position"]
        self.kind = [events.kinds[code] for code in events["kind"]]
        # The impulse on j, or on the wall, and the part of the loss by its tangential component.
        self.vector, self.tangential = self.impulse[:, None] * self.normal, np.zeros(len(self.time))
        if "impulse_vector" in events.columns:
            self.vector = events["impulse_vector"]
        if "tangential_loss" in events.columns:
            self.tangential = events["tangential_loss"]

    def __len__(self) -> int:
        return len(self.time)

    def bodies(self, row: int) -> list[int]:
        """The particles that took part."""
        i, j = int(self.i[row]), int(self.j[row])
        return [i, j] if self.kind[row] == "collision" else [i]


def coefficient(law: Any, speed: float) -> float | None:
    """Restitution at an approach speed; None for models that are not recomputed here."""
    if not isinstance(law, dict):
        return float(law)
    if law.get("model") == "cutoff":
        slowness = min(1.0, speed / law["speed"]) ** law.get("exponent", 0.75)
        return 1 - (1 - float(law["restitution"])) * slowness
    return None


def images(scene: Scene, reach: float) -> list[Array]:
    """Shifts by whole edges under which two particles within `reach` of each other may touch."""
    spans = []
    for axis in range(3):
        edge = scene.size[axis]
        many = math.ceil(reach / edge) if scene.periodic[axis] and reach > 0.5 * edge else 0
        spans.append(range(-many, many + 1))
    return [np.array(k, float) * scene.size for k in itertools.product(*spans)]


def close_pairs(scene: Scene, position: Array, time: float = 0.0) -> Array:
    """Rows of all pairs whose nearest images may touch, `[M, 2]`; every pair where they are few."""
    count = len(position)
    if count <= 320:
        return np.stack(np.triu_indices(count, 1), axis=1)
    # A grid works for similar sizes only: particles larger than twice the median are tested with all others.
    large = np.flatnonzero(scene.radius > 2 * np.median(scene.radius))
    small = np.flatnonzero(scene.radius <= 2 * np.median(scene.radius))
    low = position.min(axis=0)
    edge = np.where(scene.periodic, scene.size, 4 * (position.max(axis=0) - low) + 8 * scene.radius.max())
    points, rows = np.mod(np.where(scene.periodic, position, position - low), edge)[small], small
    reach = 2 * scene.radius[small].max()
    if (sliding := scene.sliding) is not None:
        # The upper face of the gradient axis meets copies of the particles at the lower one.
        lower = points[:, sliding.gradient] < 1.1 * reach
        copies = points[lower]
        copies[:, sliding.gradient] += edge[sliding.gradient]
        along = copies[:, sliding.flow] + float(sliding.displacement(time))
        copies[:, sliding.flow] = np.mod(along, edge[sliding.flow])
        points, rows = np.concatenate([points, copies]), np.concatenate([small, small[lower]])
        edge = np.where(np.arange(3) == sliding.gradient, 2 * edge + 4 * reach, edge)
    near = rows[cKDTree(points, boxsize=edge).query_pairs(reach * (1 + 1e-6), output_type="ndarray")]
    pairs = [near[near[:, 0] != near[:, 1]]]
    for row, i in enumerate(large):
        rest = np.setdiff1d(np.arange(count), large[: row + 1])
        pairs.append(np.stack([np.full(len(rest), i), rest], axis=1))
    return np.concatenate(pairs)


def overlap(scene: Scene, position: Array, time: float) -> float:
    """Deepest overlap of any two particles, or of one and a wall, in contact distances; in extended precision."""
    wide = position.astype(np.longdouble)
    size = scene.size.astype(np.longdouble)
    pairs = close_pairs(scene, position, time)
    pairs = pairs[scene.finite[pairs].any(axis=1)]
    sigma = scene.radius[pairs].astype(np.longdouble).sum(axis=1)
    apart = wide[pairs[:, 1]] - wide[pairs[:, 0]]
    if scene.sliding is not None:
        apart = scene.sliding.nearest(apart, time)
    apart = np.where(scene.periodic, apart - np.rint(apart / size) * size, apart)
    depth = np.longdouble(0)
    for shift in images(scene, float(sigma.max(initial=0))):
        distance = np.sqrt(((apart + shift) ** 2).sum(axis=1))
        depth = max(depth, np.max(1 - distance / sigma, initial=0))
    movable = scene.finite
    for wall in scene.walls:
        point = wall.point.astype(np.longdouble) + wall.velocity.astype(np.longdouble) * np.longdouble(time)
        gap = (wide[movable] - point) @ wall.normal.astype(np.longdouble) / scene.radius[movable]
        depth = max(depth, np.max(1 - gap, initial=0))
    return float(depth)


def worse(a: float, b: float) -> float:
    """The larger value; NaN counts as the largest."""
    return b if not b <= a and a == a else a


def exact(terms: Any) -> float:
    """The exact sum, rounded once."""
    return math.fsum(np.ravel(terms))


def walk(events: int, scene: Scene) -> float:
    """Relative error of the sum of all energies, or momenta, by rounding: an event changes it by up to about 4 ε of the
    pair's contribution, with random sign, and a pair has two of N parts."""
    return 4 * EPS * math.sqrt(events + 1) * min(1.0, 2 / scene.finite.sum())


def audit(file: haff.File) -> list[Finding]:
    """All conditions on a run with frames and a complete event log."""
    scene = Scene(file)
    events = Log(file.events)
    frames = list(file.frames)
    position = [frame.position for frame in frames]
    velocity = [frame.velocity for frame in frames]
    logged = [events.time, events.speed, events.impulse, events.loss, events.normal, events.position]
    logged += [events.vector, events.tangential]
    findings = order_of_time(events.time, len(file))
    findings += finite_without_overlap(scene, frames, longest(scene, events, position, velocity, frames), logged)
    findings += laws(scene, events)
    findings += balances(scene, events, frames)
    findings += displaced(scene, frames)
    if not {"rest", "slide"} & set(events.kind):
        findings += flights(scene, events, frames)
    return findings


def audit_without_events(file: haff.File) -> list[Finding]:
    """Conditions on a run without event log: no overlaps, and a balance of energy with the reported losses."""
    scene = Scene(file)
    frames = list(file.frames)
    table = file.observables
    rows = np.searchsorted(table["time"], [frame.time for frame in frames])
    given = sum(sign * table[name] for name, (_, sign) in observables.balance(file).items())
    gone = (table["dissipated_energy"] - given).to_numpy()
    count = int(table["collisions"].iloc[-1] + table["wall_collisions"].iloc[-1])
    reach = max(float(np.abs(frame.position).max()) for frame in frames)
    return [
        *finite_without_overlap(scene, frames, reach),
        energy_balance(scene, frames, [[float(gone[row])] for row in rows], count),
        *displaced(scene, frames),
    ]


def displaced(scene: Scene, frames: list[Any]) -> list[Finding]:
    """The edge vectors of the frames of a sheared box, against the displacement at their times."""
    if (sliding := scene.sliding) is None:
        return []
    worst = 0.0
    for frame in frames:
        edges = np.diag(scene.size)
        edges[sliding.gradient, sliding.flow] = sliding.displacement(frame.time)
        off = np.abs(frame.box.edges - edges)
        # At half an edge rounding decides which of the two images it is.
        one = off[sliding.gradient, sliding.flow] / scene.size[sliding.flow]
        off[sliding.gradient, sliding.flow] = abs(one - round(one)) * scene.size[sliding.flow]
        rounding = EPS * (scene.size.max() + abs(sliding.speed * frame.time))
        worst = worse(worst, float(off.max() / rounding))
    return [Finding("edge vectors, off the displacement [ulp]", worst, 8)]


def finite_without_overlap(
    scene: Scene, frames: list[Any], reach: float, logged: Sequence[Array] = ()
) -> list[Finding]:
    """Numbers are finite, and no overlap exceeds rounding; `reach` is the largest coordinate or free path."""
    numbers = [*(frame.position for frame in frames), *(frame.velocity for frame in frames), *logged]
    numbers += [frame.angular_velocity for frame in frames if frame.angular_velocity is not None]
    limit = max(LEAST, 4 * np.spacing(reach) / (2 * min(scene.radius)))
    deepest = max(overlap(scene, frame.position, frame.time) for frame in frames)
    return [
        Finding("numbers that are not finite", sum((~np.isfinite(x)).sum() for x in numbers), 0),
        Finding("overlap [contact distances]", deepest, limit),
    ]


def energy_balance(scene: Scene, frames: list[Any], gone: list[list[float]], events: int) -> Finding:
    """Kinetic and potential energy of every frame from its particles, against the first frame and the energy terms
    lost since."""
    m, moment = scene.mass[scene.finite], scene.moments()

    def energies(frame: Any) -> list[float]:
        v, x = scene.peculiar(frame)[scene.finite], frame.unwrapped[scene.finite]
        found = [exact(0.5 * m[:, None] * v * v), exact(-m[:, None] * scene.gravity * x)]
        if moment is not None:
            found.append(exact(0.5 * moment[:, None] * frame.angular_velocity[scene.finite] ** 2))
        return found

    start = [-energy for energy in energies(frames[0])]
    residual = 0.0
    for frame, parts in zip(frames, gone):
        terms = [*energies(frame), *start, *parts]
        residual = worse(residual, abs(math.fsum(terms)) / max(map(abs, terms)))
    return Finding("energy, relative to the largest term", residual, LEAST + walk(events, scene))


def order_of_time(time: Array, particles: int) -> list[Finding]:
    """Times do not decrease, and advance."""
    back = float(np.max(-np.diff(time), initial=0))
    same = np.diff(np.flatnonzero(np.concatenate([[True], np.diff(time) > 0, [True]])))
    return [
        Finding("time goes back by", back, 0),
        Finding("events at one time", float(np.max(same, initial=0)), STALL + 10 * particles),
    ]


def longest(scene: Scene, events: Log, position: list[Array], velocity: list[Array], frames: list[Any]) -> float:
    """Largest coordinate or free path [length]."""
    reach = max(float(np.abs(x).max()) for x in position)
    # No flight is longer than from one event to the next, at most as fast as in any frame.
    last = np.full(len(scene.mass), float(frames[0].time))
    speed = max(float(np.linalg.norm(v, axis=1).max()) for v in velocity)
    fastest = np.max([np.linalg.norm(v, axis=1) for v in velocity], axis=0)
    path = 0.0
    for row, time in enumerate(events.time):
        for k in events.bodies(row):
            path = max(path, (time - last[k]) * min(speed, fastest[k]))
            last[k] = time
    ends = (float(frames[-1].time) - last) * np.linalg.norm(velocity[-1], axis=1)
    return max(reach, path, float(ends.max()), float(scene.size[scene.periodic].max(initial=0)))


def laws(scene: Scene, events: Log) -> list[Finding]:
    """Each event's impulse, loss and Carnot energy from its law and its approach speed, and its normal's length.

    Of rough contacts these are the normal parts; Carnot's energy is the whole, with that of the tangential impulse.
    """
    error = {
        "impulse": 0.0,
        "normal component of the impulse": 0.0,
        "loss": 0.0,
        "Carnot energy": 0.0,
        "normal's length": 0.0,
        "of what does not approach": 0.0,
    }
    last = np.full(len(scene.mass), -math.inf)
    normal = np.sum(events.vector * events.normal, axis=1)
    off = np.abs(normal - events.impulse) / np.maximum(np.linalg.norm(events.vector, axis=1), 1e-300)
    across = np.linalg.norm(events.vector - events.impulse[:, None] * events.normal, axis=1)
    columns = (
        *(events.time, events.kind, events.i, events.j, events.speed, events.impulse),
        *(events.loss - events.tangential, events.tangential, events.carnot, across, off),
    )
    for time, kind, i, j, speed, impulse, loss, tangential, carnot, sideways, skew in zip(*map(list, columns)):
        if kind not in ("collision", "wall"):
            continue
        wall = kind == "wall"
        e = coefficient(scene.law(i, j, wall), speed)
        if scene.tc > 0:
            bodies = [k for k in ((i,) if wall else (i, j)) if scene.finite[k]]
            since = min(time - last[k] for k in bodies)
            # At the limit tc, rounding decides.
            e = None if abs(since - scene.tc) < 1e-9 * scene.tc else 1.0 if since < scene.tc else e
            last[bodies] = time
        if speed <= 0:
            # Particles that touch at the instant of another impact, without approach: no effect is required.
            nothing = max(abs(speed), impulse, loss, carnot)
            error["of what does not approach"] = max(error["of what does not approach"], nothing)
            continue
        if e is None:
            continue
        inverse = 1 / scene.mass[i] + (0.0 if wall else 1 / scene.mass[j])
        energy = 0.5 * speed * speed / inverse
        rough = 0.0
        if scene.inertia is not None:
            rough = 0.5 * (scene.compliance(i) + (0.0 if wall else scene.compliance(j))) * sideways**2
        lost = (1 + e) ** 2 * energy
        error["impulse"] = worse(error["impulse"], abs(impulse * inverse / ((1 + e) * speed) - 1))
        error["normal component of the impulse"] = worse(error["normal component of the impulse"], skew)
        error["loss"] = worse(error["loss"], abs(loss - (1 - e) * (1 + e) * energy) / (energy + tangential))
        error["Carnot energy"] = worse(error["Carnot energy"], abs(carnot - lost - rough) / (lost + rough))
    error["normal's length"] = float(np.max(np.abs(np.linalg.norm(events.normal, axis=1) - 1), initial=0))
    limits = {"of what does not approach": 0.0}
    # Each is a product of a few rounded numbers.
    return [Finding(f"law: {name}", value, limits.get(name, 16 * EPS)) for name, value in error.items()]


def balances(scene: Scene, events: Log, frames: list[Any]) -> list[Finding]:
    """Energy and momentum of every frame from its particles, against the first frame and the log."""
    m = scene.mass[scene.finite]
    velocity = [scene.peculiar(frame) for frame in frames]
    outer, work = np.zeros((len(events), 3)), np.zeros(len(events))
    spins = frames[0].angular_velocity
    for row, (kind, i, j) in enumerate(zip(events.kind, events.i, events.j)):
        if kind in ("wall", "rest", "slide"):
            outer[row] = -events.vector[row]
            work[row] = outer[row] @ scene.walls[j].velocity
        elif kind == "collision" and not (scene.finite[i] and scene.finite[j]):
            driven, sign = (i, 1) if scene.finite[j] else (j, -1)
            outer[row] = sign * events.vector[row]
            surface = velocity[0][driven]
            if spins is not None:
                surface = surface + np.cross(spins[driven], sign * scene.radius[driven] * events.normal[row])
            work[row] = outer[row] @ surface
    until = [int(np.searchsorted(events.time, frame.time, side="right")) for frame in frames]
    sheared = shear_work(scene, events, frames)
    gone = [[exact(events.loss[:end]), -exact(work[:end]), -w] for end, w in zip(until, sheared)]
    # What friction takes is logged at the end of a slide: no balance in between.
    between = slides(events)
    still = [k for k, frame in enumerate(frames) if not any(start <= frame.time < end for start, end in between)]
    still = sorted({0, *still})
    findings = [energy_balance(scene, [frames[k] for k in still], [gone[k] for k in still], len(events))]
    if {"rest", "slide"} & set(events.kind):
        # Forces on grains at rest are not in the log.
        return findings
    before = [exact(m * velocity[0][scene.finite, axis]) for axis in range(3)]
    push = scale = 0.0
    for frame, v, end in zip(frames, velocity, until):
        scale = max(scale, exact(m * np.linalg.norm(v[scene.finite], axis=1)))
        for axis in range(3):
            given = [*outer[:end, axis], exact(m) * scene.gravity[axis] * (frame.time - frames[0].time)]
            if (sliding := scene.sliding) is not None and axis == sliding.flow:
                # The flow of a place that a particle goes to is faster by the rate times the way.
                given.append(-sliding.rate * before[sliding.gradient] * (frame.time - frames[0].time))
            change = exact(m * v[scene.finite, axis]) - before[axis]
            size = max(scale, exact(np.abs(outer[:end, axis])))
            push = worse(push, abs(change - exact(given)) / size) if size > 0 else push
    return [*findings, Finding("momentum, relative", push, LEAST + walk(len(events), scene))]


def shear_work(scene: Scene, events: Log, frames: list[Any]) -> list[float]:
    """Work of the shear until each frame, from the velocities relative to the flow that the logged impulses give.

    In a flight −γ̇ m ∫ c_x c_y dt, for the flow along x and its gradient along y, and in an impact −γ̇ y₁₂ J_x.
    """
    if (sliding := scene.sliding) is None:
        return [0.0] * len(frames)
    f, g, rate = sliding.flow, sliding.gradient, sliding.rate
    c, mass = scene.peculiar(frames[0]), scene.mass
    last = np.full(len(mass), float(frames[0].time))
    parts: list[float] = []
    found: list[float] = []

    def flight(bodies: Any, time: float) -> Array:
        duration = time - last[bodies]
        fall = rate * c[bodies, g] * duration
        return -mass[bodies] * fall * (c[bodies, f] - 0.5 * fall)

    row = 0
    everyone = np.arange(len(mass))
    for frame in frames:
        while row < len(events) and events.time[row] <= frame.time:
            bodies, time, impulse = events.bodies(row), float(events.time[row]), events.vector[row]
            parts += flight(bodies, time).tolist()
            c[bodies, f] -= rate * c[bodies, g] * (time - last[bodies])
            last[bodies] = time
            contact = scene.radius[bodies].sum() * events.normal[row][g]
            parts.append(float(-rate * contact * impulse[f]))
            c[bodies] += np.array([[-1.0], [1.0]]) * impulse / mass[bodies][:, None]
            row += 1
        found.append(exact([*parts, *flight(everyone, float(frame.time))]))
    return found


def slides(events: Log) -> list[tuple[float, float]]:
    """Start and end of every slide that has ended: it began at the event before of its particle."""
    last: dict[int, float] = {}
    found = []
    for row, kind in enumerate(events.kind):
        if kind == "slide":
            found.append((last.get(int(events.i[row]), -math.inf), float(events.time[row])))
        last.update(dict.fromkeys(events.bodies(row), float(events.time[row])))
    return found


def flights(scene: Scene, events: Log, frames: list[Any]) -> list[Finding]:
    """Every flight between two events of a particle: from the position of the one to that of the other, at the velocity
    that the logged impulses give it; and every approach speed from those velocities. This checks times of contact
    without chaotic amplification, since each flight starts at the recorded position of its event. Of rough contacts,
    every tangential impulse and its loss from the velocities and spins that the logged impulses give."""
    velocity = frames[0].velocity
    v = velocity.tolist()
    x = frames[0].position.tolist()
    last = [float(frames[0].time)] * len(x)
    spins = None if scene.inertia is None else Spins(scene, frames[0].angular_velocity)
    g = scene.gravity.tolist()
    size, periodic = scene.size.tolist(), scene.periodic.tolist()
    mass, radius = scene.mass.tolist(), scene.radius.tolist()
    sliding = scene.sliding
    slide = 0.0 if sliding is None else abs(sliding.speed)
    fastest = (np.linalg.norm(velocity, axis=1) + slide).tolist()
    hits = [0] * len(x)
    edge = max(size[axis] * periodic[axis] for axis in range(3))
    worst_place = worst_speed = 0.0
    columns = (events.time, events.i, events.j, events.speed, events.vector, events.normal, events.position)
    for row, (kind, time, i, j, speed, impulse, n, point) in enumerate(
        zip(events.kind, *(column.tolist() for column in columns))
    ):
        bodies = [(i, -1)] if kind == "wall" else [(i, -1), (j, 1)]
        closing = 0.0
        scale = 0.0
        # A contact is exact to the rounding of the largest coordinate in any direction.
        coordinate = max(map(abs, point)) + edge
        for k, sign in bodies:
            dt = time - last[k]
            fall = g if math.isfinite(mass[k]) else (0.0, 0.0, 0.0)
            slid = 0.0
            if sliding is not None:
                # Into the image that meets the other body; it moves with the flow.
                at = sliding.gradient
                way = point[at] + sign * radius[k] * n[at] - x[k][at] - dt * v[k][at]
                up = round(way / size[at])
                slid = up * float(sliding.displacement(time))
            for axis in range(3):
                there = point[axis] + sign * radius[k] * n[axis]
                come = x[k][axis] + dt * (v[k][axis] + 0.5 * dt * fall[axis])
                off = there - come
                if sliding is not None and axis == sliding.flow:
                    off -= slid
                    v[k][axis] += up * sliding.speed
                if periodic[axis]:
                    off -= round(off / size[axis]) * size[axis]
                # Rounding of position, path and velocity, the last of which accumulates over the events so far; the
                # rounding of the logged times moves a body by its speed.
                bound = fastest[k] * (1 + hits[k])
                ulp = EPS * (coordinate + radius[k] + bound * dt + fastest[k] * abs(time))
                worst_place = worse(worst_place, abs(off) / (ulp + 1e-300))
                x[k][axis] = there
                v[k][axis] += dt * fall[axis]
                closing -= sign * n[axis] * v[k][axis]
            last[k] = time
            scale = max(scale, fastest[k] * (1 + hits[k]))
        if kind == "wall":
            closing -= sum(a * b for a, b in zip(n, scene.walls[j].velocity))
        worst_speed = worse(worst_speed, abs(closing - speed) / (EPS * (scale + speed)))
        if spins is not None:
            other = scene.walls[j].velocity if kind == "wall" else np.array(v[j])
            spins.impact(events, row, np.array(v[i]), other, kind == "wall", scale)
        for k, sign in bodies:
            v[k] = [a + sign * b / mass[k] for a, b in zip(v[k], impulse)]
            fastest[k] = max(fastest[k], math.hypot(*v[k]) + slide)
            hits[k] += 1
    findings = [
        Finding("place of an event, off its flight [ulp]", worst_place, 16),
        Finding("approach speed, off its velocities [ulp]", worst_speed, 16),
    ]
    return findings + (spins.findings(frames[-1].angular_velocity) if spins is not None else [])


class Spins:
    """The angular velocities that the logged impulses give, and the errors of the tangential impulses."""

    def __init__(self, scene: Scene, start: Array) -> None:
        self.scene, self.now = scene, np.array(start, float)
        # Largest speed of each surface by rotation, and the rounding of the spin so far in parts of it.
        self.fastest = np.linalg.norm(start, axis=1) * scene.radius
        self.hits = np.zeros(len(start))
        self.worst = {"impulse": 0.0, "loss": 0.0}

    def impact(self, events: Log, row: int, vi: Array, vj: Array, wall: bool, scale: float) -> None:
        """Compares a row with the tangential law, and takes over its impulse; `scale` is that of the velocities."""
        scene, i, j = self.scene, int(events.i[row]), int(events.j[row])
        n, bodies = events.normal[row], [i] if wall else [i, j]
        tangential = events.vector[row] - events.impulse[row] * n
        g = vi - vj
        slip = g - (g @ n) * n - np.cross(n, sum(scene.radius[k] * self.now[k] for k in bodies))
        stiffness = sum(scene.compliance(k) for k in bodies)
        size, scale = float(np.linalg.norm(slip)), scale + sum(self.fastest[k] * (1 + self.hits[k]) for k in bodies)
        beta, friction = scene.roughness(i, j, wall)
        most = friction * float(events.impulse[row]) if math.isfinite(friction) else math.inf
        kappa = min(1 + beta, most * stiffness / size) if size > 0 else 0.0
        # With the TC model it depends on the time since the last contact whether a contact is dissipative.
        if scene.tc == 0:
            off = float(np.linalg.norm(tangential * stiffness - kappa * slip)) / (EPS * scale)
            self.worst["impulse"] = worse(self.worst["impulse"], off)
            off = abs(float(events.tangential[row]) * stiffness - 0.5 * kappa * (2 - kappa) * size**2)
            self.worst["loss"] = worse(self.worst["loss"], off / (EPS * scale * (size + EPS * scale)))
        for k in bodies:
            if scene.finite[k]:
                assert scene.inertia is not None
                self.now[k] -= np.cross(n, tangential) / (scene.inertia[k] * scene.mass[k] * scene.radius[k])
                self.fastest[k] = max(self.fastest[k], np.linalg.norm(self.now[k]) * scene.radius[k])
                self.hits[k] += 1

    def findings(self, end: Array) -> list[Finding]:
        """The worst cases, with the angular velocities of the last frame."""
        radius = self.scene.radius
        off = np.linalg.norm(self.now - end, axis=1) * radius / (EPS * (self.fastest * (1 + self.hits) + 1e-300))
        return [
            Finding("tangential impulse, off its slip [ulp]", self.worst["impulse"], 16),
            Finding("tangential loss, off its slip [ulp]", self.worst["loss"], 32),
            Finding("spin in the end, off its impulses [ulp]", float(off.max()), 16),
        ]
