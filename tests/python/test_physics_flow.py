"""Inlets and outlets: a beam's number of particles, the discharge of a hopper that is refilled, a Galton board."""

import numpy as np
import pytest

import haff
from haff import analysis

pytestmark = pytest.mark.physics


@pytest.mark.long
def test_a_beam_has_as_many_particles_as_come_in_during_their_flight(tmp_path):
    """Particles too small to meet fly straight from the inlet to the outlet: their number is rate times flight."""
    rate, speed, until = 40.0, 2.0, 200.0
    scene = {
        "seed": 5,
        "domain": {"size": [20.0, 10.0, 10.0], "boundary": ["wall", "periodic", "periodic"]},
        "species": [{"name": "atom", "count": 0, "radius": 1e-4, "mass": 1.0}],
        "inlet": [
            {
                "species": "atom",
                "box": [[1.0, 0.0, 0.0], [1.5, 10.0, 10.0]],
                "velocity": [speed, 0.0, 0.0],
                "rate": rate,
                "count": 20000,
            }
        ],
        "outlet": [{"box": [[17.0, 0.0, 0.0], [20.0, 10.0, 10.0]], "interval": 0.05}],
        "run": {"until": until},
        "output": {"frames": False, "observables": 20.0},
    }
    with haff.run(scene, file=tmp_path / "beam.h5").file as run:
        table = run.observables
    # From the inlet, 1.25 on average, to the outlet, and on average half an interval into it.
    flight = (17.0 - 1.25) / speed + 0.5 * 0.05
    # Twice the flight apart, numbers are independent.
    counts = table["particles"].to_numpy()[1:]
    expected = rate * flight
    z = (counts.mean() - expected) / np.sqrt(expected / len(counts))
    assert abs(z) < 4, f"{counts.mean():.1f}, expected {expected:.1f}: z = {z:.1f}"
    entered = table["particles_in"].iloc[-1]
    z = (entered - rate * until) / np.sqrt(rate * until)
    assert abs(z) < 4, f"{entered} entries, expected {rate * until}: z = {z:.1f}"
    # Velocities are those of the inlet: momentum and energy follow from the numbers.
    assert table["momentum_x"].to_numpy() == pytest.approx(speed * table["particles"].to_numpy(), rel=1e-12)
    assert table["inlet_energy"].iloc[-1] == pytest.approx(0.5 * speed**2 * entered, rel=1e-12)


@pytest.mark.long
def test_discharge_of_a_hopper_that_is_refilled_is_steady(command):
    with command.run("refilled_hopper", run__until=120.0, output__frames=10.0, output__observables=2.0).open() as run:
        table = run.observables[15:]
        rate, particles = table["discharge_rate"].to_numpy(), table["particles"].to_numpy()
        assert (particles == len(run)).all(), "all that leaves comes in again"
    first, second = (analysis.block_average(half, 6) for half in np.array_split(rate, 2))
    z = (first.mean - second.mean) / np.hypot(first.error, second.error)
    assert abs(z) < 4, f"{first} {second}: z = {z:.1f}"


@pytest.mark.long
@pytest.mark.parametrize("settings", [{"seed": 1}, {"seed": 5}, {"seed": 6}])
def test_balls_in_the_bins_of_a_galton_board_come_to_rest(command, settings):
    """Some fall into a gap of their own width, which hardly narrows: with these seeds the run ended as a collapse."""
    done = command.run("galton_board", run__until=100.0, output__frames=50.0, **settings)
    assert done.report["stopped"] in ("until", "rest")
    with done.open() as run:
        assert (run.frames[-1].species == run.species_names.index("ball")).sum() > 180, "of 200 on average"


@pytest.mark.long
def test_balls_of_a_galton_board_are_as_often_on_the_left_as_on_the_right(command):
    with command.run("galton_board").open() as run:
        last = run.frames[-1]
        balls = last.species == run.species_names.index("ball")
        x, y = last.position[balls, 0], last.position[balls, 1]
    assert len(x) == 200 and (y < 5).all(), "all have fallen into the bins"
    deviation = x - 11.0
    z = deviation.mean() / (deviation.std() / np.sqrt(len(x)))
    assert abs(z) < 4, f"{deviation.mean():.2f}: z = {z:.1f}"
    # Wider than twelve independent steps of a half, since balls go on in their direction.
    assert 0.5 * np.sqrt(12) < deviation.std() < 6
    middle, outside = np.abs(deviation) < 4, np.abs(deviation) > 8
    assert middle.sum() > 4 * outside.sum(), "a bell curve"
