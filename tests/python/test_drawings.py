"""What pictures of few bodies show: strings, inclined walls and spins; titles and units."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.text import Text

import haff
from haff.command.main import main
from haff.figures import movie, walls
from haff.figures.style import BLACK
from haff.files.measure import in_dimension


def lines(figure, color):
    """``[n, 2]`` points of each line of a color in the only axes of a figure."""
    found = [c for c in figure.axes[0].collections if isinstance(c, LineCollection) and len(c.get_segments())]
    return [line for c in found if to_hex(c.get_colors()[0]) == to_hex(color) for line in c.get_segments()]


def texts(figure):
    return [text.get_text() for text in figure.findobj(Text) if text.get_text()]


def test_snapshots_show_strings_from_pivots_to_bobs(command):
    from haff.figures.render import Camera

    with command.run("textbook/pendulums", run__until=0.2).open() as run:
        figure, bobs = run.plot("snapshot"), run.frames[-1].position
        pivots = [pendulum["pivot"] for pendulum in run.scene["pendulum"]]
    ends = [Camera.looking().project(np.stack([pivot, bob]))[:, :2] for pivot, bob in zip(pivots, bobs)]
    drawn = lines(figure, BLACK)
    assert all(any(np.allclose(line[[0, -1]], end) for line in drawn) for end in ends)
    x, y = figure.axes[0].get_xlim(), figure.axes[0].get_ylim()
    assert all(x[0] < end[0, 0] < x[1] and y[0] < end[0, 1] < y[1] for end in ends)


def test_a_slack_string_sags_along_gravity(command):
    # Released above its pivot the bob falls freely at first.
    with command.run("textbook/pendulums", pendulum__0__angle=-2.5, run__until=0.3).open() as run:
        pivots = np.array([pendulum["pivot"] for pendulum in run.scene["pendulum"]])
        length = np.array([pendulum["length"] for pendulum in run.scene["pendulum"]])
        distance = np.linalg.norm(run.frames.array("position") - pivots, axis=2)
        slack = np.argwhere(distance < 0.98 * length)
        assert len(slack), "no string goes slack"
        index, which = map(int, slack[0])
        figure, bob = run.plot("snapshot", index=index), run.frames[index].position[which]
    from haff.figures.render import Camera

    ends = Camera.looking().project(np.stack([pivots[which], bob]))[:, :2]
    bent = [line for line in lines(figure, BLACK) if len(line) > 2 and np.allclose(line[[0, -1]], ends)]
    assert bent
    middle = bent[0][len(bent[0]) // 2]
    assert middle[1] < ends.mean(axis=0)[1] - 0.01


def test_springs_are_zigzags_between_their_ends(command):
    with command.run("textbook/spring_impact", run__until=0.1).open() as run:
        figure, place = run.plot("snapshot"), run.frames[-1].position[:, :2]
    zigzag = next(line for line in lines(figure, BLACK) if len(line) > 20)
    assert any(np.allclose(zigzag[0], at) for at in place) and any(np.allclose(zigzag[-1], at) for at in place)


WEDGE = {
    "schema": 1,
    "dimension": 2,
    "domain": {"boundary": ["open", "open"], "gravity": [0.0, -9.81]},
    "wall": [{"name": "slope", "plane": {"point": [0.0, 0.0], "normal": [0.5, 1.0]}}],
    "particle": [{"position": [1.2, 2.0], "radius": 0.1, "mass": 1.0}],
    "run": {"until": 1.0},
    "output": {"frames": 0.02, "events": True},
}


def test_paths_show_inclined_walls(tmp_path):
    haff.run(WEDGE, file=tmp_path / "wedge.h5")
    with haff.open(tmp_path / "wedge.h5") as run:
        slope = lines(run.plot("paths"), walls.WALL)
    assert len(slope) == 1
    assert np.allclose(slope[0] @ [0.5, 1.0], 0.0)
    along = np.diff(slope[0][:, 0])
    assert abs(along[0]) > 0.5


def test_trajectories_show_spins_with_their_jumps(command):
    with command.run("bouncing_superball").open() as run:
        figure, when = run.plot("trajectories"), run.events["time"][:]
    axes = figure.axes[-1]
    assert "omega_y" in axes.get_ylabel()
    time, spin = axes.lines[0].get_data()
    # ω = 0 and 20/7 s / (2 R) = 40/7 in turn, as configs/bouncing_superball.toml says.
    for k, bounce in enumerate(when):
        at = np.flatnonzero(time == bounce)
        assert np.allclose(spin[at[[0, -1]]], [0.0, 40 / 7] if k % 2 == 0 else [40 / 7, 0.0], atol=1e-12)


def test_a_sliding_ball_has_a_spin_without_a_jump(command):
    with command.run("rolling").open() as run:
        time, spin = run.plot("trajectories").axes[-1].lines[0].get_data()
        assert np.abs(np.diff(spin)).max() < 0.05 * np.abs(spin).max()
        assert np.allclose(np.interp(run.frames.time, time, spin), run.frames.array("angular_velocity")[:, 0, 1])


@pytest.mark.long
@pytest.mark.parametrize("kind", ["temperature", "snapshot", "velocity"])
def test_titles_can_be_off(files, tmp_path, kind):
    with haff.open(files["cooling"]) as run:
        titled, plain = run.plot(kind), run.plot(kind, title=False)
        assert len(titled.texts) == 2 and not plain.texts
        with pytest.raises(haff.ArgumentError, match="title = 'no': must be True or False"):
            run.plot(kind, title="no")
        assert len(run.plot(kind).texts) == 2
    head, facts = (text.get_text() for text in titled.texts)
    for title in ((), ("--no-title",)):
        to = ["-o", str(tmp_path / str(len(title)))]
        assert main(["plot", str(files["cooling"]), "--kind", kind, "--format", "svg", *title, *to]) == 0
    with_title, without = ((tmp_path / name / f"cooling-{kind}.svg").read_text() for name in "01")
    assert head in with_title and head not in without, facts


@pytest.mark.long
def test_movies_can_be_without_titles(files, tmp_path):
    from PIL import Image

    with haff.open(files["cooling"]) as run:
        sizes = []
        for title in (True, False):
            movie.save(run, tmp_path / f"{title}.gif", frames="0:1", title=title)
            sizes.append(np.asarray(Image.open(tmp_path / f"{title}.gif").convert("L"))[:40, :200])
    assert (sizes[0] < 100).sum() > 50 and not (sizes[1] < 100).sum()


@pytest.mark.parametrize(("scene", "dimension"), [("cooling", 3), ("disks", 2)])
def test_units_have_the_number_of_the_dimension(command, scene, dimension):
    small = {"species__0__count": 200, "run__until": 5.0, "output__observables": 0.1, "domain__packing_fraction": 0.1}
    with command.run(scene, **small).open() as run:
        units = {key: value.attrs.get("units", "1") for key, value in run.to_xarray().data_vars.items()}
        shown = texts(run.plot("means"))
    assert not [unit for unit in units.values() if "^d" in unit]
    assert not [text for text in shown if "^d" in text]
    assert f"energy/length^{dimension}" in units.values()


def test_letters_of_the_dimension():
    assert [in_dimension("energy^2 time^2/length^2d", d) for d in (2, 3)] == [
        "energy^2 time^2/length^4", "energy^2 time^2/length^6",
    ]  # fmt: skip
    assert in_dimension("length/time", 2) == "length/time"


def test_live_measurements_have_units_of_their_dimension():
    scene = {
        "schema": 1,
        "dimension": 2,
        "domain": {"size": [10.0, 10.0], "boundary": ["periodic", "periodic"]},
        "species": [{"name": "a", "count": 20, "radius": 0.2, "mass": 1.0}],
        "initial": {"temperature": 1.0},
        "measure": {"profiles": [{"axis": "x", "bins": 2, "interval": 0.5}], "stress_correlation": True},
        "run": {"until": 1.0},
    }
    simulation = haff.Simulation(scene)
    simulation.advance(1.0)
    profile, stress = simulation.take_profiles()["x"], simulation.correlations["stress"]
    assert profile["density"].attrs["units"] == "1/length^2"
    assert stress["value"].attrs["units"] == "energy^2/length^4"
