"""The table of impacts: velocities from frames and impulses, and the equations of impact."""

import numpy as np
import pytest

import haff
from conftest import CONFIGS
from haff import analysis
from haff.analysis.experiment import body_name
from haff.command.main import main

TEXTBOOK = sorted(path.stem for path in (CONFIGS / "textbook").glob("*.toml"))


@pytest.mark.parametrize("name", TEXTBOOK)
def test_impacts_of_the_textbook_obey_carnots_theorem(name, tmp_path):
    with haff.run(CONFIGS / "textbook" / f"{name}.toml", file=tmp_path / "run.h5", output__events=True) as run:
        table = analysis.impacts(run)
        log = run.file.events.to_pandas()
    assert len(table) == log["kind"].isin(["collision", "wall", "stick"]).sum()
    check = table["carnot_check"].to_numpy()
    assert np.all(np.isnan(check) | (np.abs(check) < 1e-14))
    # A rod takes part in the impact of its ends.
    assert np.isnan(check).any() == ("rod" in name)


def test_an_oblique_impact_has_the_numbers_of_the_problem(tmp_path):
    with haff.run(CONFIGS / "textbook/oblique_pair.toml", file=tmp_path / "run.h5", output__events=True) as run:
        row = run.file.impacts().iloc[0]
    assert (row["first"], row["second"]) == ("one", "two")
    velocities = {
        "first_before": (30, 10), "second_before": (-10, -30), "first_after": (0, 10), "second_after": (20, -30),
    }  # fmt: skip
    for name, expected in velocities.items():
        assert [row[f"{name}_{axis}"] for axis in "xy"] == pytest.approx(expected, abs=1e-12)
    assert (row["e"], row["impulse"]) == pytest.approx((0.5, 30.0), rel=1e-14)
    assert row["angle_before"] == pytest.approx(45.0) and row["angle_after"] == pytest.approx(np.degrees(np.arctan(2)))


def test_velocities_of_a_break_shot_are_those_of_the_next_frames(tmp_path):
    with haff.run(CONFIGS / "breakshot.toml", file=tmp_path / "run.h5", output__events=True) as run:
        table, last = analysis.impacts(run), run.file.frames[-1]
        assert len(table) > 50
        for body in range(1, 16):
            mine = table[(table["first"] == f"ball {body}") | (table["second"] == f"ball {body}")]
            if len(mine):
                row = mine.iloc[-1]
                side = "first" if row["first"] == f"ball {body}" else "second"
                after = [row[f"{side}_after_{axis}"] for axis in "xy"]
                assert last.velocity[body, :2] == pytest.approx(after, rel=1e-9, abs=1e-12)


def test_tables_are_markdown_csv_and_latex(tmp_path, capsys):
    run = haff.run(CONFIGS / "textbook/direct_impact.toml", file=tmp_path / "run.h5", output__events=True)
    run.close()
    path = str(tmp_path / "run.h5")
    assert main(["table", path]) == 0
    lines = capsys.readouterr().out.splitlines()
    headings = [heading.strip() for heading in lines[0].strip("|").split("|")]
    assert headings[:4] == ["time", "first", "second", "first before x"] and len(lines) == 3
    assert "first before y" not in headings, "components that are 0 throughout"
    assert main(["table", path, "-o", str(tmp_path / "impacts.csv")]) == 0
    assert (tmp_path / "impacts.csv").read_text().startswith("time,first,second,first_before_x,")
    assert main(["table", path, "--to", "latex"]) == 0
    assert r"\begin{tabular}" in capsys.readouterr().out.replace("impacts.csv", "")
    assert main(["table", path, "--columns", "e, first before x,time", "--digits", "3"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [heading.strip() for heading in lines[0].strip("|").split("|")] == ["e", "first before x", "time"]
    whole = haff.open(path).impacts()
    cells = [float(cell) for cell in lines[2].strip("|").split("|")]
    assert cells == [float(f"{whole[name][0]:.3g}") for name in ("e", "first_before_x", "time")]
    for wrong, told in ((["--columns", "e,v"], "columns = 'v': must be one of time"), (["--digits", "0"], "1 to 17")):
        assert main(["table", path, *wrong]) == 2
        assert told in capsys.readouterr().err
    assert main(["table", path, "--to", "html"]) == 2
    assert main(["table", path, "-o", str(tmp_path / "impacts.csv")]) == 2, "the file exists"


def test_what_has_no_table_says_why(files, tmp_path):
    with haff.open(files["quiet"]) as run, pytest.raises(haff.MissingDataError, match="no event log"):
        analysis.impacts(run)
    with haff.open(files["cooling"]) as run, pytest.raises(haff.NotApplicableError, match="are more than most = 10"):
        analysis.impacts(run, most=10)
    heated = haff.run(
        haff.template("heated_gas"), species__0__count=50, run__until=0.5, file=tmp_path / "h.h5", output__events=True
    )
    with heated, pytest.raises(haff.NotApplicableError, match="the kicks of drives"):
        analysis.impacts(heated)


def test_spins_are_those_of_the_next_frames(tmp_path):
    """Rough disks of two sizes in a box with rough walls, and a rough ball on a floor."""
    places = [[1.0, 1.0], [2.6, 1.2], [4.1, 3.0], [1.2, 3.4], [3.0, 4.4]]
    ball = {"velocity": [1.0, 0.7], "mass": 1.0, "angular_velocity": [0.5]}
    scene = {
        "schema": 1,
        "dimension": 2,
        "domain": {"size": [5.0, 5.0], "boundary": ["wall", "wall"]},
        "particle": [{**ball, "position": at, "radius": 0.3 + 0.05 * k} for k, at in enumerate(places)],
        "contact": {"restitution": 0.9, "tangential_restitution": 0.4},
        "run": {"until": 20.0},
        "output": {"events": True, "frames": 1.0},
    }
    for case in (scene, CONFIGS / "bouncing_superball.toml"):
        with haff.run(case, file=tmp_path / "run.h5", output__events=True, overwrite=True) as run:
            table, frames, dimension = analysis.impacts(run), run.file.frames, run.file.dimension
            names = [f"first_spin_after{axis}" for axis in ([""] if dimension == 2 else ["_x", "_y", "_z"])]
            checked = 0
            for frame in frames:
                if np.min(np.abs(table["time"] - frame.time)) < 1e-9:
                    continue  # before or after the impact, by rounding
                past = table[table["time"] < frame.time]
                for body in range(len(frame.radius)):
                    name = body_name(run.file, body)
                    mine = past[(past["first"] == name) | (past["second"] == name)]
                    if len(mine):
                        row = mine.iloc[-1]
                        side = "first" if row["first"] == name else "second"
                        found = [row[column.replace("first", side)] for column in names]
                        expected = frame.angular_velocity[body][-len(names) :]
                        assert found == pytest.approx(expected, rel=1e-9, abs=1e-12)
                        checked += 1
        assert checked > 10
        # The slip is multiplied by −β, of the whole relative velocity of the surfaces.
        beta = 0.4 if case is scene else 1.0
        assert table["slip_after"].to_numpy() == pytest.approx(
            beta * table["slip_before"].to_numpy(), rel=1e-9, abs=1e-12
        )
