#!/usr/bin/env python3
"""Records run time against error: runs `haff bench --accuracy`, and draws and tabulates the results.

    cargo build --release
    benches/accuracy.py                                                   # haff and the methods built in
    benches/accuracy.py --peer "LAMMPS=benches/peers/lammps_granular.py"  # another program too; may be given again
    benches/accuracy.py --replot benches/record/accuracy.json

The record goes to benches/record/ as accuracy.json (everything that was measured), accuracy.png and accuracy.md, where
only the part between the lines `<!-- begin accuracy -->` and `<!-- end accuracy -->` is replaced.

Needs matplotlib and numpy.
"""

from __future__ import annotations

import argparse
import datetime
import json
import shlex
import subprocess
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.lines import Line2D
from record import ROOT, STYLE, by_name, compiler, into_page, machine, revision

OURS = "haff"
MARKERS = {OURS: "o", "fixed step": "s", "soft spheres": "^"}
COLORS = {OURS: "C3", "fixed step": "C0", "soft spheres": "C2"}
SPARE = [("D", "C4"), ("v", "C1"), ("P", "C5")]
KINDS = {
    "haff": "haff",
    "flight_rounded": "exact, flights rounded to double",
    "rounded_state": "exact, states rounded to double",
    "start_nudged": "exact, start moved by an ulp",
}


def style(name: str, peers: list[str]) -> tuple[str, str]:
    """Marker and color of a method."""
    if name in MARKERS:
        return MARKERS[name], COLORS[name]
    return SPARE[peers.index(name) % len(SPARE)]


def number(value: float | None, digits: int = 2) -> str:
    return "–" if value is None or not np.isfinite(value) else f"{value:.{digits}f}"


def power(value: float | None) -> str:
    return "–" if value is None or not np.isfinite(value) else f"{value:.1e}"


def plus_minus(value: dict, digits: int = 2) -> str:
    if value["mean"] is None:
        return "–"
    return f"{number(value['mean'], digits)} ± {number(value['standard_error'], digits)}"


def lost(trial: dict) -> str:
    """Collisions per particle until a trajectory is lost, or a bound, for trials that tell it."""
    if "followed" not in trial:
        return ""
    if trial["lost_after"] is not None:
        return f", lost after {number(trial['lost_after'], 1)}"
    return f", followed for {trial['followed']['collisions_per_particle'][-1]:.1f}"


# Table


def trials(scene: dict) -> list[str]:
    """A row for each method: the error and the time of every parameter that was tried."""
    rows = []
    for method in dict.fromkeys(trial["method"] for trial in scene["trials"]):
        part = [trial for trial in scene["trials"] if trial["method"] == method]
        cells = []
        for trial in part:
            at = f"{trial['parameter']}: " if trial["parameter"] else ""
            cells.append(f"{at}{power(trial['error'])} in {power(trial['wall_seconds'])} s{lost(trial)}")
        rows.append(f"| {scene['name']} | {method} | {'; '.join(cells)} |")
    return rows


def markdown(record: dict) -> str:
    """The record as a part of a page."""
    report, at = record["report"], record["machine"]
    lines = [
        f"{record['date']}, revision `{record['revision']}`, {record['compiler']}, one thread.",
        f"Machine: {at.get('model', 'unknown')} (family {at.get('family', '?')}, model {at.get('number', '?')}),"
        f" {at['processors']} processors; {at['system']}.",
        "",
        "```sh",
        record["command"],
        "```",
        "",
        "![Run time against error](accuracy.png)",
        "",
        "Methods: haff; hard spheres at fixed time steps dt; soft spheres (spring and dashpot, velocity Verlet, 50"
        " steps in a contact of duration t_c)" + "".join(f"; {name}" for name in report["peers"]) + ".",
        "",
        "Scenes with known answers. Error: distance from the exact position, root mean square over the particles, in"
        " diameters, and the run time. A gas is lost when it is a tenth of a diameter off; the number is in collisions"
        " per particle.",
        "",
        "| scene | method | parameter: error and run time |",
        "|---|---|---|",
    ]
    for scene in report["scenes"]:
        lines += trials(scene)
    lines += ["", *(f"- {scene['name']}: {scene['description']}" for scene in report["scenes"])]
    lines += [
        "",
        "Pressure and cooling rate from a fixed run time. Every method starts from the same states. ± is the standard"
        " error of the mean over its runs, relative to the value; theory is exact to 1e-4 of the pressure and 5e-4 of"
        " the rate.",
        "",
        "| quantity | method | parameter | runs | seconds | mean | off by | ± |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for quantity in report["statistics"]:
        for estimate in quantity["estimates"]:
            lines.append(
                f"| {quantity['name']} | {estimate['method']} | {estimate['parameter']} | {estimate['runs']}"
                f" | {number(estimate['wall_seconds'])} | {estimate['mean']:.6f}"
                f" | {100 * estimate['relative_error']:+.3f} % | {100 * estimate['relative_standard_error']:.3f} % |"
            )
    lines += ["", *(f"- {q['name']}: {q['description']}; theory {q['expected']:.6f}" for q in report["statistics"])]
    lines += [
        "",
        "Growth of errors: collisions per particle until the deviation from arithmetic of"
        f" {report['growth'][0]['reference_bits']} bits is a tenth of a diameter, mean ± standard error over"
        " starts: of haff, and of exact arithmetic whose states, or flights and states, are rounded to double at each"
        " collision, or that starts an ulp off. *Earlier by*: how much earlier haff is lost than exact arithmetic on"
        " rounded flights, start by start.",
        "",
        "| gas | bits a collision | haff | states rounded | flights rounded | start moved | earlier by"
        " | engine variants compared | clock epochs |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for gas in report["growth"]:
        kinds, count = gas["kinds"], len(gas["machineries"])
        same = f"{count}, all the same bits" if gas["identical"] else f"{count}, NOT the same bits"
        cells = [plus_minus(kinds[kind]["lost_after"]) for kind in ("rounded_state", "flight_rounded", "start_nudged")]
        lines.append(
            f"| {gas['name']} | {plus_minus(kinds['haff']['bits_per_collision'])}"
            f" | {plus_minus(kinds['haff']['lost_after'])} | {' | '.join(cells)}"
            f" | {plus_minus(kinds['flight_rounded']['haff_is_lost_earlier_by'])} | {same} | ≥ {gas['epochs']} |"
        )
    lines += ["", *(f"- {gas['name']}: {gas['description']}, {gas['starts']} starts" for gas in report["growth"])]
    return "\n".join(lines) + "\n"


# Figure


def draw_trials(axes, report: dict) -> None:
    for axis, scene in zip(axes, report["scenes"]):
        for name in dict.fromkeys(trial["method"] for trial in scene["trials"]):
            part = [trial for trial in scene["trials"] if trial["method"] == name]
            marker, color = style(name, report["peers"])
            seconds, error = (np.array([trial[key] for trial in part], float) for key in ("wall_seconds", "error"))
            axis.plot(seconds, error, marker=marker, color=color, linewidth=0.8, markersize=5)
        axis.set(xscale="log", yscale="log", title=scene["name"], ylim=(1e-16, 30))
        axis.set_xlabel("run time [s]")


def draw_statistics(axes, report: dict) -> None:
    """Bias with its standard error against the time of one run: more runs reduce the error, not the bias."""
    for axis, quantity in zip(axes, report["statistics"]):
        for name in dict.fromkeys(estimate["method"] for estimate in quantity["estimates"]):
            part = [estimate for estimate in quantity["estimates"] if estimate["method"] == name]
            marker, color = style(name, report["peers"])
            seconds = [estimate["wall_seconds"] / estimate["runs"] for estimate in part]
            off = [abs(estimate["relative_error"]) for estimate in part]
            error = [estimate["relative_standard_error"] for estimate in part]
            axis.errorbar(seconds, off, error, marker=marker, color=color, linewidth=0.8, markersize=5, capsize=2)
        axis.set(xscale="log", yscale="log", title=f"{quantity['name']}, {quantity['budget_seconds']:g} s each")
        axis.set_xlabel("time of one run [s]")
        axis.set_ylim(bottom=1e-4, top=1)


def draw_growth(axis, report: dict) -> None:
    """Deviation of the first start of each gas, with the lines of the mean slopes' fits left to the table."""
    styles = dict(zip(KINDS, ["-", "--", ":", "-."]))
    for k, gas in enumerate(report["growth"]):
        for kind, line in styles.items():
            run = gas["kinds"][kind]["runs"][0]
            c = np.array(run["collisions_per_particle"][: len(run["deviation"])])
            d = np.array(run["deviation"], float)
            shown = d > 0
            axis.plot(c[shown], d[shown], line, color=f"C{k}", linewidth=1.4 if kind == "haff" else 0.9)
        bits = gas["kinds"]["haff"]["bits_per_collision"]["mean"]
        axis.plot([], [], color=f"C{k}", label=f"{gas['name']}: {bits:.1f} bits a collision")
    for kind, line in styles.items():
        axis.plot([], [], line, color="black", linewidth=1.0, label=KINDS[kind])
    axis.axhline(report["growth"][0]["lost_at"], color="gray", linewidth=0.8)
    axis.set(yscale="log", title="growth of errors", xlabel="collisions per particle")
    axis.legend(fontsize=6.5, loc="lower right")


def draw(record: dict, path: Path) -> None:
    report = record["report"]
    figure, axes = plt.subplots(2, 4, figsize=(13, 6.6), layout="constrained")
    at = record["machine"]
    figure.suptitle(f"Run time against error, one thread, {at.get('model', '')}, {record['date']}", fontsize=10)
    flat = list(axes.flat)
    draw_trials(flat[:5], report)
    draw_growth(flat[5], report)
    draw_statistics(flat[6:], report)
    for axis in (flat[0], flat[4]):
        axis.set_ylabel("error [diameters]")
    flat[6].set_ylabel("relative error")
    names = [*MARKERS, *report["peers"]]
    looks = [style(name, report["peers"]) for name in names]
    handles = [
        Line2D([], [], marker=marker, color=color, linewidth=0.8, label=name)
        for name, (marker, color) in zip(names, looks)
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    figure.savefig(path, dpi=130)
    plt.close(figure)


# The command


def measured(options: argparse.Namespace) -> dict:
    words = [str(options.haff), "bench", "--accuracy", "--json"]
    shown = ["haff", *words[1:]]
    for peer in options.peer:
        name, _, command = peer.partition("=")
        words += ["--peer", peer]
        shown += ["--peer", f"{name}={' '.join(map(by_name, command.split()))}"]
    done = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{shlex.join(words)}\nfailed with exit status {done.returncode}")
    return {
        "date": datetime.date.today().isoformat(),
        "revision": revision(),
        "compiler": compiler(),
        "machine": machine(),
        "command": shlex.join(shown),
        "report": json.loads(done.stdout),
    }


def main() -> None:
    summary, _, more = (__doc__ or "").partition("\n")
    parser = argparse.ArgumentParser(
        description=summary, epilog=more, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--haff", type=Path, default=ROOT / "target/release/haff", help="the command to measure")
    parser.add_argument("--peer", action="append", default=[], metavar="NAME=COMMAND", help="another program")
    parser.add_argument("-o", "--output", type=Path, help="folder [benches/record]")
    parser.add_argument("--replot", type=Path, metavar="JSON", help="draw and tabulate a record again, measure nothing")
    options = parser.parse_args()
    if options.replot:
        record = json.loads(options.replot.read_text())
        folder = options.output or options.replot.parent
    else:
        record = measured(options)
        folder = options.output or ROOT / "benches/record"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "accuracy.json").write_text(json.dumps(record, indent=None, ensure_ascii=False) + "\n")
    page = markdown(record)
    into_page(folder / "accuracy.md", "Accuracy", {"accuracy": page})
    with plt.rc_context(STYLE):
        draw(record, folder / "accuracy.png")
    print(page)
    print(f"wrote {folder}/accuracy.json, .md and .png", file=sys.stderr)


if __name__ == "__main__":
    main()
