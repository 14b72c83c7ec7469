#!/usr/bin/env python3
"""Reads the files of running simulations from several processes, and records failures, waiting times and what it costs.

    benches/running.py --haff .venv/bin/haff                      # 10,000 times from four processes, on an idle machine
    benches/running.py --haff .venv/bin/haff --busy 2             # beside two processes that only compute

Runs of a gas follow one another (--seconds each), with frames, observables, all events, profiles and correlations, as
fast as they are written. Each reader opens the file, reads the last frame, a random one, the observables, the last
events, the profiles and the correlations, and closes it; numbers are kept and compared with the finished file after
each run. With --cost (pairs of runs), the rate of a run that is read is compared, in turn, with that of a run beside
readers of another file of the same size and state: these take the same processor time, but share nothing with the run.

Prints one JSON object. Needs the package `haff` in this Python, or in PYTHONPATH.
"""

from __future__ import annotations

import argparse
import fcntl
import json
import multiprocessing
import random
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import zlib
from pathlib import Path

import numpy as np
import pandas  # noqa: F401  # so that no reader takes time to import it
import xarray  # noqa: F401
from busy import busy_processes

import haff

SCENE = Path(__file__).parents[1] / "tests" / "gas.toml"
SETTINGS = (
    "contact.restitution=1", "run.until=1e7", "output.frames=2.0", "output.observables=0.5", "output.checkpoint=4.0",
    'measure.profiles=[{axis="z",bins=10,interval=2.0}]', "measure.vacf=true", "measure.interval=0.5",
)  # fmt: skip


def crc(values: np.ndarray) -> int:
    return zlib.crc32(np.ascontiguousarray(values).tobytes())


def numbers(run: haff.File, draw: random.Random | None, chosen: list | None = None) -> list:
    """Checksums of some rows, by kind and number; of those chosen before, if any are given."""
    columns = {
        "frames": lambda k: crc(run.frames[k].position) ^ crc(run.frames[k].velocity),
        "samples": lambda k: crc(np.array([run.samples[name][k] for name in ("time", "temperature", "collisions")])),
        "events": lambda k: crc(run.events[k : k + 1][["time", "impulse", "i", "j"]].to_numpy(float)),
        "profiles": lambda k: crc(run.profiles["z"].density.values[k]),
    }
    if chosen is None:
        lengths = {
            "frames": len(run.frames),
            "samples": len(run.samples["time"]),
            "events": len(run.events),
            "profiles": run.profiles["z"].sizes["time"],
        }
        assert draw is not None
        chosen = [(kind, k) for kind, n in lengths.items() if n for k in (n - 1, draw.randrange(n))]
        times = run.frames.time
        assert np.all(np.isfinite(times)) and np.all(np.diff(times) > 0), "times of frames"
        correlation = run.correlations["vacf"]
        assert np.all(np.isfinite(correlation.value.values)), "correlation"
    return [(kind, k, columns[kind](k)) for kind, k in chosen]


def read_until_told(path: Path, stop, seed: int, count, pipe) -> None:  # type: ignore[no-untyped-def]
    """A reader: reads again and again, and sends its times, failures, and what it has read."""
    draw = random.Random(seed)
    opening, whole, failures, found, running = [], [], [], set(), 0
    while not stop.is_set():
        if not path.exists():
            time.sleep(0.001)
            continue
        began = time.perf_counter()
        try:
            with haff.open(path) as run:
                opened = time.perf_counter()
                running += run.running
                found.update(numbers(run, draw))
        except Exception as error:
            failures.append(f"{type(error).__name__}: {error}")
        else:
            opening.append(opened - began)
            whole.append(time.perf_counter() - began)
        with count.get_lock():
            count.value += 1
    pipe.send((opening, whole, failures, sorted(found), running))


def one_run(command: str, path: Path, read: Path, options: argparse.Namespace, seed: int) -> dict:
    """One run, with readers of the file ``read``."""
    context = multiprocessing.get_context("fork")
    stop, count = context.Event(), context.Value("q", 0)
    pipes, workers = [], []
    for k in range(options.readers):
        ours, theirs = context.Pipe(duplex=False)
        workers.append(context.Process(target=read_until_told, args=(read, stop, seed + k, count, theirs)))
        pipes.append(ours)
    for worker in workers:
        worker.start()
    sets = [word for item in (*SETTINGS, f"run.wall_time={options.seconds}") for word in ("--set", item)]
    call = [command, "run", SCENE, "-o", path, "--overwrite", "-q", "-vv", "--json", "--threads", "1", *sets]
    done = subprocess.run(call, capture_output=True, text=True, check=True)
    stop.set()
    results = [pipe.recv() for pipe in pipes]
    for worker in workers:
        worker.join()
    report = json.loads(done.stdout)
    waits = [float(number) for number in re.findall(r"waited for readers.* seconds=([0-9.e-]+)", done.stderr)]
    return {
        "rate": report["collisions"] / report["wall_seconds"],
        "flushes": done.stderr.count("flushed"),
        "waited": sum(waits),
        "opening": [t for result in results for t in result[0]],
        "whole": [t for result in results for t in result[1]],
        "failures": [text for result in results for text in result[2]],
        "found": sorted({one for result in results for one in result[3]}),
        "running": sum(result[4] for result in results),
        "opens": count.value,
    }


def stress(command: str, folder: Path, options: argparse.Namespace) -> dict:
    path = folder / "run.h5"
    totals: dict = {"opens": 0, "running": 0, "rows": 0, "runs": 0, "flushes": 0, "failures": [], "wrong": 0}
    opening, whole = [], []
    while totals["opens"] < options.opens:
        path.unlink(missing_ok=True)
        one = one_run(command, path, path, options, 1000 * totals["runs"])
        with haff.open(path) as run:
            again = numbers(run, None, [(kind, k) for kind, k, _ in one["found"]])
        totals["wrong"] += sum(a != tuple(b) for a, b in zip(again, one["found"], strict=True))
        totals["rows"] += len(again)
        totals["runs"] += 1
        for name in ("opens", "running", "flushes"):
            totals[name] += one[name]
        totals["failures"] += one["failures"]
        opening += one["opening"]
        whole += one["whole"]
        print(f"{totals['opens']} opens, {len(totals['failures'])} failures", file=sys.stderr, flush=True)
    for name, times in (("open", opening), ("read", whole)):
        totals[name] = {"median": statistics.median(times), "99.9 %": np.quantile(times, 0.999), "most": max(times)}
    return totals


def cost(command: str, folder: Path, options: argparse.Namespace) -> dict:
    path, copy = folder / "run.h5", folder / "copy.h5"
    path.unlink(missing_ok=True)
    one_run(command, path, folder / "missing.h5", options, 0)
    shutil.copy(path, copy)
    ratios, rates, waited = [], [], []
    # Held as a run holds it: the copy is then read as the file of a run is.
    with copy.open("rb") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        for pair in range(options.cost):
            order = [path, copy] if pair % 2 == 0 else [copy, path]
            found = {}
            for read in order:
                path.unlink(missing_ok=True)
                found[read] = one_run(command, path, read, options, pair)
            ratios.append(found[path]["rate"] / found[copy]["rate"])
            rates.append(found[copy]["rate"])
            waited.append(found[path]["waited"] / options.seconds)
            print(f"pair {pair}: {ratios[-1]:.4f}, waited {waited[-1]:.4f}", file=sys.stderr, flush=True)
    return {
        "pairs": len(ratios),
        "rate of a read run": statistics.median(ratios),
        "ratios": ratios,
        "collisions per second": statistics.median(rates),
        "waiting of the writer": statistics.median(waited),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--haff", default="haff", help="the command")
    parser.add_argument("--opens", type=int, default=10_000)
    parser.add_argument("--readers", type=int, default=4)
    parser.add_argument("--busy", type=int, default=0, help="processes that only compute")
    parser.add_argument("--seconds", type=float, default=10, help="length of a run")
    parser.add_argument("--cost", type=int, default=0, help="pairs of runs for the cost")
    options = parser.parse_args()
    with busy_processes(options.busy), tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        report: dict = {"busy": options.busy, "readers": options.readers}
        if options.opens:
            report["stress"] = stress(options.haff, folder, options)
        if options.cost:
            report["cost"] = cost(options.haff, folder, options)
    print(json.dumps(report, indent=1))
    if options.opens and (report["stress"]["failures"] or report["stress"]["wrong"]):
        sys.exit(1)


if __name__ == "__main__":
    main()
