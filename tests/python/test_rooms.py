"""Rooms stand in one order, and no files of a crate name each other in a circle."""

from __future__ import annotations

import re

import pytest

from structure import ROOT, Crate, circles, crates, imports

CRATES = crates()
HOUSES = ("engine", "scene", "cli")


def rooms(crate: Crate) -> list[str]:
    """Its rooms from the ground up, as the root file has them; a file beside them counts as one."""
    text = (crate.root / crate.main).read_text()
    return [name for test, name in re.findall(r"(#\[cfg\(test\)\]\n)?^(?:pub )?mod (\w+);", text, re.M) if not test]


def higher(crate: Crate, order: list[str]) -> list[str]:
    """Which file of a room names one of a room above it, and what it names there."""
    found = []
    for file, others in crate.names().items():
        room = file.relative_to(crate.root).parts[0].removesuffix(".rs")
        for other, names in others.items():
            above = other.relative_to(crate.root).parts[0].removesuffix(".rs")
            if room in order and (above not in order or order.index(above) > order.index(room)):
                found.append(f"{file.relative_to(crate.root)} names {other.relative_to(crate.root)}: {sorted(names)}")
    return found


@pytest.mark.parametrize("name", HOUSES)
def test_all_files_are_in_rooms(name):
    crate = CRATES[name]
    found = {path.relative_to(crate.root).parts[0].removesuffix(".rs") for path in crate.code}
    loose = {path.stem for path in crate.root.glob("*.rs")} - {"lib", "build", "arguments", "fuzz"}
    assert not loose and found - {"lib", "fuzz"} == set(rooms(crate))


@pytest.mark.parametrize("name", HOUSES)
def test_no_room_names_a_higher_one(name):
    assert not higher(CRATES[name], rooms(CRATES[name]))


@pytest.mark.parametrize("name", sorted(CRATES))
def test_no_files_name_each_other_in_a_circle(name):
    crate = CRATES[name]
    assert not [[str(file.relative_to(crate.root)) for file in circle] for circle in circles(crate.names())]


@pytest.mark.parametrize(("name", "room"), [(name, room) for name in HOUSES for room in rooms(CRATES[name])])
def test_each_room_opens_with_an_essay(name, room):
    path = CRATES[name].root / room / "mod.rs"
    text = path.read_text() if path.is_file() else (CRATES[name].root / f"{room}.rs").read_text()
    if not path.is_file():
        assert text.startswith("//!")
        return
    essay = text[: text.index("*/")]
    assert text.startswith("/*!") and essay.count("\n") <= 45
    for words in ("*What is here.*", "*What to change here.*", "*May import*", "*Begin with*"):
        assert words in essay, words


def test_no_source_has_more_than_500_lines():
    sources = [path for path in (ROOT / "crates").rglob("*.rs") if "tests" not in path.parts]
    assert len(sources) > 300
    assert not [str(path.relative_to(ROOT)) for path in sources if path.read_text().count("\n") > 500]


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


@pytest.mark.long
def test_no_modules_of_the_package_import_each_other_in_a_circle():
    found = imports()
    assert len(found) > 50
    assert not [[str(file.relative_to(ROOT / "python")) for file in circle] for circle in circles(found)]


# From the ground up; a file beside the rooms is one of its own. `__init__` hands names on, when they are used.
LOWER = "text errors common theory mechanics files analysis export figures reader restitution".split()
PACKAGE = [*LOWER, *"viewer scenes packing command live __main__ __init__".split()]


@pytest.mark.long
def test_no_room_of_the_package_imports_a_higher_one():
    package = ROOT / "python" / "haff"

    def room(file):
        return file.relative_to(package).with_suffix("").parts[0]

    found = imports()
    assert {room(file) for file in package.rglob("*.py")} == {*PACKAGE}
    higher = [
        f"{file.relative_to(package)} imports {other.relative_to(package)}"
        for file, others in found.items()
        for other in others
        if PACKAGE.index(room(other)) > PACKAGE.index(room(file)) and others[other] != {"_engine"}
    ]
    assert not higher


@pytest.mark.parametrize("room", [name for name in PACKAGE if (ROOT / "python" / "haff" / name).is_dir()])
def test_each_room_of_the_package_opens_with_what_it_is(room):
    text = (ROOT / "python" / "haff" / room / "__init__.py").read_text()
    essay = text[: text.index('"""', 5)]
    assert all(words in essay for words in ("*What to change here.*", "*May import*", "*Begin with*")), essay
