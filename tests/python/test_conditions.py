"""Figures and estimates state their conditions, and are left out where these do not hold."""

from __future__ import annotations

import numpy as np
import pytest

import haff
import synthetic
from haff import analysis, figures, theory
from haff.analysis import conditions, experiment
from haff.analysis.phases import phase_note
from haff.errors import NotApplicableError
from haff.figures.style import signed

GAS = {
    "title": "Gas",
    "seed": 5,
    "domain": {"packing_fraction": 0.1},
    "species": [{"name": "grain", "count": 500, "radius": 0.5, "mass": 1.0}],
    "initial": {"positions": "random", "temperature": 1.0},
    "contact": {"restitution": 0.8},
    "run": {"until": 30.0},
    "output": {"frames": 0.5, "observables": 0.1, "events": True},
}
NOISE = {"kind": "white_noise", "strength": 0.4, "rate": 50.0}
BALL = {
    "domain": {"size": [4, 4, 10], "boundary": ["open", "open", "open"], "gravity": [0, 0, -1]},
    "particle": [{"name": "ball", "position": [2, 2, 2.5], "radius": 0.5, "mass": 1.0}],
    "contact": {"restitution": 0.8},
    "wall": [{"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}],
    "run": {"until": 8.0},
    "output": {"frames": 0.05, "observables": 0.05, "events": True},
}


def changed(scene, **keys):
    return scene | {
        name: {**scene.get(name, {}), **value} if isinstance(value, dict) else value for name, value in keys.items()
    }


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Files of runs by name, each made once."""
    folder, done = tmp_path_factory.mktemp("conditions"), {}

    def make(name, scene):
        if name not in done:
            done[name] = folder / f"{name}.h5"
            haff.run(scene, file=done[name])
        return haff.open(done[name])

    return make


@pytest.fixture(scope="module")
def continued(command, tmp_path_factory):
    """A gas that cools, and goes on with another restitution."""
    folder = tmp_path_factory.mktemp("continued")
    first, second = folder / "first.h5", folder / "second.h5"
    haff.run(changed(GAS, contact={"restitution": 0.9}), file=first)
    command("run", "--resume", first, "--set", "contact.restitution=0.6", "--set", "run.until=100", "-o", second)
    return second


def texts(figure):
    found = [text.get_text() for text in figure.texts]
    for axes in figure.axes:
        found += [text.get_text() for text in axes.texts]
        if (legend := axes.get_legend()) is not None:
            found += [text.get_text() for text in (*legend.get_texts(), legend.get_title())]
    return "\n".join(found).replace("\n", " ")


def labels(figure):
    return [line.get_label() for axes in figure.axes for line in axes.lines]


# --- the distribution of velocities, and the temperature -----------------------------------------------------


@pytest.mark.long
def test_velocities_of_a_heated_gas_have_its_own_correction(made):
    heated, cooling = float(theory.sonine_a2_heated(0.8)), float(theory.sonine_a2(0.8))
    with made("heated", changed(GAS, drive=[NOISE])) as run:
        told = texts(figures.draw(run, "velocity"))
        assert f"heated gas in theory  $a_2$ = {signed(heated)}" in told and signed(cooling) not in told
        figure = figures.draw(run, "temperature")
        assert not any("Haff" in str(label) for label in labels(figure))
        state = analysis.heated_state(run)
        assert any("steady state, Enskog" in str(label) for label in labels(figure))
        T = run.samples["temperature"]
        late = T[len(T) // 3 :]
        # 0.6 % is the error of theory at this restitution and density, and more than the statistical one.
        assert late.mean() == pytest.approx(state.temperature, rel=0.05)
        with pytest.raises(NotApplicableError, match="Haff's law needs a gas that nothing drives: the scene has white"):
            analysis.cooling_law(run)


def test_rescaled_velocities_have_the_distribution_of_the_cooling_state(made):
    drive = [{"kind": "rescale", "temperature": 1.0, "interval": 0.05}]
    with made("rescaled", changed(GAS, drive=drive)) as run:
        assert f"cooling gas in theory  $a_2$ = {signed(float(theory.sonine_a2(0.8)))}" in texts(
            figures.draw(run, "velocity")
        )


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "keys", "why"),
    [
        (
            "andersen",
            {"drive": [{"kind": "andersen", "temperature": 1.0, "rate": 1.0}]},
            "the scene has an Andersen thermostat",
        ),
        ("rare kicks", {"drive": [{**NOISE, "rate": 1.0}]}, "the time between kicks, 1, is above 0.2 mean free times"),
        ("two drives", {"drive": [NOISE, {**NOISE, "rate": 40.0}]}, "white noise on all particles"),
        ("rough", {"contact": {"tangential_restitution": 0.3}, "drive": [NOISE]}, "needs smooth contacts"),
        ("viscoelastic", {"contact": {"restitution": {"model": "viscoelastic", "coefficient": 0.1}}}, "one constant"),
    ],
)
def test_velocity_figure_without_theory_says_why(made, name, keys, why):
    with made(name, changed(GAS, **keys)) as run:
        figure = figures.draw(run, "velocity")
        told = texts(figure)
        assert "no theory drawn: needs " in told and why in told
        assert "Sonine" not in told


def test_velocities_of_elastic_particles_are_maxwells_without_a_remark(made):
    with made("elastic", changed(GAS, contact={"restitution": 1.0}, run={"until": 5.0})) as run:
        told = texts(figures.draw(run, "velocity"))
        assert "no theory" not in told and "Sonine," not in told


@pytest.mark.parametrize(
    ("keys", "why"),
    [
        ({"drive": [{"kind": "andersen", "temperature": 1.0, "rate": 1.0}]}, "a gas that nothing drives"),
        ({"contact": {"tc": 0.5}}, "short contacts: contact.tc = 0.5 is above 0.01 of the mean free time"),
        ({"contact": {"tc": 1e-6}}, None),
        ({"contact": {"restitution": {"speeds": [0.0, 1.0], "values": [0.9, 0.8]}}}, "one constant coefficient"),
        ({"contact": {"restitution": {"speeds": [0.0, 1.0], "values": [0.9, 0.9]}}}, None),
        ({"contact": {"restitution": {"model": "cutoff"}}}, "one constant coefficient"),
        ({"contact": {"pair": [{"between": ["grain", "grain"], "restitution": 0.5}]}}, "one constant coefficient"),
        ({"contact": {"pair": [{"between": ["grain", "grain"], "sticks": True}]}}, "one constant coefficient"),
        ({"contact": {"tangential_restitution": 0.5}}, "smooth contacts"),
        ({"wall": [{"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}]}, "a box without walls"),
        ({"particle": [{"name": "a"}] * 60}, "a homogeneous gas: the scene places 60 of 500 particles one by one"),
    ],
)
def test_each_condition_of_haffs_law_is_read_from_the_scene(tmp_path, keys, why):
    path = synthetic.cooling_gas(tmp_path / "gas.h5", n=500, frames=2, samples=20, collisions=2000)
    with haff.open(path) as run:
        table = run.samples
        table["mean_free_time"] = np.full(len(table["time"]), 1.3)
        run.__dict__["scene"] = changed(run.scene, **keys)
        if why is None:
            assert np.isfinite(analysis.cooling_law(run).tau)
            return
        with pytest.raises(NotApplicableError) as error:
            analysis.cooling_law(run)
        assert str(error.value).startswith("Haff's law needs ") and why in str(error.value)


def test_species_that_start_at_different_temperatures_do_not_follow_haffs_law(made):
    species = [
        {**GAS["species"][0], "name": name, "count": 250, "temperature": T} for name, T in (("a", 0.5), ("b", 2.0))
    ]
    with made("unequal", changed(GAS, species=species, run={"until": 2.0})) as run:
        with pytest.raises(
            NotApplicableError, match="one temperature at the start: the species start at different ones"
        ):
            analysis.cooling_law(run)


# --- files of runs that went on with other keys --------------------------------------------------------------


def test_haffs_law_starts_where_a_run_went_on_with_another_restitution(continued):
    with haff.open(continued) as run:
        law, table = analysis.cooling_law(run), run.samples
        assert law.start == conditions.start(run) == table["time"][0] == 30.0
        assert law.restitution == 0.6 and law.T0 == table["temperature"][0]
        figure = figures.draw(run, "temperature")
        ratio = figure.axes[1].lines[1].get_ydata()
        # The temperature of 500 particles has a standard deviation of √(2/(3 · 500)) = 3.7 %.
        assert abs(ratio[0] - 1) < 0.05, f"T/T_Haff starts at {ratio[0]}"
        assert np.all(np.abs(ratio[: len(ratio) // 4] - 1) < 0.15), f"up to {np.abs(ratio - 1).max()}"
        assert "after 30, where the file starts" in figure.axes[1].get_xlabel()


def test_energies_of_a_run_that_went_on_add_up_to_those_at_its_first_sample(continued):
    with haff.open(continued) as run:
        figure = figures.draw(run, "energy")
        top = figure.axes[0]
        line = next(line for line in top.lines if "E_0" in line.get_label())
        heights = [path.get_paths()[0].vertices[:, 1].max() for path in top.collections]
        assert max(heights) == pytest.approx(line.get_ydata()[0], rel=1e-9)
        assert "at $t$ = 30" in line.get_label()


def test_correlations_of_a_run_that_went_on_give_no_coefficients(command, tmp_path):
    first, second = tmp_path / "first.h5", tmp_path / "second.h5"
    elastic = changed(
        GAS, contact={"restitution": 1.0}, measure={"msd": True, "stress_correlation": True}, output={"events": False}
    )
    haff.run(elastic, file=first)
    with haff.open(first) as run:
        assert analysis.self_diffusion(run).einstein > 0 and analysis.shear_viscosity(run).einstein > 0
    command("run", "--resume", first, "--set", "run.until=60", "--set", "contact.wall_restitution=0.5", "-o", second)
    with haff.open(second) as run:
        for function in (analysis.self_diffusion, analysis.shear_viscosity):
            with pytest.raises(
                NotApplicableError, match="needs a run from its start: the file goes on from another run"
            ):
                function(run)


# --- transport -----------------------------------------------------------------------------------------------


def test_gases_that_cool_have_no_coefficients_of_transport(made):
    measure = {"msd": True, "vacf": True, "stress": True, "stress_correlation": True}
    with made("cooling", changed(GAS, measure=measure, output={"events": False})) as run:
        with pytest.raises(NotApplicableError, match="self-diffusion needs a steady temperature: it goes from"):
            analysis.self_diffusion(run)
        with pytest.raises(NotApplicableError, match="viscosity of an equilibrium needs elastic contacts"):
            analysis.shear_viscosity(run)
        figure = figures.draw(run, "msd")
        assert len(figure.axes) == 1 and "no coefficient: needs a steady temperature" in texts(figure)
        assert "no viscosity: needs elastic contacts" in texts(figures.draw(run, "stress"))


@pytest.mark.long
def test_a_gas_that_moves_past_and_one_between_walls_have_no_self_diffusion(made, tmp_path):
    measure = {"msd": True, "interval": 0.1}
    still = changed(GAS, contact={"restitution": 1.0}, measure=measure, run={"until": 40.0}, output={"events": False})
    with made("still", still) as run:
        frame = run.frames[0]
        state = {"x": frame.position, "v": frame.velocity + np.array([0.5, 0.0, 0.0])}
        assert analysis.self_diffusion(run).einstein > 0
        size = run.box.size.tolist()
    rows = zip(state["x"], state["v"])
    lines = ["x,y,z,vx,vy,vz,radius,mass", *(",".join(map(repr, map(float, (*x, *v, 0.5, 1.0)))) for x, v in rows)]
    (tmp_path / "moving.csv").write_text("\n".join(lines) + "\n")
    start = {"positions": {"file": str(tmp_path / "moving.csv")}}
    moving = {**still, "domain": {"size": size}, "initial": start}
    with made("moving", moving) as run:
        with pytest.raises(NotApplicableError, match=r"a center of mass at rest: it moves with the velocity 0\.5"):
            analysis.self_diffusion(run)
    walls = {"size": size, "boundary": ["periodic", "periodic", "wall"]}
    with made("walls", {**still, "domain": walls}) as run:
        with pytest.raises(NotApplicableError, match="self-diffusion needs a periodic box"):
            analysis.self_diffusion(run)


# --- few bodies ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("keys", "why"),
    [
        ({}, ""),
        (
            {"wall": [{**BALL["wall"][0], "motion": {"kind": "sine", "amplitude": 0.01, "frequency": 1.0}}]},
            "the floor oscillates",
        ),
        ({"wall": [{**BALL["wall"][0], "velocity": [0, 0, -0.1]}]}, "the floor has a velocity"),
        ({"wall": [{**BALL["wall"][0], "temperature": 1.0}]}, "the floor is thermal"),
        ({"contact": {"tc": 0.1}}, "needs contacts of no duration"),
        ({"drive": [{"kind": "andersen", "temperature": 0.1, "rate": 0.5}]}, "needs a gas that nothing drives"),
        (
            {"wall": [*BALL["wall"], {"name": "ramp", "plane": {"point": [-9, 0, 0], "normal": [1, 0, 1]}}]},
            "an inclined wall",
        ),
    ],
)
def test_closed_form_of_a_bouncing_ball_has_conditions(tmp_path, keys, why):
    haff.run(changed(BALL, **keys), file=tmp_path / "ball.h5")
    with haff.open(tmp_path / "ball.h5") as run:
        told = texts(figures.draw(run, "closed_form"))
        if not why:
            assert "no closed form" not in told and haff.restitution_from(run).mean == pytest.approx(0.8, rel=1e-9)
            return
        assert "no closed form drawn: " in told and why in told
        if "inclined" not in why:
            with pytest.raises(NotApplicableError):
                experiment.heights(run)


def test_a_ball_that_goes_on_from_another_run_has_no_closed_form(command, tmp_path):
    haff.run(changed(BALL, run={"until": 2.5}), file=tmp_path / "first.h5")
    command("run", "--resume", tmp_path / "first.h5", "--set", "run.until=5", "-o", tmp_path / "second.h5")
    with haff.open(tmp_path / "second.h5") as run:
        assert "needs a run from its start" in texts(figures.draw(run, "closed_form"))


def test_paths_of_kicked_bodies_are_not_followed_by_the_event_log(tmp_path):
    pair = {
        "domain": {"size": [6.0, 6.0, 6.0]},
        "species": [{"name": "a", "count": 2, "radius": 0.5, "mass": 1.0}],
        "drive": [{"kind": "andersen", "temperature": 1.0, "rate": 2.0}],
        "run": {"until": 5.0},
        "output": {"frames": 0.5, "observables": 0.5, "events": True},
    }
    haff.run(pair, file=tmp_path / "pair.h5")
    with haff.open(tmp_path / "pair.h5") as run:
        frames = run.frames
        for body, path in enumerate(figures.trajectories.flights(run)):
            steps = np.linalg.norm(np.diff(path.position, axis=0), axis=1)
            longest = np.linalg.norm(np.diff(frames.array("unwrapped")[:, body], axis=0), axis=1).max()
            assert steps.max() < 0.5 * longest, "the path jumps at a frame"


# --- phases --------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_frames_and_samples_at_one_phase_are_marked(made):
    vibrated = {
        "domain": {"size": [6, 6, 30], "boundary": ["periodic", "periodic", "wall"], "gravity": [0, 0, -1]},
        "species": [{"name": "grain", "count": 100, "radius": 0.5, "mass": 1.0}],
        "contact": {"restitution": 0.9},
        "wall": [{"name": "z-", "motion": {"kind": "sine", "amplitude": 0.2, "frequency": 2.0}}],
        "measure": {"profiles": [{"axis": "z", "bins": 10, "interval": 2.0}]},
        "run": {"until": 20.0},
        "output": {"frames": 0.5, "observables": 0.5},
    }
    note = "at one phase of the wall z-"
    with made("strobed", vibrated) as run:
        for kind in ("heights", "temperature", "energy"):
            assert note in texts(figures.draw(run, kind)), kind
        # The states of profiles are spread.
        assert note not in texts(figures.draw(run, "profiles"))
    equal = [{"axis": "z", "bins": 10, "interval": 5.0, "samples": 10, "spread": False}]
    spread = changed(vibrated, output={"frames": 0.43, "observables": 0.43}, measure={"profiles": equal})
    with made("spread", spread) as run:
        for kind in ("heights", "temperature", "energy"):
            assert note not in texts(figures.draw(run, kind)), kind
        assert f"states {note}" in texts(figures.draw(run, "profiles"))


@pytest.mark.parametrize(
    ("between", "note"),
    [
        (1.0, "at one phase of the wall floor"),
        (4.0, "at one phase of the wall floor"),
        (0.5, "at two opposite phases of the wall floor"),
        (0.25, ""),
        (0.618, ""),
        (0.001, ""),
    ],
)
def test_records_are_compared_with_the_period(tmp_path, between, note):
    path = synthetic.bouncing_ball(tmp_path / "ball.h5")
    with haff.open(path) as run:
        motion = {"kind": "sine", "amplitude": 0.1, "frequency": 1.0}
        run.scene["wall"] = [{"name": "floor", "motion": motion}]
        assert phase_note(run, between * np.arange(200.0)) == note


# --- totals --------------------------------------------------------------------------------------------------


def test_studies_have_all_totals_of_runs(tmp_path):
    scene = changed(
        GAS, contact={"tangential_restitution": 0.5}, drive=[NOISE], run={"until": 1.0}, output={"events": False}
    )
    study = haff.sweep(scene, {"contact.restitution": [0.8]}, output=tmp_path / "study")
    run = haff.run(scene)
    of_the_process = ("threads", "peak_memory_bytes", "seed", "trajectory_version")
    numbers = {name for name, value in run.report.items() if isinstance(value, (int, float))} - set(of_the_process)
    assert numbers <= set(study.data_vars), sorted(numbers - set(study.data_vars))
    for name in numbers - {"wall_seconds", "collisions_per_second"}:
        assert float(study[name].isel(restitution=0, seed=0)) == run.report[name], name
    assert run.report["drive_work"] > 0 and run.report["rotational_energy"] > 0
    with haff.open(tmp_path / "study" / str(study.file.values.ravel()[0])) as file:
        for name in ("kinetic_energy", "rotational_energy", "dissipated_energy", "carnot_energy", "drive_work"):
            assert file.summary[name] == pytest.approx(run.report[name]), name
