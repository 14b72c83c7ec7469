"""The scenes of configs/textbook and the break shot against their closed forms."""

import math
import re

import numpy as np
import pytest

from haff import analysis

pytestmark = pytest.mark.physics


def textbook(command, name):
    return command.run(f"textbook/{name}")


def test_rebound_heights_fall_by_e_squared(command):
    H, e, g = 1.0, 0.8, 9.81
    with textbook(command, "bouncing_ball").open() as run:
        log = run.events.to_pandas()
        bounces = log[log["kind"] == "wall"]
        heights = bounces["approach_speed"] ** 2 / (2 * g)
        expected = H * e ** (2 * np.arange(len(bounces)))
        assert len(bounces) >= 5
        assert np.max(np.abs(heights - expected)) <= 1e-12 * H
        fall = math.sqrt(2 * H / g)
        times = fall * (1 + 2 * np.cumsum(np.r_[0, e ** np.arange(1, len(bounces))]))
        assert np.allclose(bounces["time"], times, rtol=0, atol=1e-12 * times[-1])


def test_rebound_heights_from_recorded_frames(command):
    # Energy over m g between bounces is the height of the next apex, frame by frame.
    H, e, g = 1.0, 0.8, 9.81
    with textbook(command, "bouncing_ball").open() as run:
        log = run.events.to_pandas()
        hits = log["time"][log["kind"] == "wall"].to_numpy()
        z, v = run.frames.array("position")[:, 0, 2], run.frames.array("velocity")[:, 0, 2]
        k = np.searchsorted(hits, run.frames.time, side="right")
        flying = run.frames.time < hits[-1]
        apex = z - 0.1 + v**2 / (2 * g)
        assert np.max(np.abs(apex - H * e ** (2.0 * k))[flying]) <= 1e-12 * H


def test_bouncing_ball_comes_to_rest_after_a_finite_time_and_path(command):
    H, e, g = 1.0, 0.8, 9.81
    done = textbook(command, "bouncing_ball")
    with done.open() as run:
        log = run.events.to_pandas()
        rest = log[log["kind"] == "rest"]
        assert len(rest) == 1
        T = math.sqrt(2 * H / g) * (1 + e) / (1 - e)
        assert rest["time"].iloc[0] == pytest.approx(T, rel=1e-9)
        bounces = log[log["kind"] == "wall"]
        heights = bounces["approach_speed"].to_numpy() ** 2 / (2 * g)
        # The row of the series has all of the remaining energy: m g × the height before its first impact.
        left = rest["energy_loss"].iloc[0] / (1.0 * g)
        path = heights[0] + 2 * heights[1:].sum() + 2 * left / (1 - e**2)
        assert path == pytest.approx(H * (1 + e**2) / (1 - e**2), rel=1e-9)
        lost = math.fsum(log["energy_loss"])
        assert lost == pytest.approx(g * H, rel=1e-12), "all of m g H is lost in the end"
        assert run.observables["dissipated_energy"].iloc[-1] == pytest.approx(lost, rel=1e-12)
        last = run.frames[-1]
        assert last.position[0, 2] == pytest.approx(0.1, abs=1e-12) and np.all(last.velocity == 0)
        assert run.observables["ledger_residual"].abs().max() <= 1e-12
    assert done.report["stopped"] == "rest"
    assert done.report["wall_collisions"] < 10_000


def test_direct_impact_agrees_with_its_closed_form(command):
    with textbook(command, "direct_impact").open() as run:
        velocity = run.frames[-1].velocity
        assert velocity[:, 0] == pytest.approx([1.5, 3.0], rel=1e-14) and np.all(velocity[:, 1:] == 0)
        (event,) = run.events.to_pandas().itertuples()
        assert event.time == pytest.approx(1.0, rel=1e-14)
        assert (event.approach_speed, event.impulse) == pytest.approx((3.0, 3.0), rel=1e-14)
        assert (event.energy_loss, event.carnot_energy) == pytest.approx((2.25, 6.75), rel=1e-14)
        assert event.energy_loss == pytest.approx(event.carnot_energy * 0.5 / 1.5, rel=1e-14)
        assert (event.normal_x, event.position_x) == pytest.approx((1.0, 3.5), rel=1e-13)


def test_oblique_impact_of_problem_2_2(command):
    with textbook(command, "oblique_pair").open() as run:
        velocity = run.frames[-1].velocity
        expected = np.array([[0.0, 10.0, 0.0], [20.0, -30.0, 0.0]])
        assert np.allclose(velocity, expected, rtol=0, atol=1e-12 * 40), f"{velocity}, expected {expected}"
        (event,) = run.events.to_pandas().itertuples()
        assert event.time == pytest.approx(0.05, rel=1e-13)
        assert (event.approach_speed, event.impulse, event.energy_loss) == pytest.approx((40, 30, 300), rel=1e-13)
        momentum = run.frames.array("velocity").sum(axis=1)
        assert np.allclose(momentum, momentum[0], rtol=0, atol=1e-13 * 40)
        # (2.26): impacts of smooth spheres conserve their angular momentum.
        spin = np.cross(run.frames.array("position"), run.frames.array("velocity"))[..., 2].sum(axis=1)
        assert np.allclose(spin, spin[0], rtol=0, atol=1e-12 * np.abs(spin).max())


def test_oblique_impact_with_a_wall(command):
    with textbook(command, "oblique_wall").open() as run:
        velocity = run.frames[-1].velocity[0]
        assert np.allclose(velocity, [1.0, 1.0, 0.0], rtol=0, atol=1e-14)
        (event,) = run.events.to_pandas().itertuples()
        assert event.kind == "wall" and event.time == pytest.approx(1.0, rel=1e-14)
        assert (event.normal_x, event.normal_y) == pytest.approx((0.0, -1.0), abs=1e-14), (
            "the normal points into the wall"
        )
        assert event.energy_loss == pytest.approx(1.5, rel=1e-14)


@pytest.mark.parametrize(
    ("name", "m1", "m2", "v"), [("hammer_and_nail", 0.5, 0.005, 5.0), ("forging", 50.0, 1000.0, 6.0)]
)
def test_plastic_impact_loses_the_share_of_equation_2_18(command, name, m1, m2, v):
    with textbook(command, name).open() as run:
        event, *further = run.events.to_pandas().itertuples()
        # The velocities after a plastic impact agree only to rounding: a second contact is possible.
        assert all(contact.approach_speed < 1e-15 * v for contact in further)
        share = event.energy_loss / (0.5 * m1 * v**2)
        assert share == pytest.approx(1 / (1 + m1 / m2), rel=1e-13)
        speed = np.linalg.norm(run.frames[-1].velocity, axis=1)
        assert speed == pytest.approx([m1 * v / (m1 + m2)] * 2, rel=1e-13), "both move on together"
        assert event.carnot_energy == pytest.approx(event.energy_loss, rel=1e-14), "Carnot's theorem at e = 0"


def test_break_shot_stays_on_the_table_and_balances(command):
    done = command.run("breakshot")
    with done.open() as run:
        table = run.observables
        assert table["ledger_residual"].abs().max() <= 1e-12
        assert done.report["collisions"] >= 15 and done.report["wall_collisions"] > 0
        start = 0.5 * 0.17 * 81
        assert table["kinetic_energy"].iloc[0] == pytest.approx(start, rel=1e-14)
        assert math.fsum(run.events["energy_loss"]) == pytest.approx(table["dissipated_energy"].iloc[-1], rel=1e-12)
        radius = run.radius[:, None]
        for frame in run.frames:
            assert analysis.kinetic_energy(frame) <= start * (1 + 1e-14)
            assert np.all(frame.position[:, :2] >= radius - 1e-12)
            assert np.all(frame.position[:, :2] <= run.box.size[:2] - radius + 1e-12)
            assert analysis.max_overlap(frame).depth <= 1e-12
            assert np.all(frame.position[:, 2] == 0)


def test_spring_energy_is_separate_from_that_of_gravity(command):
    with command.run("textbook/spring_impact").open() as run:
        table = run.observables
        spring = table["spring_energy"].to_numpy()
        x = run.frames.array("position")[:, :, 0]
        assert np.allclose(spring, 0.5 * 60.0 * (x[:, 2] - x[:, 1] - 1.0) ** 2, rtol=0, atol=1e-13 * 18)
        assert np.allclose(table["gravity_energy"], 0) and np.allclose(table["potential_energy"], spring, rtol=1e-15)
        # The spring takes at most half of the energy after the plastic impact: k/2 · v² m/6k.
        assert spring.max() == pytest.approx(36 / 12, rel=1e-3)
        assert run.summary["spring_energy"] == spring[-1]
        assert "spring_energy" in repr(run)
    output = command("info", command.run("textbook/spring_impact").path).stdout
    assert re.search(r"potential energy +\S+\n +of springs +\S+", output), output
    with textbook(command, "pendulums").open() as run:
        assert "spring_energy" not in run.observables and "of springs" not in command("info", run.path).stdout


def test_sticking_particle_follows_a_moving_wall_and_an_elastic_one_does_not(command, tmp_path):
    scene = tmp_path / "clay.toml"
    body = '[[particle]]\nname = "{}"\nposition = [0.0, 0.0, {}]\nradius = 0.1\nmass = 2.0\n'
    scene.write_text(
        'schema = 1\n[domain]\nboundary = ["open", "open", "open"]\ngravity = [0.0, 0.0, -9.81]\n'
        '[[wall]]\nname = "lift"\nvelocity = [0.0, 0.0, 0.5]\nsticks = true\n'
        "plane = { point = [0, 0, 0], normal = [0, 0, 1] }\n"
        + body.format("clay", 1.1)
        + body.format("ball", 1.1).replace("[0.0,", "[1.0,")
        + '[[contact.pair]]\nbetween = ["ball", "lift"]\nrestitution = 1.0\n'
        "[run]\nuntil = 0.9\n[output]\nevents = true\nobservables = 0.1\n"
    )
    with command.run(scene).open() as run:
        log = run.events.to_pandas()
        assert list(log["kind"]) == ["wall", "wall"]
        hit = (-0.5 + math.sqrt(0.25 + 2 * 9.81)) / 9.81
        assert log["time"].to_numpy() == pytest.approx([hit, hit], rel=1e-13)
        speed = 9.81 * hit + 0.5
        assert log["energy_loss"].to_numpy() == pytest.approx([speed**2, 0], rel=1e-13), "½ m v² with m = 2"
        assert log["carnot_energy"].to_numpy() == pytest.approx([speed**2, 4 * speed**2], rel=1e-13)
        last = run.frames[-1]
        assert last.velocity[0] == pytest.approx([0, 0, 0.5], abs=1e-15) and last.position[0, 2] == pytest.approx(0.55)
        fall = 9.81 * (0.9 - hit)
        assert last.velocity[1, 2] == pytest.approx(speed + 0.5 - fall, rel=1e-12)
        assert run.observables["ledger_residual"].abs().max() < 1e-14
