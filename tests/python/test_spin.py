"""Rough particles: files with spins are read, checked, compared with theory, and exported."""

from __future__ import annotations

import re

import h5py
import numpy as np
import pandas as pd
import pytest

import haff
import synthetic
from haff import analysis, figures, mechanics, theory
from haff.command.main import main
from haff.figures import trajectories
from validation import audit

ROUGH = ("rough", "rough_disks", "impacts", "sliding")


# --- files -------------------------------------------------------------------------------------------------


def test_spins_are_read_as_velocities_are(files):
    with haff.open(files["rough"]) as run:
        frames = run.frames
        frame = frames[3]
        assert np.array_equal(run.inertia, np.full(2000, 0.4)) and frame.inertia is run.inertia
        assert "angular_velocity" not in vars(frame)
        assert frame.angular_velocity.shape == (2000, 3) and frame.angular_velocity is frame.angular_velocity
        assert np.array_equal(frames[::-2].array("angular_velocity")[2], frame.angular_velocity)
        with h5py.File(files["rough"]) as file:
            assert np.array_equal(file["particles/all/angular_velocity/value"][3], frame.angular_velocity)
    with haff.open(files["rough_disks"]) as run:
        assert np.all(run.frames.array("angular_velocity")[..., :2] == 0) and np.all(run.inertia == 0.5)


def test_smooth_files_have_no_spins(files):
    with haff.open(files["cooling"]) as run:
        assert run.inertia is None and run.frames[0].angular_velocity is None and run.frames[0].inertia is None
        with pytest.raises(haff.MissingDataError, match="no angular_velocity in the frames"):
            run.frames.array("angular_velocity")
        with pytest.raises(haff.ArgumentError, match="must be one of position, velocity, image, angular_velocity"):
            run.frames.array("spin")
        assert analysis.rotational_energy(run.frames[0]) == 0
        assert np.isnan(analysis.rotational_temperature(run.frames[0]))
        for name, only in (("impulse_vector", "spin or thermal walls"), ("tangential_loss", "spin")):
            with pytest.raises(haff.MissingDataError, match=f"lacks '{name}': .*; only scenes with {only} have it"):
                run.events[name]


def test_killed_run_is_read_up_to_its_last_complete_spin(tmp_path):
    path = synthetic.cooling_gas(tmp_path / "killed.h5", n=50, frames=6, collisions=100, beta=0.0)
    synthetic.truncate(path, "particles/all/angular_velocity/value", 4)
    synthetic.truncate(path, "events/tangential_loss", 60)
    with haff.open(path) as run:
        assert len(run.frames) == 4 and run.frames[-1].angular_velocity.shape == (50, 3)
        assert len(run.events) == len(run.events.to_pandas()) == 60


def test_events_have_impulse_vectors_and_tangential_losses(files):
    with haff.open(files["rough"]) as run:
        events = run.events
        assert events.columns[-2:] == ["impulse_vector", "tangential_loss"]
        table = events[:100]
        assert {"impulse_vector_x", "impulse_vector_z", "tangential_loss"} <= set(table.columns)
        normal = np.sum(events["impulse_vector"] * events["normal"], axis=1)
        assert np.allclose(normal, events["impulse"], rtol=1e-12)
        # Carnot's theorem for the normal part, with e, and for the tangential one, with β.
        mu, q, e, beta = 0.5, 0.4, 0.9, 0.5
        along = events["impulse"] ** 2 / (2 * mu)
        assert np.allclose(events["energy_loss"] - events["tangential_loss"], along * (1 - e) / (1 + e), rtol=1e-9)
        across = events["impulse_vector"] - events["impulse"][:, None] * events["normal"]
        sideways = np.sum(across**2, axis=1) * (1 + 1 / q) / (2 * mu)
        assert np.allclose(events["tangential_loss"], sideways * (1 - beta) / (1 + beta), rtol=1e-9)
        assert np.allclose(events["carnot_energy"], along + sideways, rtol=1e-9)
    with haff.open(files["sliding"]) as run:
        assert list(run.events.to_pandas()["kind"]) == ["rest", "slide"]


def test_observables_of_rotation_are_those_of_the_frames(files):
    for name in ("rough", "rough_disks", "impacts", "sliding"):
        with haff.open(files[name]) as run:
            table = run.observables.set_index("time")
            for frame in run.frames:
                row = table.loc[frame.time]
                assert analysis.rotational_energy(frame) == pytest.approx(row["rotational_energy"], rel=1e-12), name
                found = analysis.rotational_temperature(frame)
                if name.startswith("rough"):
                    assert found == pytest.approx(row["rotational_temperature"], rel=1e-12)
                    assert found == pytest.approx(row["species_rotational_temperature_grain"], rel=1e-12)
                    assert analysis.rotational_temperature(frame, species=0) == pytest.approx(found, rel=1e-15)
            energies = table[["kinetic_energy", "rotational_energy", "potential_energy", "dissipated_energy"]].sum(
                axis=1
            )
            assert np.allclose(energies, energies.iloc[0], rtol=1e-12)
            assert run.summary["rotational_energy"] == table["rotational_energy"].iloc[-1]
    with haff.open(files["rough"]) as run:
        assert run.to_xarray()["species_rotational_temperature"].dims == ("time", "species")


@pytest.mark.parametrize(
    ("place", "value", "read", "message"),
    [
        ("particles/all/inertia", np.ones(49), lambda f: f.inertia, "inertia: has 49 rows; .* each of 50 particles"),
        ("particles/all/inertia", np.zeros(50), lambda f: f.inertia, r"inertia\[0\] = 0.0: must be in"),
        (
            "particles/all/inertia",
            np.ones(50, int),
            lambda f: f.inertia,
            "inertia: holds int64; must hold real numbers",
        ),
        (
            "particles/all/angular_velocity/value",
            np.zeros((4, 50, 2)),
            lambda f: f.frames,
            r"angular_velocity/value: has shape \(4, 50, 2\); must be \(any, 50, 3\)",
        ),
        (
            "particles/all/angular_velocity/value",
            np.full((4, 50, 3), np.inf),
            lambda f: f.frames[2].angular_velocity,
            r"angular_velocity/value\[2, 0, 0\] = inf: must be a number",
        ),
        ("events/impulse_vector", np.zeros((200, 2)), lambda f: f.events, r"has shape \(200, 2\); must be \(any, 3\)"),
        (
            "events/tangential_loss",
            np.full(200, np.nan),
            lambda f: f.events["tangential_loss"],
            r"tangential_loss\[0\] = nan: must be a number",
        ),
        (
            "observables/rotational_energy/value",
            np.full(13, np.nan),
            lambda f: f.observables,
            r"rotational_energy/value\[0\] = nan: must be a finite number",
        ),
    ],
)
def test_spins_that_no_run_can_have_written_are_refused(place, value, read, message, tmp_path):
    path = synthetic.cooling_gas(tmp_path / "gas.h5", n=50, frames=4, samples=10, collisions=200, beta=0.5)
    with h5py.File(path, "r+") as file:
        del file[place]
        file[place] = value
    with pytest.raises(haff.FileError, match=message), haff.open(path) as file:
        read(file)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("tangential_restitution = 1.5", r"contact.tangential_restitution = 1.5: must be a number in \[-1, 1\]"),
        ('tangential_restitution = "x"', "contact.tangential_restitution = 'x': must be a number"),
        ("friction = -0.1", "contact.friction = -0.1: must be a number, 0 or more"),
        ("friction = nan", "contact.friction = nan: must be a number of up to 1e\\+100"),
        ("friction = inf", None),
    ],
)
def test_roughness_of_a_recorded_scene_is_checked(line, message, tmp_path):
    path = synthetic.cooling_gas(tmp_path / "gas.h5", n=50, frames=2, collisions=10)
    with h5py.File(path, "r+") as file:
        text = file["parameters/scene"][()].decode()
        del file["parameters/scene"]
        file["parameters/scene"] = text.rstrip() + f"\n{line}\n"
    with haff.open(path) as file:
        if message is None:
            assert np.isfinite(analysis.cooling_law(file).tau), "β = -1 is smooth"
            return
        with pytest.raises(haff.FileError, match=message):
            analysis.cooling_law(file)


def test_laws_of_smooth_contacts_are_not_applied_to_rough_ones(files):
    with haff.open(files["rough"]) as run:
        assert analysis.gas_restitution(run) == 0.9
        with pytest.raises(haff.NotApplicableError, match="needs smooth contacts"):
            analysis.cooling_law(run)


def test_roughness_of_a_pair_beats_that_of_the_wall_which_beats_the_general_one(files):
    from haff.analysis import experiment

    with haff.open(files["impacts"]) as run:
        assert experiment.roughness(run, "ball", "stone") == (0.4, np.inf)
        assert experiment.wall_roughness(run, "stone", 0) == (0.2, 0.15)
        run.scene["contact"]["pair"] = [
            {"between": ["floor", "stone"], "friction": 0.5},
            {"between": ["ball", "stone"], "tangential_restitution": -1.0},
        ]
        assert experiment.wall_roughness(run, "stone", 0) == (0.2, 0.5)
        assert experiment.wall_roughness(run, "ball", 0) == (0.2, 0.15)
        assert experiment.roughness(run, "stone", "ball") == (-1.0, np.inf)
        assert (
            experiment.restitution(run, "stone", "ball") == 0.8 and experiment.wall_restitution(run, "stone", 0) == 0.6
        )


def test_closed_form_of_an_impact_has_its_spins(files):
    with haff.open(files["impacts"]) as run:
        figure = figures.draw(run, "closed_form")
        assert "no closed form" not in " ".join(text.get_text() for text in figure.texts)
        assert len(figure.axes) == 2 and max(line.get_ydata()[:3].max() for line in figure.axes[1].lines[:6]) < 1e-14


def test_figures_need_the_columns_of_rough_contacts(files, tmp_path):
    """A scene may ask for the columns of smooth contacts only."""
    gas, impacts = tmp_path / "gas.h5", tmp_path / "impacts.h5"
    for path, name, column in ((gas, "rough", "tangential_loss"), (impacts, "impacts", "impulse_vector")):
        path.write_bytes(files[name].read_bytes())
        with h5py.File(path, "r+") as file:
            del file[f"events/{column}"]
    with haff.open(gas) as run:
        assert len(figures.draw(run, "losses").axes) == 1
    with haff.open(impacts) as run:
        for body, path in enumerate(trajectories.flights(run)):
            assert len(path.hits) == 0, "arcs from frame to frame"
            assert np.allclose(path.position[-1], run.frames[-1].position[body], atol=1e-12)


@pytest.mark.parametrize("name", ROUGH)
def test_page_of_a_file_with_spins_is_written(name, files, tmp_path):
    assert main(["view", str(files[name]), "-o", str(tmp_path / "page.html")]) == 0
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert '"rotational"' in page


# --- exports -----------------------------------------------------------------------------------------------


def exported(path, tmp_path, to, *arguments):
    target = tmp_path / f"out.{to}"
    assert main(["export", str(path), "--to", to, "-o", str(target), *arguments]) == 0
    return target


def test_extended_xyz_has_spins_with_every_bit(files, tmp_path):
    text = exported(files["impacts"], tmp_path, "extxyz").read_text().splitlines()
    with haff.open(files["impacts"]) as run:
        for k, frame in enumerate(run.frames):
            header, *rows = text[4 * k + 1 : 4 * k + 4]
            properties = re.search(r"Properties=(\S+)", header)[1]
            assert properties.endswith(":image:I:3:angular_velocity:R:3")
            assert sum(map(int, properties.split(":")[2::3])) == len(rows[0].split())
            values = np.array([[float(word) for word in row.split()[-3:]] for row in rows])
            assert np.array_equal(values, frame.angular_velocity)
    ase = pytest.importorskip("ase.io")
    read = ase.read(tmp_path / "out.extxyz", index=-1, format="extxyz")
    with haff.open(files["impacts"]) as run:
        assert np.array_equal(read.arrays["angular_velocity"], run.frames[-1].angular_velocity)


def test_vtkhdf_has_spins_at_every_step(files, tmp_path):
    with haff.open(files["impacts"]) as run, h5py.File(exported(files["impacts"], tmp_path, "vtkhdf")) as hdf:
        root = hdf["VTKHDF"]
        start = root["Steps/PointDataOffsets/angular_velocity"][:]
        values = root["PointData/angular_velocity"][:]
        found = np.stack([values[row : row + len(run)] for row in start])
        assert np.array_equal(found, run.frames.array("angular_velocity"))
    vtk = pytest.importorskip("vtk", reason="no vtk: pip install 'haff[validation]'")
    from vtk.util.numpy_support import vtk_to_numpy

    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(tmp_path / "out.vtkhdf"))
    reader.UpdateInformation()
    reader.SetStep(4)
    reader.Update()
    spins = vtk_to_numpy(reader.GetOutput().GetPointData().GetArray("angular_velocity"))
    with haff.open(files["impacts"]) as run:
        assert np.array_equal(spins, run.frames[4].angular_velocity)


def test_table_of_frames_has_spins(files, tmp_path):
    table = pd.read_csv(exported(files["impacts"], tmp_path, "csv", "--table", "frames"), dtype=str)
    # Each number as Python reads it, to the last bit.
    spins = table[[f"angular_velocity_{axis}" for axis in "xyz"]].map(float).to_numpy()
    with haff.open(files["impacts"]) as run:
        assert np.array_equal(spins.reshape(len(run.frames), len(run), 3), run.frames.array("angular_velocity"))


@pytest.mark.parametrize("name", ["impacts", "rough_disks"])
def test_gsd_has_the_angular_momenta_of_hoomd(name, files, tmp_path):
    hoomd = pytest.importorskip("gsd.hoomd")
    with haff.open(files[name]) as run, hoomd.open(str(exported(files[name], tmp_path, "gsd")), "r") as trajectory:
        for frame, read in zip(run.frames, trajectory):
            particles = read.particles
            moment = run.inertia * run.mass * run.radius**2
            axes = [1, 1, 1] if run.dimension == 3 else [0, 0, 1]
            assert np.allclose(particles.moment_inertia, moment[:, None] * axes, rtol=1e-6)
            assert np.all(particles.orientation == [1, 0, 0, 0]) and np.all(particles.angmom[:, 0] == 0)
            # HOOMD-blue: the angular momentum in the frame of the body is half of conj(orientation) times angmom.
            momentum = 0.5 * particles.angmom[:, 1:].astype(float)
            assert np.allclose(momentum, moment[:, None] * frame.angular_velocity, rtol=1e-6, atol=1e-12)


def test_gsd_has_no_momentum_of_bodies_of_infinite_mass(files, tmp_path):
    hoomd = pytest.importorskip("gsd.hoomd")
    path = tmp_path / "driven.h5"
    path.write_bytes(files["impacts"].read_bytes())
    with h5py.File(path, "r+") as file:
        file["particles/all/mass"][1] = np.inf
    with hoomd.open(str(exported(path, tmp_path, "gsd")), "r") as trajectory:
        particles = trajectory[0].particles
        assert np.all(particles.moment_inertia[1] == 0) and np.all(particles.angmom[1] == 0)
        assert np.all(particles.moment_inertia[0] > 0) and np.isfinite(particles.angmom).all()
    with haff.open(path) as run:
        assert analysis.rotational_energy(run.frames[0]) == pytest.approx(0.5 * 0.4 * 0.25 * 5.25, rel=1e-14)


# --- mechanics and theory ----------------------------------------------------------------------------------


@pytest.mark.parametrize("m2", [0.3, 5.0, np.inf])
@pytest.mark.parametrize(("beta", "friction"), [(-1.0, np.inf), (-0.4, np.inf), (0.7, 0.05), (1.0, np.inf), (0.2, 2.0)])
def test_rough_impact_conserves_momenta_and_loses_the_stated_energy(beta, friction, m2):
    m1, e, radii, q = 2.0, 0.6, (0.5, 0.3), (0.4, 0.25)
    w1, w2 = np.array([1.0, -2.0, 0.5]), np.array([-0.5, 0.3, 0.1])
    spins = np.array([[3.0, -1.0, 2.0], [0.5, 4.0, -1.5]])
    n = np.array([0.2, -1.0, 0.4]) / np.sqrt(1.2)
    after = mechanics.rough_impact(m1, m2, w1, w2, *spins, n, e, beta, friction, radii, q)
    v, w = (
        np.array([after.velocity_1, after.velocity_2]),
        np.array([after.angular_velocity_1, after.angular_velocity_2]),
    )

    def surface(v, w):
        """Relative velocity of the surfaces at the contact, from the velocities of two points."""
        return v[0] + np.cross(w[0], radii[0] * n) - v[1] - np.cross(w[1], -radii[1] * n)

    before, later = surface((w1, w2), spins), surface(v, w)
    assert later @ n == pytest.approx(-e * (before @ n), abs=1e-14)
    slip, kept = before - (before @ n) * n, later - (later @ n) * n
    assert np.allclose(after.slip, slip, atol=1e-14)
    tangential = after.impulse - (after.impulse @ n) * n
    bound = friction * (after.impulse @ n)
    assert after.slides == (friction == 0.05)
    if after.slides:
        assert np.linalg.norm(tangential) == pytest.approx(bound, rel=1e-14)
        assert np.linalg.norm(kept + beta * slip) > 0.01
    else:
        assert np.allclose(kept, -beta * slip, atol=1e-14) and np.linalg.norm(tangential) <= bound
    # Of bodies of finite mass, momenta and angular momenta about the contact.
    mass = np.array([m1, m2 if np.isfinite(m2) else 0.0])
    moment = mass * np.array(q) * np.array(radii) ** 2
    impulses = mass[:, None] * (v - [w1, w2])
    assert np.allclose(impulses[0], -after.impulse, atol=1e-14)
    if np.isfinite(m2):
        assert np.allclose(impulses.sum(axis=0), 0, atol=1e-14)
    for k, arm in ((0, -radii[0] * n), (1, radii[1] * n)):
        assert np.allclose(np.cross(arm, impulses[k]) + moment[k] * (w[k] - spins[k]), 0, atol=1e-14)
    # Energies; of a wall or a driven body also the work on it.
    work = 0.0 if np.isfinite(m2) else after.impulse @ (w2 + np.cross(spins[1], -radii[1] * n))

    def energy(mass, moment, v, w):
        return 0.5 * np.sum(mass[:, None] * np.square(v)) + 0.5 * np.sum(moment[:, None] * np.square(w))

    lost = energy(mass, moment, (w1, w2), spins) - energy(mass, moment, v, w) - work
    assert after.energy_loss == pytest.approx(lost, abs=1e-13)
    carnot = energy(mass, moment, v - [w1, w2], w - spins)
    assert after.carnot_energy == pytest.approx(carnot, rel=1e-13)
    smooth = mechanics.impact(m1, m2, w1, w2, n, e)
    assert after.energy_loss - after.tangential_loss == pytest.approx(smooth.energy_loss, rel=1e-14)
    if beta == -1:
        assert np.allclose(after.velocity_1, smooth.velocity_1, atol=1e-15) and after.tangential_loss == 0
    if beta == 1:
        assert after.tangential_loss == 0 and np.linalg.norm(tangential) > 0.1


def test_temperature_ratio_of_a_rough_gas_computed_by_hand():
    # q = 2/5, β = 0, e = 1: h = 1.4²/0.8 · (−0.6/1.4) = −1.05; √(1 + h²) = 1.45.
    assert theory.rough_temperature_ratio(1.0, 0.0) == pytest.approx(0.4, rel=1e-14)
    # e = 0.8: h = 2.45 · (0.36 − 3/7) = −0.168.
    assert theory.rough_temperature_ratio(0.8, 0.0) == pytest.approx(-0.168 + np.sqrt(1 + 0.168**2), rel=1e-14)
    # Disks, q = 1/2, β = 0, e = 1: η = 1/6, h = 4.5 · (2 · 5/36 − 4 · 2/9) = −2.75; √(2 + h²) = 3.092...
    assert theory.rough_temperature_ratio(1.0, 0.0, d=2) == pytest.approx(-2.75 + np.sqrt(2 + 2.75**2), rel=1e-14)


def test_temperature_ratio_of_a_rough_gas_has_the_right_limits():
    for d in (2, 3):
        for q in (0.1, 0.4, 0.5, 1.0):
            assert theory.rough_temperature_ratio(1.0, 1.0, q, d) == pytest.approx(1.0, rel=1e-14), "equipartition"
    # Rotation is not heated, and does not cool, where contacts are nearly smooth.
    assert theory.rough_temperature_ratio(1.0, -0.999) < 1e-3 and theory.rough_temperature_ratio(0.9, -0.99) > 1e3
    assert theory.rough_temperature_ratio(0.9, -1.0) == np.inf and np.isnan(theory.rough_temperature_ratio(1.0, -1.0))
    assert theory.rough_temperature_ratio([0.7, 0.9], [[0.0], [0.5], [0.9]]).shape == (3, 2)
    with pytest.raises(ValueError, match="d = 4"):
        theory.rough_temperature_ratio(0.9, 0.0, 0.4, 4)


@pytest.mark.parametrize(("d", "axes"), [(2, 1), (3, 3)])
def test_at_the_ratio_of_theory_both_temperatures_fall_alike(d, axes):
    e, beta = np.meshgrid([0.6, 0.9, 1.0], [-0.8, -0.3, 0.0, 0.6, 0.99])
    ratio = theory.rough_temperature_ratio(e, beta, d=d)
    lost = theory.rough_losses(1.0, ratio, e, beta, d=d)
    assert np.allclose(lost.normal + lost.tangential, lost.translational + lost.rotational, rtol=1e-12)
    assert np.allclose(lost.translational / d, lost.rotational / (axes * ratio), rtol=1e-9)


@pytest.mark.long
@pytest.mark.parametrize(("d", "axes"), [(2, 1), (3, 3)])
def test_mean_losses_are_those_of_impacts_drawn_at_random(d, axes):
    rng = np.random.default_rng(d)
    T, T_rot, e, beta, q, radius, count = 1.3, 0.6, 0.8, 0.3, 0.45, 0.7, 8000
    seen = np.empty((count, 4))
    n = np.array([1.0, 0.0, 0.0])
    for row in seen:
        v = rng.normal(scale=np.sqrt(T), size=(2, 3)) * ([1, 1, 1] if d == 3 else [1, 1, 0])
        # Approach speeds of colliding pairs have the density ∝ g exp(−g²/4T) of mass 1.
        v[:, 0] += 0.5 * (np.sqrt(-4 * T * np.log(rng.random())) - (v[0, 0] - v[1, 0])) * np.array([1, -1])
        w = rng.normal(scale=np.sqrt(T_rot / q) / radius, size=(2, 3)) * ([1, 1, 1] if axes == 3 else [0, 0, 1])
        hit = mechanics.rough_impact(1.0, 1.0, *v, *w, n, e, beta, np.inf, (radius, radius), (q, q))
        after, spins = [hit.velocity_1, hit.velocity_2], [hit.angular_velocity_1, hit.angular_velocity_2]
        row[:2] = hit.energy_loss - hit.tangential_loss, hit.tangential_loss
        row[2] = 0.5 * (np.sum(v**2) - np.sum(np.square(after)))
        row[3] = 0.5 * q * radius**2 * (np.sum(w**2) - np.sum(np.square(spins)))
    expected = theory.rough_losses(T, T_rot, e, beta, q, d)
    error = np.std(seen, axis=0, ddof=1) / np.sqrt(count)
    z = (seen.mean(axis=0) - np.array(expected)) / error
    assert np.all(np.abs(z) < 4), f"z = {z}, means {seen.mean(axis=0)}, theory {expected}"


# --- audit -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["impacts", "sliding"])
def test_rough_runs_pass_the_audit(name, files):
    with haff.open(files[name]) as run:
        findings = audit.audit(run)
    broken = [str(finding) for finding in findings if not finding.passed]
    assert not broken, broken
    assert any("tangential impulse" in finding.name for finding in findings) == (name == "impacts")


@pytest.mark.parametrize(
    ("place", "change", "name", "finding"),
    [
        ("events/tangential_loss", lambda x: x * (1 + 1e-12), "impacts", "tangential loss"),
        ("events/tangential_loss", lambda x: x * (1 + 1e-9), "impacts", "law: loss"),
        ("events/impulse_vector", lambda x: x * (1 + 1e-12), "impacts", "law: normal component of the impulse"),
        ("events/impulse_vector", lambda x: np.add(x, [1e-12, 0, 0]), "impacts", "tangential impulse"),
        ("events/carnot_energy", lambda x: x * (1 + 1e-13), "impacts", "law: Carnot"),
        (
            "particles/all/angular_velocity/value",
            lambda x: x * (1 + 1e-12 * (x == x[-1])),
            "impacts",
            "spin in the end",
        ),
        ("particles/all/angular_velocity/value", lambda x: x * (1 + 1e-9), "sliding", "energy, relative"),
        ("events/energy_loss", lambda x: x * (1 + 1e-9), "sliding", "energy, relative"),
    ],
)
def test_audit_detects_a_corrupted_rough_run(place, change, name, finding, files, tmp_path):
    path = tmp_path / "run.h5"
    path.write_bytes(files[name].read_bytes())
    with h5py.File(path, "r+") as file:
        file[place][...] = change(file[place][:])
    with haff.open(path) as run:
        broken = [found.name for found in audit.audit(run) if not found.passed]
    assert any(found.startswith(finding) for found in broken), broken


# --- live simulations --------------------------------------------------------------------------------------


class Core:
    """In place of the compiled simulation: a state, and the changes that it was asked for."""

    time, species_names = 0.0, ["grain"]
    radius, mass, species = np.full(4, 0.5), np.ones(4), np.zeros(4, np.int64)

    def __init__(self, spins):
        self.spins, self.changes = spins, []
        self.inertia = None if spins is None else np.full(4, 0.4)

    def frame(self):
        zero = np.zeros((4, 3))
        return self.time, 0, zero, zero, zero.astype(np.int32), self.spins

    def change(self, **what):
        self.changes.append(what)


def live(spins):
    simulation = object.__new__(haff.Simulation)
    simulation._core, simulation._frame = Core(spins), None
    return simulation


def test_spins_of_live_simulations_are_read_and_assigned():
    spins = np.arange(12.0).reshape(4, 3)
    gas = live(spins)
    assert gas.angular_velocities is spins and np.array_equal(gas.inertias, np.full(4, 0.4))
    gas.angular_velocities = [0, 0, 2]
    gas.add([[1, 2, 3], [4, 5, 6]], angular_velocities=[0.0, 0.0, 1.0])
    first, second = gas._core.changes
    assert first.keys() == {"angular_velocities"}
    assert np.array_equal(first["angular_velocities"], np.tile([0.0, 0.0, 2.0], (4, 1)))
    assert second["add"] == [
        ([1.0, 2.0, 3.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0], 0.5, 1.0, 0),
        ([4.0, 5.0, 6.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0], 0.5, 1.0, 0),
    ]
    smooth = live(None)
    assert smooth.angular_velocities is None and smooth.inertias is None


try:
    from haff._engine import Simulation as Compiled
except ImportError:
    Compiled = None


@pytest.mark.skipif(not hasattr(Compiled, "inertia"), reason="a compiled module without spin")
@pytest.mark.parametrize("dimension", [2, 3])
def test_live_rough_gas_balances(dimension):
    axes = 3 if dimension == 3 else 1
    scene = {
        "seed": 6,
        "dimension": dimension,
        "domain": {"packing_fraction": 0.1},
        "species": [{"name": "grain", "count": 200, "radius": 0.5, "mass": 2.0, "inertia": 0.3}],
        "initial": {"positions": "lattice", "temperature": 1.0, "rotational_temperature": 0.5},
        "contact": {"restitution": 0.9, "tangential_restitution": 0.4, "friction": 0.5},
        "run": {"until": 5.0},
    }
    gas = haff.Simulation(scene, events=True)
    assert np.array_equal(gas.inertias, np.full(200, 0.3))
    energy = 0.5 * 0.3 * 2.0 * 0.25 * np.sum(gas.angular_velocities**2)
    sample = gas.sample()
    assert sample["rotational_energy"] == pytest.approx(energy, rel=1e-13)
    assert sample["rotational_temperature"] == pytest.approx(0.5, rel=1e-12)
    assert energy == pytest.approx(axes / 2 * 200 * 0.5, rel=1e-12)
    gas.run()
    sample, events = gas.sample(), gas.take_events()
    assert abs(sample["ledger_residual"]) < 1e-13
    assert 0 < events["tangential_loss"].sum() < events["energy_loss"].sum()
    assert events["energy_loss"].sum() == pytest.approx(sample["dissipated_energy"], rel=1e-12)
    wanted = np.tile([0.0, 0.0, 3.0], (200, 1))
    gas.angular_velocities = [0.0, 0.0, 3.0]
    assert np.array_equal(gas.angular_velocities, wanted)
    assert gas.sample()["rotational_temperature"] == pytest.approx(0.3 * 2.0 * 0.25 * 9.0 / axes, rel=1e-12)
    gas.remove([0, 1])
    assert gas.angular_velocities.shape == (198, 3) and len(gas.inertias) == 198
    gas.advance(6.0)
    assert abs(gas.sample()["ledger_residual"]) < 1e-12
    if dimension == 2:
        with pytest.raises(ValueError, match=r"angular_velocities\[0\] = \[1, 0, 0\]: must be along z"):
            gas.angular_velocities = [1.0, 0.0, 0.0]
