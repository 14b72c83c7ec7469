#!/usr/bin/env python3
"""Measures the searches in boxes that deform: millions of collisions a second of each of them, and of `auto`.

    benches/deforming.py --haff .venv/bin/haff

Prints a Markdown table, for benches/record/choice.md. Each figure is the best of some runs (--runs) on one thread; a
dash where a search refuses the box.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

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


def rate(command: str, scene: Path, keys: list[str], search: str, runs: int) -> str:
    words = [word for key in (*keys, f"engine.neighbors={search}") for word in ("--set", key)]
    best = 0.0
    for _ in range(runs):
        line = [command, "run", str(scene), "--json", "--threads", "1", *words]
        report = json.loads(subprocess.run(line, capture_output=True, text=True).stdout)
        if "collisions_per_second" not in report:
            if "does not work here" in report["error"]:
                return "–"
            raise SystemExit(report["error"])
        best = max(best, report["collisions_per_second"])
    return f"{best / 1e6:.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--haff", default="haff", help="the command")
    parser.add_argument("--runs", type=int, default=3, help="runs of each search")
    options = parser.parse_args()
    print(f"| scene | {' | '.join(SEARCHES)} |\n|---|{'---|' * len(SEARCHES)}")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.toml"
        for label, scene, keys in SCENES:
            path.write_text(scene)
            figures = [rate(options.haff, path, keys, search, options.runs) for search in SEARCHES]
            print(f"| {label} | {' | '.join(figures)} |", flush=True)


if __name__ == "__main__":
    main()
