#!/usr/bin/env python3
"""Measures boxes that deform, and events at the same instant.

    benches/deforming.py --haff .venv/bin/haff                        # for benches/record/choice.md
    benches/deforming.py --haff .venv/bin/haff --threads              # for benches/record/deforming.md
    benches/deforming.py --haff .venv/bin/haff --simultaneous

The first has millions of collisions a second of each search and of `auto`, the best of some runs (--runs) on one
thread; a dash where a search refuses the box. The second has one thread and two in turn: the medians of their rates,
and the ratios of medians and of pairs. The third has the time in which events are taken on one thread. Each prints a
Markdown table.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from pathlib import Path
from statistics import median

SEARCHES = ("cells", "windows", "lists", "auto")
GRAINS = """
[[species]]
name = "grain"
count = 1000
radius = 0.5
mass = 1.0
temperature = 1.0
[output]
frames = false
observables = false
"""
SHEAR = 'domain.shear = { flow = "x", gradient = "y", rate = 0.5 }\nrun.collisions = 150_000\n' + GRAINS
GROWTH = "growth.temperature = 1.0\n" + GRAINS


def sheared(name: str, phi: float, e: float, count: int = 1000, *more: str) -> tuple[str, str, list[str]]:
    keys = [f"contact.restitution={e}", f"species.grain.count={count}", f"domain.packing_fraction={phi}", *more]
    return f"shear, {count:,} {name}, φ = {phi}, e = {e}", SHEAR, keys


def long(ratio: int) -> tuple[str, str, list[str]]:
    keys = ["contact.restitution=0.8", f"species.grain.count={30 * ratio}", f"domain.size=[{5.0 * ratio},5.0,5.0]"]
    return f"shear, φ = 0.126, e = 0.8, ratio of edges {ratio}", SHEAR, keys


def growth(count: int, start: float, end: float, rate: float) -> tuple[str, str, list[str]]:
    keys = [f"species.grain.count={count}", f"domain.packing_fraction={start}", f"growth.rate={rate}"]
    keys.append(f"growth.until_packing_fraction={end}")
    return f"growth, {count:,} spheres, φ = {start} to {end}, rate {rate}", GROWTH, keys


SCENES = [
    *(sheared("spheres", phi, e) for e in (0.8, 0.97) for phi in (0.1, 0.3, 0.45, 0.5)),
    *(sheared("disks", phi, e, 1000, "dimension=2") for e in (0.8, 0.97) for phi in (0.3, 0.6, 0.72)),
    *(sheared("spheres", phi, 0.8, 30_000, "run.collisions=600000") for phi in (0.3, 0.49)),
    *(sheared("spheres", 0.1, 0.8, count, "run.collisions=30000") for count in (20, 50)),
    sheared("spheres", 0.3, 0.8, 120, "run.collisions=30000"),
    *map(long, (6, 10, 20)),
    *(growth(count, 0.1, 0.6, 0.002) for count in (20, 50, 100)),
    *(
        growth(1000, start, end, rate)
        for rate in (0.002, 0.02, 0.1)
        for start, end in ((0.1, 0.2), (0.25, 0.3), (0.5, 0.55))
    ),
]


LARGE = [
    *(sheared("spheres", phi, 0.9, count, "run.collisions=3000000") for phi, count in ((0.1, 100_000), (0.3, 100_000))),
    sheared("spheres", 0.5, 0.9, 500_000, "run.collisions=3000000"),
    growth(300_000, 0.3, 0.45, 0.01),
]

LATTICE = """
domain.size = [400.0, 400.0, 20.0]
domain.boundary = ["periodic", "periodic", "wall"]
domain.gravity = [0.0, 0.0, -1.0]
contact.restitution = 0.9
initial.positions = "lattice"
run.until = 6.0
"""
FALLING = LATTICE + GRAINS.replace("1000", "90000").replace("temperature = 1.0", "temperature = 0.0")
TIED = [
    (*sheared("spheres", 0.3, 0.9, 400_000, "run.collisions=800000"), "lists"),
    *(("90,000 balls of a lattice that fall on a floor, t = 6", FALLING, [], search) for search in ("cells", "lists")),
]


def run(command: str, scene: Path, keys: list[str], search: str, threads: int) -> dict[str, object]:
    words = [word for key in (*keys, f"engine.neighbors={search}") for word in ("--set", key)]
    line = [command, "run", str(scene), "--json", "--threads", str(threads), *words]
    return json.loads(subprocess.run(line, capture_output=True, text=True).stdout)


def rate(command: str, scene: Path, keys: list[str], search: str, runs: int = 1, threads: int = 1) -> float | None:
    """Collisions a second, the largest of some runs; `None` if the search refuses the box."""
    best = 0.0
    for _ in range(runs):
        report = run(command, scene, keys, search, threads)
        if "collisions_per_second" not in report:
            if "does not work here" in report["error"]:
                return None
            raise SystemExit(report["error"])
        best = max(best, report["collisions_per_second"])
    return best


def searches(options: argparse.Namespace, path: Path) -> None:
    print(f"| scene | {' | '.join(SEARCHES)} |\n|---|{'---|' * len(SEARCHES)}")
    for label, scene, keys in SCENES:
        path.write_text(scene)
        rates = [rate(options.haff, path, keys, search, options.runs) for search in SEARCHES]
        print(f"| {label} | {' | '.join('–' if one is None else f'{one / 1e6:.2f}' for one in rates)} |", flush=True)


def threads(options: argparse.Namespace, path: Path) -> None:
    print("| scene | 1 thread | 2 threads | ratio of medians | of pairs |\n|---|---|---|---|---|")
    for label, scene, keys in LARGE:
        path.write_text(scene)
        pairs = [[rate(options.haff, path, keys, "auto", threads=n) / 1e6 for n in (1, 2)] for _ in range(options.runs)]
        one, two = (median(column) for column in zip(*pairs))
        ratios = sorted(two / one for one, two in pairs)
        print(f"| {label} | {one:.3f} | {two:.3f} | {two / one:.2f} | {ratios[0]:.2f}–{ratios[-1]:.2f} |", flush=True)


def simultaneous(options: argparse.Namespace, path: Path) -> None:
    print("| scene | search | events taken in [s] |\n|---|---|---|")
    for label, scene, keys, search in TIED:
        path.write_text(scene)
        print(f"| {label} | {search} | {run(options.haff, path, keys, search, 1)['wall_seconds']:.2f} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--haff", default="haff", help="the command")
    parser.add_argument("--runs", type=int, default=3, help="runs of each search, or pairs of runs")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--threads", dest="table", action="store_const", const=threads, help="one thread and two")
    what.add_argument("--simultaneous", dest="table", action="store_const", const=simultaneous, help="events at once")
    parser.set_defaults(table=searches)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        options.table(options, Path(folder) / "scene.toml")


if __name__ == "__main__":
    main()
