"""The command behind ``scripts/validate``."""

from __future__ import annotations

import argparse
import datetime
import os
import platform
import subprocess
import sys
import time
from pathlib import Path

from . import report
from .registry import discover
from .runs import ROOT, Context, executable


def arguments(names: list[str]) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="scripts/validate",
        description="Compares haff with theory and published simulation, by z-score. Exit status 1 if anything fails.",
        epilog="Example: scripts/validate pressure haff_rate --jobs 4",
    )
    parser.add_argument("name", nargs="*", metavar="NAME", help="parts to measure; all of them if none is named")
    parser.add_argument("--list", action="store_true", help="list the parts and end")
    parser.add_argument("--quick", action="store_true", help="short runs: is all well? Writes a record only with -o")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="runs at once [all cores]")
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="DIR",
        help="where validation.json, .md and .png go, beside parts measured before [benches/record]",
    )
    parser.add_argument(
        "--haff", type=Path, metavar="FILE", help="the command to validate [HAFF, or the one installed]"
    )
    return parser


def processor() -> str:
    """The machine in a few words."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.machine()


def main() -> int:
    parts = discover()
    parser = arguments(list(parts))
    options = parser.parse_args()
    if options.list:
        for part in parts.values():
            print(f"{part.name:<22}{part.title}")
        return 0
    unknown = [name for name in options.name if name not in parts]
    if unknown:
        parser.error(f"no part {unknown[0]!r}; there are: {', '.join(parts)}")
    if options.jobs < 1:
        parser.error("--jobs must be 1 or more")
    directory = options.output or (None if options.quick else ROOT / "benches" / "record")
    try:
        binary = executable(options.haff)
    except RuntimeError as error:
        parser.error(str(error))
    version = subprocess.run([str(binary), "--version"], capture_output=True, text=True, check=True).stdout.split(
        " ", 1
    )
    record = report.load(directory / "validation.json") if directory else {"parts": {}}
    failed = 0
    for name in [name for name in parts if not options.name or name in options.name]:
        context = Context(binary, options.jobs, options.quick, label=name)
        started = time.monotonic()
        try:
            rows = parts[name].measure(context)
        finally:
            context.close()
        failed += sum(not row.passed for row in rows)
        record["parts"][name] = {
            "rows": [row.to_json() for row in rows],
            "collisions": context.collisions,
            "max_overlap": context.worst_overlap,
            "ledger_residual": context.worst_residual,
            "seconds": round(time.monotonic() - started, 1),
            "jobs": options.jobs,
            "quick": options.quick,
            "machine": processor(),
            "version": version[-1].strip(),
            "date": datetime.date.today().isoformat(),
        }
        print(f"\n{parts[name].title}: {report.summary(rows)}\n")
        print("\n".join(report.table(rows)), flush=True)
        # After every part, so that an interrupted run keeps its results.
        if directory:
            report.write(record, directory, parts)
    if failed:
        print(f"\n{failed} failed", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
