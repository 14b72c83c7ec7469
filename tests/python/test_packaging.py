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


def test_version_of_the_packages_is_that_of_cargo(tmp_path):
    import subprocess
    import sys

    version = toml(ROOT / "Cargo.toml")["workspace"]["package"]["version"]
    said = subprocess.run([sys.executable, ROOT / "packaging/version.py"], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == version
    wrong = subprocess.run([sys.executable, ROOT / "packaging/version.py", "v9.9.9"], capture_output=True, text=True)
    assert wrong.returncode == 1 and f"Cargo.toml has the version {version}" in wrong.stderr
    notes = subprocess.run([sys.executable, ROOT / "packaging/version.py", "--notes"], capture_output=True, text=True)
    assert notes.returncode == 0 and len(notes.stdout) > 200
    recipe = (ROOT / "packaging/conda/recipe.yaml").read_text()
    assert f'version: "{version}"' in recipe


def test_the_conda_recipe_has_the_dependencies_of_the_wheel():
    recipe = (ROOT / "packaging/conda/recipe.yaml").read_text()
    run = recipe.split("  run:\n", 1)[1].split("\ntests:", 1)[0]
    found = dict(re.match(r"\s+- ([\w-]+) >=(\S+)", line).groups() for line in run.splitlines() if ">=" in line)
    names = {"matplotlib-base": "matplotlib", "freud": "freud-analysis"}
    found = {names.get(name, name): least for name, least in found.items()}
    project = toml(ROOT / "pyproject.toml")["project"]
    wanted = {"python": project["requires-python"].removeprefix(">=")}
    for requirement in project["dependencies"]:
        if "python_version" not in requirement:
            name, least = re.match(r"([\w-]+)>=(\S+)", requirement).groups()
            wanted[name] = least
    assert found == wanted


def test_workflows_call_what_is_there():
    yaml = pytest.importorskip("yaml")
    paths = sorted((ROOT / ".github/workflows").glob("*.yml"))
    assert [path.stem for path in paths] == ["release", "test", "wheels"]
    called = set()
    for path in paths:
        workflow = yaml.safe_load(path.read_text())
        steps = [step for job in workflow["jobs"].values() for step in job.get("steps", ())]
        for text in (step.get("run", "") for step in steps):
            called |= set(re.findall(r"(?:scripts|packaging|\.ci)/[\w.]+", text))
    assert {"scripts/release", "scripts/newcomer", "packaging/version.py", ".ci/run"} <= called
    for name in called:
        assert (ROOT / name).is_file(), name


def test_tools_of_a_release_have_fixed_versions():
    lines = [line for line in (ROOT / "packaging/release.txt").read_text().splitlines() if not line.startswith("#")]
    assert {line.split("==")[0] for line in lines} == {"auditwheel", "cargo-zigbuild", "cmake", "maturin", "ziglang"}
    assert all(re.fullmatch(r"[\w-]+==[\d.]+", line) for line in lines)


def test_images_build_with_a_rust_that_is_new_enough():
    needed = tuple(map(int, toml(ROOT / "Cargo.toml")["workspace"]["package"]["rust-version"].split(".")[:2]))
    image = re.search(r"^FROM rust:([\d.]+)", (ROOT / "packaging/Dockerfile").read_text(), re.MULTILINE)[1]
    assert tuple(map(int, image.split(".")[:2])) >= needed


def test_equal_files_give_equal_archives(tmp_path):
    import importlib.util
    import os
    import sys
    import types

    # The backend of builds, of which pip installs what it imports.
    sys.modules.setdefault("maturin", types.SimpleNamespace(**dict.fromkeys(BACKEND, lambda *_: [])))
    spec = importlib.util.spec_from_file_location("haff_build", ROOT / "packaging/haff_build.py")
    build = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(build)
    made = []
    for name, time in (("a", 0), ("b", 1e9)):
        (tmp_path / name).write_text("text")
        os.utime(tmp_path / name, (time, time))
        build.write_archive(tmp_path / f"{name}.tar.gz", {tmp_path / name: "dir/text"}, 1_700_000_000)
        made.append((tmp_path / f"{name}.tar.gz").read_bytes())
    assert made[0] == made[1]


BACKEND = [
    "get_requires_for_build_editable", "get_requires_for_build_sdist", "get_requires_for_build_wheel",
    "prepare_metadata_for_build_wheel", "build_wheel", "build_editable",
]  # fmt: skip
