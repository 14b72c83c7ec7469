"""Wrong arguments for every public function: what each parameter is, and the values that no such parameter can have."""

from __future__ import annotations

import datetime
import fractions
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import haff
from haff import analysis, mechanics, theory
from haff.files.container import Container


class Hostile:
    """An object that raises whatever is asked of it."""

    def __array__(self, *_args, **_options):
        raise RuntimeError("no array")

    def __float__(self):
        raise RuntimeError("no number")

    __index__ = __int__ = __len__ = __iter__ = __float__

    def __repr__(self):
        raise RuntimeError("no text")


HOSTILE = Hostile()
NAN, INF = float("nan"), float("inf")
LONG = "x" * 100_000
HUGE = 10**400
"""Beyond the range of doubles."""

NO_NUMBERS: dict[str, Any] = {
    "none": None,
    "text": "0.5",
    "long text": LONG,
    "bytes": b"0.5",
    "complex": 1 + 2j,
    "complex array": np.array([1j, 2.0]),
    "true": True,
    "truth values": np.array([True, False]),
    "dict": {"a": 1.0},
    "object": object(),
    "hostile object": HOSTILE,
    "function": len,
    "objects": np.array([None, 1.0], object),
    "texts": np.array(["a", "b"]),
    "dates": np.array(["2020-01-01"], "datetime64[s]"),
    "durations": np.array([1], "timedelta64[s]"),
    "masked": np.ma.masked_array([1.0, 2.0], [False, True]),
    "masked constant": np.ma.masked,
    "ragged": [[1.0, 2.0], [3.0]],
    "records": np.zeros(2, [("x", float)]),
    "huge": HUGE,
    "set": {1.0, 2.0},
    "table of texts": pd.DataFrame({"a": ["x", "y"]}),
    "day": datetime.date(2020, 1, 1),
}
"""For parameters that take numbers in arrays."""
SEVERAL = {"list": [1.0, 2.0], "array": np.array([1.0, 2.0]), "empty": np.array([]), "nested": [[0.5]]}
BEYOND = {"nan": NAN, "infinite": INF, "minus infinity": -INF}
NO_REAL = {**NO_NUMBERS, **SEVERAL, "nan": NAN}
NO_POSITIVE = {**NO_NUMBERS, **SEVERAL, **BEYOND, "zero": 0.0, "negative": -1.0, "minus zero": -0.0}
NO_COUNT = {
    **NO_NUMBERS,
    **SEVERAL,
    **BEYOND,
    "negative": -1,
    "fraction": 1.5,
    "whole fraction": fractions.Fraction(2),
    "float": 2.0,
    "negative huge": -HUGE,
    "beyond 64 bits": 2**64,
}
NO_FLAG = {"none": None, "one": 1, "zero": 0, "text": "yes", "array": np.array([True]), "nan": NAN, "object": HOSTILE}
NO_PATH = {
    "none": None,
    "number": 5,
    "float": 1.5,
    "empty": "",
    "NUL": "a\0b",
    "list": ["a.h5"],
    "bytes with NUL": b"a\0",
    "object": object(),
    "hostile object": HOSTILE,
    "dict": {},
    "array": np.array(["a.h5"]),
    "true": True,
}
NO_NAME = {
    "none": None,
    "number": 5,
    "nan": NAN,
    "unknown": "frobnicate",
    "empty": "",
    "long": LONG,
    "bytes": b"x",
    "list": ["x"],
    "dict": {},
    "object": HOSTILE,
    "control characters": "a\nb\x1b",
    "array": np.array(["x"]),
}
NO_NAMES = {
    "number": 5,
    "text": "time",
    "numbers": [1, 2],
    "unknown": ["frobnicate"],
    "bytes": b"time",
    "object": HOSTILE,
    "none in a list": [None],
    "dict": {"time": 1},
}
NO_FUNCTION = {"none": None, "number": 5, "text": "f", "list": [], "object": HOSTILE}
NO_FRAME = {
    "none": None,
    "number": 5,
    "text": "frame",
    "list": [],
    "dict": {},
    "array": np.zeros((3, 3)),
    "object": HOSTILE,
}
NO_FRAMES = {
    "none": None,
    "number": 5,
    "text": "frames",
    "empty": [],
    "numbers": [1, 2],
    "nones": [None],
    "dict": {},
    "array": np.zeros((3, 3)),
    "object": HOSTILE,
}
NO_FILE = {"none": None, "number": 5, "list": [], "dict": {}, "array": np.zeros(3), "object": HOSTILE, "true": True}
NO_DIMENSION = {**NO_COUNT, "one": 1, "four": 4, "zero": 0}
NO_SCENE = {**NO_PATH, "missing file": "no_such_scene.toml", "set": {1}, "folder": "."}
del NO_SCENE["dict"]


def without(values: dict[str, Any], *names: str) -> dict[str, Any]:
    """The values without those that are allowed here."""
    return {name: value for name, value in values.items() if name not in names}


@dataclass(frozen=True)
class Call:
    """A call that works, and for each of its parameters the values that must be refused."""

    name: str
    function: Callable[..., Any]
    good: dict[str, Any]
    bad: dict[str, dict[str, Any]]
    told: dict[str, str]
    """What errors call a parameter, if not by its name."""


class Table:
    """Collects calls."""

    def __init__(self) -> None:
        self.calls: list[Call] = []

    def add(
        self, name: str, function: Callable[..., Any], told: dict[str, str] | None = None, /, **parameters: Any
    ) -> None:
        """``parameters``: for each the value that works, and the bad ones; the value alone if it is not varied."""
        good = {key: value[0] if isinstance(value, tuple) else value for key, value in parameters.items()}
        bad = {key: value[1] for key, value in parameters.items() if isinstance(value, tuple)}
        self.calls.append(Call(name, function, good, bad, told or {}))

    def __iter__(self) -> Iterator[tuple[str, Call, str, Any]]:
        for call in self.calls:
            for parameter, values in call.bad.items():
                for kind, value in values.items():
                    yield f"{call.name}-{parameter}-{kind}", call, parameter, value


GAS = {
    "seed": 6,
    "domain": {"packing_fraction": 0.1},
    "species": [{"name": "grain", "count": 60, "radius": 0.5, "mass": 1.0}],
    "initial": {"temperature": 1.0, "rotational_temperature": 1.0},
    "contact": {"restitution": 0.9},
    "run": {"until": 2.0},
}


def vectors(count: int) -> dict[str, Any]:
    """For arrays of vectors of ``count`` particles."""
    many = np.zeros((count, 3))
    return {
        **NO_NUMBERS,
        "rows": many[:-1],
        "columns": many[:, :2],
        "row of vectors": many[None].repeat(2, 0),
        "transposed": many.T,
        "empty": np.array([]),
        "two numbers": [1.0, 2.0],
        "no rows": many[:0],
        "nan": np.nan,
        "one nan": np.where(np.arange(3 * count).reshape(count, 3) == 7, np.nan, 1.0),
        "infinite": [0.0, INF, 0.0],
        "beyond scenes": [0.0, 1e200, 0.0],
        "object array": many.astype(object) + 1j,
        "complex of zeros": many.astype(complex),
        "texts of numbers": many.astype(str),
    }


def make() -> haff.Simulation:
    """A simulation for one call."""
    gas = haff.Simulation(GAS, threads=1)
    gas.advance(0.2)
    return gas


def free_places(count: int) -> list[list[float]]:
    """Centers of the simulation at which no particle is."""
    gas = make()
    points = np.stack(np.meshgrid(*[np.arange(0.2, size, 0.3) for size in gas.box.size]), -1).reshape(-1, 3)
    apart = np.linalg.norm(gas.box.nearest(points[:, None] - gas.positions), axis=-1).min(axis=1)
    return points[np.argsort(-apart)[:count]].tolist()


def simulation(table: Table) -> None:
    """Live simulations."""
    count, late = len(make()), {"past": 0.1, "minus infinity": -INF, "nan": NAN, "beyond scenes": 1e51}

    def on(call: Callable[..., Any]) -> Callable[..., Any]:
        return lambda **given: call(make(), **given)

    table.add(
        "Simulation",
        lambda scene, **given: haff.Simulation(scene, **given),
        {"scene": "scene|directory"},
        scene=(GAS, NO_SCENE),
        threads=(1, without({**NO_COUNT, "zero": 0, "many": 1025}, "none")),
        events=(False, NO_FLAG),
    )
    until = {**without(NO_REAL, "nan"), **late}
    table.add("advance", on(haff.Simulation.advance), until=(1.5, until), collisions=(10**6, without(NO_COUNT, "none")))
    table.add("step", on(haff.Simulation.step), collisions=(1, {**NO_COUNT, "zero": 0}), until=(5.0, until))
    table.add(
        "every",
        on(haff.Simulation.every),
        interval=(0.5, {**NO_POSITIVE, "tiny": 1e-60, "large": 1e60, "rounding": 1e-17}),
        call=(print, NO_FUNCTION),
    )
    table.add(
        "every_collisions",
        on(haff.Simulation.every_collisions),
        count=(5, {**NO_COUNT, "zero": 0}),
        call=(print, NO_FUNCTION),
    )
    for name in ("positions", "velocities", "angular_velocities"):
        values = vectors(count)
        if name == "positions":
            values |= {"overlap": 1.0, "far": [0.0, 0.0, 8.0 * 2**40]}
        told = {"positions": "positions|overlap"} if name == "positions" else {}
        table.add(
            f"set {name}",
            lambda name=name, **given: setattr(make(), name, given[name]),
            told,
            **{name: (getattr(make(), name), values)},
        )
    one = vectors(1)
    for name in ("nan", "one nan", "no rows", "two numbers", "rows", "columns", "transposed", "row of vectors"):
        del one[name]
    places = {
        **one,
        "four": np.zeros((2, 4)),
        "numbers": [1.0, 2.0],
        "nan": [NAN, 0.0, 0.0],
        "far": [8.0 * 2**40, 0.0, 0.0],
        "scalar": 1.0,
        "cube": np.zeros((2, 2, 3)),
    }
    pair = {**one, "nan": NAN, "three for two": np.zeros((3, 3)), "two numbers": [1.0, 2.0], "four": np.zeros(4)}
    sizes = {
        **without(NO_NUMBERS, "none"),
        "zero": 0.0,
        "negative": -1.0,
        "nan": NAN,
        "infinite": INF,
        "below rounding": 1e-30,
        "beyond scenes": 1e60,
        "three for two": [0.1] * 3,
        "vectors": np.ones((2, 3)),
        "empty": [],
    }
    table.add(
        "add",
        on(haff.Simulation.add),
        positions=(free_places(2), places),
        velocities=(0.0, pair),
        species=("grain", without(NO_NAME, "none")),
        radius=(1e-6, {**sizes, "large": 40.0}),
        mass=(1.0, without(sizes, "infinite", "below rounding")),
        angular_velocities=(0.0, pair),
    )
    rows = {
        **NO_NUMBERS,
        "nested": [[1, 2]],
        "scalars of floats": [1.0, 2.0],
        "beyond": count,
        "negative": -count - 1,
        "huge index": 10**12,
        "beyond 64 bits": 2**64 - 1,
        "twice": [3, 3],
        "the same from the end": [0, -count],
        "all": np.arange(count),
        "short mask": [True, False],
        "mask of all": np.ones(count, bool),
        "masks": np.ones((count, 1), bool),
        "nan": NAN,
    }
    table.add("remove", on(haff.Simulation.remove), rows=(0, without(rows, "true", "truth values") | {"true": True}))


def runs(table: Table, folder: Path, done: Path) -> None:
    """Runs, studies and scenes."""
    no_threads = without({**NO_COUNT, "zero": 0, "many": 1025}, "none")
    table.add(
        "run",
        lambda scene, **given: haff.run(scene, **given),
        {"scene": "scene|directory", "file": "file|directory"},
        scene=(GAS, NO_SCENE),
        file=(folder / "new.h5", without(NO_PATH, "none") | {"folder": folder, "nowhere": "no/such/folder/x.h5"}),
        overwrite=(True, NO_FLAG),
        threads=(1, no_threads),
        progress=(False, NO_FLAG),
    )
    table.add(
        "resume",
        haff.resume,
        {"path": "path|no_such"},
        path=(done, NO_PATH | {"missing": "no_such.h5"}),
        threads=(1, no_threads),
        progress=(False, NO_FLAG),
    )
    table.add("validate", lambda scene: haff.validate(scene), {"scene": "scene|directory"}, scene=(GAS, NO_SCENE))
    table.add(
        "load_scene",
        haff.load_scene,
        {"path": "path|no_such|directory"},
        path=(folder / "gas.toml", NO_PATH | {"missing": "no_such.toml", "folder": "."}),
    )
    table.add(
        "save_scene",
        haff.save_scene,
        {"path": "path|directory"},
        scene=(GAS, without(NO_FILE, "dict") | {"text": "x"}),
        path=(folder / "saved.toml", NO_PATH | {"folder": "."}),
    )
    table.add("template", haff.template, name=("cooling", NO_NAME))
    table.add(
        "open",
        haff.open,
        {"path": "path|no_such"},
        path=(done, NO_PATH | {"missing": "no_such.h5"}),
        locking=(True, without(NO_FLAG, "none")),
    )
    values = {
        "number": 5,
        "text": "x",
        "list": [("a", 1)],
        "key that is no text": {5: [1]},
        "value": {"contact.restitution": 0.5},
        "text for values": {"contact.restitution": "0.5"},
        "no values": {"contact.restitution": []},
        "object": HOSTILE,
        "unknown key": {"contact.frobnicate": [1]},
        "bad value": {"contact.restitution": [0.5, object()]},
        "out of range": {"contact.restitution": [1.2]},
    }
    table.add(
        "sweep",
        haff.sweep,
        {"values": "contact|values", "series": "series|observable"},
        scene=(GAS, NO_SCENE),
        output=(folder / "study", NO_PATH),
        values=({"contact.restitution": [0.9]}, values),
        seeds=(1, no_threads | {"many": 10**9}),
        series=((), NO_NAMES),
        jobs=(1, no_threads | {"many": 10**9}),
        threads=(1, no_threads),
        retries=(0, without(NO_COUNT)),
        dims=("names", NO_NAME),
        measure=(len, without(NO_FUNCTION, "none")),
    )
    table.add(
        "open_study",
        haff.open_study,
        {"folder": "folder|study", "series": "series|observable"},
        folder=(folder / "study", NO_PATH | {"no study": "."}),
        series=((), NO_NAMES),
        measure=(len, without(NO_FUNCTION, "none")),
        dims=("names", NO_NAME),
    )
    sources = {
        **without(NO_FILE, "dict", "list"),
        "missing": "no_such.csv",
        "NUL": "a\0",
        "empty table": pd.DataFrame(),
        "wrong columns": {"x": [1.0]},
        "texts": {"height": ["a", "b", "c"]},
        "complex": {"height": [1j, 1.0, 2.0]},
        "too few": {"height": [1.0]},
    }
    table.add(
        "restitution_from",
        haff.restitution_from,
        {"source": ""},
        source=({"height": [1.0, 0.64, 0.41, 0.26]}, sources),
        kind=("heights", without(NO_NAME, "none")),
        error=(0.01, without(NO_POSITIVE, "none", "list", "array")),
        masses=(
            (1.0, 2.0),
            {
                "one": 1.0,
                "three": (1, 2, 3),
                "texts": ("a", "b"),
                "negative": (1.0, -1.0),
                "nan": (1.0, NAN),
                "complex": (1j, 1.0),
                "object": HOSTILE,
            },
        ),
    )


def reading(table: Table, run: haff.File, folder: Path) -> None:
    """What is read from files, and what is made of them."""
    frames, events, frame = run.frames, run.events, run.frames[-1]
    no_index = {
        **without(NO_COUNT, "negative"),
        "beyond": len(frames),
        "before": -len(frames) - 1,
        "huge index": 10**12,
    }
    table.add("frames[]", lambda index: frames[index], {"index": "frames"}, index=(0, no_index))
    table.add(
        "frames[:]",
        lambda start, step: frames[slice(start, None, step)],
        {"start": "frames", "step": "frames"},
        start=(0, without(NO_COUNT, "none", "negative", "beyond 64 bits", "negative huge", "huge")),
        step=(1, {"zero": 0, "text": "2"}),
    )
    table.add("frames.array", frames.array, name=("velocity", NO_NAME))
    table.add("frame.to_pandas", frame.to_pandas, unwrapped=(True, NO_FLAG))
    no_key = {
        "huge index": 10**12,
        "number": 5,
        "negative": -1,
        "none": None,
        "unknown": "frobnicate",
        "list": ["time"],
        "float": 1.0,
        "tuple": (1, 2),
        "object": HOSTILE,
        "long": LONG,
        "stepless": slice(None, None, 0),
        "slice of texts": slice("a", "b"),
    }
    table.add("events[]", lambda key: events[key], {"key": "events"}, key=("time", no_key))
    table.add("events.to_pandas", events.to_pandas, {"columns": "columns|events"}, columns=(["time"], NO_NAMES))
    for name in ("chunks", "blocks"):
        table.add(
            f"events.{name}",
            lambda name=name, **given: next(iter(getattr(events, name)(**given))),
            {"columns": "columns|events"},
            size=(10, {**NO_COUNT, "zero": 0}),
            columns=(["time"], NO_NAMES),
        )
    table.add("to_mdanalysis", run.to_mdanalysis, unwrapped=(False, NO_FLAG))
    choices = {
        "float": 1.5,
        "text": "a:b",
        "beyond": 10**9,
        "list": [1, 2],
        "object": HOSTILE,
        "zero step": "::0",
        "dict": {},
        "true": True,
        "slice of texts": slice("a", None),
        "step of zero": slice(None, None, 0),
        "long": LONG,
    }
    table.add(
        "export",
        lambda output, **given: run.export(output, **given),
        output=(folder / "out.csv", without(NO_PATH, "none")),
        to=("csv", without(NO_NAME, "none")),
        frames=(None, choices),
        table=("frames", without(NO_NAME, "none")),
        unwrapped=(False, NO_FLAG),
        overwrite=(True, NO_FLAG),
    )
    table.add(
        "plot",
        haff.plot,
        {"source": "source|no_such"},
        source=(run, NO_FILE | {"missing": "no_such.h5", "NUL": "a\0", "empty": ""}),
        kind=("energy", NO_NAME),
        output=(folder / "energy.png", without(NO_PATH, "none") | {"no suffix": "out", "other": "out.doc"}),
        overwrite=(True, NO_FLAG),
    )
    table.add(
        "plot snapshot",
        lambda index: haff.plot(run, "snapshot", index=index),
        {"index": "index|frame"},
        index=(0, no_index),
    )
    table.add(
        "view",
        haff.view,
        {"source": "source|no_such", "color_range": "color.range"},
        source=(run, NO_FILE | {"missing": "no_such.h5", "NUL": "a\0", "empty": ""}),
        output=(folder / "page.html", without(NO_PATH, "none")),
        frames=(None, choices),
        size=(40.0, NO_POSITIVE),
        color=("speed", without(NO_NAME, "none")),
        color_range=(
            (0.0, 1.0),
            {
                "one": [1.0],
                "three": [1, 2, 3],
                "texts": ["a", "b"],
                "reversed": (1.0, 0.0),
                "nan": (NAN, 1.0),
                "complex": (1j, 2.0),
                "number": 5,
                "text": "ab",
                "object": HOSTILE,
                "infinite": (0.0, INF),
            },
        ),
        overwrite=(True, NO_FLAG),
        show=(False, NO_FLAG),
        notes=(None, {"number": 5, "text": "x", "tuple": (), "object": HOSTILE}),
    )
    table.add(
        "Estimate.z",
        lambda **given: analysis.Estimate(1.0, 0.1).z(**given),
        expected=(1.0, without(NO_REAL, "nan")),
        uncertainty=(0.0, without(NO_REAL, "nan") | {"negative": -1.0}),
    )
    box = run.box
    triples = {**vectors(2), "four": np.zeros((2, 4))}
    for name in (
        "columns",
        "row of vectors",
        "no rows",
        "rows",
        "transposed",
        "nan",
        "one nan",
        "infinite",
        "beyond scenes",
    ):
        del triples[name]
    table.add("box.nearest", box.nearest, apart=(np.zeros((2, 3)), triples))
    table.add("box.unwrap", box.unwrap, position=(np.zeros((2, 3)), triples), image=(np.zeros((2, 3), int), triples))
    table.add(
        "Box",
        haff.Box,
        size=(
            [1.0, 1.0, 1.0],
            {
                **NO_NUMBERS,
                **BEYOND,
                "two": [1.0, 2.0],
                "negative": [1.0, -1.0, 1.0],
                "zero": [0.0, 1.0, 1.0],
                "scalar": 1.0,
            },
        ),
        boundary=(
            ["periodic"] * 3,
            {
                "number": 5,
                "none": None,
                "unknown": ["open", "closed", "open"],
                "two": ["open"] * 2,
                "numbers": [1, 2, 3],
                "object": HOSTILE,
            },
        ),
        dimension=(3, NO_DIMENSION),
        displacement=(
            (1, 0, 0.1),
            {
                "number": 5,
                "two": (1, 0),
                "same": (1, 1, 0.1),
                "axis": (3, 0, 0.1),
                "nan": (1, 0, NAN),
                "text": "101",
                "complex": (1, 0, 1j),
                "object": HOSTILE,
            },
        ),
    )


def of_frames(table: Table, run: haff.File) -> None:
    """Analysis of frames."""
    frame, frames = run.frames[-1], run.frames[:2]
    for name in (
        "clusters",
        "kinetic_energy",
        "max_overlap",
        "rotational_energy",
        "rotational_temperature",
        "scaled_velocities",
        "sonine_a2",
        "temperature",
    ):
        table.add(name, getattr(analysis, name), frame=(frame, NO_FRAME))
    no_species = {**without(NO_COUNT, "none", "text"), "unknown": 7, "name": "nothing"}
    for name in ("temperature", "rotational_temperature", "scaled_velocities", "sonine_a2"):
        table.add(name, getattr(analysis, name), frame=frame, species=(0, no_species))
    table.add(
        "mixing",
        analysis.mixing,
        file=(run, NO_FILE),
        species=("grain", {"unknown": "nothing", "number": 3, "object": HOSTILE}),
        profile=("z", {"unknown": "q", "number": 3, "object": HOSTILE}),
    )
    table.add(
        "clusters",
        analysis.clusters,
        {"distance": "distance|the box is too small"},
        frame=frame,
        distance=(1.1, {**NO_POSITIVE, "beyond the box": 1e9}),
    )
    table.add(
        "cluster_sizes",
        analysis.cluster_sizes,
        {"reach": "reach|the box is too small"},
        frame=(frame, NO_FRAME),
        reach=(1.1, {**NO_POSITIVE, "beyond the box": 1e9}),
    )
    bins = {**NO_COUNT, "zero": 0}
    table.add(
        "radial_distribution",
        analysis.radial_distribution,
        {"r_max": "r_max|the box is too small"},
        frames=(frames, NO_FRAMES),
        r_max=(1.5, {**NO_POSITIVE, "beyond the box": 1e9}),
        bins=(5, bins),
        r_min=(0.0, {**NO_REAL, **BEYOND, "negative": -1.0, "above": 2.0}),
    )
    table.add(
        "structure_factor",
        analysis.structure_factor,
        frames=(frames, NO_FRAMES),
        k_max=(5.0, NO_POSITIVE),
        bins=(5, bins),
    )
    table.add(
        "static_structure",
        analysis.static_structure,
        frames=(frames, NO_FRAMES),
        k_max=(5.0, NO_POSITIVE),
        bins=(5, bins),
        most_waves=(20, bins),
        seed=(0, NO_COUNT),
        species=(0, {**no_species, "three": (0, 0, 0), "one": ("grain",), "pair": ("grain", "nothing")}),
    )
    table.add(
        "pair_distributions",
        analysis.pair_distributions,
        {"r_max": "r_max|the box is too small"},
        frames=(frames, NO_FRAMES),
        r_max=(1.5, {**NO_POSITIVE, "beyond the box": 1e9}),
        bins=(5, bins),
        most_pairs=(1e4, without(NO_POSITIVE, "none")),
        seed=(0, NO_COUNT),
    )
    table.add(
        "density_field",
        analysis.density_field,
        frames=(frames, NO_FRAMES),
        cells=(4, {**without(NO_COUNT), "zero": 0, "two": [4, 4], "zeros": [0, 4, 4]}),
        quantity=("packing_fraction", NO_NAME),
    )
    table.add(
        "velocity_histogram",
        analysis.velocity_histogram,
        frames=(frames, NO_FRAMES),
        bins=(5, bins),
        reach=(5.0, NO_POSITIVE),
        species=("grain", no_species),
    )
    table.add(
        "height_profile",
        analysis.height_profile,
        frames=(frames, NO_FRAMES),
        bins=(5, bins),
        axis=("z", without(NO_NAME, "none")),
        species=("grain", no_species),
        limits=(
            (0.0, 1.0),
            {
                "number": 5,
                "one": [1.0],
                "reversed": (1.0, 0.0),
                "nan": (NAN, 1.0),
                "texts": ("a", "b"),
                "complex": (1j, 2.0),
                "object": HOSTILE,
                "infinite": (0.0, INF),
            },
        ),
    )
    table.add(
        "mean",
        analysis.mean,
        values=(np.arange(40.0), {**NO_NUMBERS, **BEYOND, "cube": np.zeros((2, 2, 2)), "nothing": []}),
    )
    table.add(
        "block_average",
        analysis.block_average,
        values=(np.arange(40.0), {**NO_NUMBERS, **BEYOND, "cube": np.zeros((2, 2, 2)), "too few": [1.0]}),
        blocks=(4, {**NO_COUNT, "zero": 0, "one": 1, "more than values": 1000}),
        weights=(
            np.ones(40),
            {
                **without(NO_NUMBERS, "none"),
                "other length": np.ones(3),
                "negative": -np.ones(40),
                "zeros": np.zeros(40),
            },
        ),
    )
    for name in (
        "cooling_law",
        "gas_restitution",
        "height_axis",
        "rheology",
        "self_diffusion",
        "shear_viscosity",
        "viscosity_scale",
    ):
        table.add(name, getattr(analysis, name), file=(run, NO_FILE | {"text": "no_such.h5"}))
    table.add(
        "drawn_frames",
        analysis.drawn_frames,
        file=(run, NO_FILE | {"text": "no_such.h5"}),
        count=(2, {**NO_COUNT, "zero": 0}),
        after=(0.1, NO_REAL | {"negative": -1.0}),
    )
    late = {**without(NO_REAL, "none"), **BEYOND}
    table.add("self_diffusion", analysis.self_diffusion, file=run, start=(0.5, late), end=(1.0, late))
    table.add(
        "running_integral",
        analysis.running_integral,
        correlation=(
            run.correlations["vacf"],
            {
                "none": None,
                "number": 5,
                "text": "x",
                "empty": {},
                "no value": {"lag": [0.0, 1.0]},
                "lengths": {"lag": [0.0, 1.0], "value": [1.0]},
                "texts": {"lag": ["a", "b"], "value": [1.0, 2.0]},
                "complex": {"lag": [0.0, 1.0], "value": [1j, 2j]},
                "object": HOSTILE,
            },
        ),
    )


def of_packings(table: Table, run: haff.File) -> None:
    """Analysis of packings."""
    table.add("reduced_pressure", analysis.reduced_pressure, frame=(run.frames[-1], NO_FRAME))
    table.add("contact_tolerance", analysis.contact_tolerance, reduced_pressure=(1e6, NO_POSITIVE))
    places = {
        **NO_NUMBERS,
        **{name: np.full((4, 3), value) for name, value in BEYOND.items()},
        "one": [0.0, 0.0, 0.0],
        "four columns": np.zeros((4, 4)),
        "two columns": np.zeros((4, 2)),
        "no rows": np.zeros((0, 3)),
        "cube": np.zeros((4, 3, 3)),
        "beyond scenes": np.full((4, 3), 1e60),
    }
    sizes = {**NO_NUMBERS, **BEYOND, "zero": 0.0, "negative": [-0.5] * 4, "three": [0.5] * 3, "tiny": 1e-60}
    no_box = {"none": None, "number": 5.0, "list": [3.0] * 3, "dict": {}, "text": "box", "object": HOSTILE}
    good = {"positions": (2.5 * np.eye(4)[:, :3], places), "radii": (0.5, sizes), "box": (run.box, no_box)}
    far, told = {**NO_POSITIVE, "beyond the box": 1e9}, "the box is too small"
    table.add("close_gaps", analysis.close_gaps, {"cutoff": f"cutoff|{told}"}, **good, cutoff=(0.1, far))
    table.add(
        "contact_network",
        analysis.contact_network,
        {"tolerance": f"tolerance|{told}"},
        **good,
        tolerance=(0.1, without(far, "none")),
    )
    table.add("contact_network", analysis.contact_network, **good, reduced_pressure=(9.0, without(NO_POSITIVE, "none")))
    bins = {**without(NO_COUNT, "none"), "zero": 0}
    ball = Container({"name": "ball", "sphere": {"center": [3, 3, 3], "radius": 3.0}}, 3)
    inside = {**good, "box": (haff.Box([6.0] * 3, ["wall"] * 3, 3, container=ball), no_box)}
    table.add("radial_porosity", analysis.radial_porosity, **inside, bins=(9, bins))
    neighbors = {**without(NO_COUNT, "none"), "zero": 0}
    table.add("bond_order", analysis.bond_order, **good, neighbors=(3, neighbors))
    rows = {
        **without(NO_NUMBERS, "huge"),
        "beyond": [[0, 4]],
        "negative": [[-1, 0]],
        "fraction": [[0.5, 1.0]],
        "nan": [[0.0, NAN]],
        "three": [[0, 1, 2]],
    }
    table.add(
        "rattlers",
        analysis.rattlers,
        count=(4, {**NO_COUNT, "zero": 0}),
        pairs=([[0, 1], [1, 2]], rows),
        dimension=(3, NO_DIMENSION),
        walls=([0, 1], without(rows, "set")),
    )
    phi = np.linspace(0.6, 0.6399, 20)
    series = {**NO_NUMBERS, "other length": phi[:3], "nested": np.ones((20, 2)), "number": 0.5}
    table.add(
        "jamming_fraction",
        analysis.jamming_fraction,
        packing_fraction=(phi, series),
        reduced_pressure=(3 / (1 - phi / 0.64), series),
        dimension=(3, NO_DIMENSION),
    )


GOOD = {
    "n": 0.1,
    "sigma": 1.0,
    "T": 1.0,
    "m": 1.0,
    "g0": 1.2,
    "a2": 0.01,
    "e": 0.9,
    "eta": 0.1,
    "omega0": 1.0,
    "tau": 1.0,
    "T0": 1.0,
    "t": 1.0,
    "L": 10.0,
    "viscosity": 1.0,
    "particles": 100.0,
    "x": 0.5,
    "c": 0.5,
    "speed": 1.0,
    "coefficient": 0.1,
    "delta": 0.1,
    "sigma_tracer": 2.0,
    "strength": 0.1,
    "drag_time": 2.0,
    "hot": 2.0,
    "cold": 1.0,
    "width": 50.0,
    "accommodation": 0.9,
    "T_rot": 1.0,
    "beta": 0.5,
    "q": 0.4,
    "packing_fraction": 0.1,
    "rate": 0.5,
    "k": 2.0,
    "height": 1.0,
    "g": 9.8,
    "count": 3.0,
    "alpha": 0.5,
    "length": 1.0,
    "m1": 1.0,
    "m2": 2.0,
    "v": 1.0,
    "theta": 0.5,
    "friction": 0.3,
}
"""An argument that every closed form takes, by its name."""


def closed_forms(table: Table) -> None:
    """Theory and mechanics: all numbers of all functions."""
    import inspect

    mixture = {"n": [0.1, 0.1], "sigma": [1.0, 2.0], "m": [1.0, 8.0], "e": 0.9, "T": [1.0, 1.0]}
    vectors_of = {
        "w1": [1.0, 0.0, 0.0],
        "w2": [0.0, 0.0, 0.0],
        "n": [1.0, 0.0, 0.0],
        "omega1": [0.0, 0.0, 0.0],
        "omega2": [0.0, 0.0, 0.0],
    }
    for module in (theory, mechanics):
        for name in module.__all__:
            function = getattr(module, name)
            if inspect.isclass(function):
                continue
            good = GOOD
            if name.startswith("mixture") or name == "granular_temperatures":
                good = GOOD | mixture
            elif name in ("impact", "rough_impact"):
                good = GOOD | vectors_of
            parameters: dict[str, Any] = {}
            for key, parameter in inspect.signature(function).parameters.items():
                annotation = str(parameter.annotation)
                if key == "d":
                    # Sonine polynomials have one of a single component, too.
                    bad = without(NO_DIMENSION, "one") if name == "sonine_polynomial" else NO_DIMENSION
                    parameters[key] = (3, bad)
                elif key == "denominator":
                    parameters[key] = (5, NO_COUNT)
                elif key in ("equation", "approximation"):
                    default = parameter.default
                    parameters[key] = (default, NO_NAME if default is not None else without(NO_NAME, "none"))
                elif key == "restitution":
                    parameters[key] = (lambda speed: 0.9 + 0 * speed, NO_FUNCTION)
                elif key in ("radii", "q") and "tuple" in annotation:
                    parameters[key] = (
                        parameter.default,
                        {
                            "one": (1.0,),
                            "number": 1.0,
                            "texts": ("a", "b"),
                            "none": None,
                            "complex": (1j, 1.0),
                            "object": HOSTILE,
                        },
                    )
                elif annotation in ("ArrayLike", "float", "ArrayLike | None"):
                    bad = (
                        without(NO_NUMBERS, "none") if "None" in annotation or parameter.default is None else NO_NUMBERS
                    )
                    parameters[key] = (
                        good[key] if parameter.default is inspect.Parameter.empty else parameter.default,
                        bad,
                    )
            table.add(f"{module.__name__.rsplit('.')[-1]}.{name}", function, **parameters)
