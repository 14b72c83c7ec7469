#!/usr/bin/env python3
"""Measures the discharge of hoppers by their aperture, for benches/record/shapes.md.

    benches/hopper.py --haff .venv/bin/haff --dimension 2

Grains that flow out of a funnel come in again above it. Prints a Markdown table of steady rates with errors, and the
exponent n of W = C (D − k)^n fitted to them, where Beverloo's law has 3/2 in two and 5/2 in three dimensions.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from scipy.optimize import curve_fit

import haff

ANGLE = 0.6
"""Half the opening angle of the funnel."""
ORIFICE = 12.0
"""Height of the aperture."""
APERTURES = {2: (5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0), 3: (4.0, 4.5, 5.0, 5.5, 6.0, 6.5, 7.0)}
SCENE = {
    2: """
dimension = 2
seed = {seed}
[domain]
size = [30.0, 70.0]
boundary = ["wall", "wall"]
gravity = [0.0, -1.0]
[[species]]
name = "grain"
count = 800
radius = {{ uniform = [0.45, 0.55] }}
density = 1.0
temperature = 0.01
region = {{ box = [[0.0, 24.0], [30.0, 66.0]] }}
[[wall]]
name = "funnel"
cone.apex = [15.0, {apex}]
cone.axis = [0.0, 1.0]
cone.angle = {angle}
cone.start = {start}
cone.length = 21.92
cone.side = "both"
[[inlet]]
box = [[1.0, 55.0], [29.0, 68.0]]
temperature = 0.01
refill = true
[[outlet]]
box = [[0.0, 0.0], [30.0, 8.0]]
""",
    3: """
seed = {seed}
[domain]
size = [16.0, 16.0, 60.0]
boundary = ["wall", "wall", "wall"]
gravity = [0.0, 0.0, -1.0]
[[species]]
name = "grain"
count = 2500
radius = {{ uniform = [0.45, 0.55] }}
density = 1.0
temperature = 0.01
region = {{ cylinder = {{ point = [8.0, 8.0, 23.0], axis = [0.0, 0.0, 1.0], radius = 7.2, length = 34.0 }} }}
[[wall]]
name = "shaft"
cylinder = {{ point = [8.0, 8.0, 0.0], axis = [0.0, 0.0, 1.0], radius = 7.9 }}
[[wall]]
name = "funnel"
cone.apex = [8.0, 8.0, {apex}]
cone.axis = [0.0, 0.0, 1.0]
cone.angle = {angle}
cone.start = {start}
cone.length = 11.54
cone.side = "both"
[[inlet]]
box = [[3.0, 3.0, 46.0], [13.0, 13.0, 58.0]]
temperature = 0.01
refill = true
[[outlet]]
box = [[0.0, 0.0, 0.0], [16.0, 16.0, 8.0]]
""",
}
LAWS = """
[contact]
restitution = 0.7
rest_speed = 0.3
[run]
until = {until}
[output]
frames = false
observables = 1.0
"""


def discharge(options: argparse.Namespace, aperture: float, seed: int) -> tuple[float, float, float]:
    """Grains a time in the steady state, its error, and when this begins."""
    start = 0.5 * aperture / math.tan(ANGLE)
    values = {"seed": seed, "apex": ORIFICE - start, "angle": ANGLE, "start": start, "until": options.until}
    with tempfile.TemporaryDirectory() as folder:
        scene, file = Path(folder) / "hopper.toml", Path(folder) / "hopper.h5"
        scene.write_text((SCENE[options.dimension] + LAWS).format(**values))
        command = [options.haff, "run", scene, "-o", file, "-q", "--threads", "1"]
        subprocess.run(command, check=True)
        with haff.open(file) as run:
            rate = run.means.loc["discharge_rate"]
    return float(rate["mean"]), float(rate["error"]), float(rate["start"])


def law(aperture: np.ndarray, constant: float, offset: float, exponent: float) -> np.ndarray:
    return constant * np.maximum(aperture - offset, 1e-9) ** exponent


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--haff", default="haff")
    parser.add_argument("--dimension", type=int, choices=(2, 3), default=2)
    parser.add_argument("--until", type=float, default=70.0)
    parser.add_argument("--seeds", type=int, default=1, help="runs of each aperture")
    parser.add_argument("--jobs", type=int, default=1, help="runs at the same time")
    options = parser.parse_args()
    rates = []
    print("| aperture D | grains a time | error | steady from |\n|---|---|---|---|")
    with ThreadPoolExecutor(options.jobs) as pool:
        for aperture in APERTURES[options.dimension]:
            runs = [pool.submit(discharge, options, aperture, seed) for seed in range(1, options.seeds + 1)]
            found = np.array([run.result() for run in runs])
            rate, start = found[:, 0].mean(), found[:, 2].max()
            error = math.sqrt(np.sum(found[:, 1] ** 2)) / options.seeds
            rates.append((aperture, rate, error))
            print(f"| {aperture} | {rate:.3f} | {error:.3f} | {start:.0f} |", flush=True)
    D, W, error = np.array(rates).T
    expected = {2: 1.5, 3: 2.5}[options.dimension]
    found, covariance = curve_fit(law, D, W, (1.0, 1.5, expected), sigma=error, absolute_sigma=True)
    chi2 = float(np.sum(((law(D, *found) - W) / error) ** 2)) / (len(D) - 3)
    widths = np.sqrt(np.diag(covariance) * max(chi2, 1.0))
    print(f"\nexponent {found[2]:.3f} ± {widths[2]:.3f}, offset {found[1]:.2f} ± {widths[1]:.2f} diameters, ", end="")
    print(f"constant {found[0]:.3f} ± {widths[0]:.3f}, χ²/ν = {chi2:.2f}")
    fixed, covariance = curve_fit(
        lambda d, c, k: law(d, c, k, expected), D, W, (1.0, 1.5), sigma=error, absolute_sigma=True
    )
    chi2 = float(np.sum(((law(D, *fixed, expected) - W) / error) ** 2)) / (len(D) - 2)
    print(f"with the exponent {expected}: offset {fixed[1]:.2f}, constant {fixed[0]:.3f}, χ²/ν = {chi2:.2f}")


if __name__ == "__main__":
    main()
