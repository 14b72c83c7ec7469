"""All readers, figures, pages and exports take every shipped scene, every template and every form of every key."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import forms
import haff
from conftest import CONFIGS
from haff import figures, viewer
from haff.errors import MissingDataError, NotApplicableError
from haff.export import FORMATS, TABLES, export
from haff.files import measure
from haff.files.scene import SceneFault, parsed, shaped_walls
from validation.runs import toml

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

SHIPPED = sorted(path for path in CONFIGS.glob("**/*.toml") if "invalid" not in path.parts)
MOST = 210
"""Particles of each species in these runs: figures of velocities need 200."""
SHORTER = 20
"""By how much runs of gases are shorter than in their scenes."""
FULL = ("fcc_073",)
"""Scenes that need all their particles."""
OF_PLUGINS = "of what another crate adds: examples/plugin/tests"
ELSEWHERE = {
    ("engine.simd", "avx2"): "not every processor has these instructions, and files do not differ",
    ("output.file", "string"): "named by the command line here",
    ("species[].radius.table", "string"): "a file of sizes is read when the run starts",
    ("contact.restitution.parameters", "object"): OF_PLUGINS,
    ("contact.wall_restitution.parameters", "object"): OF_PLUGINS,
    ("contact.pair[].restitution.parameters", "object"): OF_PLUGINS,
    ("wall[].restitution.parameters", "object"): OF_PLUGINS,
    ("wall[].surface", "string"): OF_PLUGINS,
    ("wall[].parameters", "object"): OF_PLUGINS,
    ("drive[].parameters", "object"): OF_PLUGINS,
    ("wall[].mesh.hash", "string"): "set by the program",
    ("measure.probes", "list"): OF_PLUGINS,
    ("measure.probes[]", "table"): OF_PLUGINS,
    ("measure.probes[].kind", "string"): OF_PLUGINS,
    ("measure.probes[].parameters", "object"): OF_PLUGINS,
}
"""Forms that no scene of this test has, and why."""


def small(scene: dict, name: str) -> dict[str, object]:
    """Settings that make a run of a scene short, with some frames and samples in it."""
    changes: dict[str, object] = {"output.events": name != "collapse"}
    species = scene.get("species", ())
    for k, one in enumerate(species):
        if one["count"] > MOST and name not in FULL:
            changes[f"species.{k}.count"] = MOST
    run = scene.get("run", {})
    if until := run.get("until"):
        until = until / (SHORTER if species else 1)
        changes |= {"run.until": until, "output.frames": until / 6, "output.observables": until / 20}
        changes |= {"run.collisions": 3000} if "collisions_per_particle" not in run else {}
    else:
        changes["run.collisions_per_particle"] = 5.0
    return changes


def read(path: Path, folder: Path) -> list[str]:
    """Reads all of a file in every way; returns the names of the figures that apply."""
    drawn = []
    with haff.open(path) as run:
        assert len(repr(run)) > 50 and "damaged" not in repr(run) and "damaged" not in run._repr_html_()
        assert run.summary["particles"] == len(run) == len(run.mass) == len(run.radius) == len(run.species)
        assert run.parameters and len(run.wall_names) >= 0
        if "frames" in run:
            for frame in (run.frames[0], run.frames[-1]):
                assert frame.position.shape == frame.velocity.shape == (len(frame.id), 3)
                assert len(frame.to_pandas()) == len(frame.id) and (run.flows or len(frame.id) == len(run))
        if "observables" in run:
            assert len(run.observables) == run.to_xarray().sizes["time"] == run.summary["samples"]
        if "events" in run:
            assert len(run.events.to_pandas()) == len(run.events)
        for part, found in (("profiles", "profiles"), ("correlations", "correlations")):
            assert part not in run or getattr(run, found)
        assert "correlations" not in run or measure.correlation_columns(run)
        for kind in figures.KINDS:
            try:
                figures.KINDS[kind].draw(run)
                drawn.append(kind)
            except (NotApplicableError, MissingDataError):
                continue
        outputs = [(name, None) for name in FORMATS if FORMATS[name].trajectory and "frames" in run]
        outputs += [(name, table) for name in ("csv", "parquet") for table in TABLES if table in run]
        for name, table in outputs:
            export(run, folder / f"out{FORMATS[name].suffix}", to=name, table=table, overwrite=True)
        if "frames" in run:
            viewer.view(run, folder / "page.html", overwrite=True)
    return drawn


def check(command, folder: Path, scene: Path, changes: dict[str, object] | None = None, status: int = 0) -> list[str]:
    path = folder / "run.h5"
    sets = [part for key, value in (changes or {}).items() for part in ("--set", f"{key}={toml(value)}")]
    arguments = ["--quiet", "--json", "--threads", "1", "-o", path, "--overwrite"]
    done = command("run", scene, *arguments, *sets, check=False)
    assert done.returncode in (0, status), done.stderr
    report, info = json.loads(done.stdout), json.loads(command("info", path, "--json").stdout)
    assert info["collisions"] == report["collisions"] and info["summary"]["state_hash"] == report["state_hash"]
    if (last := info["last"]) is not None:
        # Of both what the other has, too: names of totals are written once.
        energies = [name for name in last if name.endswith(("energy", "work", "heat")) and last[name] is not None]
        assert {name: last[name] for name in energies} == {name: pytest.approx(report[name]) for name in energies}
    assert "events" in command("info", path).stdout
    expected = json.loads(command("check", scene, "--json", *sets).stdout)["temperature"]
    with haff.open(path) as run:
        if "observables" in run and np.isfinite(run.samples["temperature"][0]):
            assert run.samples["temperature"][0] == pytest.approx(expected, rel=1e-12), "temperature of haff check"
    return read(path, folder)


@pytest.mark.long
@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: "-".join(path.relative_to(CONFIGS).with_suffix("").parts))
def test_shipped_scene_is_read_by_everything(path, command, tmp_path):
    # A collapse ends a scene with exit status 3, and its file is read all the same.
    drawn = check(command, tmp_path, path, small(tomllib.loads(path.read_text()), path.stem), status=3)
    assert len(drawn) >= 3, f"only {drawn}"


def test_shipped_scenes_are_templates(command, tmp_path):
    texts = {path.stem: path.read_text() for path in SHIPPED if path.parent.name in ("configs", "textbook")}
    assert set(texts) == set(haff.templates())
    assert all(command("init", name, cwd=tmp_path).stdout == text for name, text in texts.items())
    # The mesh of a scene is written beside it, once, and never over another file.
    (tmp_path / "mill.toml").write_text(texts["mill"])
    assert command("check", "mill.toml", cwd=tmp_path).returncode == 0
    mesh = tmp_path / "meshes/mill.obj"
    mesh.write_text("mine")
    refused = command("init", "mill", cwd=tmp_path, check=False)
    assert refused.returncode == 2 and "exists with other contents" in refused.stderr
    assert mesh.read_text() == "mine"
    listed = command("init", "--list").stdout
    assert all(name in listed and title in listed for name, title in haff.templates().items())
    missing = command("run", "drum", cwd=tmp_path, check=False)
    assert missing.returncode == 4 and "haff init drum > drum.toml" in missing.stderr


@pytest.mark.long
@pytest.mark.parametrize("name", forms.SCENES)
def test_scene_of_rare_forms_is_read_by_everything(name, command, tmp_path):
    haff.save_scene(forms.SCENES[name], tmp_path / "scene.toml")
    assert check(command, tmp_path, tmp_path / "scene.toml")


@pytest.mark.long
def test_runs_from_states_and_runs_that_went_on_are_read_by_everything(command, tmp_path):
    first, second, third = (tmp_path / f"{name}.h5" for name in ("first", "second", "third"))
    haff.save_scene(forms.SCENES["table"], tmp_path / "scene.toml")
    command("run", tmp_path / "scene.toml", "-o", first)
    # With other keys in a new file, whose log begins with a row of no particle.
    command("run", "--resume", first, "--set", "contact.restitution=0.5", "--set", "run.until=4.0", "-o", second)
    with haff.open(second) as run:
        assert run.events.to_pandas()["kind"].iloc[0] == "change"
    assert "energy" in read(second, tmp_path)
    start = forms.SCENES["table"] | {"initial": {"positions": {"file": str(first), "index": -2}}}
    haff.save_scene(start, tmp_path / "start.toml")
    command("run", tmp_path / "start.toml", "-o", third)
    assert "energy" in read(third, tmp_path)
    # The same in a box of twice the size.
    with haff.open(first) as run:
        size, positions, radii = run.box.size[: run.dimension], run.frames[-2].position, run.radius
    large = start | {"domain": {k: v for k, v in start["domain"].items() if k not in ("size", "packing_fraction")}}
    large["species"] = [one | {"radius": 2 * one["radius"]} for one in start["species"]]
    large["initial"] = {"positions": start["initial"]["positions"] | {"scale_to": (2 * size).tolist()}}
    haff.save_scene(large, tmp_path / "large.toml")
    command("run", tmp_path / "large.toml", "-o", third, "--overwrite")
    with haff.open(third) as run:
        assert np.array_equal(run.frames[0].position, 2 * positions) and np.array_equal(run.radius, 2 * radii)
    assert "energy" in read(third, tmp_path)


def test_scenes_of_these_tests_have_every_form_of_every_key():
    allowed = forms.forms_of(haff.schema())
    scenes = [tomllib.loads(path.read_text()) for path in SHIPPED]
    state = {"initial": {"positions": {"file": "first.h5", "index": -2, "scale_to": [9.0, 9.0, 9.0]}}}
    off = {"output": {"file": False}}
    found = {form for scene in [*scenes, *forms.SCENES.values(), state, off] for form in forms.forms_in(scene, allowed)}
    assert found <= allowed, f"not in the schema: {sorted(found - allowed)}"
    assert ELSEWHERE.keys() <= allowed
    missing = sorted(allowed - found - ELSEWHERE.keys())
    assert not missing, f"no scene has {missing}"


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_scenes_pass_the_check_of_recorded_ones(path):
    text = path.read_text()
    assert parsed(text) == tomllib.loads(text)


def test_scenes_of_later_versions_and_plug_ins_are_read():
    text = """
        newer = 1
        [contact]
        restitution = { model = "delta", parameters = { added = 0.1 } }
        [[drive]]
        kind = "wind"
        strength = 1
        [[species]]
        name = "a"
        count = 1e3
        mass = inf
    """
    assert parsed(text)["drive"][0]["kind"] == "wind"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("contact.restitution = 1.2", "contact.restitution = 1.2: must be a number in [0, 1] or a table"),
        ("contact.tc = -1", "contact.tc = -1: must be a number, 0 or more"),
        ("contact.tc = nan", "contact.tc = nan: must be a number of up to 1e+100"),
        ("contact.rest_speed = inf", "contact.rest_speed = inf: must be a number of up to 1e+100"),
        ("domain.gravity = [1, 2, 3, 4]", "domain.gravity = [1, 2, 3, 4]: must be an array of 2 to 3 numbers"),
        ("domain = 5", "domain = 5: must be a table"),
        ("domain.shear = { flow = 'x', gradient = 'y' }", "domain.shear.rate is missing"),
        ("species = 5", "species = 5: must be an array of tables"),
        ("species = [{ name = 5 }]", "species[0].name = 5: must be text"),
        ("[[wall]]\nsticks = 1", "wall[0].sticks = 1: must be true or false"),
        ("[[wall]]\nplane = { point = [0, 0, 0], normal = [0, 0, 0] }",
         "wall[0].plane.normal = [0, 0, 0]: must be a vector, not all of its numbers 0"),
        ("contact.restitution = { speeds = [1, 1], values = [0, 1] }",
         "contact.restitution = {'speeds': [1, 1], 'values': [0, 1]}: must be speeds in ascending order, "
         "and a value for each"),
        ("dimension = 4", "dimension = 4: must be a whole number in [2, 3]"),
    ],
)  # fmt: skip
def test_recorded_scenes_that_no_run_has_written_are_refused(text, message):
    with pytest.raises(SceneFault) as caught:
        parsed(text)
    assert str(caught.value) == message


def test_a_surface_of_another_crate_is_a_wall_of_its_own():
    """Walls have rows in the order of the scene, whatever their shape."""
    plane = {"point": [0, 0, 0], "normal": [0, 0, 1]}
    walls = [{"name": "z-"}, {"name": "torus", "surface": "torus"}, {"name": "floor", "plane": plane}]
    assert [wall["name"] for wall in shaped_walls({"wall": walls})] == ["torus", "floor"]
