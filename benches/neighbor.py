#!/usr/bin/env python3
"""Measures one and two threads beside other processes that only compute, in turn.

    benches/neighbor.py --haff .venv/bin/haff                     # one busy process, N = 100,000 and 500,000
    benches/neighbor.py --haff .venv/bin/haff --busy 0            # on a free machine

For each number of particles some pairs of `haff bench` (--pairs) are run, with --threads 1 and 2, in alternating order,
so that slow changes of the machine cancel. Prints a JSON object with the collisions per second of each run and the
ratio of two threads to one: its median, and those of all pairs.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess

from busy import busy_processes

THREADS = (1, 2)


def rate(command: str, n: int, threads: int, options: argparse.Namespace) -> float:
    """Collisions per second of one run."""
    settings = {"n": n, "phi": options.phi, "threads": threads, "melt": options.melt, "collisions": options.collisions}
    words = [word for name, value in settings.items() for word in (f"--{name}", str(value))]
    done = subprocess.run([command, "bench", *words, "--json"], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)["collisions_per_second"]


def pairs(command: str, n: int, options: argparse.Namespace) -> dict:
    rates: dict[int, list[float]] = {threads: [] for threads in THREADS}
    for pair in range(options.pairs):
        for threads in THREADS if pair % 2 == 0 else THREADS[::-1]:
            rates[threads].append(rate(command, n, threads, options))
    ratios = [two / one for one, two in zip(*rates.values(), strict=True)]
    medians = [statistics.median(rates[threads]) for threads in THREADS]
    return {
        "n": n,
        "busy": options.busy,
        "rates": rates,
        "ratio of medians": medians[1] / medians[0],
        "median of ratios": statistics.median(ratios),
        "ratios": ratios,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--haff", default="haff", help="the command")
    parser.add_argument("--n", type=int, nargs="+", default=[100_000, 500_000])
    parser.add_argument("--phi", type=float, default=0.1)
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--busy", type=int, default=1, help="processes that only compute")
    parser.add_argument("--melt", type=float, default=1)
    parser.add_argument("--collisions", type=int, default=3_000_000)
    options = parser.parse_args()
    with busy_processes(options.busy):
        print(json.dumps([pairs(options.haff, n, options) for n in options.n], indent=1))


if __name__ == "__main__":
    main()
