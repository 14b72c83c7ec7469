#!/usr/bin/env python3
"""Counts the instructions that features cost: those a scene does not use, and those it uses.

    cargo build --release
    benches/features.py                       # everything, into benches/record/features.md; about an hour
    benches/features.py --part prices         # one of: absent, prices, run
    benches/features.py --part absent --only tc walls

absent  The engine of the plain scene (elastic spheres of one size, periodic, nothing recorded) as it is, and once more
        from copies of the sources from which one feature is left out (benches/without.toml), and all of them. What is
        left must not run a different trajectory, and at most 1 % fewer instructions: what a scene does not use must
        cost nothing.
prices  The plain scene, and the same with one feature in use, by `haff run`.
run     `haff run` and `haff bench` of one scene: instructions, and wall times in turn.

Of features.md, each part replaces what stands between its lines `<!-- begin PART -->` and `<!-- end PART -->`.

Counts are those of valgrind's callgrind. Every run is made in two lengths, and the difference is divided by that of the
collisions, so that packing, melting and the end of a run drop out. Needs valgrind, and matplotlib for record.py.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

from record import ROOT, compiler, into_page, machine, revision

WITHOUT = ROOT / "benches" / "without.toml"
# One packing fraction for windows, and one for lists.
PHI = [0.1, 0.49]
DISKS_PHI = {0.1: 0.1, 0.49: 0.72}
# N of the engine alone is an edge cubed; that of scenes fills an fcc lattice.
EDGE = 16
PARTICLES = 4_000
# Collisions of the melting, and of what is counted by default.
MELT, COUNTED = 20_000, 100_000
# Collisions of a run whose wall time is taken.
WALL_COLLISIONS = 2_000_000
PARTS = ["absent", "prices", "run"]


def call(command: list[str], **options: object) -> str:
    """Standard output of a command that must not fail."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
    if done.returncode != 0:
        why = done.stderr.strip()[-2000:]
        raise SystemExit(f"{' '.join(command)}\nfailed with exit status {done.returncode}:\n{why}")
    return done.stdout


def count(command: list[str], folder: Path) -> tuple[list[int], str]:
    """Instructions of every thread, the first of which is the main one, and standard output."""
    for old in folder.glob("count*"):
        old.unlink()
    valgrind = ["valgrind", "--tool=callgrind", "--separate-threads=yes", f"--callgrind-out-file={folder}/count"]
    text = call([*valgrind, *command], env={**os.environ, "RAYON_NUM_THREADS": "1"})
    threads = []
    for file in sorted(folder.glob("count-*")):
        total = re.findall(r"^(?:totals|summary): (\d+)", file.read_text(), re.MULTILINE)
        threads.append(int(total[-1]))
    return threads, text


# Features compiled in and not used


def source_copy(folder: Path) -> Path:
    """A copy of what cargo needs, to leave features out of."""
    copy = folder / "source"
    copy.mkdir()
    for name in ["Cargo.toml", "Cargo.lock", "rustfmt.toml"]:
        shutil.copy(ROOT / name, copy)
    shutil.copytree(ROOT / "crates", copy / "crates")
    # The manifest names the benches.
    (copy / "benches").mkdir()
    for bench in (ROOT / "benches").glob("*.rs"):
        shutil.copy(bench, copy / "benches")
    return copy


def features() -> dict[str, list[dict[str, str]]]:
    """The features that can be left out, all of them first, each with what is replaced in which file."""
    known = tomllib.loads(WITHOUT.read_text())
    return {"all of these": [edit for edits in known.values() for edit in edits]} | known


def leave_out(copy: Path, edits: list[dict[str, str]]) -> None:
    """Makes the edits of some features in a copy of the sources; one that several of them make is made once."""
    for name, old, new in dict.fromkeys((edit["file"], edit["old"], edit["new"]) for edit in edits):
        file = copy / name
        text = file.read_text()
        if text.count(old) != 1:
            raise SystemExit(f"{WITHOUT}: {name} does not have this once:\n{old}")
        file.write_text(text.replace(old, new))


def engine(copy: Path, name: str, edits: list[dict[str, str]], folder: Path) -> Path:
    """The engine's example `throughput`, built with these edits."""
    kept = {edit["file"]: (copy / edit["file"]).read_text() for edit in edits}
    leave_out(copy, edits)
    # A target folder per run: cargo would not notice that another run has left out other features of the same sources.
    target = folder / "target"
    build = ["cargo", "build", "--release", "--quiet", "-p", "haff-engine", "--example", "throughput"]
    call([*build, "--target-dir", str(target)], cwd=copy)
    built = folder / name
    shutil.copy(target / "release" / "examples" / "throughput", built)
    for file, text in kept.items():
        (copy / file).write_text(text)
    return built


def absent(only: list[str], counted: int, folder: Path) -> list[str]:
    """Table of the plain scene with and without the features that it does not use."""
    copy = source_copy(folder)
    chosen = {name: edits for name, edits in features().items() if not only or name in only}
    found: dict[str, list[float]] = {}
    hashes: dict[str, list[str]] = {}
    for name, edits in ({"nothing": []} | chosen).items():
        built = engine(copy, name.replace(" ", "_"), edits, folder)
        found[name], hashes[name] = [], []
        for phi in PHI:
            totals = []
            for collisions in [0, counted]:
                # Collisions a particle that are not counted, before those that are.
                words = [str(EDGE), str(phi), str(1 + collisions), "auto", "spheres", str(MELT // EDGE**3)]
                threads, text = count([str(built), *words], folder)
                totals.append(sum(threads))
            found[name].append((totals[1] - totals[0]) / counted)
            hashes[name].append(text.split()[-1])
        show = "  ".join(f"{value:8.1f}" for value in found[name])
        print(f"without {name:12} {show}", file=sys.stderr, flush=True)
        if hashes[name] != hashes["nothing"]:
            raise SystemExit(f"without {name} the trajectory is another one: {hashes[name]}, not {hashes['nothing']}")
    lines = ["| left out |" + "".join(f" φ = {phi} | saved |" for phi in PHI), "|---|" + "---|---|" * len(PHI)]
    for name, values in found.items():
        cells = "".join(
            f" {value:.1f} | {'' if name == 'nothing' else f'{100 * (1 - value / plain):.2f} %'} |"
            for value, plain in zip(values, found["nothing"], strict=True)
        )
        lines.append(f"| {name} |{cells}")
    return lines


# Features in use


@dataclass
class Feature:
    """The plain scene with something changed: keys of sections, species, and what is recorded."""

    name: str
    domain: dict[str, object] = field(default_factory=dict)
    contact: dict[str, object] = field(default_factory=dict)
    pairs: list[tuple[str, str, float]] = field(default_factory=list)
    species: list[dict[str, object]] | None = None
    positions: str = "lattice"
    # Keys of [output]; times in mean free times of the plain scene.
    output: dict[str, object] | None = None
    top: dict[str, object] = field(default_factory=dict)
    # A rate of shear is in mean free times of the plain scene.
    # Entries of [[wall]] and [[drive]]; a rate and a time are in units of the mean free time of the plain scene.
    walls: list[dict[str, object]] = field(default_factory=list)
    drive: dict[str, float | str] | None = None
    # Keys of [measure]; intervals in mean free times of the plain scene.
    measure: dict[str, object] = field(default_factory=dict)


def sphere(name: str, count: int, radius: object = 0.5, density: float = 6 / np.pi) -> dict[str, object]:
    return {"name": name, "count": count, "radius": radius, "density": density}


HALF = PARTICLES // 2
ALIKE = [sphere("a", HALF), sphere("b", HALF)]
ROUGH = {"restitution": 0.9, "tangential_restitution": 0.5, "friction": 0.3}
VISCOELASTIC = {"model": "viscoelastic", "coefficient": 0.1}
CUTOFF = {"model": "cutoff", "restitution": 0.9, "speed": 1.0}
FEATURES = [
    Feature("plain"),
    Feature("restitution 0.9", contact={"restitution": 0.9}),
    Feature("restitution by pair", species=ALIKE, pairs=[("a", "b", 0.9)]),
    Feature("rough: restitution 0.9, β = 0.5, μ = 0.3", contact=ROUGH),
    # The rate at which the work of the shear balances the losses.
    Feature("shear: restitution 0.9", domain={"shear": 0.3}, contact={"restitution": 0.9}),
    Feature("viscoelastic", contact={"restitution": VISCOELASTIC}),
    Feature("cut-off", contact={"restitution": CUTOFF}),
    Feature("restitution 0.9 and TC", contact={"restitution": 0.9, "tc": 1e-3}),
    Feature("two sizes, 1 : 2", species=[sphere("a", HALF, 0.25), sphere("b", HALF)], positions="random"),
    Feature(
        "sizes from 0.6 to 1",
        species=[sphere("a", PARTICLES, {"uniform": [0.3, 0.5]})],
        positions="random",
    ),
    Feature("walls all around", domain={"boundary": ["wall", "wall", "wall"]}),
    Feature("gravity over a floor", domain={"boundary": ["periodic", "periodic", "wall"], "gravity": "scale"}),
    Feature(
        "gravity over a vibrating floor",
        domain={"boundary": ["periodic", "periodic", "wall"], "gravity": "scale"},
        walls=[{"name": "z-", "restitution": 0.9, "motion": {"kind": "sine", "amplitude": 0.01, "frequency": 1.0}}],
    ),
    Feature(
        "thermal walls all around",
        domain={"boundary": ["wall", "wall", "wall"]},
        walls=[{"name": name, "temperature": 1.0} for name in ("x-", "x+", "y-", "y+", "z-", "z+")],
    ),
    Feature("white noise, a kick in a mean free time", drive={"kind": "white_noise", "strength": 1e-9, "rate": 1.0}),
    Feature("drag, time constant of 100 mean free times", drive={"kind": "drag", "time": 100.0}),
    Feature("disks", top={"dimension": 2}),
    Feature("measuring: pressure tensor", measure={"stress": True}),
    Feature(
        "measuring: profile of 50 cells, a state every mean free time",
        measure={"profiles": [{"axis": "z", "bins": 50, "interval": 10.0}]},
    ),
    Feature(
        "measuring: displacements and velocities of all every mean free time",
        measure={"msd": True, "vacf": True, "interval": 1.0},
    ),
    Feature(
        "measuring: autocorrelation of the tensor every tenth of a mean free time",
        measure={"stress_correlation": True, "interval": 0.1},
    ),
    Feature("recording: nothing due", output={}),
    Feature("recording: all events", output={"events": True}),
    Feature("recording: all events, stored as they are", output={"events": True, "compression": "none"}),
    Feature("recording: events, i and j alone", output={"events": {"columns": ["i", "j"]}}),
    Feature("recording: observables every mean free time", output={"observables": 1.0}),
    Feature("recording: frames every 10 mean free times", output={"frames": 10.0}),
    Feature("recording: checkpoints every 10 mean free times", output={"checkpoint": 10.0}),
]


def toml(value: object) -> str:
    """A value in TOML."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(toml(item) for item in value) + "]"
    return json.dumps(value)


def scene(feature: Feature, phi: float, mean_free_time: float) -> str:
    """The scene file of a feature."""
    flat = feature.top.get("dimension") == 2
    phi = DISKS_PHI[phi] if flat else phi
    domain = {"packing_fraction": phi, **feature.domain}
    if domain.get("gravity") == "scale":
        # The box is five scale heights kT/mg tall at φ = 0.1, and as much gravity at any density.
        domain["gravity"] = [0.0, 0.0, -5.0 / float(np.cbrt(PARTICLES * np.pi / 6 / 0.1))]
    if "shear" in domain:
        domain["shear"] = {"flow": "x", "gradient": "y", "rate": domain["shear"] / mean_free_time}
    species = feature.species or [sphere("a", PARTICLES, density=4 / np.pi if flat else 6 / np.pi)]
    never = 1e9
    output = {"frames": never, "observables": never, "checkpoint": never}
    for key, value in (feature.output or {}).items():
        output[key] = value * mean_free_time if key in output else value
    lines = ["schema = 1", "seed = 1", *[f"{key} = {toml(value)}" for key, value in feature.top.items()]]
    sections = {"domain": domain, "contact": feature.contact, "output": output}
    sections["initial"] = {"positions": feature.positions, "temperature": 1.0}
    for name, keys in sections.items():
        lines += [f"[{name}]", *[f"{key} = {toml(value)}" for key, value in keys.items()]]
    for a, b, restitution in feature.pairs:
        lines += ["[[contact.pair]]", f'between = ["{a}", "{b}"]', f"restitution = {restitution}"]
    for keys in feature.walls:
        lines += ["[[wall]]", *[f"{key} = {toml(value)}" for key, value in keys.items()]]
    if feature.drive:
        scale = {"rate": 1 / mean_free_time, "time": mean_free_time}
        drive = {key: float(value) * scale[key] if key in scale else value for key, value in feature.drive.items()}
        lines += ["[[drive]]", *[f"{key} = {toml(value)}" for key, value in drive.items()]]
    if feature.measure:
        measure = dict(feature.measure)
        if "interval" in measure:
            measure["interval"] = float(measure["interval"]) * mean_free_time
        for profile in measure.get("profiles", []):
            measure["profiles"] = [profile | {"interval": profile["interval"] * mean_free_time}]
        lines += ["[measure]", *[f"{key} = {toml(value)}" for key, value in measure.items()]]
    for keys in species:
        lines += ["[[species]]", *[f"{key} = {toml(value)}" for key, value in keys.items()]]
    return "\n".join(lines) + "\n"


def run_command(haff: Path, file: Path, collisions: int) -> list[str]:
    """`haff run` of a scene up to so many collisions, on one thread."""
    length = ["--set", f"run.collisions={collisions}"]
    return [str(haff), "run", str(file), "--json", "--quiet", "--threads", "1", *length]


def bench_command(haff: Path, file: Path, collisions: int) -> list[str]:
    """`haff bench` of the same."""
    length = ["--melt", "0", "--collisions", str(collisions), "--repeats", "1"]
    return [str(haff), "bench", "--scene", str(file), "--json", "--quiet", "--threads", "1", *length]


def price(
    haff: Path, feature: Feature, phi: float, mean_free_time: float, counted: int, folder: Path
) -> dict[str, object]:
    """Instructions a collision of `haff run` with a feature: of the thread of events, and of the others."""
    file = folder / "scene.toml"
    file.write_text(scene(feature, phi, mean_free_time))
    counts, reports = [], []
    for collisions in [MELT, MELT + counted]:
        command = run_command(haff, file, collisions)
        if feature.output is not None:
            command += ["-o", str(folder / "out.h5"), "--overwrite"]
        threads, text = count(command, folder)
        counts.append((threads[0], sum(threads[1:])))
        reports.append(json.loads(text.strip().splitlines()[-1]))
    main, others = ((counts[1][k] - counts[0][k]) / counted for k in range(2))
    span = reports[1]["simulated_time"] - reports[0]["simulated_time"]
    mean_free_time = span * PARTICLES / (2 * counted)
    return {"main": main, "others": others, "neighbors": reports[1]["neighbors"], "mean_free_time": mean_free_time}


def prices(haff: Path, only: list[str], counted: int, folder: Path) -> list[str]:
    """Table of what features in use cost."""
    lines = ["| scene |" + "".join(f" φ = {phi}: search | instructions | of other threads | factor |" for phi in PHI)]
    lines.append("|---|" + "---|---|---|---|" * len(PHI))
    plain: dict[float, dict[str, object]] = {}
    for feature in FEATURES:
        if feature.name != "plain" and only and not any(word in feature.name for word in only):
            continue
        cells = []
        for phi in PHI:
            mean_free_time = plain[phi]["mean_free_time"] if plain.get(phi) else 1.0
            found = price(haff, feature, phi, mean_free_time, counted, folder)
            plain.setdefault(phi, found)
            total = found["main"] + found["others"]
            factor = total / (plain[phi]["main"] + plain[phi]["others"])
            cells.append(f" {found['neighbors']} | {total:.0f} | {found['others']:.0f} | {factor:.2f} |")
        lines.append(f"| {feature.name} |{''.join(cells)}")
        print(lines[-1], file=sys.stderr, flush=True)
    return lines


# `haff run` and `haff bench`


def run_and_bench(haff: Path, repeats: int, counted: int, folder: Path) -> list[str]:
    """Table of one scene through both commands."""
    head = ["N", "φ", "run, instructions", "bench", "ratio", "run, wall s", "bench", "ratio"]
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for n in [4_000, 32_000]:
        for phi in PHI:
            melt = 2 * n
            file = folder / "scene.toml"
            printed = call([str(haff), "bench", "--scene", "fluid", "--n", str(n), "--phi", str(phi), "--print-scene"])
            file.write_text(printed)
            instructions = []
            hashes = set()
            for command in [run_command, bench_command]:
                totals = []
                for total in [melt, melt + counted]:
                    threads, text = count(command(haff, file, total), folder)
                    totals.append(sum(threads))
                instructions.append((totals[1] - totals[0]) / counted)
                hashes.add(json.loads(text.strip().splitlines()[-1])["state_hash"])
            if len(hashes) != 1:
                raise SystemExit(f"N = {n}, φ = {phi}: run and bench end in different states")
            seconds: list[list[float]] = [[], []]
            for _ in range(repeats):
                for k, command in enumerate([run_command, bench_command]):
                    report = json.loads(call(command(haff, file, WALL_COLLISIONS)).strip().splitlines()[-1])
                    seconds[k].append(report["wall_seconds"])
            wall = [float(np.median(times)) for times in seconds]
            run, bench = instructions
            lines.append(
                f"| {n:,} | {phi} | {run:.1f} | {bench:.1f} | {run / bench:.4f} "
                f"| {wall[0]:.3f} | {wall[1]:.3f} | {wall[0] / wall[1]:.3f} |"
            )
            print(lines[-1], file=sys.stderr, flush=True)
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", choices=PARTS, action="append", help="only this part; may be repeated")
    parser.add_argument("--only", nargs="+", default=[], help="only these features (beside the plain scene)")
    built = ROOT / "target" / "release" / "haff"
    parser.add_argument("--haff", type=Path, default=built, help="the command to measure")
    parser.add_argument("--repeats", type=int, default=7, help="wall times of run and bench (default 7)")
    parser.add_argument("--collisions", type=int, default=COUNTED, help=f"what is counted (default {COUNTED:,})")
    parser.add_argument("--output", type=Path, help="page for the tables; default benches/record/features.md")
    options = parser.parse_args()
    if not shutil.which("valgrind"):
        raise SystemExit("valgrind is not installed: it counts the instructions")
    parts = options.part or PARTS
    if {"prices", "run"} & set(parts) and not options.haff.exists():
        raise SystemExit(f"{options.haff} does not exist: cargo build --release")
    today = datetime.date.today().isoformat()
    output = options.output or ROOT / "benches" / "record" / "features.md"
    made: dict[str, list[str]] = {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder)
        if "absent" in parts:
            made["absent"] = absent(options.only, options.collisions, path)
        if "prices" in parts:
            made["prices"] = prices(options.haff, options.only, options.collisions, path)
        if "run" in parts:
            made["run"] = run_and_bench(options.haff, options.repeats, options.collisions, path)
    found = machine()
    head = f"{found.get('model', '?')}, {found['processors']} processors; {compiler()}; revision {revision()}; {today}"
    output.parent.mkdir(parents=True, exist_ok=True)
    into_page(output, "Features", {part: page_part(part, options.collisions, head, made[part]) for part in made})
    print(output)


def page_part(part: str, counted: int, head: str, lines: list[str]) -> str:
    """A part of the page: how it was made, and its table."""
    return f"`benches/features.py --part {part} --collisions {counted}`; {head}.\n\n" + "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
