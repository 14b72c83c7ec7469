"""The rooms of the engine stand in one order, and no files of the workspace name each other in a circle."""

from __future__ import annotations

import re

import pytest

from structure import ROOT, Crate, circles, crates

CRATES = crates()
ENGINE = CRATES["engine"]
# From the ground up, as lib.rs has them.
ROOMS = re.findall(
    r"^(?:pub )?mod (\w+);", (ENGINE.root / "lib.rs").read_text().replace("#[cfg(test)]\nmod examples;", ""), re.M
)


def higher(crate: Crate, rooms: list[str]) -> list[str]:
    """Which file of a room names one of a room above it, and what it names there."""
    found = []
    for file, others in crate.names().items():
        room = file.relative_to(crate.root).parts[0]
        for other, names in others.items():
            above = other.relative_to(crate.root).parts[0]
            if room in rooms and (above not in rooms or rooms.index(above) > rooms.index(room)):
                found.append(f"{file.relative_to(crate.root)} names {other.relative_to(crate.root)}: {sorted(names)}")
    return found


def test_all_files_of_the_engine_are_in_rooms():
    loose = [path.name for path in ENGINE.root.glob("*.rs") if path.name != "lib.rs"]
    folders = [path.name for path in ENGINE.root.iterdir() if path.is_dir() and path.name != "examples"]
    assert not loose and sorted(folders) == sorted(ROOMS)


def test_no_room_names_a_higher_one():
    assert not higher(ENGINE, ROOMS)


@pytest.mark.parametrize("name", sorted(CRATES))
def test_no_files_name_each_other_in_a_circle(name):
    crate = CRATES[name]
    assert not [[str(file.relative_to(crate.root)) for file in circle] for circle in circles(crate.names())]


def test_each_room_opens_with_an_essay():
    for room in ROOMS:
        text = (ENGINE.root / room / "mod.rs").read_text()
        essay = text[: text.index("*/")]
        assert text.startswith("/*!") and essay.count("\n") <= 45, room
        for words in ("*What is here.*", "*What to change here.*", "*May import*", "*Begin with*"):
            assert words in essay, f"{room}: {words}"


def test_what_the_tests_look_for_is_found(tmp_path):
    files = {
        "lib.rs": "mod low;\nmod high;\n",
        "low/mod.rs": "mod a;\npub use a::A;\n",
        "low/a.rs": "use crate::high::{B, c::{self, C}};\npub struct A;\n",
        "high/mod.rs": "pub mod b;\npub mod c;\npub use b::B;\n",
        "high/b.rs": "use crate::low::A;\npub struct B;\n// use crate::high::c;\n",
        "high/c.rs": "pub struct C;\nfn f() -> super::b::B {}\n#[cfg(test)]\nmod tests {\n    use crate::low::A;\n}\n",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    crate = Crate(tmp_path)
    names = {
        str(f.relative_to(tmp_path)): {str(g.relative_to(tmp_path)) for g in others}
        for f, others in crate.names().items()
    }
    assert names == {"low/a.rs": {"high/b.rs", "high/c.rs"}, "high/b.rs": {"low/a.rs"}, "high/c.rs": {"high/b.rs"}}
    assert len(higher(crate, ["low", "high"])) == 2
    assert [[file.stem for file in circle] for circle in circles(crate.names())] == [["b", "c", "a"]]
    assert ROOT.is_dir()
