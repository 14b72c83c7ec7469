#!/usr/bin/env python3
"""Measures collisions per second over a grid of N and φ, and records them with machine, commands, date and revision.

    cargo build --release
    benches/record.py                                        # the grid of the README, one thread, median of 3
    benches/record.py --growth                               # time per collision, N = 10³ to 10⁷, φ = 0.001 to 0.6
    benches/record.py --scene cooling --n 32000 --phi 0.1    # another scene of `haff bench --list`
    benches/record.py --peers peers.csv                      # figures of other codes beside ours
    benches/record.py --peer "EDMD=./edmd.sh {n} {phi}"      # another code, measured in alternation with ours
    benches/record.py --replot benches/record/throughput.json

The record goes to benches/record/ as NAME.json (everything that was measured), NAME.png and NAME.md. NAME is
`throughput` or `growth`, with another scene `throughput_SCENE` or `growth_SCENE`. If NAME.md exists, only the part
between its lines `<!-- begin NAME -->` and `<!-- end NAME -->` is replaced; the rest of the page is written by hand.
A trial goes to another folder with -o.

--peers reads a CSV with the columns name,n,phi,collisions_per_second,source; `source` says where a figure comes from
and how it was measured. A --peer command may contain {n}, {phi}, {collisions}, {melt} and {threads}; it prints one JSON
object with at least `collisions_per_second`. It runs after every single measurement of ours, so that both run under the
same load; compare a peer on one core with --threads 1.

Needs matplotlib, numpy and pandas.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import shlex
import subprocess
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

ROOT = Path(__file__).resolve().parents[1]
OURS = "haff"
GRID_N = [4_000, 32_000, 500_000]
GRID_PHI = [0.01, 0.05, 0.1, 0.3, 0.49]
GROWTH_N = [1_000, 4_000, 10_000, 32_000, 100_000, 320_000, 1_000_000, 3_200_000, 10_000_000]
GROWTH_N_PHI = [0.05, 0.49]
GROWTH_PHI = [0.001, 0.003, 0.01, 0.03, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
GROWTH_PHI_N = 32_000
PEER_COLUMNS = ["name", "n", "phi", "collisions_per_second", "source"]
COUNTERS = ["candidates", "predictions", "stale", "dropped", "transfers"]
# What the tables call them: entries that another collision invalidated, entries dropped without a successor, and cell
# crossings or list updates.
COUNTER_TITLES = ["candidates", "predictions", "invalidated", "dropped", "crossings, updates"]


# Measuring


def machine() -> dict[str, object]:
    """Processor, its caches and number, memory and system, as far as the system reports them."""
    found: dict[str, object] = {"system": f"{platform.system()} {platform.machine()}", "processors": os.cpu_count()}
    try:
        lscpu = subprocess.run(["lscpu"], capture_output=True, text=True, check=True, env={**os.environ, "LC_ALL": "C"})
        wanted = {"Model name": "model", "L2 cache": "l2", "L3 cache": "l3", "CPU family": "family", "Model": "number"}
        for line in lscpu.stdout.splitlines():
            key, _, value = line.partition(":")
            if key.strip() in wanted:
                found[wanted[key.strip()]] = value.strip()
    except (OSError, subprocess.CalledProcessError):
        found["model"] = platform.processor()
    return found


def revision() -> str:
    """The git revision of the sources, with a + if they have been changed since."""

    def git(*words: str) -> str:
        command = ["git", "-C", str(ROOT), *words]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    try:
        return git("rev-parse", "--short=12", "HEAD") + ("+" if git("status", "--porcelain", "-uno") else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def compiler() -> str:
    try:
        return subprocess.run(["rustc", "--version"], capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def haff_command(options: argparse.Namespace, n: int, phi: float) -> list[str]:
    """`haff bench` for one cell; what is not set is left to it."""
    command = [str(options.haff), "bench", "--json", "--quiet", "--scene", options.scene]
    command += ["--n", str(n), "--phi", f"{phi:g}", "--threads", str(options.threads)]
    command += ["--melt", f"{options.melt:g}"] if options.melt is not None else []
    command += ["--collisions", str(options.collisions)] if options.collisions is not None else []
    return command + shlex.split(options.options)


def peer_command(template: str, options: argparse.Namespace, n: int, phi: float) -> list[str]:
    """A peer's command with the cell's values filled in."""
    values = {
        "n": n,
        "phi": f"{phi:g}",
        "threads": options.threads,
        "melt": f"{20 if options.melt is None else options.melt:g}",
        "collisions": max(1_000_000, 2 * n) if options.collisions is None else options.collisions,
    }
    return [word.format(**values) for word in shlex.split(template)]


def report_of(command: list[str]) -> dict:
    """Runs a command that prints one JSON object, and returns it."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{shlex.join(command)}\nfailed with exit status {done.returncode}:\n{done.stderr.strip()}")
    try:
        report = json.loads(done.stdout.strip().splitlines()[-1])
        float(report["collisions_per_second"])
    except (IndexError, KeyError, TypeError, ValueError) as error:
        raise SystemExit(f"{shlex.join(command)}\nprinted no JSON with collisions_per_second: {error}") from error
    return report


def measure(options: argparse.Namespace, cells: list[tuple[int, float]], repeats: int, what: str) -> list[dict]:
    """Every cell `repeats` times, ours and the peers' in turn."""
    cells_measured = []
    for n, phi in cells:
        commands = {OURS: haff_command(options, n, phi)}
        commands |= {name: peer_command(template, options, n, phi) for name, template in options.peer}
        reports: dict[str, list[dict]] = {name: [] for name in commands}
        for _ in range(repeats):
            for name, command in commands.items():
                reports[name].append(report_of(command))
        for name, found in reports.items():
            cells_measured.append(
                {"what": what, "name": name, "n": n, "phi": phi, "command": portable(commands[name]), "reports": found}
            )
            rates = np.array([report["collisions_per_second"] for report in found]) / 1e6
            print(f"{name:12} N = {n:>9,}  φ = {phi:<6g} {np.median(rates):8.4f} M/s", file=sys.stderr, flush=True)
    return cells_measured


def by_name(word: str) -> str:
    """A word of a command line, an absolute path by its last name."""
    return Path(word).name if word.startswith("/") else word


def portable(command: list[str]) -> str:
    """A command as another machine would write it."""
    return shlex.join([Path(command[0]).name, *map(by_name, command[1:])])


# Tables


def read_peers(path: Path) -> pd.DataFrame:
    """Figures of other codes from a CSV with the columns of `PEER_COLUMNS`."""
    table = pd.read_csv(path, comment="#", skipinitialspace=True)
    missing = [column for column in PEER_COLUMNS if column not in table.columns]
    if missing:
        raise SystemExit(f"{path}: no column {', '.join(missing)}; it needs {','.join(PEER_COLUMNS)}")
    for column in ("n", "phi", "collisions_per_second"):
        table[column] = pd.to_numeric(table[column], errors="coerce")
        bad = table.index[~(table[column] > 0)]
        if len(bad):
            raise SystemExit(f"{path}: {column} must be a positive number in row {bad[0] + 2}")
    return table[PEER_COLUMNS].assign(name=table["name"].astype(str))


def summary(record: dict) -> pd.DataFrame:
    """A row per cell and code: median rate, its spread, what ours counted, and figures of others."""
    rows = []
    for cell in record["cells"]:
        rates = np.array([report["collisions_per_second"] for report in cell["reports"]], dtype=float)
        row = {key: cell[key] for key in ("what", "name", "n", "phi")}
        row |= {"rate": np.median(rates), "least": rates.min(), "most": rates.max(), "repeats": len(rates)}
        row["measured"] = True
        if cell["name"] == OURS:
            last = cell["reports"][-1]
            row |= {key: last["per_collision"].get(key) for key in COUNTERS}
            row |= {key: last.get(key) for key in ("neighbors", "startup_seconds", "bytes_per_particle")}
        rows.append(row)
    for peer in record.get("peers", []):
        rate = peer["collisions_per_second"]
        rows.append(
            {"what": "grid", "name": peer["name"], "n": peer["n"], "phi": peer["phi"], "rate": rate, "least": rate}
            | {"most": rate, "repeats": 0, "measured": False}
        )
    columns = ["what", "name", "n", "phi", "rate", "least", "most", "repeats", "measured"]
    columns += [*COUNTERS, "neighbors", "startup_seconds", "bytes_per_particle"]
    return pd.DataFrame(rows, columns=columns)


def best_peer(table: pd.DataFrame, n: int, phi: float) -> pd.Series | None:
    """The fastest other code in this cell: among those measured beside ours, if there are any."""
    others = table[(table.name != OURS) & (table.n == n) & np.isclose(table.phi, phi)]
    if others.measured.any():
        others = others[others.measured.astype(bool)]
    return None if others.empty else others.loc[others.rate.idxmax()]


def number(value: object, digits: int) -> str:
    return "–" if value is None or pd.isna(value) else f"{value:,.{digits}f}"


def markdown(record: dict) -> str:
    """The record as a part of a page: machine, commands, and a table per measurement."""
    table = summary(record)
    at = record["machine"]
    caches = ", ".join(f"{level.upper()} {at[level]}" for level in ("l2", "l3") if at.get(level))
    lines = [
        f"{record['title']}. {record['date']}, revision `{record['revision']}`, {record['compiler']},"
        f" {threads(record)}.",
        f"Machine: {at.get('model', 'unknown')} (family {at.get('family', '?')}, model {at.get('number', '?')}),"
        f" {at['processors']} processors, {caches or 'caches unknown'}; {at['system']}.",
        "",
        "```sh",
        record["command"],
        "```",
        "",
        "Rates in millions of collisions between particles per second, median of the repeats, ± half the spread."
        " Packing, building and melting are not timed. Counts are per collision.",
    ]
    for what, label in (("grid", []), ("growth in n", ["With N:", ""]), ("growth in phi", ["With φ:", ""])):
        ours = table[(table.what == what) & (table.name == OURS)]
        if ours.empty:
            continue
        peers = what == "grid" and (table.name != OURS).any()
        head = ["N", "φ", "M/s", "±", "ns a collision", "search", *COUNTER_TITLES, "start [s]", "bytes a particle"]
        head += ["best peer", "its M/s", "ratio"] if peers else []
        lines += ["", *label, "| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
        for _, row in ours.iterrows():
            half = 0.5 * (row["most"] - row["least"]) / 1e6 if row["repeats"] > 1 else None
            cells = [f"{row['n']:,}", f"{row['phi']:g}", number(row["rate"] / 1e6, 3), number(half, 3)]
            cells += [number(1e9 / row["rate"], 0), row["neighbors"] if isinstance(row["neighbors"], str) else "–"]
            cells += [number(row[COUNTERS[0]], 1), *(number(row[key], 2) for key in COUNTERS[1:])]
            cells += [number(row["startup_seconds"], 2), number(row["bytes_per_particle"], 0)]
            if peers:
                best = best_peer(table[table.what == what], row["n"], row["phi"])
                cells += (
                    ["–"] * 3
                    if best is None
                    else [best["name"], number(best["rate"] / 1e6, 3), number(row["rate"] / best["rate"], 2)]
                )
            lines.append("| " + " | ".join(cells) + " |")
    sources = {(peer["name"], peer["source"]) for peer in record.get("peers", [])}
    measured = {cell["name"]: cell["command"] for cell in record["cells"] if cell["name"] != OURS}
    if sources or measured:
        lines += ["", "Peers:", ""]
        lines += [f"- {name}: measured in alternation with ours, such as `{text}`" for name, text in measured.items()]
        lines += [f"- {name}: {source}" for name, source in sorted(sources)]
    return "\n".join(lines) + "\n"


def into_page(page: Path, title: str, parts: dict[str, str]) -> None:
    """Puts measured parts into their places in a page: what is written by hand around them stays.

    A part stands between the lines `<!-- begin NAME -->` and `<!-- end NAME -->`; without them it is added at the end.
    """
    text = page.read_text() if page.exists() else f"# {title}\n"
    for name, made in parts.items():
        begin, end = f"<!-- begin {name} -->\n", f"<!-- end {name} -->\n"
        if (begin in text) != (end in text):
            raise SystemExit(f"{page}: must have both {begin.strip()} and {end.strip()}, or neither")
        if begin not in text:
            text += f"\n{begin}{end}"
        head, rest = text.split(begin, 1)
        if end not in rest:
            raise SystemExit(f"{page}: {end.strip()} must come after {begin.strip()}")
        text = f"{head}{begin}\n{made}\n{end}{rest.split(end, 1)[1]}"
    page.write_text(text)


# Figures

STYLE = {"font.size": 9, "axes.grid": True, "grid.alpha": 0.3, "legend.frameon": False, "axes.axisbelow": True}
MARKERS = ["s", "D", "^", "v", "P", "X"]


def shades(values: list) -> dict:
    """A color for each value, ordered as they are."""
    spread = plt.get_cmap("viridis")(np.linspace(0.0, 0.88, max(len(values), 2)))
    return {value: spread[k] for k, value in enumerate(values)}


def decimal(value: float, _position: object = None) -> str:
    """A tick of an axis in plain digits: 0.1, 3, 500."""
    return f"{value:g}" if value < 10_000 else f"{value:.0e}"


def styles(names: list[str]) -> dict[str, dict]:
    """How each code is drawn: ours full, the others open and dashed."""
    drawn = {OURS: {"linestyle": "-", "marker": "o", "linewidth": 1.6, "markersize": 5}}
    for k, name in enumerate(name for name in names if name != OURS):
        drawn[name] = {"linestyle": "--", "marker": MARKERS[k % len(MARKERS)], "linewidth": 1.0}
        drawn[name] |= {"markersize": 4.5, "markerfacecolor": "white"}
    return drawn


def curves(axis, table: pd.DataFrame, x: str, by: str, label, unit: float, *, inverse: bool = False) -> None:
    """Rate (or time per collision) over `x`, a color per value of `by`, a style per code."""
    values = sorted(table[by].unique())
    color, style = shades(values), styles(list(dict.fromkeys(table.name)))
    for (name, value), part in table.groupby(["name", by], sort=False):
        part = part.sort_values(x)
        y, least, most = ((unit / part[key] if inverse else part[key] / unit) for key in ("rate", "least", "most"))
        low, high = (most, least) if inverse else (least, most)
        errors = [np.maximum(y - low, 0), np.maximum(high - y, 0)]
        axis.errorbar(part[x], y, errors, color=color[value], capsize=2, elinewidth=0.8, **style[name])
    axis.set_xscale("log")
    axis.set_yscale("log")
    handles = [Line2D([], [], color=color[value], linewidth=3, label=label(value)) for value in values]
    first = axis.legend(handles=handles, fontsize=8, loc="best", ncols=1 if len(values) < 6 else 2)
    if len(style) > 1:
        axis.add_artist(first)
    ticks = FuncFormatter(decimal)
    axis.yaxis.set_major_formatter(ticks)
    # Minor ticks are named where the axis spans too little for two powers of ten.
    axis.yaxis.set_minor_formatter(FuncFormatter(lambda value, _: named_minor(value, *axis.get_ylim())))
    axis.tick_params(which="minor", labelsize=7)


def named_minor(value: float, low: float, high: float) -> str:
    """The name of a minor tick: all of them on a short axis, else 2 and 5 only."""
    lead = round(value / 10 ** np.floor(np.log10(value)))
    return decimal(value) if high / low < 5 or lead in (2, 5) else ""


def codes_legend(figure, names: list[str]) -> None:
    """The legend of the codes, below the panels."""
    style = styles(names)
    handles = [Line2D([], [], color="black", label=name, **style[name]) for name in style]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))


def threads(record: dict) -> str:
    return f"{record['threads']} thread" + ("s" if record["threads"] > 1 else "")


def caption(record: dict) -> str:
    at = record["machine"]
    return f"{record['title']}, {threads(record)}, {at.get('model', 'unknown machine')}, {record['date']}"


def draw_rates(record: dict, path: Path) -> bool:
    """Collisions per second against N for each φ, and against φ for each N."""
    table = summary(record)
    table = table[table.what == "grid"]
    if table.empty:
        return False
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.5, 4.4), layout="constrained", sharey=True)
    figure.suptitle(caption(record), fontsize=10)
    curves(left, table, "n", "phi", lambda phi: f"φ = {phi:g}", 1e6)
    curves(right, table, "phi", "n", lambda n: f"N = {n:,}", 1e6)
    left.set(xlabel="particles N", ylabel="collisions per second [10⁶/s]")
    right.set(xlabel="packing fraction φ")
    right.xaxis.set_major_formatter(FuncFormatter(decimal))
    names = list(dict.fromkeys(table.name))
    if len(names) > 1:
        codes_legend(figure, names)
    figure.savefig(path, dpi=150)
    plt.close(figure)
    return True


def draw_growth(record: dict, path: Path) -> bool:
    """Time per collision against N and against φ."""
    table = summary(record)
    panels = [("growth in n", "n", "phi"), ("growth in phi", "phi", "n")]
    panels = [panel for panel in panels if (table.what == panel[0]).any()]
    if not panels:
        return False
    figure, axes = plt.subplots(
        1, len(panels), figsize=(4.75 * len(panels), 4), layout="constrained", squeeze=False, sharey=True
    )
    figure.suptitle(caption(record), fontsize=10)
    for axis, (what, x, by) in zip(axes[0], panels):
        label = (lambda phi: f"φ = {phi:g}") if by == "phi" else (lambda n: f"N = {n:,}")
        part = table[table.what == what]
        curves(axis, part, x, by, label, 1e9, inverse=True)
        axis.set(xlabel="particles N" if x == "n" else "packing fraction φ")
        if x == "phi":
            axis.xaxis.set_major_formatter(FuncFormatter(decimal))
    axes[0, 0].set_ylabel("time per collision [ns]")
    names = list(dict.fromkeys(table[table.what != "grid"].name))
    if len(names) > 1:
        codes_legend(figure, names)
    figure.savefig(path, dpi=150)
    plt.close(figure)
    return True


# The command


def numbers(kind):
    """Parses a comma list of positive numbers; whole ones also as 1e6."""

    def parse(text: str) -> list:
        try:
            values = [float(word) for word in text.replace("_", "").split(",")]
        except ValueError as error:
            raise argparse.ArgumentTypeError(f"{text!r}: must be numbers, separated by commas") from error
        if not all(value > 0 and kind(value) == value for value in values):
            raise argparse.ArgumentTypeError(f"{text!r}: must be positive{' and whole' if kind is int else ''}")
        return [kind(value) for value in values]

    return parse


def named_command(text: str) -> tuple[str, str]:
    name, equals, command = text.partition("=")
    if not (name.strip() and equals and command.strip()) or name.strip() == OURS:
        raise argparse.ArgumentTypeError(f"{text!r}: must be NAME=COMMAND, the name not {OURS!r}")
    try:
        command.format(n=1, phi=1, collisions=1, melt=1, threads=1)
    except (IndexError, KeyError, ValueError) as error:
        message = f"{text!r}: only {{n}}, {{phi}}, {{collisions}}, {{melt}} and {{threads}} are known in a command"
        raise argparse.ArgumentTypeError(message) from error
    return name.strip(), command.strip()


def arguments(words: list[str] | None = None) -> argparse.Namespace:
    summary_line, _, more = (__doc__ or "").partition("\n")
    parser = argparse.ArgumentParser(
        description=summary_line, epilog=more, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--haff", type=Path, default=ROOT / "target/release/haff", help="the command to measure")
    parser.add_argument("--scene", default="fluid", help="a scene of `haff bench --list` [fluid]")
    parser.add_argument("--n", type=numbers(int), default=GRID_N, help="numbers of particles [4000,32000,500000]")
    parser.add_argument("--phi", type=numbers(float), default=GRID_PHI, help="packing fractions [0.01,…,0.49]")
    parser.add_argument("--threads", type=int, default=1, help="threads of haff [1]")
    parser.add_argument("--collisions", type=int, help="collisions to time [as `haff bench`]")
    parser.add_argument("--melt", type=float, help="collisions per particle before the clock starts [as `haff bench`]")
    parser.add_argument("--repeats", type=int, default=3, help="measurements of each cell [3]")
    parser.add_argument("--options", default="", help="more options of `haff bench`, in one word")
    parser.add_argument("--peers", type=Path, metavar="CSV", help="figures of other codes")
    parser.add_argument(
        "--peer", type=named_command, action="append", default=[], metavar="NAME=COMMAND", help="another code"
    )
    parser.add_argument("--growth", action="store_true", help="measure growth with N and φ instead of the grid")
    parser.add_argument("--growth-n", type=numbers(int), default=GROWTH_N, help="numbers of particles of the growth")
    parser.add_argument("--growth-phi", type=numbers(float), default=GROWTH_PHI, help="packing fractions of the growth")
    parser.add_argument("--title", help="title of the record")
    parser.add_argument("--name", help="name of the files [throughput or growth; _SCENE but for the fluid]")
    parser.add_argument("-o", "--output", type=Path, help="folder [benches/record]")
    parser.add_argument("--replot", type=Path, metavar="JSON", help="draw and tabulate a record again, measure nothing")
    options = parser.parse_args(words)
    if options.repeats < 1 or options.threads < 1:
        parser.error("--repeats and --threads must be at least 1")
    return options


def default_name(options: argparse.Namespace) -> str:
    """Name of the files of a record."""
    return ("growth" if options.growth else "throughput") + ("" if options.scene == "fluid" else f"_{options.scene}")


def growth_cells(options: argparse.Namespace) -> list[tuple[str, list[tuple[int, float]]]]:
    """The cells of the two growth series."""
    along_n = [(n, phi) for phi in GROWTH_N_PHI for n in options.growth_n]
    along_phi = [(GROWTH_PHI_N, phi) for phi in options.growth_phi]
    return [("growth in n", along_n), ("growth in phi", along_phi)]


def record_of(options: argparse.Namespace) -> dict:
    """Measures the cells given by the options."""
    peers = [] if options.peers is None else read_peers(options.peers).to_dict("records")
    series = growth_cells(options) if options.growth else [("grid", [(n, f) for n in options.n for f in options.phi])]
    cells = []
    for what, part in series:
        cells += measure(options, part, options.repeats, what)
    return {
        "title": options.title or f"haff bench, scene {options.scene}" + (", growth" if options.growth else ""),
        "date": datetime.date.today().isoformat(),
        "revision": revision(),
        "compiler": compiler(),
        "machine": machine(),
        "command": shlex.join(["benches/record.py", *command_words(sys.argv[1:])]),
        "scene": options.scene,
        "threads": options.threads,
        "cells": cells,
        "peers": peers,
    }


def command_words(words: list[str]) -> list[str]:
    """The words of this command without paths of this machine: programs and files by their names."""
    kept = []
    words = [part for word in words for part in (word.split("=", 1) if word.startswith("--") else [word])]
    pairs = iter(words)
    for word in pairs:
        if word in ("--haff", "-o", "--output"):
            next(pairs, None)
        elif word == "--peers":
            kept += [word, Path(next(pairs, "")).name]
        elif word == "--peer":
            name, command = named_command(next(pairs, ""))
            # Not quoted again: its placeholders stay readable.
            kept += [word, f"{name}={' '.join(map(by_name, command.split()))}"]
        else:
            kept.append(word)
    return kept


def main() -> None:
    options = arguments()
    if options.replot:
        record = json.loads(options.replot.read_text())
        folder, name = options.output or options.replot.parent, options.name or options.replot.stem
        if options.peers is not None:
            record["peers"] = read_peers(options.peers).to_dict("records")
    else:
        record = record_of(options)
        folder = options.output or ROOT / "benches/record"
        name = options.name or default_name(options)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.json").write_text(json.dumps(record, indent=1, ensure_ascii=False) + "\n")
    page = markdown(record)
    into_page(folder / f"{name}.md", record["title"], {name: page})
    with plt.rc_context(STYLE):
        for draw in (draw_rates, draw_growth):
            draw(record, folder / f"{name}.png")
    print(page)
    print(f"wrote {folder / name}.json, .md and .png", file=sys.stderr)


if __name__ == "__main__":
    main()
