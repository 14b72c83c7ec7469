"""Errors name keywords to Python and options to users of the command, and shorten every value that they quote."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest

import haff
import synthetic
from conftest import ROOT
from haff import text
from haff.command.main import main

GAS = {
    "schema": 1,
    "domain": {"packing_fraction": 0.1},
    "species": [{"name": "grain", "count": 50, "radius": 0.5, "mass": 1.0}],
    "run": {"until": 0.5},
}


# Options of the command, and the command itself.
OPTIONS = re.compile(r"--[a-z]|\(-o\)|-o DIR|haff run")
LITERAL = re.compile(r'//[^\n]*|"((?:[^"\\]|\\.)*)"', re.DOTALL)
# Messages that Python never shows: of the command line itself, of commands that Python does not call.
UNSEEN = {"arguments.rs", "bench.rs", "check.rs", "info.rs", "init.rs", "manual.rs", "python.rs", "build.rs"}


def messages() -> list[tuple[str, str, str]]:
    """Texts with options in the sources of the command: file, text, and what is before it up to ``say(`` or ``;``."""
    found = []
    for crate in ("cli", "record", "scene", "engine", "linkage"):
        for path in sorted((ROOT / "crates" / crate).rglob("*.rs")):
            if path.name in UNSEEN or {"tests", "bench", "examples"} & set(path.parts):
                continue
            source = path.read_text().split("#[cfg(test)]")[0]
            for match in LITERAL.finditer(source):
                if OPTIONS.search(match[1] or ""):
                    before = source[: match.start()]
                    start = max(before.rfind("say("), before.rfind(";"), before.rfind("=>"))
                    found.append((path.name, match[1], before[start:]))
    return found


def test_every_message_with_an_option_has_words_for_python_beside_it():
    found = messages()
    assert len(found) > 12, "the sources are read"
    # The errors of scenes have both forms in one function.
    alone = [(file, text) for file, text, before in found if not before.startswith("say(") and file != "error.rs"]
    assert not alone


def test_errors_of_runs_and_sweeps_name_keywords(tmp_path):
    haff.run(GAS, file=tmp_path / "gas.h5")
    scene = haff.save_scene(GAS, tmp_path / "gas.toml")
    (tmp_path / "notes.txt").write_text("no HDF5 file")
    with pytest.raises(haff.FileError, match=r"gas\.h5 exists.*\(overwrite=True\)$"):
        haff.run(GAS, file=tmp_path / "gas.h5")
    with pytest.raises(haff.FileError, match=r"overwrite=True replaces outputs of runs only.*\(file=…\)$"):
        haff.run(GAS, file=tmp_path / "notes.txt", overwrite=True)
    with pytest.raises(haff.SceneError, match=r"is the scene; name another file \(file=…\)$"):
        haff.run(scene, file=scene, overwrite=True)
    with pytest.raises(haff.ArgumentError, match=r"^threads = 0: must be a whole number from 1 to 1024$"):
        haff.run(GAS, threads=0)
    haff.sweep(GAS, {"run.until": [0.1]}, output=tmp_path / "study")
    with pytest.raises(
        haff.FileError, match=r"it has run\.until=0\.1\b.*\bnot run\.until=0\.1 seed=1; .*\(output=…\)$"
    ):
        haff.sweep(GAS, {"run.until": [0.1], "seed": [1]}, output=tmp_path / "study")
    for values, seeds in (({}, None), ({"seed": [1, 2]}, 2), ({"run.untl": [1]}, None)):
        with pytest.raises(haff.SceneError) as caught:
            haff.sweep(GAS, values, seeds=seeds, output=tmp_path / "other")
        assert "--" not in str(caught.value), str(caught.value)


def test_own_errors_name_keywords_to_python_and_options_to_the_command(tmp_path, capsys):
    path = synthetic.cooling_gas(tmp_path / "gas.h5", n=50, frames=4, samples=10, collisions=200)
    kept = tmp_path / "kept.csv"
    kept.touch()
    with haff.open(path) as file:
        with pytest.raises(haff.ArgumentError, match=r"kept\.csv: exists; overwrite=True replaces it$"):
            file.export(kept)
        with pytest.raises(haff.ArgumentError, match=r"^no format given: to must be one of gsd"):
            file.export()
        with pytest.raises(
            haff.ArgumentError, match=r"^unknown suffix \.xyz: use to='extxyz' or output='a\.extxyz'; to must"
        ):
            file.export("a.xyz")
        with pytest.raises(haff.ArgumentError, match=r"^unknown suffix \.doc: to must be one of gsd, extxyz"):
            file.export("a.doc")
    assert main(["export", str(path), "-o", "a.xyz"]) == 2
    assert capsys.readouterr().err.startswith("haff: error: unknown suffix .xyz: use --to extxyz or -o a.extxyz; --to")
    assert main(["export", str(path), "-o", str(kept)]) == 2
    assert capsys.readouterr().err.endswith("kept.csv: exists; --overwrite replaces it\n")
    assert main(["export", str(path)]) == 2
    assert capsys.readouterr().err.startswith("haff: error: no format given: --to must be one of gsd")
    with pytest.raises(haff.ArgumentError, match="overwrite=True"), haff.open(path) as file:
        # The command has not left its words.
        file.export(kept)


def test_error_of_a_file_in_use_fits_its_reader(tmp_path, monkeypatch, capsys):
    path = synthetic.cooling_gas(tmp_path / "gas.h5", n=50, frames=4, samples=10, collisions=200)

    def locked(*arguments, **options):
        raise BlockingIOError

    monkeypatch.setattr(h5py, "File", locked)
    with pytest.raises(haff.FileError, match=r"is writing it just now; try again$"):
        haff.open(path)
    assert main(["plot", str(path), "-o", str(tmp_path)]) == 4
    assert capsys.readouterr().err.endswith("in use by a running simulation, which is writing it just now; try again\n")


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (1.5, "1.5"),
        ("no", "'no'"),
        (np.array([1.0, 2.0]), "[1.0, 2.0]"),
        (np.zeros((1000, 3)), "ndarray of float64, shape (1000, 3)"),
        (pd.DataFrame({"x": range(100)}), "DataFrame, shape (100, 1)"),
        (10**5000, "<int>"),
        ("\x1b[2J", r"'\x1b[2J'"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_values_are_quoted_briefly(value, shown):
    assert text.quoted(value) == shown


@pytest.mark.parametrize(
    "value",
    ["x" * 5000, list(range(10000)), {"a": "x" * 5000}, b"\0" * 500, np.zeros((2,) * 20)],
    ids=lambda value: type(value).__name__,
)
def test_quoted_values_have_at_most_80_characters(value):
    assert len(text.quoted(value)) <= 80


def test_no_error_quotes_a_value_at_full_length():
    """``{value!r}`` in an error has any length; ``quoted`` has not."""
    for path in sorted((ROOT / "python" / "haff").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Raise):
                whole = [
                    part for part in ast.walk(node) if isinstance(part, ast.FormattedValue) and part.conversion == 114
                ]
                assert not whole, f"{path.name}:{node.lineno}: {ast.unparse(whole[0])}"


def long_calls(file: haff.File, gas: haff.Simulation, folder: Path):
    """Calls with a wrong argument that is long."""
    long = "x" * 5000
    return [
        lambda: file.export(to=long),
        lambda: file.export(folder / "a.csv", table=long),
        lambda: file.export(folder / "a.csv", table="frames", frames=long),
        lambda: file.frames.array(long),
        lambda: file.events[long],
        lambda: haff.restitution_from(file, kind=long),
        lambda: haff.restitution_from({"height": [1.0, 0.5]}, error=[0.1] * 5000),
        lambda: haff.theory.contact_value(0.1, equation=long),
        lambda: haff.template(long),
        lambda: haff.sweep(GAS, {"run.until": {"a": long}}, output=folder / "study"),
        lambda: haff.sweep(GAS, {"run.until": [1]}, output=folder / "study", dims=long),
        lambda: gas.add([1.0, 1.0, 1.0], species=long),
        lambda: haff.Simulation(np.zeros((1000, 3))),
        lambda: haff.save_scene({"seed": 10**4000}, folder / "a.toml"),
        lambda: haff.Simulation(GAS, contact={(1,) * 5000: 2}),
    ]


def test_errors_stay_short_however_long_an_argument_is(tmp_path):
    path = synthetic.cooling_gas(tmp_path / "gas.h5", n=50, frames=4, samples=10, collisions=200)
    gas = haff.Simulation(GAS)
    with haff.open(path) as file:
        for number, call in enumerate(long_calls(file, gas, tmp_path)):
            with pytest.raises((haff.HaffError, ValueError, TypeError, KeyError)) as caught:
                call()
            # A value of 80 characters, and the text around it.
            assert len(str(caught.value)) <= 300, (number, str(caught.value)[:500])
