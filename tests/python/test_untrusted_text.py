"""Names and titles of a file are escaped on terminals and in tables, pages and figures."""

from __future__ import annotations

import csv
import html
import json
import re

import h5py
import numpy as np
import pandas as pd
import pytest

import haff
import synthetic
from haff import figures, text
from haff.command.main import main

TITLES = [
    "{{content}}", "{{title}} {{styles}} {{other}}", "</title><script>alert(1)</script>", "<!--", "a & b",
    "costs $5, or $\\frac{$", "$", "\\$", "$x$", "\x1b[2J\x1b[31mgas", "gas\nhaff: error: forged", "\u202egas",
    "\u2028", "x" * 5000,
]  # fmt: skip


def toml(value: str) -> str:
    return '"' + "".join(f"\\U{ord(c):08x}" for c in value) + '"'


def titled(path, title, name="grain"):
    """A gas with this title, whose species has this name."""
    synthetic.cooling_gas(path, n=250, frames=4, samples=20, collisions=2000)
    with h5py.File(path, "r+") as file:
        scene = file["parameters/scene"][()].decode()
        scene = re.sub(r'(?m)^title = ".*"$', lambda _: f"title = {toml(title)}", scene)
        scene = scene.replace('name = "grain"', f"name = {toml(name)}")
        del file["parameters/scene"]
        file["parameters/scene"] = scene
    return path


def test_text_is_escaped_for_a_terminal():
    assert text.escaped("gas ρ = 1\u2009g, 日本") == "gas ρ = 1\u2009g, 日本"
    assert text.escaped("a\x1b[31m\n\t\x85\u202e\udc80\x00") == r"a\x1b[31m\n\t\x85\u202e\udc80\x00"
    assert text.brief("a\n" * 500, 10) == r"a\na\na\na" + "…"
    assert str(haff.FileError("gas\nerror: x\x1b")) == r"gas\nerror: x\x1b"
    assert str(haff.SimulationError(("two", "lines\n"))) == "two\nlines\\n"


def test_csv_cell_with_a_formula_is_the_name_after_an_apostrophe():
    for name in ("=1+1", "+1", "-1", "@A1", "\t=1", "\r=1", "'quoted"):
        assert text.cell(name) == "'" + text.escaped(name)
    assert text.cell("grain") == "grain" and text.cell("a=1") == "a=1"


@pytest.mark.parametrize("title", TITLES, ids=ascii)
def test_title_is_escaped_in_a_page(title, tmp_path, capsys):
    path = titled(tmp_path / "gas.h5", title, name=title)
    plain = titled(tmp_path / "plain.h5", "plain")
    pages = []
    for source in (path, plain):
        assert main(["view", str(source), "-o", str(tmp_path / "page.html"), "--overwrite"]) == 0
        pages.append((tmp_path / "page.html").read_text(encoding="utf-8"))
    capsys.readouterr()
    page, sound = pages
    shown = text.escaped(title)
    assert html.unescape(re.search("<title>(.*?)</title>", page, re.DOTALL)[1]) == shown
    assert page.count(f"<h1>{html.escape(shown)}</h1>") == 1
    # The same elements as with another title, in the same order.
    for tag in ("<script", "</script", "<title", "<style", "<body", "<!--"):
        assert page.count(tag) == sound.count(tag), tag
    header = json.loads(re.search(r'id="header">(.*?)</script>', page, re.DOTALL)[1])
    assert header["title"] == shown and header["species"] == [shown]


@pytest.mark.long
@pytest.mark.parametrize("title", TITLES, ids=ascii)
def test_title_is_escaped_in_a_figure(title, tmp_path, recwarn):
    path = titled(tmp_path / "gas.h5", title, name=title)
    with haff.open(path) as run:
        figure = figures.draw(run, "temperature")
        drawn = [one.get_text() for one in figure.findobj(lambda one: hasattr(one, "get_text"))]
        figures.save_all(run, ["energy"], tmp_path, "svg")
    wanted = text.brief(title, 100).replace("$", r"\$")
    assert any(one.startswith(wanted) for one in drawn), drawn
    assert not any("missing from font" in str(one.message) and "\x1b" in str(one.message) for one in recwarn)


def test_names_of_few_bodies_are_not_parsed_as_formulas_in_figures(tmp_path, command):
    path = tmp_path / "spring.h5"
    path.write_bytes(command.run("textbook/spring_impact").path.read_bytes())
    with h5py.File(path, "r+") as file:
        file["parameters/species_names"][:] = ["$a$ and $\\frac{$", "_b", "c\n$"]
    with haff.open(path) as run:
        figure = figures.draw(run, "trajectories")
    shown = [one.get_text() for legend in figure.legends for one in legend.get_texts()]
    # A legend omits labels that begin with an underscore.
    assert shown[:3] == [r"\$a\$ and \$\frac{\$", "\u2009_b", r"c\n\$"]


@pytest.mark.parametrize("title", ["\x1b[2J", "x\nhaff: error: forged", "x\rhaff: error: forged", "\u202e"], ids=ascii)
def test_commands_escape_control_characters_of_a_file(title, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = titled(tmp_path / f"{title}.h5", title, name=title)
    lines = [
        ["view", path, "--frames", "::2"], ["view", path], ["export", path, "--to", "csv"],
        ["export", path, "--to", "csv"], ["export", f"{path}.none", "--to", "gsd"],
        ["plot", path, "--kind", "temperature"], ["plot", path, "--kind", "paths"],
        ["plot", path, "--movie", tmp_path / f"{title}.avi"], ["view", path, "-o", tmp_path / f"{title}" / "x.html"],
    ]  # fmt: skip
    for words in lines:
        main(list(map(str, words)))
    with pytest.raises(SystemExit):
        main(["plot", str(path), "--kind", title])
    with h5py.File(path, "r+") as file:
        del file["parameters/scene"]
        file["parameters/scene"] = f"title = [{toml(title)}]"
    main(["view", str(path), "-o", "other.html"])
    out, err = capsys.readouterr()
    assert all(line.isprintable() for line in (out + err).split("\n")), ascii(out + err)
    for line in err.split("\n"):
        assert not line or line.startswith(("haff: ", "skipped ", "usage: ", " ")), ascii(line)
        assert "haff: error: forged" not in line[:20], ascii(line)


def test_tables_store_names_as_text(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = titled(tmp_path / "gas.h5", "gas", name="=HYPERLINK(1)")
    with h5py.File(path, "r+") as file:
        element = file.create_group("observables/@SUM(A1)")
        element["value"] = -np.ones(file["observables/temperature/value"].shape)
        for part in ("time", "step"):
            element[part] = file[f"observables/temperature/{part}"]
        kind = file["events/kind"][:]
        del file["events/kind"]
        kinds = h5py.enum_dtype({"+collision": 0, "wall": 1, "a\rb": 2}, "u1")
        kind[1] = 2
        file.create_dataset("events/kind", data=kind, dtype=kinds)
    with haff.open(path) as run:
        cells = {}
        for table in ("frames", "observables", "events"):
            target = run.export(f"{table}.csv", table=table)
            rows = list(csv.reader(target.read_text().splitlines()))
            cells[table] = rows
            for cell in (cell for row in rows for cell in row):
                number = re.fullmatch(r"[-+]?[0-9].*|", cell)
                assert number or not cell.startswith(("=", "+", "-", "@", "\t", "\r")), cell
        assert {row[cells["frames"][0].index("species")] for row in cells["frames"][1:]} == {"'=HYPERLINK(1)"}
        assert "'@SUM(A1)" in cells["observables"][0]
        kinds = [row[cells["events"][0].index("kind")] for row in cells["events"][1:4]]
        assert kinds == ["'+collision", r"a\rb", "'+collision"]
        # Numbers are not changed.
        assert (pd.read_csv("observables.csv")["'@SUM(A1)"] == -1).all()
        # Formats other than CSV have the name itself.
        pytest.importorskip("pyarrow")
        run.export("frames.parquet", table="frames")
        assert set(pd.read_parquet("frames.parquet")["species"]) == {"=HYPERLINK(1)"}


def test_extended_xyz_has_one_line_per_particle(tmp_path):
    path = titled(tmp_path / "gas.h5", 'a "b"\r\u2028c\nd', name='x "y"\r\u2028z')
    with haff.open(path) as run:
        lines = run.export(tmp_path / "gas.extxyz", frames=":1").read_text(encoding="utf-8").splitlines()
        assert len(lines) == len(run) + 2
        assert len(lines[2].split()) == len(lines[3].split()) == 13, lines[2]
