"""Damaged and foreign files: reading them succeeds or raises a :class:`haff.HaffError`.

Reads 60 changed files before a commit, 300 in all tests, or as many as ``HAFF_MUTATIONS=10000`` gives.
"""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

import synthetic
from conftest import ROOT, executable
from mutations import mutate
from patience import HANGS, processor_time

resource = pytest.importorskip("resource", reason="memory can be limited on Unix only")

pytestmark = pytest.mark.usefixtures("bounded")

COUNT = int(os.environ.get("HAFF_MUTATIONS", "300"))
SEED = int(os.environ.get("HAFF_MUTATIONS_SEED", "0"))
COUNTS = [COUNT] if "HAFF_MUTATIONS" in os.environ else [COUNT // 5, pytest.param(COUNT, marks=pytest.mark.long)]
SECONDS = 30
"""Processor time that a file may take; a sound one takes less than one."""
GIB = 1 << 30


@pytest.fixture(scope="module")
def sound(command, tmp_path_factory) -> list[Path]:
    """Small files of each kind."""
    few = {"output__events": True, "output__observables": 0.5, "output__frames": 0.5}
    runs = [
        command.run(ROOT / "tests" / "gas.toml", **few, species__0__count=250, run__until=3.0),
        command.run("disks", **few, species__0__count=120, run__until=2.0),
        command.run("heap", **few, species__0__count=40, run__until=2.0),
        command.run("sheared_gas", **few, species__0__count=150, run__until=2.0),
        command.run("breakshot"),
        command.run("textbook/bouncing_ball"),
        command.run("textbook/pendulums"),
        command.run("textbook/spring_impact"),
        command.run("textbook/stick_to_rod"),
        command.run("textbook/oblique_wall"),
    ]
    study = tmp_path_factory.mktemp("sound") / "study"
    command("sweep", ROOT / "tests" / "gas.toml", "--set", "contact.restitution=0.8,0.9", "--set", "run.until=2",
            "--set", "species.grain.count=120", "-o", study, "--quiet")  # fmt: skip
    spins = tmp_path_factory.mktemp("spins")
    rough = [
        synthetic.cooling_gas(spins / "gas.h5", n=120, frames=4, samples=12, collisions=500, beta=0.5),
        synthetic.rough_impacts(spins / "impacts.h5"),
        synthetic.sliding_ball(spins / "sliding.h5"),
    ]
    return [*(run.path for run in runs if run.path), study / "run-0000.h5", *rough]


class Worker:
    """A process that reads files; started again after a file that kills it."""

    def __init__(self, folder: Path, sound: list[Path]) -> None:
        self.folder, self.sound = folder, sound
        self.process: subprocess.Popen[str] | None = None

    def start(self) -> subprocess.Popen[str]:
        script = Path(__file__).with_name("foreign_worker.py")
        words = [sys.executable, str(script), str(self.folder), *map(str, self.sound)]
        with open(self.folder / "worker.log", "a") as log:
            process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, text=True)
        assert process.stdout is not None and process.stdout.readline() == "ready\n", "the worker reads no sound file"
        return process

    def read(self, path: Path, seed: int, thorough: bool = False) -> dict:
        """The outcome."""
        self.process = self.process or self.start()
        stdin, stdout = self.process.stdin, self.process.stdout
        assert stdin is not None and stdout is not None
        stdin.write(f"{path}\t{seed}\t{'all' if thorough else ''}\n")
        stdin.flush()
        before = processor_time(self.process.pid)
        while not select.select([stdout], [], [], 1.0)[0]:
            if processor_time(self.process.pid) > before + SECONDS:
                self.stop()
                return {"died": f"more than {SECONDS} s", "faults": [], "errors": {}}
        line = stdout.readline()
        if not line:
            status = self.process.wait()
            self.process = None
            return {"died": f"exit {status}", "faults": [], "errors": {}}
        return json.loads(line)

    def stop(self) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.communicate()
            self.process = None


@pytest.fixture(scope="module")
def worker(sound, tmp_path_factory) -> Iterator[Worker]:
    found = Worker(tmp_path_factory.mktemp("worker"), sound)
    yield found
    found.stop()


@pytest.mark.long
def test_valid_files_raise_no_unexpected_errors(worker, sound):
    for k, path in enumerate(sound):
        found = worker.read(path, k, thorough=k % 5 == 2)
        assert not found["faults"] and "died" not in found, (path, found)
        # Other errors, such as NotApplicableError, are allowed, but no FileError.
        assert not any("FileError" in error for error in found["errors"].values()), (path, found["errors"])


@pytest.mark.parametrize("count", COUNTS)
def test_changed_files_are_read_or_refused(worker, sound, tmp_path, count):
    wrong, outcomes = [], Counter[str]()
    for seed in range(SEED, SEED + count):
        source = sound[seed % len(sound)]
        # A new file each time: HDF5 recognizes a file that is still open.
        target = tmp_path / f"changed-{seed}.h5"
        done = mutate(source, target, seed)
        found = worker.read(target, seed)
        if found["faults"] or "died" in found:
            wrong.append(f"seed {seed}, {source.name}: {done}\n  " + "\n  ".join(found["faults"] or [found["died"]]))
            if keep := os.environ.get("HAFF_MUTATIONS_KEEP"):
                Path(keep, f"{seed}.h5").write_bytes(target.read_bytes())
        if count > 1000 and seed % 500 == 0:
            print(f"seed {seed}: {len(wrong)} wrong, {dict(outcomes)}", flush=True)
        target.unlink()
        outcomes["refused" if any("FileError" in one for one in found["errors"].values()) else "read"] += 1
    print(f"\n{dict(outcomes)}")
    assert not wrong, f"{len(wrong)} of {count}:\n" + "\n".join(wrong)
    # Some changes must have no effect, and some must be refused.
    assert outcomes["read"] > 0.1 * count and outcomes["refused"] > 0.3 * count, outcomes


def _limited() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (2 * GIB, 2 * GIB))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("arguments", [["info"], ["info", "--json"]], ids=" ".join)
def test_command_reads_changed_files_or_refuses_them(sound, tmp_path, arguments, count):
    wrong = []
    target = tmp_path / "changed.h5"
    for seed in range(SEED, SEED + count, 3):
        done = mutate(sound[seed % len(sound)], target, seed)
        words = [str(executable()), *arguments, str(target)]
        try:
            found = subprocess.run(words, capture_output=True, timeout=HANGS, preexec_fn=_limited, check=False)
        except subprocess.TimeoutExpired:
            wrong.append(f"seed {seed}: {done}: more than {HANGS} s")
            continue
        if found.returncode not in (0, 4) or b"panicked" in found.stderr or b"memory allocation of" in found.stderr:
            reason = signal.Signals(-found.returncode).name if found.returncode < 0 else f"exit {found.returncode}"
            wrong.append(f"seed {seed}: {done}: {reason} {found.stderr[-300:]!r}")
    assert not wrong, f"{len(wrong)}:\n" + "\n".join(wrong)
