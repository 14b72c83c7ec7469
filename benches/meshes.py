#!/usr/bin/env python3
"""Measures the rate of grains in a cube whose faces are a mesh, for benches/record/shapes.md.

    benches/meshes.py --haff .venv/bin/haff

Prints a Markdown table: millions of collisions a second on one thread, medians of some runs (--runs), which alternate;
with the walls of the domain just outside the mesh, and with open axes.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from pathlib import Path
from statistics import median

EDGE = 80.0
SCENE = """
seed = 1
contact.restitution = 0.9
[[species]]
name = "grain"
count = 100_000
radius = 0.5
mass = 1.0
temperature = 1.0
[output]
frames = false
observables = false
"""
DIVISIONS = (1, 29, 91)
"""Squares along an edge of the cube, each two triangles."""


def cube(path: Path, n: int) -> int:
    """Writes an OBJ file with n × n squares on each face; returns the number of its triangles."""
    numbers: dict[tuple[int, ...], int] = {}
    faces = []
    for axis in range(3):
        for side in (0, n):
            for a in range(n):
                for b in range(n):
                    square = []
                    for u, v in ((a, b), (a + 1, b), (a + 1, b + 1), (a, b + 1)):
                        corner = [0, 0, 0]
                        corner[axis], corner[(axis + 1) % 3], corner[(axis + 2) % 3] = side, u, v
                        square.append(numbers.setdefault(tuple(corner), len(numbers) + 1))
                    faces += [(square[0], square[1], square[2]), (square[0], square[2], square[3])]
    lines = [f"v {' '.join(repr(EDGE * x / n) for x in corner)}" for corner in numbers]
    path.write_text("\n".join([*lines, *(f"f {a} {b} {c}" for a, b, c in faces), ""]))
    return len(faces)


def mesh(path: Path, boundary: str, margin: float) -> str:
    edge, at = EDGE + 2 * margin, [margin] * 3
    wall = f'[[wall]]\nname = "cube"\nmesh = {{ file = "{path}", side = "inside", point = {at} }}\n'
    return f"domain.size = {[edge] * 3}\ndomain.boundary = {[boundary] * 3}\n{SCENE}{wall}"


def rate(options: argparse.Namespace, scene: Path) -> float:
    length = f"run.collisions={options.collisions}"
    line = [options.haff, "run", str(scene), "--json", "--threads", "1", "--set", length]
    report = json.loads(subprocess.run(line, capture_output=True, text=True).stdout)
    return report["collisions_per_second"] / 1e6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--haff", default="haff", help="the command")
    parser.add_argument("--runs", type=int, default=3, help="runs of each scene")
    parser.add_argument("--collisions", type=int, default=5_000_000, help="collisions of each run")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scenes = {"planes": f"domain.size = {[EDGE] * 3}\ndomain.boundary = {['wall'] * 3}\n{SCENE}"}
        triangles = {}
        for n in DIVISIONS:
            triangles[n] = cube(folder / f"{n}.obj", n)
            scenes[f"{n} walls"] = mesh(folder / f"{n}.obj", "wall", 0.5)
            scenes[f"{n} open"] = mesh(folder / f"{n}.obj", "open", 0.0)
        rates: dict[str, list[float]] = {key: [] for key in scenes}
        for _ in range(options.runs):
            for key, text in scenes.items():
                (folder / "scene.toml").write_text(text)
                rates[key].append(rate(options, folder / "scene.toml"))
    found = {key: f"{median(values):.3f}" for key, values in rates.items()}
    print("| | triangles | walls of the domain outside the mesh | open axes |\n|---|---|---|---|")
    print(f"| six walls of the domain | | {found['planes']} | |")
    for n in DIVISIONS:
        print(f"| mesh | {triangles[n]:,} | {found[f'{n} walls']} | {found[f'{n} open']} |")


if __name__ == "__main__":
    main()
