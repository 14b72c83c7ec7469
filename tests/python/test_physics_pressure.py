"""Temperatures, pressures, forces and works of samples against frames and event logs, replayed in NumPy."""

from __future__ import annotations

import json
import math

import h5py
import numpy as np
import pytest

import haff
from haff import analysis
from replay import Replay


def random_scene(seed: int) -> tuple[dict, tuple[bool, ...]]:
    """A random scene of a few particles, and the axes on which momentum is conserved."""
    rng = np.random.default_rng(seed)
    d = int(rng.integers(2, 4))
    size = rng.uniform(6, 9, d).round(3)
    boundary = [str(rng.choice(["periodic", "wall"])) for _ in range(d)]
    scene: dict = {"dimension": d, "seed": seed, "title": f"random {seed}", "contact": {"restitution": 0.9}}
    conserved = [side == "periodic" for side in boundary]
    domain = scene["domain"] = {"size": size.tolist(), "boundary": boundary}
    walls: list[dict] = []
    floor = next((k for k in range(d) if boundary[k] == "wall"), None)
    feature = str(rng.choice(["none", "shear", "gravity", "fixed", "piston", "sine", "thermal", "oblique"]))
    if feature == "shear":
        domain["boundary"] = ["periodic"] * d
        flow, gradient = (int(k) for k in rng.permutation(d)[:2])
        domain["shear"] = {"flow": "xyz"[flow], "gradient": "xyz"[gradient], "rate": 0.5}
        conserved = [k not in (flow, gradient) for k in range(d)]
    elif floor is not None and feature != "fixed":
        name, last = "xyz"[floor], f"{'xyz'[floor]}+"
        if feature == "gravity":
            domain["gravity"] = np.where(np.arange(d) == floor, -0.6, 0.0).tolist()
            # Elastic, so that no grain comes to rest.
            scene["contact"]["wall_restitution"] = 1.0
        elif feature == "piston":
            along = (np.arange(d) == floor).astype(float)
            plane = {"point": (along * size).tolist(), "normal": (-along).tolist()}
            walls.append({"name": "piston", "plane": plane, "velocity": (-0.1 * along).tolist()})
        elif feature == "sine":
            motion = {"kind": "sine", "amplitude": 0.1, "frequency": 0.7, "phase": 0.4}
            walls.append({"name": f"{name}-", "motion": motion, "restitution": 1.0})
        elif feature == "thermal":
            walls.append({"name": last, "temperature": 1.5})
            conserved = [False] * d
        elif feature == "oblique" and boundary[:2] == ["wall", "wall"]:
            plane = {"point": [size[0], 0.7 * size[1]] + [0] * (d - 2), "normal": [-1, -1] + [0] * (d - 2)}
            walls.append({"name": "oblique", "plane": plane, "restitution": 0.95})
    if walls:
        scene["wall"] = walls
    # A common velocity: particles one by one, and species beside them.
    common = rng.uniform(-0.7, 0.7, d)
    count = int(rng.integers(1, 9))
    low = size * 0.12
    spots = [low + np.array(at) * (size - 2 * low) for at in _spots(rng, count, d)]
    particles = []
    for k, spot in enumerate(spots):
        velocity = common + rng.normal(size=d)
        if "shear" in domain:
            velocity[flow_axis(domain)] += 0.5 * spot[gradient_axis(domain)]
        radius, mass = rng.uniform(0.3, 0.5), rng.uniform(0.5, 3.0)
        entry = {
            "name": f"p{k % 2}",
            "position": spot.tolist(),
            "velocity": velocity.tolist(),
            "radius": radius,
            "mass": mass,
        }
        particles.append(entry)
    if feature == "fixed":
        particles[0] |= {"mass": math.inf, "velocity": [0.0] * d, "name": "fixed"}
        if count > 1:
            conserved = [False] * d
        else:
            particles[0]["mass"] = 1.0
    if feature == "oblique" and any(wall["name"] == "oblique" for wall in walls):
        particles = [p for p in particles if sum(p["position"][:2]) < size[0] + 0.7 * size[1] - 1.0] or [
            particles[0] | {"position": low.tolist()}
        ]
    scene["particle"] = particles
    scene["measure"] = {"stress": True, "wall_forces": bool(walls) or "wall" in domain["boundary"]}
    scene["run"] = {"until": 15.0}
    scene["output"] = {"frames": 2.3, "observables": 0.7, "events": True}
    return scene, tuple(conserved)


def _spots(rng: np.random.Generator, count: int, d: int) -> np.ndarray:
    """Places on a grid of four cells a side, as fractions."""
    chosen = rng.choice(4**d, count, replace=False)
    return np.stack(np.unravel_index(chosen, (4,) * d), axis=1) / 3


def flow_axis(domain: dict) -> int:
    return "xyz".index(domain["shear"]["flow"])


def gradient_axis(domain: dict) -> int:
    return "xyz".index(domain["shear"]["gradient"])


def check(run: haff.File, scene: dict, conserved: tuple[bool, ...]) -> int:
    """Compares all observables with the replay. Returns the number of events."""
    d = run.dimension
    assert run.conserved_momentum.tolist() == [*conserved, False][:3]
    replayed = Replay(run, scene, conserved).found
    with h5py.File(run.path) as file:
        stored = {name: file[f"observables/{name}/value"][:] for name in file["observables"] if name in replayed}
    # What a scene does not have is zero in the replay.
    for name in set(replayed) - set(stored):
        assert not np.any(replayed[name]), name
    energy = max(float(np.max(stored["kinetic_energy"])), 1e-3)
    scales = {
        "kinetic_energy": energy, "wall_work": energy, "shear_work": energy,
        "temperature": energy / (d * len(run)), "species_temperature": energy,
        "momentum": math.sqrt(2 * energy * run.mass[np.isfinite(run.mass)].sum()),
    }  # fmt: skip
    pressure = 2 * energy / run.box.volume
    for name, values in stored.items():
        expected = np.array(replayed[name]).reshape(values.shape)
        scale = scales.get(name, pressure)
        if name in ("wall_force", "pressure_tensor_collisional", "pressure_tensor", "pressure"):
            # Sums of impulses, which may be larger than the pressure of the gas.
            scale = max(scale, float(np.nanmax(np.abs(expected[1:]), initial=0.0)))
        # Rounding of the recorded impulses, added up over some hundred events; times are those of ticks.
        np.testing.assert_allclose(values, expected, rtol=0, atol=2e-12 * scale, err_msg=f"{scene['title']}: {name}")
    sampled = np.searchsorted(run.samples["time"], [frame.time for frame in run.frames])
    for row, frame in zip(sampled, run.frames):
        assert analysis.temperature(frame) == pytest.approx(stored["temperature"][row], rel=1e-12, abs=1e-15)
    return len(run.events)


@pytest.mark.long
def test_samples_of_random_scenes_are_those_of_their_events(tmp_path):
    events, features = 0, set()
    for seed in range(64):
        scene, conserved = random_scene(seed)
        file = tmp_path / f"{seed}.h5"
        haff.run(scene, file=file)
        with haff.open(file) as run:
            events += check(run, scene, conserved)
        features |= {key for key in ("shear", "gravity") if key in scene["domain"]}
        features |= {
            key for wall in scene.get("wall", ()) for key in ("velocity", "motion", "temperature") if key in wall
        }
        features |= {"fixed" for particle in scene["particle"] if particle["mass"] == math.inf}
        features |= {"oblique" for wall in scene.get("wall", ()) if wall["name"] == "oblique"}
        features |= {"one particle"} if len(scene["particle"]) == 1 else set()
    assert events > 1000, events
    assert features == {
        "shear", "gravity", "velocity", "motion", "temperature", "fixed", "oblique", "one particle",
    }  # fmt: skip


def means(run: haff.File) -> dict[str, np.ndarray]:
    """Means over the whole run of what is a mean between samples."""
    span = np.diff(run.samples["time"])
    with h5py.File(run.path) as file:
        names = [
            n
            for n in ("pressure", "pressure_tensor", "pressure_tensor_kinetic", "wall_force")
            if n in file["observables"]
        ]
        return {n: np.average(file[f"observables/{n}/value"][1:], axis=0, weights=span) for n in names}


def test_the_walls_of_a_box_give_the_pressure_tensor_and_the_gas_law(tmp_path):
    """P V between walls: d/dt Σ m r v = Σ m v v + Σ r J + Σ r F of the walls, in the mean over a run.

    The left side is known from the first and the last frame, so that the equality holds to rounding for a run of any
    length. Centers are up to a radius R from walls, so that opposite walls with the force F give F (L - 2R), the
    pressure on them times the accessible volume.
    """
    mass, radius, side, end = 2.0, 0.5, 12.0, 2000.0
    scene = {
        "dimension": 2, "seed": 8,
        "domain": {"size": [side, side], "boundary": ["wall", "wall"]},
        "species": [{"name": "disk", "count": 10, "radius": radius, "mass": mass}],
        "initial": {"positions": "random", "temperature": 1.0},
        "measure": {"stress": True, "wall_forces": True},
        "run": {"until": end}, "output": {"frames": end, "observables": 100.0},
    }  # fmt: skip
    file = tmp_path / "box.h5"
    haff.run(scene, file=file)
    with haff.open(file) as run:
        mean, force = means(run), {}
        for name, vector in zip(run.wall_names, mean["wall_force"]):
            force[name] = vector["xy".index(name[0])]
        first, last = (mass * np.sum(f.position * f.velocity, axis=0) for f in (run.frames[0], run.frames[-1]))
        temperature = run.samples["temperature"]
    tensor = mean["pressure_tensor"] * side**2
    for axis, name in enumerate("xy"):
        of_walls = force[f"{name}+"] * (side - radius) + force[f"{name}-"] * radius
        assert tensor[axis, axis] == pytest.approx(of_walls + (last - first)[axis] / end, rel=1e-12), name
    # Elastic: N T of the start is that of every sample, and the kinetic part of p V.
    np.testing.assert_allclose(temperature, 1.0, rtol=1e-13)
    assert np.trace(mean["pressure_tensor_kinetic"]) * side**2 / 2 == pytest.approx(10.0, rel=1e-13)
    assert mean["pressure"] * side**2 == pytest.approx(np.trace(tensor) / 2, rel=1e-13)
    # Of the ten disks each has nine partners, which leaves little of the second virial coefficient, 2 φ.
    phi = 10 * math.pi * radius**2 / (side - 2 * radius) ** 2
    assert 10.0 < mean["pressure"] * side**2 < 10.0 * (1 + 4 * phi)


@pytest.mark.parametrize("dimension", [2, 3])
def test_one_particle_between_walls_obeys_the_gas_law(tmp_path, dimension):
    """p V = N T for N = 1, and on each pair of walls F (L - 2R) = m v², over whole periods."""
    velocity, size = [1.5, -1.0, 0.5][:dimension], [7.0, 4.0, 5.0][:dimension]
    scene = {
        "dimension": dimension,
        "domain": {"size": size, "boundary": ["wall"] * dimension},
        "particle": [{"position": [2.0] * dimension, "velocity": velocity, "radius": 0.5, "mass": 1.5}],
        "measure": {"stress": True, "wall_forces": True},
        # Periods of 2 (L - 2R)/v: 8, 6 and 16.
        "run": {"until": 96.0}, "output": {"observables": 48.0},
    }  # fmt: skip
    haff.run(scene, file=tmp_path / "one.h5")
    with haff.open(tmp_path / "one.h5") as run:
        assert not run.conserved_momentum.any()
        mean, temperature = means(run), run.samples["temperature"]
        expected = 1.5 * np.square(velocity)
        np.testing.assert_allclose(temperature, expected.mean(), rtol=1e-14)
        assert mean["pressure"] * run.box.volume == pytest.approx(expected.mean(), rel=1e-13)
        np.testing.assert_allclose(np.diag(mean["pressure_tensor"]) * run.box.volume, expected, rtol=1e-13)
        for wall, force in zip(run.wall_names, mean["wall_force"]):
            axis = "xyz".index(wall[0])
            assert abs(force[axis]) * (size[axis] - 1.0) == pytest.approx(expected[axis], rel=1e-12), wall


def test_the_work_of_the_shear_is_that_of_the_pressure_tensor_while_the_gas_moves(tmp_path):
    scene = {
        "dimension": 2,
        "domain": {"size": [10.0, 10.0], "shear": {"flow": "x", "gradient": "y", "rate": 0.1}},
        "particle": [
            {"name": "a", "position": [2.0, 2.0], "velocity": [1.2, 1.0], "radius": 0.5, "mass": 1.0},
            {"name": "b", "position": [7.0, 6.0], "velocity": [3.6, 1.0], "radius": 0.5, "mass": 1.0},
        ],
        "measure": {"stress": True},
        "run": {"until": 1.0}, "output": {"observables": 0.5, "frames": 0.5},
    }  # fmt: skip
    haff.run(scene, file=tmp_path / "shear.h5")
    with haff.open(tmp_path / "shear.h5") as run:
        table = run.samples
        power = -0.1 * 100.0 * table["pressure_tensor_yx"][1:] * np.diff(table["time"])
        np.testing.assert_allclose(np.diff(table["shear_work"]), power, rtol=1e-13)
        # c_x = 1 and 3 at the start, and c_y = 1: -γ̇ Σ c_x c_y, less as c_x falls.
        assert table["shear_work"][-1] == pytest.approx(-0.1 * (4.0 - 2 * 0.1 / 2), rel=1e-13)


@pytest.mark.long
def test_check_and_the_first_sample_have_the_same_temperature(command, tmp_path):
    """`haff check` uses the same definition, also for a common velocity, walls and shear."""
    for seed in range(12):
        scene, _ = random_scene(seed)
        scene["run"]["until"] = 0.1
        haff.run(scene, file=tmp_path / f"{seed}.h5")
        with haff.open(tmp_path / f"{seed}.h5") as run:
            sampled, text = run.samples["temperature"][0], run.scene_text
        (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
        checked = json.loads(command("check", tmp_path / "scene.toml", "--json").stdout)["temperature"]
        assert checked == pytest.approx(sampled, rel=1e-13), seed


@pytest.mark.parametrize("fixed", [False, True])
def test_bodies_on_springs_have_the_motion_of_their_center_of_mass_only_if_an_end_is_fixed(tmp_path, fixed):
    ends: dict = {"between": ["b"], "point": [9.0, 0.0]} if fixed else {"between": ["a", "b"]}
    scene = {
        "dimension": 2,
        "domain": {"size": [1.0, 1.0], "boundary": ["open", "open"]},
        "particle": [
            {"name": "a", "position": [0.0, 0.0], "velocity": [2.0, 0.5], "radius": 0.5, "mass": 1.0},
            {"name": "b", "position": [4.0, 0.0], "velocity": [1.0, 0.5], "radius": 0.5, "mass": 3.0},
        ],
        "spring": [{"name": "s", "stiffness": 2.0, "length": 4.0, **ends}],
        "run": {"until": 1.0}, "output": {"observables": 0.5, "frames": 0.5},
    }  # fmt: skip
    haff.run(scene, file=tmp_path / "spring.h5")
    with haff.open(tmp_path / "spring.h5") as run:
        assert run.conserved_momentum.tolist() == [not fixed, not fixed, False]
        for frame, temperature in zip(run.frames, run.samples["temperature"]):
            velocity = frame.velocity - (0.0 if fixed else np.average(frame.velocity, axis=0, weights=frame.mass))
            expected = frame.mass @ np.sum(velocity**2, axis=1) / 4
            assert temperature == pytest.approx(expected, rel=1e-13)
            assert analysis.temperature(frame) == pytest.approx(expected, rel=1e-13)
