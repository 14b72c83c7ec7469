"""Consistency of the repository: dependencies with their reasons, one version."""

import re
from pathlib import Path

import pytest

from conftest import ROOT

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    import tomli as tomllib


def toml(path: Path) -> dict:
    return tomllib.loads(path.read_text())


def rust_dependencies() -> set[str]:
    names = set()
    for path in [ROOT / "Cargo.toml", *ROOT.glob("crates/*/Cargo.toml")]:
        for table in ("dependencies", "dev-dependencies", "build-dependencies"):
            names |= {name for name in toml(path).get(table, {}) if not name.startswith("haff-")}
    return names


def python_dependencies() -> set[str]:
    project = toml(ROOT / "pyproject.toml")
    lists = [project["build-system"]["requires"], project["project"]["dependencies"]]
    lists += project["project"]["optional-dependencies"].values()
    names = {re.match(r"[\w-]+", requirement)[0] for requirements in lists for requirement in requirements}
    return names - {"haff"}


@pytest.mark.parametrize("dependencies", [rust_dependencies, python_dependencies])
def test_every_dependency_has_its_reason(dependencies):
    listed = set(re.findall(r"`([\w-]+)`", (ROOT / "docs" / "dependencies.md").read_text()))
    assert len(dependencies()) > 5
    assert dependencies() <= listed, f"docs/dependencies.md lacks {sorted(dependencies() - listed)}"


def test_every_listed_dependency_is_in_use():
    tables = re.findall(r"^\| ([^|]+) \|", (ROOT / "docs" / "dependencies.md").read_text(), flags=re.MULTILINE)
    listed = set(re.findall(r"`([\w-]+)`", " ".join(tables))) - {"hdf5-metno"}
    known = rust_dependencies() | python_dependencies()
    assert listed <= known, sorted(listed - known)


def test_version_and_rust_version_are_consistent():
    workspace = toml(ROOT / "Cargo.toml")["workspace"]["package"]
    citation = (ROOT / "CITATION.cff").read_text()
    assert f"\nversion: {workspace['version']}\n" in citation
    for page in ("README.md", "docs/tutorial.md", "docs/dependencies.md"):
        assert f"{workspace['rust-version']}" in (ROOT / page).read_text(), page
