"""Small scenes that, with the shipped ones, have every form of every key of a scene; and the forms of a schema."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

Form = tuple[str, str]
"""Path of a key, such as ``wall[].restitution``, and a form of its value."""


def forms_of(schema: dict[str, Any]) -> set[Form]:
    """All forms of all keys that a JSON schema allows: a type, or a word."""
    return set(_allowed(schema, schema, ""))


def _allowed(node: dict[str, Any], schema: dict[str, Any], path: str) -> Iterator[Form]:
    while "$ref" in node:
        node = schema["$defs"][node["$ref"].rpartition("/")[2]]
    several = [*node.get("anyOf", ()), *node.get("oneOf", ())]
    for one in several:
        yield from _allowed(one, schema, path)
    if several:
        return
    if "const" in node:
        yield path, str(node["const"])
    elif "properties" in node:
        yield path, "table"
        for key, inner in node["properties"].items():
            yield from _allowed(inner, schema, f"{path}.{key}".lstrip("."))
    elif node.get("type") == "array":
        yield path, "list"
        if isinstance(node.get("items"), dict) and "$ref" in node["items"]:
            yield from _allowed(node["items"], schema, f"{path}[]")
    else:
        yield path, {"integer": "number"}.get(node["type"], node["type"])


def forms_in(value: Any, words: set[Form], path: str = "") -> Iterator[Form]:
    """The forms in a scene; texts that are one of ``words`` count as such."""
    match value:
        case dict():
            yield path, "table"
            for key, inner in value.items():
                yield from forms_in(inner, words, f"{path}.{key}".lstrip("."))
        case list():
            yield path, "list"
            for inner in value:
                # Numbers and names in lists have one form.
                if isinstance(inner, dict) or (isinstance(inner, str) and (f"{path}[]", inner) in words):
                    yield from forms_in(inner, words, f"{path}[]")
        case bool():
            yield path, str(value) if (path, str(value)) in words else "boolean"
        case int() | float():
            yield path, "number"
        case str():
            yield path, value if (path, value) in words else "string"


_GRAIN = {"name": "grain", "count": 30, "radius": 0.4, "mass": 1.0}
_BOX = {"size": [8.0, 8.0, 8.0]}
_SHORT = {"until": 2.0}
_TABLE = {"speeds": [0.0, 1.0], "values": [1.0, 0.7]}
_VISCOELASTIC = {"model": "viscoelastic", "coefficient": 0.05}
_CUTOFF = {"model": "cutoff", "restitution": 0.8, "speed": 0.5, "exponent": 0.75}
_UNIFORM = {"model": "random", "uniform": [0.7, 0.9]}
_NORMAL = {"model": "random", "normal": [0.8, 0.05]}
_DRAWN = {"model": "random", "values": [0.7, 0.8, 0.9]}
_OUTPUT = {"frames": 0.5, "observables": 0.25, "events": True}


def _gas(restitution: Any, **more: Any) -> dict[str, Any]:
    """A gas between walls whose contacts all have one law, given in each place where a scene can have one."""
    return {
        "domain": {**_BOX, "boundary": ["periodic", "wall", "wall"]},
        "species": [_GRAIN, {**_GRAIN, "name": "other", "count": 20}],
        "contact": {
            "restitution": restitution,
            "wall_restitution": restitution,
            "pair": [{"between": ["grain", "other"], "restitution": restitution}],
        },
        "wall": [{"name": "y-", "restitution": restitution}],
        "run": _SHORT,
        "output": _OUTPUT,
        **more,
    }


def _sizes(radius: Any) -> dict[str, Any]:
    return {
        "domain": {"packing_fraction": 0.1},
        "species": [{"name": "grain", "count": 40, "radius": radius, "density": 1.0}],
        "run": {"collisions": 50},
        "output": _OUTPUT,
    }


def _planes(*walls: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {
        "domain": {"size": [8.0, 8.0, 20.0], "boundary": ["periodic", "wall", "open"], "gravity": [0, 0, -1]},
        "species": [_GRAIN],
        "wall": list(walls),
        "run": _SHORT,
        "output": _OUTPUT,
        **more,
    }


_FLOOR = {"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
_BODY = {"radius": 0.3, "mass": 1.0}

SCENES: dict[str, dict[str, Any]] = {
    "table": _gas(_TABLE, output={**_OUTPUT, "compression": "none"}),
    "viscoelastic": _gas(_VISCOELASTIC, output={**_OUTPUT, "compression": "deflate"}),
    "cutoff": _gas(_CUTOFF, engine={"neighbors": "auto", "simd": "auto", "blocks": 1}),
    "uniform restitution": _gas(_UNIFORM),
    "normal restitution": _gas(_NORMAL),
    "drawn restitution": _gas(_DRAWN),
    "added speed": {
        "domain": {**_BOX, "boundary": ["periodic", "wall", "wall"]},
        "species": [_GRAIN, {**_GRAIN, "name": "other", "count": 20}],
        "contact": {
            "restitution": 0.8,
            "added_speed": 0.05,
            "tangential_restitution": 0.5,
            "pair": [{"between": ["grain", "other"], "added_speed": 0.0}],
        },
        "wall": [
            {"name": "y-", "added_speed": 0.1},
            {"name": "z-", "temperature": 1.0, "accommodation": 0.5, "restitution": 0.9, "added_speed": 0.02},
        ],
        "drive": [{"kind": "andersen", "temperature": 1.0, "rate": 0.1, "rotational": True}],
        "run": _SHORT,
        "output": _OUTPUT,
    },
    "list of radii": _sizes({"list": [0.3, 0.4, 0.5]}),
    "uniform radii": _sizes({"uniform": [0.3, 0.5]}),
    "normal radii": _sizes({"normal": [0.4, 0.05], "min": 0.2, "max": 0.6}),
    "lognormal radii": _sizes({"lognormal": [0.4, 0.05]}),
    "Schulz radii": _sizes({"schulz": [0.4, 0.05]}),
    "power of radii": _sizes({"power": [0.3, 0.5, -2.0]}),
    "table of radii": _sizes({"table": {"radii": [0.3, 0.5], "weights": [2.0, 1.0]}}),
    "rough walls": _planes(
        {
            **_FLOOR,
            "tangential_restitution": 0.3,
            "friction": 0.4,
            "motion": {"kind": "triangle", "amplitude": 0.1, "frequency": 1.0, "phase": 0.5},
        },
        {"name": "y-", "restitution": 0.5},
        {"name": "lid", "plane": {"point": [0, 0, 19], "normal": [0, 0, -1]}, "velocity": [0.0, 0.0, 0.1]},
        contact={
            "restitution": 0.9,
            "tangential_restitution": 0.5,
            "friction": 0.2,
            "pair": [{"between": ["grain", "floor"], "tangential_restitution": 0.1, "friction": 0.1}],
            "tc": 1e-6,
        },
        species=[{**_GRAIN, "inertia": 0.3}],
        particle=[
            {"position": [4, 4, 15], "radius": 0.5, "density": 1.0, "angular_velocity": [0, 0, 1], "inertia": 0.3}
        ],
        initial={"positions": "random", "temperature": 1.0, "rotational_temperature": 0.5},
    ),
    "thermal walls": _planes(
        {**_FLOOR, "temperature": 1.0, "accommodation": 0.7},
        measure={"wall_forces": True},
        initial={"positions": "lattice"},
    ),
    "partitions": _planes(
        {
            "name": "sieve",
            "plane": {"point": [0, 4, 0], "normal": [0, 1, 0], "hole": {"center": [4, 4, 3], "radius": 1.0}},
        },
        {"name": "divider", "plane": {"point": [4, 0, 0], "normal": [1, 0, 0], "two-sided": True}},
        domain={"size": [8.0, 8.0, 20.0], "boundary": ["wall", "wall", "wall"]},
        contact={"pair": [{"between": ["grain", "sieve"], "restitution": 0.8}]},
    ),
    "containers": {
        "domain": {"size": [12.0, 12.0, 12.0], "boundary": ["open", "open", "open"], "gravity": [0, 0, -0.1]},
        "species": [
            {**_GRAIN, "region": {"cylinder": {"point": [6, 6, 1], "axis": [0, 0, 1], "radius": 3, "length": 9}}},
            {**_GRAIN, "name": "dust", "count": 10, "region": {"box": [[4, 4, 4], [8, 8, 8]]}},
            {**_GRAIN, "name": "rest", "count": 3, "region": {"sphere": {"center": [6, 6, 6], "radius": 3}}},
        ],
        "contact": {"restitution": 0.9, "tangential_restitution": 0.5, "friction": 0.3},
        "wall": [
            {
                "name": "can",
                "cylinder": {"point": [6, 6, 0], "axis": [0, 0, 2], "radius": 6, "length": 12, "side": "inside"},
                "rotation": {"axis": [0, 0, 1], "point": [6, 6, 3], "rate": 0.5},
            },
            {
                "name": "ball",
                "sphere": {"center": [6, 6, 6], "radius": 5.9, "side": "inside"},
                "velocity": [0.0, 0.0, 0.1],
                "reference_time": 1.0,
                "offset": [0.0, 0.0, 0.1],
                "passes": ["dust"],
            },
            {"name": "pit", "cone": {"apex": [6, 6, -4], "axis": [0, 0, 1], "angle": 0.8, "side": "inside"}},
            {
                "name": "barrel",
                "mesh": {
                    "file": str(Path(__file__).parents[2] / "configs" / "meshes" / "mill.obj"),
                    "scale": 3.0,
                    "point": [6, 6, 6],
                    "rotation": [[1, 0, 0], 1.5],
                    "side": "inside",
                },
                "motion": {"kind": "sine", "amplitude": 0.1, "frequency": 1.0, "direction": [1, 0, 1]},
            },
        ],
        "run": _SHORT,
        "output": _OUTPUT,
    },
    "pistons": {
        "domain": {**_BOX, "boundary": ["periodic", "periodic", "open"], "gravity": [0, 0, -1]},
        "species": [_GRAIN],
        "contact": {"restitution": 0.9, "tangential_restitution": 0.5, "friction": 0.2, "tc": 1e-3},
        "wall": [
            {"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}},
            {"name": "lid", "plane": {"point": [0, 0, 12.5], "normal": [0, 0, -1]}, "mass": 20, "force": 10},
        ],
        "run": _SHORT,
        "output": _OUTPUT,
    },
    "flow": {
        "domain": {**_BOX, "boundary": ["periodic", "periodic", "wall"], "gravity": [0, 0, -1]},
        "species": [_GRAIN, {**_GRAIN, "name": "rain", "count": 0}],
        "contact": {"restitution": 0.9, "tangential_restitution": 0.5, "friction": 0.2},
        "inlet": [
            {
                "species": "rain",
                "box": [[0, 0, 5], [8, 8, 7]],
                "velocity": [0, 0, -1],
                "temperature": 0.1,
                "rate": 9.0,
                "count": 30,
            },
            {"species": "grain", "box": [[0, 0, 5], [8, 8, 7]], "refill": True, "count": 100},
        ],
        "outlet": [{"box": [[0, 0, 0], [8, 8, 1]], "interval": 0.05}],
        "run": {"until": 5.0},
        "output": _OUTPUT,
    },
    "obstacles": _planes(
        {"name": "pin", "cylinder": {"point": [2, 2, 0], "axis": [0, 0, 1], "radius": 0.3, "side": "outside"}},
        {"name": "tube", "cylinder": {"point": [6, 2, 2], "axis": [0, 0, 1], "radius": 1, "length": 2, "side": "both"}},
        {"name": "bead", "sphere": {"center": [2, 6, 3], "radius": 0.5, "side": "outside"}},
        {"name": "shell", "sphere": {"center": [6, 6, 12], "radius": 1.0, "side": "both"}},
        {
            "name": "spike",
            "cone": {"apex": [4, 4, 6], "axis": [0, 0, -1], "angle": 0.1, "start": 1, "length": 5, "side": "outside"},
        },
        {
            "name": "funnel",
            "cone": {"apex": [4, 4, 8], "axis": [0, 0, 1], "angle": 0.4, "start": 2, "length": 5, "side": "both"},
        },
        {
            "name": "shelf",
            "plane": {"point": [4, 1, 15], "normal": [0, 0, 1], "extent": [3.0, 1.0], "along": [1, 0, 0]},
        },
        {
            "name": "block",
            "mesh": {"file": str(Path(__file__).parents[2] / "configs" / "meshes" / "mill.obj"), "side": "outside"}
            | {"scale": 0.1, "point": [6, 2, 12]},
        },
        {
            "name": "skin",
            "mesh": {"file": str(Path(__file__).parents[2] / "configs" / "meshes" / "mill.obj"), "side": "both"}
            | {"scale": 0.1, "point": [2, 2, 12]},
        },
        domain={"size": [8.0, 8.0, 20.0], "boundary": ["wall", "wall", "wall"], "gravity": [0, 0, -0.1]},
    ),
    "grains at rest": _planes(
        _FLOOR,
        contact={"restitution": 0.5, "rest_speed": 0.05},
        output={**_OUTPUT, "events": {"columns": ["time", "kind", "i", "j", "energy_loss"]}, "checkpoint": 1.0},
        species=[{**_GRAIN, "temperature": 0.1}],
    ),
    "sticky floor": {
        "domain": {"size": [8, 8, 8], "boundary": ["open", "open", "open"], "gravity": [0, 0, -1]},
        "particle": [
            {**_BODY, "name": "lump", "position": [1, 1, 2]},
            {**_BODY, "name": "ball", "position": [1, 1, 4], "velocity": [0.2, 0, 0]},
            {**_BODY, "name": "third", "position": [4, 1, 2]},
        ],
        "contact": {"restitution": 0.5, "pair": [{"between": ["lump", "third"], "sticks": True}]},
        "wall": [{**_FLOOR, "sticks": True}],
        "run": _SHORT,
        "output": _OUTPUT,
    },
    "pendulums and springs": {
        "domain": {"size": [8, 8, 8], "boundary": ["open", "open", "open"], "gravity": [0, 0, -1]},
        "particle": [
            {**_BODY, "name": "one"},
            {**_BODY, "name": "two"},
            {**_BODY, "name": "three", "position": [10, 0, 2]},
            {**_BODY, "name": "four", "position": [12, 0, 2]},
            {**_BODY, "name": "five", "position": [20, 0, 2]},
            {**_BODY, "name": "six"},
            {**_BODY, "name": "seven", "position": [30, 0, 1.5]},
        ],
        "pendulum": [
            {"name": "left", "bob": "one", "pivot": [0, 0, 3], "length": 1.0, "angle": 0.5, "tether": "string"},
            {"name": "right", "bob": "two", "pivot": [4, 0, 3], "length": 1.0, "angle": -0.3, "tether": "rod"},
            {"bob": "seven", "pivot": [30, 0, 3], "length": 2.0, "slack": True},
        ],
        "spring": [{"name": "k", "between": ["three", "four"], "stiffness": 2.0, "length": 1.5}],
        "rod": [{"name": "bar", "between": ["five", "six"], "length": 1.0, "angle": 0.4}],
        "run": _SHORT,
        "output": _OUTPUT,
    },
    "spring on a point": {
        "particle": [{**_BODY, "name": "one", "position": [2, 0, 0], "velocity": [0.5, 0, 0]}],
        "spring": [{"between": ["one"], "point": [0, 0, 0], "stiffness": 1.0}],
        "run": _SHORT,
        "output": _OUTPUT,
    },
    "all measurements": {
        "title": "All measurements",
        "schema": 1,
        "seed": 3,
        "domain": _BOX,
        "species": [_GRAIN],
        "contact": {"restitution": 0.9},
        "drive": [
            {"kind": "white_noise", "strength": 0.1, "interval": 0.1, "species": ["grain"]},
            {"kind": "rescale", "temperature": 1.0, "interval": 0.5},
            {"kind": "andersen", "temperature": 1.0, "rate": 0.1},
        ],
        "measure": {
            "stress": True,
            "msd": True,
            "vacf": True,
            "stress_correlation": True,
            "interval": 0.05,
            "tracers": 10,
            "profiles": [
                {"axis": "z", "bins": 4, "interval": 0.5, "samples": 5, "range": [0.0, 4.0], "spread": True},
                {"axis": "xy", "bins": [4, 3], "interval": 1.0, "spread": False},
                {"axis": "xyz", "bins": 2, "interval": 1.0},
            ],
        },
        "run": {"until": 4.0, "wall_time": "1h"},
        "output": {
            **_OUTPUT,
            "events": {"columns": ["i", "j", "approach_speed", "impulse", "carnot_energy", "normal"]},
        },
    },
    "measurements by species": {
        "domain": _BOX,
        "species": [_GRAIN, {**_GRAIN, "name": "other", "count": 20}],
        "measure": {
            "pair_collisions": True,
            "msd": {"species": "each"},
            "vacf": {"species": ["other"]},
            "interval": 0.05,
            "profiles": [
                {"axis": "z", "bins": 4, "interval": 0.5, "species": "each"},
                {"axis": "x", "bins": 2, "interval": 0.5, "species": ["other"]},
            ],
        },
        "run": _SHORT,
        "output": _OUTPUT,
    },
    "vacf of each": {
        "domain": _BOX,
        "species": [_GRAIN],
        "measure": {"msd": {"species": ["grain"]}, "vacf": {"species": "each"}, "interval": 0.05},
        "run": _SHORT,
        "output": _OUTPUT,
    },
    "all columns of rough contacts": {
        "dimension": 2,
        "domain": {"packing_fraction": 0.3},
        "species": [_GRAIN],
        "initial": {"positions": "hexagonal"},
        "contact": {"tangential_restitution": 0.5, "friction": 0.3, "restitution": 0.9},
        "engine": {"neighbors": "cells", "simd": "portable"},
        "run": {"collisions_per_particle": 4.0, "wall_time": 600},
        "output": {
            **_OUTPUT,
            "events": {"columns": ["time", "i", "j", "position", "impulse_vector", "tangential_loss"]},
            "observables": {"log": [0.1, 2.0]},
            "frames": {"log": [0.1, 2.0]},
        },
    },
    "sheared": {
        "domain": {**_BOX, "shear": {"flow": "x", "gradient": "y", "rate": 0.5, "offset": 1.0}},
        "particle": [
            {**_BODY, "position": [2, 2, 2], "velocity": [1, 0.5, 0.2]},
            {**_BODY, "position": [5, 5, 3], "velocity": [-1, -0.5, 0.1]},
        ],
        "contact": {"restitution": 0.9},
        "measure": {"stress": True},
        "engine": {"neighbors": "cells"},
        "run": _SHORT,
        "output": _OUTPUT,
    },
    "compressed": {
        "domain": {**_BOX, "compression": {"rate": 0.05}},
        "species": [_GRAIN],
        "run": _SHORT,
        "output": _OUTPUT,
    },
    "elongated": {
        "domain": {**_BOX, "compression": {"rates": [0.04, -0.02, -0.02]}},
        "species": [_GRAIN],
        "run": _SHORT,
        "output": _OUTPUT,
    },
    "grown": {
        "domain": {"packing_fraction": 0.1},
        "species": [_GRAIN],
        "growth": {"rate": 0.05, "temperature": 1.0, "until_packing_fraction": 0.2},
        "output": _OUTPUT,
    },
    "pressed": {
        "domain": {"packing_fraction": 0.1},
        "species": [_GRAIN],
        "growth": {"rate": 0.05, "until_reduced_pressure": 1.5},
        "output": _OUTPUT,
    },
    "lists": {
        "domain": {"packing_fraction": 0.3},
        "species": [_GRAIN],
        "initial": {"positions": "fcc"},
        "engine": {"neighbors": "lists"},
        "run": _SHORT,
        "output": _OUTPUT,
    },
    "moved walls": {
        "domain": {**_BOX, "boundary": ["periodic", "periodic", "wall"]},
        "particle": [{**_BODY, "position": [3, 3, 3], "velocity": [0.5, 0, 1]}],
        "wall": [
            {
                "name": "floor",
                "plane": {"point": [0, 0, 1], "normal": [0, 0, 1]},
                "velocity": [0, 0, 0.1],
                "reference_time": 0.5,
            },
            {"name": "z+", "displacement": -0.25},
        ],
        "run": _SHORT,
        "output": _OUTPUT,
    },
    "only samples": {
        "domain": _BOX,
        "species": [_GRAIN],
        "engine": {"neighbors": "all_pairs"},
        "run": _SHORT,
        "output": {"frames": False, "observables": 0.1},
    },
    "only frames": {
        "domain": {"size": [20.0, 20.0, 20.0]},
        "species": [{**_GRAIN, "count": 200}],
        "engine": {"neighbors": "windows"},
        "run": _SHORT,
        "output": {"frames": 0.5, "observables": False, "events": False},
    },
    "records by collisions": {
        "domain": _BOX,
        "species": [_GRAIN],
        "run": _SHORT,
        "output": {"frames": {"collisions_per_particle": 2.0}, "observables": {"collisions_per_particle": 0.5}},
    },
}
