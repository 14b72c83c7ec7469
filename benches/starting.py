#!/usr/bin/env python3
"""Times `import haff`, help, errors and single figures of one or two packages, and records them.

    benches/starting.py --haff .venv/bin/haff                                      # the package of this checkout
    benches/starting.py --haff .venv/bin/haff --before OLD/scripts                 # and an earlier one, in turn

The package is the folder `haff` in the folder that is named, by PYTHONPATH; the files to draw are made by the command
in a temporary folder, a few megabytes each. Every command is run once, then nine times (--repeats) in turn with that of
the other package; the record has the medians of the wall time and of the processor time, user and system. A figure that
the earlier package does not have is left out there. The record goes to benches/record/ as starting.json and
starting.md, where only the part between the lines `<!-- begin starting -->` and `<!-- end starting -->` is replaced.

Needs matplotlib, numpy and pandas, as record.py does.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from record import ROOT, by_name, into_page, machine, portable, revision

GAS = ["--set", "species.grain.count=2000", "--set", "run.until=50"]
MEASURED = ["species.0.count=500", "run.collisions_per_particle=400", "measure.msd=true", "measure.vacf=true"]
MEASURED += ["measure.stress=true", "measure.stress_correlation=true", "measure.interval=0.02"]
FILES = {
    "gas": ["cooling", *GAS],
    "ball": ["ball"],
    "break": ["breakshot"],
    "wall": ["hot_wall", "--set", "run.until=100"],
    "fluid": ["fluid", *(word for one in MEASURED for word in ("--set", one))],
    "sheared": ["sheared_gas", "--set", "run.until=100"],
}
"""Scenes of configs/ and their settings, by the name of the file; `ball` is `haff init bouncing_ball`."""
FIGURES = {
    "gas": ["temperature", "energy", "velocity", "structure", "losses", "snapshot"],
    "ball": ["closed_form", "trajectories", "snapshot"],
    "break": ["paths", "snapshot"],
    "wall": ["profiles"],
    "fluid": ["msd", "stress"],
    "sheared": ["shear"],
}
QUICK = [
    ["python", "-c", "import haff"],
    *(["haff", command, what] for command in ("plot", "export", "view") for what in ("--help", "missing.h5")),
]


def commands() -> list[list[str]]:
    """What is timed; `OUT` stands for a folder that does not exist yet."""
    drawn = [
        ["haff", "plot", f"{name}.h5", "--kind", kind, "-o", "OUT"] for name, kinds in FIGURES.items() for kind in kinds
    ]
    return [*QUICK, *drawn]


def make_files(haff: Path, folder: Path) -> None:
    """Runs the scenes of ``FILES``."""
    for name, (scene, *settings) in FILES.items():
        path = ROOT / "configs" / f"{scene}.toml"
        if scene == "ball":
            path = folder / "ball.toml"
            shown = subprocess.run([haff, "init", "bouncing_ball"], capture_output=True, text=True, check=True)
            path.write_text(shown.stdout)
        words = [str(haff), "run", str(path), *settings, "-o", str(folder / f"{name}.h5"), "--quiet", "--overwrite"]
        subprocess.run(words, check=True, stdout=subprocess.DEVNULL)


def measure(words: list[str], package: Path, folder: Path, programs: dict[str, str]) -> tuple[float, float] | None:
    """Wall and processor time of one call [s]; ``None`` if the package has no such figure."""
    with tempfile.TemporaryDirectory(dir=folder) as out:
        call = [programs[words[0]], *(f"{out}/figures" if word == "OUT" else word for word in words[1:])]
        environment = {**os.environ, "PYTHONPATH": str(package), "MPLBACKEND": "Agg", "PYTHONDONTWRITEBYTECODE": ""}
        start = time.perf_counter()
        process = subprocess.Popen(
            call, cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)
        expected = 4 if "missing.h5" in words else 0
        if process.returncode == 2 and words[1] == "plot" and package != ROOT / "python":
            return None
        if process.returncode != expected:
            raise SystemExit(f"{portable(call)}: exit status {process.returncode}, not {expected}")
        return wall, usage.ru_utime + usage.ru_stime


def cells(options: argparse.Namespace, packages: dict[str, Path]) -> list[dict]:
    """All commands, each with the times of each package."""
    found = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_files(options.haff, folder)
        programs = {"haff": str(options.haff), "python": str(options.haff.parent / "python3")}
        for words in commands():
            times: dict[str, list[tuple[float, float]]] = {package: [] for package in packages}
            # The first call fills the caches of the disk and is not counted.
            for repeat in range(options.repeats + 1):
                for package, path in packages.items():
                    pair = measure(words, path, folder, programs)
                    if repeat and pair is not None:
                        times[package].append(pair)
            found.append({"command": " ".join(word for word in words if word not in ("-o", "OUT")), "times": times})
            print(row(found[-1], list(packages)), file=sys.stderr)
    return found


def row(cell: dict, packages: list[str]) -> str:
    """Medians of one command, as a row of the table."""
    texts = []
    for package in packages:
        found = cell["times"][package]
        wall, cpu = (statistics.median(column) for column in zip(*found)) if found else (None, None)
        texts.append(f"{wall:.2f} ({cpu:.2f})" if found else "–")
    return f"| `{cell['command']}` | {' | '.join(texts)} |"


def markdown(record: dict) -> str:
    """The measured part of the page."""
    at = record["machine"]
    packages = list(record["packages"])
    heads = " | ".join(f"{name}, revision {record['packages'][name]}" for name in packages)
    lines = [
        f"`{record['command']}`; {at.get('model', '')} (family {at.get('family', '?')}); {record['date']}; medians of"
        f" {record['repeats']}: wall time, in brackets processor time [s].",
        "",
        f"| command | {heads} |",
        "|---|" + "---|" * len(packages),
        *(row(cell, packages) for cell in record["cells"]),
    ]
    return "\n".join(lines) + "\n"


def revision_of(folder: Path) -> str:
    """The git revision of a checkout."""
    words = ["git", "-C", str(folder), "rev-parse", "--short=7", "HEAD"]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()


def main() -> None:
    summary, _, more = (__doc__ or "").partition("\n")
    parser = argparse.ArgumentParser(
        description=summary, epilog=more, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--haff", type=Path, default=ROOT / ".venv/bin/haff", help="the installed command")
    parser.add_argument("--before", type=Path, metavar="FOLDER", help="folder of an earlier package, in a checkout")
    parser.add_argument("--repeats", type=int, default=9, help="calls of each command (default: 9)")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "benches/record", help="folder [benches/record]")
    parser.add_argument("--replot", type=Path, metavar="JSON", help="tabulate a record again, measure nothing")
    options = parser.parse_args()
    if options.replot:
        record = json.loads(options.replot.read_text())
    else:
        packages = {"before": options.before} if options.before else {}
        packages["now"] = ROOT / "python"
        # Changes that are not committed show as a +.
        names = {name: revision_of(path) for name, path in packages.items()} | {"now": revision()[:7] + revision()[12:]}
        # As it runs here, the virtual environment's own Python resolved.
        options.haff = options.haff.absolute()
        record = {
            "date": datetime.date.today().isoformat(),
            "machine": machine(),
            "command": " ".join(["benches/starting.py", *map(by_name, sys.argv[1:])]),
            "repeats": options.repeats,
            "packages": names,
            "cells": cells(options, {name: path.absolute() for name, path in packages.items()}),
        }
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "starting.json").write_text(json.dumps(record, ensure_ascii=False) + "\n")
    into_page(options.output / "starting.md", "Start", {"starting": markdown(record)})


if __name__ == "__main__":
    main()
