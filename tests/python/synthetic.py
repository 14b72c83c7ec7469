"""Small H5MD files in the layout that `haff run` writes, made from closed forms without the simulator.

Their contents are known exactly, so the reader, the analysis and the figures can be checked against them.
"""

from __future__ import annotations

import math
from pathlib import Path

import h5py
import numpy as np

from haff import mechanics, theory

KINDS = {"collision": 0, "wall": 1, "rest": 2, "slide": 10}


def write(
    path: Path,
    *,
    scene: str,
    size,
    boundary,
    mass,
    radius,
    species,
    inertia=None,
    frames: dict[str, np.ndarray] | None = None,
    observables: dict[str, np.ndarray] | None = None,
    events: dict[str, np.ndarray] | None = None,
) -> Path:
    """Writes one file. `frames`: time, step, position, velocity, image; the other tables by their names.

    With spin, `inertia` and `frames["angular_velocity"]` are there, too.
    """
    with h5py.File(path, "w", libver=("earliest", "v108")) as f:
        meta = f.create_group("h5md")
        meta.attrs["version"] = np.array([1, 1], np.int32)
        meta.create_group("author").attrs["name"] = "synthetic"
        creator = meta.create_group("creator")
        creator.attrs["name"] = "haff"
        creator.attrs["version"] = "0"
        everything = f.create_group("particles/all")
        box = everything.create_group("box")
        box.attrs["dimension"] = np.int32(3)
        box.attrs["boundary"] = np.array([b.encode() for b in boundary], "S8")
        everything["mass"] = np.asarray(mass, float)
        everything["radius"] = np.asarray(radius, float)
        if inertia is not None:
            everything["inertia"] = np.asarray(inertia, float)
        everything["species"] = np.asarray(species, np.uint32)
        everything["id"] = np.arange(len(mass), dtype=np.uint32)
        if frames is not None:
            count = len(frames["time"])
            for name in (name for name in frames if name not in ("time", "step")):
                element = everything.create_group(name)
                element.create_dataset("value", data=frames[name], maxshape=(None, *frames[name].shape[1:]))
                if name == "position":
                    element.create_dataset("step", data=np.asarray(frames["step"], np.int64), maxshape=(None,))
                    element.create_dataset("time", data=np.asarray(frames["time"], float), maxshape=(None,))
                else:
                    element["step"], element["time"] = everything["position/step"], everything["position/time"]
            edges = box.create_group("edges")
            edges["value"] = np.tile(np.asarray(size, float), (count, 1))
            edges["step"], edges["time"] = everything["position/step"], everything["position/time"]
        if observables is not None:
            group = f.create_group("observables")
            step = group.create_dataset("kinetic_energy/step", data=np.asarray(observables["step"], np.int64))
            time = group.create_dataset("kinetic_energy/time", data=np.asarray(observables["time"], float))
            for name, values in observables.items():
                if name in ("step", "time"):
                    continue
                element = group.require_group(name)
                element["value"] = values
                if name != "kinetic_energy":
                    element["step"], element["time"] = step, time
        if events is not None:
            group = f.create_group("events")
            for name, values in events.items():
                dtype = h5py.enum_dtype(KINDS, basetype="u1") if name == "kind" else values.dtype
                group.create_dataset(name, data=values, dtype=dtype, maxshape=(None, *values.shape[1:]), chunks=True)
        parameters = f.create_group("parameters")
        parameters["scene"] = scene
        parameters["seed"] = np.uint64(0)
        parameters["dimension"] = np.uint32(3 if "dimension = 2" not in scene else 2)
        parameters["box_size"] = np.asarray(size, float)
    return path


def draw_velocities(rng: np.random.Generator, n: int, d: int, a2: float) -> np.ndarray:
    """[n, 3] velocities of unit temperature and mass at zero momentum with Sonine coefficient a2."""
    kept = np.empty((0, d))
    while len(kept) < n:
        v = rng.normal(size=(2 * n, d))
        weight = 1 + a2 * theory.sonine_polynomial(np.sum(v**2, axis=1) / 2, d)
        kept = np.concatenate([kept, v[rng.random(2 * n) * 3 < np.clip(weight, 0, 3)]])
    v = kept[:n] - kept[:n].mean(axis=0)
    v /= math.sqrt(np.mean(np.sum(v**2, axis=1)) / d)
    return np.pad(v, ((0, 0), (0, 3 - d)))


def jittered_lattice(rng: np.random.Generator, n: int, length: float, d: int, sigma: float) -> np.ndarray:
    """[n, 3] positions on a simple lattice, moved at random without overlap."""
    cells = math.ceil(n ** (1 / d) - 1e-9)
    spacing = length / cells
    sites = np.stack(np.meshgrid(*[np.arange(cells)] * d, indexing="ij"), axis=-1).reshape(-1, d)[:n]
    room = max(0.0, (spacing - sigma) / 2 * 0.999)
    points = (sites + 0.5) * spacing + rng.uniform(-room, room, (n, d))
    return np.pad(points, ((0, 0), (0, 3 - d)))


def cooling_gas(
    path: Path,
    *,
    n: int = 2000,
    e: float = 0.9,
    eta: float = 0.05,
    d: int = 3,
    frames: int = 8,
    samples: int = 60,
    collisions: int = 20_000,
    until_taus: float = 20.0,
    seed: int = 1,
    events: bool = True,
    beta: float | None = None,
) -> Path:
    """A gas that follows Haff's law exactly, with van Noije–Ernst velocities and exponential losses.

    With `beta` its contacts are rough, and its temperatures have the ratio of theory all the time.
    """
    rng = np.random.default_rng(seed)
    density = float(theory.number_density(eta, 1.0, d))
    length = (n / density) ** (1 / d)
    a2 = float(theory.sonine_a2(e, d)) if e < 1 else 0.0
    omega = float(theory.collision_frequency(density, 1.0, 1.0, 1.0, theory.contact_value(eta, d), d))
    tau = float(theory.haff_time(e, omega, d, a2)) if e < 1 else 100 / omega
    q, axes_of_rotation, ratio = (0.4, 3, 0.0) if d == 3 else (0.5, 1, 0.0)
    if beta is not None:
        ratio = float(theory.rough_temperature_ratio(e, beta, q, d))
        tau = float(2 * d / (omega * theory.rough_losses(1.0, ratio, e, beta, q, d).translational))
    end = until_taus * tau
    temperature = (lambda t: theory.haff_temperature(t, 1.0, tau)) if e < 1 else (lambda t: np.ones_like(t))
    elapsed = (lambda t: tau * np.log1p(t / tau)) if e < 1 else (lambda t: np.asarray(t, float))
    total = n * omega / 2 * elapsed(end)
    counted = lambda t: np.floor(n * omega / 2 * elapsed(np.asarray(t, float)) + 1e-9).astype(np.int64)  # noqa: E731

    frame_time = np.concatenate([[0.0], np.geomspace(0.3 * tau, end, frames - 1)])
    position = np.stack([jittered_lattice(rng, n, length, d, 1.0) for _ in frame_time])
    velocity = np.stack(
        [draw_velocities(rng, n, d, a2 if t > 0 else 0.0) * math.sqrt(float(temperature(t))) for t in frame_time]
    )
    image = rng.integers(-2, 3, position.shape).astype(np.int32)
    image[..., d:] = 0

    time = np.unique(np.concatenate([[0.0], np.geomspace(0.01 * tau, end, samples), frame_time]))
    T = temperature(time)
    kinetic, rotational = d * n / 2 * T, axes_of_rotation * n / 2 * ratio * T
    both = kinetic + rotational
    pressure = density * T * theory.compressibility(eta, e, d)
    pressure[0] = np.nan
    rate = np.concatenate([[np.nan], np.diff(counted(time)) / np.diff(time)])
    observables = {
        "time": time,
        "step": counted(time),
        "kinetic_energy": kinetic,
        "potential_energy": np.zeros_like(T),
        "dissipated_energy": both[0] - both,
        "carnot_energy": (both[0] - both) * (1 + e) / max(1 - e, 1e-12),
        "wall_work": np.zeros_like(T),
        "ledger_residual": np.concatenate([[0.0], rng.normal(0, 3e-16, len(T) - 1)]),
        "temperature": T,
        "species_temperature": T[:, None],
        "sonine_a2": np.where(time > tau / 5, a2, 0.0) + rng.normal(0, 2 / math.sqrt(n), len(T)),
        "pressure": pressure,
        "momentum": rng.normal(0, 1e-13, (len(T), 3)),
        "external_impulse": np.zeros((len(T), 3)),
        "collisions": counted(time),
        "wall_collisions": np.zeros(len(T), np.int64),
        "collision_rate": rate,
        "mean_free_time": n / (2 * np.maximum(rate, 1e-300)),
    }
    log, spins, inertia = None, {}, None
    if beta is not None:
        observables["rotational_energy"] = rotational
        observables["rotational_temperature"] = ratio * T
        observables["species_rotational_temperature"] = ratio * T[:, None]
        inertia = np.full(n, q)
        spin = rng.normal(size=(len(frame_time), n, 3)) * ([1, 1, 1] if d == 3 else [0, 0, 1])
        # I = q/4, for mass 1 and radius 1/2.
        now = q / 4 * np.sum(spin**2, axis=(1, 2)) / (axes_of_rotation * n)
        spins["angular_velocity"] = spin * np.sqrt(ratio * temperature(frame_time) / now)[:, None, None]
    if events:
        s = np.sort(rng.random(collisions)) * elapsed(end)
        when = tau * np.expm1(s / tau) if e < 1 else s
        T_event = temperature(when)
        mu = 0.5
        energy = rng.exponential(size=collisions) * T_event
        speed = np.sqrt(2 * energy / mu)
        normal = rng.normal(size=(collisions, d))
        normal = np.pad(normal / np.linalg.norm(normal, axis=1)[:, None], ((0, 0), (0, 3 - d)))
        i = rng.integers(0, n - 1, collisions)
        log = {
            "time": when,
            "kind": np.zeros(collisions, np.uint8),
            "i": i.astype(np.uint32),
            "j": (i + 1).astype(np.uint32),
            "approach_speed": speed,
            "impulse": (1 + e) * mu * speed,
            "energy_loss": energy * (1 - e * e),
            "carnot_energy": energy * (1 + e) ** 2,
            "normal": normal,
            "position": np.pad(rng.random((collisions, d)) * length, ((0, 0), (0, 3 - d))),
        }
        if beta is not None:
            _roughen(log, rng, beta, q, d, 2 * T_event * (1 + ratio / q))
    assert total > 0
    size = [length, length, length if d == 3 else 1.0]
    axes = '["periodic", "periodic", "periodic"]'
    scene = f"""schema = 1
title = "Synthetic {"cooling" if e < 1 else "elastic"} gas"
seed = {seed}
dimension = {d}

[domain]
size = [{size[0]!r}, {size[1]!r}, {size[2]!r}]
boundary = {axes}

[[species]]
name = "grain"
count = {n}
radius = 0.5
mass = 1.0

[contact]
restitution = {e}
"""
    if beta is not None:
        scene += f"tangential_restitution = {beta}\n"
    return write(
        path,
        scene=scene,
        size=size,
        boundary=["periodic", "periodic", "periodic" if d == 3 else "none"],
        mass=np.ones(n),
        radius=np.full(n, 0.5),
        species=np.zeros(n),
        inertia=inertia,
        frames={
            "time": frame_time,
            "step": counted(frame_time),
            "position": position,
            "velocity": velocity,
            "image": image,
            **spins,
        },
        observables=observables,
        events=log,
    )


def _roughen(log: dict[str, np.ndarray], rng: np.random.Generator, beta: float, q: float, d: int, variance) -> None:
    """Gives collisions of equal spheres of mass 1 slips of this variance per component, with impulses and losses."""
    n = log["normal"]
    across = rng.normal(size=n.shape) * ([1, 1, 1] if d == 3 else [1, 1, 0])
    across -= np.sum(across * n, axis=1)[:, None] * n
    slip = across * np.sqrt(variance)[:, None]
    stiffness = 2 * (1 + 1 / q)
    square = np.sum(slip**2, axis=1) / stiffness
    log["impulse_vector"] = log["impulse"][:, None] * n + (1 + beta) / stiffness * slip
    log["tangential_loss"] = 0.5 * (1 - beta**2) * square
    log["energy_loss"] = log["energy_loss"] + log["tangential_loss"]
    log["carnot_energy"] = log["carnot_energy"] + 0.5 * (1 + beta) ** 2 * square


def rough_impacts(path: Path) -> Path:
    """Two rough spheres without gravity: one hits the other, and both hit a floor with friction, exactly."""
    mass, radius, q = np.array([1.0, 2.0]), np.array([0.5, 0.7]), np.array([0.4, 0.3])
    x = np.array([[5.0, 5.0, 4.0], [5.4, 5.2, 2.0]])
    v = np.array([[0.3, 0.0, -1.0], [0.0, 0.1, -0.5]])
    w = np.array([[1.0, -2.0, 0.5], [-0.5, 0.3, 2.0]])
    # e, β and μ of the two with each other, and with the floor.
    pair, floor = (0.8, 0.4, np.inf), (0.6, 0.2, 0.15)
    down, rows, now, frames = np.array([0.0, 0.0, -1.0]), [], 0.0, []
    end = 6.0
    while True:
        r, u = x[1] - x[0], v[1] - v[0]
        b, square = r @ u, (r @ u) ** 2 - (u @ u) * (r @ r - radius.sum() ** 2)
        times = {"collision": (r @ r - radius.sum() ** 2) / (-b + math.sqrt(square)) if b < 0 <= square else math.inf}
        times |= {k: (x[k, 2] - radius[k]) / -v[k, 2] if v[k, 2] < 0 else math.inf for k in (0, 1)}
        first = min(times, key=times.__getitem__)
        until = min(now + times[first], end)
        while len(frames) < 7 and len(frames) * end / 6 <= until:
            at = len(frames) * end / 6
            frames.append((at, len(rows), x + v * (at - now), v.copy(), w.copy()))
        if now + times[first] >= end:
            break
        x, now = x + v * times[first], now + times[first]
        if first == "collision":
            n = (x[1] - x[0]) / radius.sum()
            hit = mechanics.rough_impact(*mass, *v, *w, n, *pair, tuple(radius), tuple(q))
            v, w = (
                np.array([hit.velocity_1, hit.velocity_2]),
                np.array([hit.angular_velocity_1, hit.angular_velocity_2]),
            )
            rows.append((now, 0, 0, 1, hit, n, x[0] + radius[0] * n))
        else:
            k, n, still = int(first), down, np.zeros(3)
            hit = mechanics.rough_impact(
                mass[k], np.inf, v[k], still, w[k], still, n, *floor, (radius[k], 0.0), (q[k], 1.0)
            )
            v[k], w[k] = hit.velocity_1, hit.angular_velocity_1
            rows.append((now, 1, k, 0, hit, n, x[k] + radius[k] * n))
    time, kind, i, j, hits, normal, position = map(list, zip(*rows))
    events = {
        "time": np.array(time),
        "kind": np.array(kind, np.uint8),
        "i": np.array(i, np.uint32),
        "j": np.array(j, np.uint32),
        "approach_speed": np.array([hit.approach_speed for hit in hits]),
        "impulse": np.array([hit.impulse @ n for hit, n in zip(hits, normal)]),
        "energy_loss": np.array([hit.energy_loss for hit in hits]),
        "carnot_energy": np.array([hit.carnot_energy for hit in hits]),
        "normal": np.array(normal),
        "position": np.array(position),
        "impulse_vector": np.array([hit.impulse for hit in hits]),
        "tangential_loss": np.array([hit.tangential_loss for hit in hits]),
    }
    time, step, position, velocity, spin = (np.array(column) for column in zip(*frames))
    kinetic = np.sum(0.5 * mass[:, None] * velocity**2, axis=(1, 2))
    rotational = np.sum(0.5 * (q * mass * radius**2)[:, None] * spin**2, axis=(1, 2))
    zero = np.zeros_like(time)
    observables = {
        "time": time,
        "step": step,
        "kinetic_energy": kinetic,
        "rotational_energy": rotational,
        "potential_energy": zero,
        "dissipated_energy": np.array([events["energy_loss"][:k].sum() for k in step]),
        "carnot_energy": np.array([events["carnot_energy"][:k].sum() for k in step]),
        "wall_work": zero,
        "ledger_residual": zero,
        "temperature": zero,
        "rotational_temperature": rotational / 3,
        "momentum": np.sum(mass[:, None] * velocity, axis=1),
        "collisions": np.array([kind[:k].count(0) for k in step]),
        "wall_collisions": np.array([kind[:k].count(1) for k in step]),
    }
    particles = "".join(
        f"""
[[particle]]
name = "{name}"
position = {x.tolist()}
velocity = {v.tolist()}
angular_velocity = {w.tolist()}
inertia = {q}
radius = {radius}
mass = {mass}
"""
        for name, x, v, w, q, radius, mass in zip(
            ("ball", "stone"), position[0], velocity[0], spin[0], q.tolist(), radius.tolist(), mass.tolist()
        )
    )
    scene = f"""schema = 1
title = "Synthetic rough impacts"

[domain]
size = [10.0, 10.0, 10.0]
boundary = ["open", "open", "open"]
{particles}
[contact]
restitution = {pair[0]}
tangential_restitution = {pair[1]}

[[wall]]
name = "floor"
plane = {{ point = [0, 0, 0], normal = [0, 0, 1] }}
restitution = {floor[0]}
tangential_restitution = {floor[1]}
friction = {floor[2]}
"""
    return write(
        path,
        scene=scene,
        size=[10.0, 10.0, 10.0],
        boundary=["none"] * 3,
        mass=mass,
        radius=radius,
        species=[0, 1],
        inertia=q,
        frames={
            "time": time,
            "step": step,
            "position": position,
            "velocity": velocity,
            "image": np.zeros_like(position, np.int32),
            "angular_velocity": spin,
        },
        observables=observables,
        events=events,
    )


def sliding_ball(path: Path, *, v: float = 7.0, friction: float = 0.3, g: float = 9.81, samples: int = 13) -> Path:
    """A ball without spin that slides on a floor with friction, and rolls from 2v/(7μg) on."""
    radius, q, until = 0.5, 0.4, 2 * v / (7 * friction * g)
    time = np.linspace(0, 2 * until, samples)
    slides = np.minimum(time, until)
    speed = v - friction * g * slides
    spin = friction * g * slides / (q * radius)
    place = 1.0 + v * slides - friction * g * slides**2 / 2 + speed * (time - slides)
    lost = friction * g * (v * slides - friction * g * (1 + 1 / q) * slides**2 / 2)
    vectors = lambda k, values: np.eye(3)[k] * values[:, None, None]  # noqa: E731
    position = np.add(vectors(0, place), [0.0, 5.0, radius])
    zero, count = np.zeros_like(time), np.ones(samples, np.int64)
    # Neither a row at the start nor one at the end has a normal impulse.
    log = {
        name: np.zeros(2) for name in ("approach_speed", "impulse", "energy_loss", "carnot_energy", "tangential_loss")
    }
    log["energy_loss"][1] = log["tangential_loss"][1] = lost[-1]
    log |= {"time": np.array([0.0, until]), "kind": np.array([KINDS["rest"], KINDS["slide"]], np.uint8)}
    log |= {"i": np.zeros(2, np.uint32), "j": np.zeros(2, np.uint32), "normal": np.tile([0.0, 0.0, -1.0], (2, 1))}
    log["impulse_vector"] = np.array([[0.0, 0.0, 0.0], [friction * g * until, 0.0, 0.0]])
    log["position"] = np.array([[1.0, 5.0, 0.0], [1.0 + v * until - friction * g * until**2 / 2, 5.0, 0.0]])
    scene = f"""schema = 1
title = "Synthetic sliding ball"

[domain]
size = [10.0, 10.0, 10.0]
boundary = ["open", "open", "wall"]
gravity = [0.0, 0.0, {-g}]

[[particle]]
name = "ball"
position = [1.0, 5.0, {radius}]
velocity = [{v}, 0.0, 0.0]
radius = {radius}
mass = 1.0

[contact]
restitution = 0.5
tangential_restitution = 0.0
friction = {friction}
"""
    return write(
        path,
        scene=scene,
        size=[10.0, 10.0, 10.0],
        boundary=["none"] * 3,
        mass=[1.0],
        radius=[radius],
        species=[0],
        inertia=[q],
        frames={
            "time": time,
            "step": count,
            "position": position,
            "velocity": vectors(0, speed),
            "image": np.zeros_like(position, np.int32),
            "angular_velocity": vectors(1, spin),
        },
        observables={
            "time": time,
            "step": count,
            "kinetic_energy": speed**2 / 2,
            "rotational_energy": q * radius**2 * spin**2 / 2,
            "potential_energy": np.full(samples, g * radius),
            "dissipated_energy": lost,
            "carnot_energy": zero,
            "wall_work": zero,
            "ledger_residual": zero,
            "temperature": zero,
            "rotational_temperature": q * radius**2 * spin**2 / 3,
            "momentum": vectors(0, speed)[:, 0],
            "collisions": np.zeros(samples, np.int64),
            "wall_collisions": count,
        },
        events=log,
    )


def bouncing_ball(path: Path, *, e: float = 0.7, height: float = 2.0, g: float = 9.81, bounces: int = 40) -> Path:
    """A ball of radius 0.5 dropped on a floor from clear height `height`: exact series, then rest."""
    impact = math.sqrt(2 * g * height)
    fall = math.sqrt(2 * height / g)
    hit = fall + np.concatenate([[0.0], np.cumsum(2 * fall * e ** np.arange(1, bounces))])
    speed = impact * e ** np.arange(bounces)
    end = fall * (1 + e) / (1 - e)

    def state(t: float) -> tuple[float, float]:
        if t >= end:
            return 0.5, 0.0
        k = int(np.searchsorted(hit, t, side="right")) - 1
        if k < 0:
            return 0.5 + height - g * t * t / 2, -g * t
        up, dt = e * speed[k], t - hit[k]
        return 0.5 + max(0.0, up * dt - g * dt * dt / 2), up - g * dt

    time = np.linspace(0, 1.2 * end, 25)
    states = np.array([state(t) for t in time])
    position = np.zeros((len(time), 1, 3))
    position[:, 0, :2], position[:, 0, 2] = 5.0, states[:, 0]
    velocity = np.zeros_like(position)
    velocity[:, 0, 2] = states[:, 1]
    kinetic, potential = states[:, 1] ** 2 / 2, g * states[:, 0]
    total = kinetic[0] + potential[0]
    loss = speed**2 / 2 * (1 - e * e)
    done = np.searchsorted(hit, time, side="right")
    rest_loss = total - g * 0.5 - loss.sum()
    lost = np.array([loss[:k].sum() for k in done]) + np.where(time >= end, rest_loss, 0.0)
    count = bounces + 1
    column = lambda wall, rest: np.append(wall, rest)  # noqa: E731
    events = {
        "time": column(hit, end),
        "kind": np.append(np.full(bounces, 1, np.uint8), np.uint8(2)),
        "i": np.zeros(count, np.uint32),
        "j": np.zeros(count, np.uint32),
        "approach_speed": column(speed, speed[-1] * e),
        "impulse": column((1 + e) * speed, (1 + e) * speed[-1] * e / (1 - e)),
        "energy_loss": column(loss, rest_loss),
        "carnot_energy": column(speed**2 / 2 * (1 + e) ** 2, 0.0),
        "normal": np.tile([0.0, 0.0, -1.0], (count, 1)),
        "position": np.tile([5.0, 5.0, 0.0], (count, 1)),
    }
    observables = {
        "time": time,
        "step": done,
        "kinetic_energy": kinetic,
        "potential_energy": potential,
        "dissipated_energy": lost,
        "carnot_energy": np.zeros_like(time),
        "wall_work": np.zeros_like(time),
        "ledger_residual": np.zeros_like(time),
        "temperature": np.zeros_like(time),
        "momentum": velocity[:, 0],
        "collisions": np.zeros(len(time), np.int64),
        "wall_collisions": done,
    }
    scene = f"""schema = 1
title = "Synthetic bouncing ball"

[domain]
size = [10.0, 10.0, 10.0]
boundary = ["open", "open", "wall"]
gravity = [0.0, 0.0, {-g}]

[[particle]]
name = "ball"
position = [5.0, 5.0, {0.5 + height}]
radius = 0.5
mass = 1.0

[contact]
restitution = {e}
"""
    return write(
        path,
        scene=scene,
        size=[10.0, 10.0, 10.0],
        boundary=["none", "none", "none"],
        mass=[1.0],
        radius=[0.5],
        species=[0],
        frames={
            "time": time,
            "step": done,
            "position": position,
            "velocity": velocity,
            "image": np.zeros_like(position, np.int32),
        },
        observables=observables,
        events=events,
    )


def truncate(path: Path, dataset: str, rows: int) -> None:
    """Shortens one dataset, as a run killed between two writes leaves it."""
    with h5py.File(path, "r+") as f:
        f[dataset].resize(rows, axis=0)


def sheared_flights(
    path: Path, position, velocity, times, *, rate: float, edge: float = 10.0, offset: float = 0.0, d: int = 3
) -> Path:
    """Spheres of radius ½ that fly freely in a sheared cube, exactly: flow along x, gradient along y.

    `position`, `velocity`: [N, 3] at time 0, where the mean velocity would be `rate` · y.
    """
    times, count = np.asarray(times, float), len(position)
    where = np.asarray(position, float) + times[:, None, None] * np.asarray(velocity, float)
    slid = offset + rate * edge * times
    slid -= np.round(slid / edge) * edge
    rows = np.floor(where[..., 1] / edge)
    where[..., 0] -= rows * slid[:, None]
    image = np.floor(where / edge) * (np.arange(3) < d)
    moves = np.repeat(np.asarray(velocity, float)[None], len(times), axis=0)
    moves[..., 0] -= rows * rate * edge
    size = [edge, edge, edge if d == 3 else 1.0]
    scene = f"""schema = 1
title = "Free flights in shear"
dimension = {d}

[domain]
size = {size}
boundary = ["periodic", "periodic", "periodic"]
shear = {{ flow = "x", gradient = "y", rate = {rate}, offset = {offset} }}

[[species]]
name = "grain"
count = {count}
radius = 0.5
mass = 1.0
"""
    write(
        path, scene=scene, size=size, boundary=["periodic", "periodic", "periodic" if d == 3 else "none"],
        mass=np.ones(count), radius=np.full(count, 0.5), species=np.zeros(count),
        frames={"time": times, "step": np.arange(len(times)), "position": where - image * edge, "velocity": moves,
                "image": image.astype(np.int32)},
    )  # fmt: skip
    edges = np.tile(np.diag(size), (len(times), 1, 1))
    edges[:, 1, 0] = slid
    with h5py.File(path, "r+") as file:
        del file["particles/all/box/edges/value"]
        file["particles/all/box/edges/value"] = edges
    return path


def grown(
    path: Path, position, radius, size, *, species=None, pressures=(20.0, 200.0, 1e4, 1e6), boundary="ppp", d: int = 3
) -> Path:
    """A run of growth that ends with these particles, as `haff pack` writes it: radii are constant, the box shrinks.

    `size`: edges at the end; `pressures`: reduced pressures at the later frames, by p = d/(1 − φ/φ_J), the last one
    with the box at the end. Samples have the mean over the interval before them, at a constant rate of φ. Particles
    keep their places relative to the box. Masses are 1, and so is the temperature.
    """
    position, size, n = np.asarray(position, float), np.asarray(size, float), len(position)
    radius = np.broadcast_to(np.asarray(radius, float), n)
    p = np.array(pressures, float)
    volume = float(np.sum(np.pi * radius**2 * (1 if d == 2 else 4 / 3 * radius)))
    final = volume / float(np.prod(size[:d]))
    jam = final / (1 - d / p[-1])
    phi = np.concatenate([[jam / 3], jam * (1 - d / p)])
    away = np.concatenate([[2 / 3], d / p])
    mean = d * np.log(away[:-1] / away[1:]) / -np.diff(away)
    edges = np.where(np.arange(3) < d, size * (final / phi)[:, None] ** (1 / d), 1.0)
    edges[-1, :d] = size[:d]
    place = np.zeros((n, 3))
    place[:, :d] = position[:, :d] / size[:d]
    where = place * edges[:, None]
    where[-1, :, :d] = position[:, :d]
    time, zero = np.arange(len(phi), dtype=float), np.zeros(len(phi))
    velocity = np.where(np.arange(3) < d, np.random.default_rng(0).normal(size=(n, 3)), 0.0)
    velocity -= velocity.mean(axis=0)
    velocity *= math.sqrt(d * n / np.sum(velocity**2))
    box_volume = np.prod(edges[:, :d], axis=1)
    kinds = np.zeros(n, int) if species is None else np.asarray(species).astype(int)
    sides = [{"p": "periodic", "w": "wall"}[side] for side in boundary[:d]]
    scene = f'schema = 1\ntitle = "Grown"\nseed = 7\ndimension = {d}\n\n[domain]\nsize = {edges[0, :d].tolist()}\n'
    scene += f"boundary = {sides}\n\n[growth]\nrate = 0.01\n"
    for kind in np.unique(kinds):
        own = radius[kinds == kind]
        law = repr(float(own[0])) if np.ptp(own) == 0 else f"{{ uniform = [{own.min()!r}, {own.max()!r}] }}"
        law = law.replace("np.float64(", "").replace(")", "")
        scene += f'\n[[species]]\nname = "grain {kind}"\ncount = {len(own)}\nradius = {law}\nmass = 1.0\n'
    write(
        path, scene=scene, size=edges[0],
        boundary=["periodic" if side == "periodic" else "none" for side in sides] + ["none"] * (3 - d),
        mass=np.ones(n), radius=radius, species=kinds,
        frames={"time": time, "step": 1000 * np.arange(len(phi)), "position": where,
                "velocity": np.tile(velocity, (len(phi), 1, 1)), "image": np.zeros(where.shape, np.int32)},
        observables={"time": time, "step": 1000 * np.arange(len(phi)), "kinetic_energy": zero + d * n / 2,
                     "temperature": zero + 1.0, "pressure": np.concatenate([[np.nan], mean * n / box_volume[1:]]),
                     "packing_fraction": phi, "box_volume": box_volume,
                     "collisions": 1000 * np.arange(len(phi))},
    )  # fmt: skip
    with h5py.File(path, "r+") as file:
        file["particles/all/box/edges/value"][:] = edges
        file["parameters/summary"] = '{"stopped": "jammed", "collisions": 4000}'
        file["parameters/seed"][()] = 7
    return path
