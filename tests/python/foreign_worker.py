"""Reads files in a separate process: ``foreign_worker.py FOLDER SOUND_FILES``, then one a line of standard input.

Each answer is a line of JSON: outcomes that are neither success nor a :class:`haff.HaffError`. Memory is limited to
1 GiB more than valid files need.
"""

from __future__ import annotations

import contextlib
import io
import json
import random
import resource
import sys
import time
import traceback
import warnings
from collections.abc import Callable
from functools import cached_property
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import numpy as np

import haff
from haff import analysis, scenes
from haff.command.main import _FORMATS, _KINDS, _TABLES, main
from haff.figures import movie, snapshot
from haff.figures.style import _RC

GIB = 1 << 30
# The smallest pictures: their size is not tested.
snapshot.draw.__kwdefaults__["pixels"] = movie.PIXELS = 60
_RC.update({"savefig.dpi": 30, "figure.dpi": 30})


def _density(frame: haff.Frame) -> object:
    return analysis.density_field(frame, 8)


def _heights(frame: haff.Frame) -> object:
    return analysis.height_profile([frame], 5)


def _distributions(frame: haff.Frame) -> object:
    return analysis.pair_distributions([frame], 1.0, 10, most_pairs=1e5)


def _structure(frame: haff.Frame) -> object:
    return analysis.static_structure([frame], 5.0, 10, most_waves=10)


class Reader:
    """Calls all functions of the package that read a file."""

    def __init__(self, path: Path, folder: Path, rng: random.Random, all_of_it: bool = False) -> None:
        self.path, self.folder, self.rng, self.all_of_it = path, folder, rng, all_of_it
        self.faults: list[str] = []
        self.errors: dict[str, str] = {}

    def fault(self, what: str) -> None:
        self.faults.append(what)

    def attempt(self, name: str, action: Callable[[], object]) -> object:
        """The result, or ``None`` after an error, which must be a HaffError on one printable line."""
        try:
            return action()
        except haff.HaffError as error:
            self.errors[name] = f"{type(error).__name__}: {error}"
            self.judge(name, error)
        except Exception as error:
            at = traceback.extract_tb(error.__traceback__)[-1]
            self.fault(f"{name}: {type(error).__name__}: {ascii(str(error))[:200]} at {at.filename}:{at.lineno}")
            self.fault("".join(traceback.format_exception(error))[-1500:])
        return None

    def judge(self, name: str, error: haff.HaffError) -> None:
        text = str(error)
        if not text or not text.isprintable() or len(text) > 2000:
            self.fault(f"{name}: message {ascii(text)[:200]}")
        if isinstance(error, haff.FileError) and str(self.path) not in text:
            self.fault(f"{name}: no file is named: {text}")
        cause: BaseException | None = error
        while cause is not None:
            if isinstance(cause, MemoryError) or "unable to allocate" in str(cause).lower():
                self.fault(f"{name}: more memory than allowed: {ascii(text)[:300]}")
                break
            cause = cause.__cause__ or cause.__context__

    def attributes(self, thing: object, name: str) -> None:
        """Every public property."""
        for key, value in vars(type(thing)).items():
            if not key.startswith("_") and isinstance(value, (property, cached_property)):
                self.attempt(f"{name}.{key}", lambda key=key: getattr(thing, key))

    def read(self) -> None:
        file = self.attempt("open", lambda: haff.open(self.path))
        if isinstance(file, haff.File):
            with file:
                self.file(file)
        self.commands()

    def file(self, file: haff.File) -> None:
        self.attributes(file, "file")
        for what in (
            len,
            repr,
            haff.File.to_xarray,
            analysis.cooling_law,
            lambda f: [p in f for p in ("frames", "events")],
        ):
            self.attempt(f"{what.__name__}(file)", lambda what=what: what(file))
        frames = self.attempt("frames", lambda: file.frames)
        if isinstance(frames, haff.Frames):
            self.attributes(frames, "frames")
            self.attempt("repr(frames)", lambda: repr(frames))
            for name in ("position", "velocity", "image", "unwrapped", "angular_velocity"):
                self.attempt(f"frames.array({name})", lambda name=name: frames[::-2].array(name))
            for k in (0, -1) if len(frames) else ():
                frame = frames[k]
                self.attributes(frame, f"frames[{k}]")
                self.attributes(haff.Box([1, 1, 1], ("open",) * 3, 3), "box")
                for what in (
                    *(analysis.max_overlap, analysis.kinetic_energy, analysis.temperature, analysis.sonine_a2),
                    *(analysis.rotational_energy, analysis.rotational_temperature),
                    *(haff.Frame.to_freud, haff.Frame.to_pandas, analysis.clusters),
                    *(_density, _heights, _distributions, _structure),
                ):
                    self.attempt(what.__name__, lambda what=what, frame=frame: what(frame))
        events = self.attempt("events", lambda: file.events)
        if isinstance(events, haff.Events):
            self.attributes(events, "events")
            self.attempt("repr(events)", lambda: repr(events))
            for name in events.columns:
                self.attempt(f"events[{name}]", lambda name=name: events[name])
            self.attempt("events[:5]", lambda: events[:5])
            self.attempt("events[::3]", lambda: events[::3])
            self.attempt("events.chunks", lambda: list(events.chunks(100)))
        several: list[tuple[str, Callable[[], object]]] = [
            ("to_mdanalysis", file.to_mdanalysis),
            ("to_mdanalysis(unwrapped)", lambda: list(file.to_mdanalysis(unwrapped=True).trajectory[:2])),
            ("restitution_from", lambda: haff.restitution_from(file)),
            ("restitution_from(times)", lambda: haff.restitution_from(file, "times")),
            ("recorded_state", lambda: scenes.recorded_state(self.path)),
            ("g(r)", lambda: analysis.radial_distribution(analysis.drawn_frames(file, 2), 1.0, 10)),
            ("view", lambda: haff.view(file, self.folder / "x.html", size=1.0, overwrite=True)),
        ]
        for name, action in several if self.all_of_it else [self.rng.choice(several)]:
            self.attempt(name, action)

    def commands(self) -> None:
        lines: list[list[str]] = [["view", "-o", "out.html"]]
        lines += [["plot", "-o", "figures", "--kind", kind] for kind in _KINDS]
        lines += [["plot", "--movie", "out.gif", "--frames", ":1", "--overwrite"]]
        lines += [["export", "--to", to, "-o", f"out.{to}"] for to in _FORMATS[:3]]
        lines += [["export", "--to", to, "-o", f"out.{to}", "--table", t] for to in _FORMATS[3:] for t in _TABLES]
        # Figures take longer than all other functions together.
        chosen = [self.rng.choice(lines)] if self.rng.random() < 0.4 else []
        for line in lines if self.all_of_it else chosen:
            words = [str(self.folder / w) if w.startswith(("out.", "figures")) else w for w in line]
            words += ["--overwrite"] if line[0] != "plot" else []
            self.attempt(" ".join(line), lambda words=words: self.command([words[0], str(self.path), *words[1:]]))

    def command(self, words: list[str]) -> None:
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            status = main(words)
        output = out.getvalue() + err.getvalue()
        sound = all(line.isprintable() for line in output.split("\n")) and "Traceback" not in output
        # An injected line would begin with "error:".
        starts = all(line.startswith(("haff: ", "skipped ")) for line in err.getvalue().splitlines())
        if status not in (0, 2, 4) or not sound or not starts or (status == 0) != bool(out.getvalue()):
            self.fault(f"{' '.join(words)}: exit {status}: {ascii(output)[:500]}")
        if any(name == "open" for name in self.errors) and status != 4:
            self.fault(f"{' '.join(words)}: exit {status} of a file that cannot be opened")


def answer(path: Path, folder: Path, seed: int, all_of_it: bool = False) -> dict:
    reader = Reader(path, folder, random.Random(seed), all_of_it)
    start = time.monotonic()
    reader.read()
    return {"faults": reader.faults, "errors": reader.errors, "seconds": time.monotonic() - start}


def loop(warm_up: list[Path], folder: Path) -> None:
    warnings.simplefilter("ignore")
    np.seterr(all="ignore")
    # Valid files first, without a limit: libraries that are imported lazily take memory, too.
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    resource.setrlimit(resource.RLIMIT_AS, (hard, hard))
    for path in warm_up[:2]:
        answer(path, folder, 0, all_of_it=True)
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + GIB, size + GIB))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    print("ready", flush=True)
    for line in sys.stdin:
        path, seed, thorough = line.split("\t")
        found = answer(Path(path), folder, int(seed), thorough.strip() == "all")
        print(json.dumps(found), flush=True)


if __name__ == "__main__":
    loop([Path(p) for p in sys.argv[2:]], Path(sys.argv[1]))
