"""A disk that is full or cannot be written: a small file system in memory, which only the superuser can make."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from haff.command.main import main
from validation.runs import ROOT

GAS = ROOT / "tests" / "gas.toml"
FULL = "cannot write: No space left on device"


@pytest.fixture
def disk(tmp_path) -> Iterator[tuple[Path, Callable[[str], None]]]:
    """A folder on a separate disk, and a function that changes its mount options, such as its size."""
    folder = tmp_path / "disk"
    folder.mkdir()

    def mount(options: str) -> None:
        subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", folder], check=True, capture_output=True)

    if not hasattr(os, "geteuid") or os.geteuid() != 0:
        pytest.skip("only the superuser can make a disk")
    try:
        mount("size=1m")
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no disk can be made here")
    yield folder, lambda options: mount(f"remount,{options}")
    # Detached at once, even if a library still has files open there.
    subprocess.run(["umount", "--lazy", folder], check=True)


def test_run_on_a_full_disk_fails_and_resumes_without_loss(disk, command):
    folder, remount = disk
    path = folder / "gas.h5"
    complete = command.run(GAS, run__until=60)

    def starved(*arguments) -> int:
        done = command("run", *arguments, "--quiet", "--json", check=False)
        assert done.returncode == 4 and done.stderr.count("\n") == 1, done.stderr
        assert f"{path}: {FULL}" in done.stderr
        assert json.loads(done.stdout)["stopped"] == "output"
        return json.loads(command("info", path, "--json").stdout)["frames"]

    frames = starved(GAS, "-o", path, "--set", "run.until=60")
    assert 1 < frames < 61
    assert starved("--resume", path) == frames
    remount("size=20m")
    resumed = json.loads(command("run", "--resume", path, "--quiet", "--json").stdout)
    assert resumed["stopped"] == "until" and resumed["resumed_from"] > 0
    assert resumed["state_hash"] == complete.report["state_hash"]


def test_sweep_on_a_full_disk_reports_each_run_and_resumes(disk, command):
    folder, remount = disk
    study = ["sweep", GAS, "--set", "contact.restitution=0.8,0.9", "--set", "run.until=10", "-o", folder / "study"]
    starved = command(*study, check=False)
    assert starved.returncode == 4 and "at path" not in starved.stderr, starved.stderr
    for run in ("run-0000.h5", "run-0001.h5"):
        assert f"{folder / 'study' / run}: {FULL}" in starved.stderr, starved.stderr
    remount("size=20m")
    assert "2 of 2 runs are complete" in command(*study).stderr
    rows = json.loads((folder / "study" / "manifest.json").read_text())["runs"]
    hashes = [command.run(GAS, contact__restitution=e, run__until=10).report["state_hash"] for e in (0.8, 0.9)]
    assert [row["state_hash"] for row in rows] == hashes


@pytest.mark.parametrize(
    "arguments",
    [
        "export FILE -o out.gsd",
        "export FILE -o out.extxyz",
        "export FILE -o out.vtkhdf",
        "export FILE -o out.csv --table frames",
        "export FILE -o out.parquet --table frames",
        "view FILE -o out.html",
        "plot FILE --movie out.gif --frames :1",
        "plot FILE --movie out.mp4 --frames :1",
    ],
)
def test_failed_export_keeps_the_old_file(disk, arguments, files, capfd):
    folder, remount = disk
    words = arguments.split()
    index = next(k for k, word in enumerate(words) if word.startswith("out."))
    target = folder / words[index]
    words[1], words[index] = str(files["cooling"]), str(target)
    target.write_text("the old one")
    remount("size=8k")
    assert main([*words, "--overwrite"]) == 4
    assert capfd.readouterr().err == f"haff: error: {target}: {FULL}\n"
    assert [file.name for file in folder.iterdir()] == [target.name] and target.read_text() == "the old one"


@pytest.mark.long
def test_figures_are_written_completely_or_not_at_all(disk, files, capfd):
    folder, remount = disk
    remount("size=12k")
    assert main(["plot", str(files["cooling"]), "--kind", "temperature", "-o", str(folder / "figures")]) == 4
    assert capfd.readouterr().err == f"haff: error: {folder / 'figures' / 'cooling-temperature.png'}: {FULL}\n"
    assert not list((folder / "figures").iterdir())


@pytest.mark.parametrize(
    "arguments", ["export FILE -o out.csv", "view FILE -o out.html", "plot FILE --kind energy -o ."]
)
def test_read_only_disk_is_an_error(disk, arguments, files, capfd, monkeypatch):
    folder, remount = disk
    monkeypatch.chdir(folder)
    (folder / "part.h5").write_bytes(files["ball"].read_bytes())
    remount("ro")
    assert main([word.replace("FILE", "part.h5") for word in arguments.split()]) == 4
    message = capfd.readouterr().err
    assert message.endswith(": cannot write: Read-only file system\n") and message.count("\n") == 1, message
    assert ".part" not in message and [file.name for file in folder.iterdir()] == ["part.h5"]
