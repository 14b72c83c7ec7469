"""The scene recorded in a file. It may come from another program, so it is checked by the schema of scenes first."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from itertools import pairwise
from typing import Any

from ..common.compiled import schema
from ..text import brief
from .column import LARGEST

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    import tomli as tomllib  # type: ignore[no-redef]

__all__ = [
    "SHAPES",
    "SceneFault",
    "constant",
    "is_rough",
    "law_name",
    "law_of",
    "mean_displacement",
    "mean_point",
    "pair_laws",
    "parsed",
    "pistons",
    "roughness",
    "shape_of",
    "shaped_walls",
]

SHAPES = ("plane", "cylinder", "sphere", "cone", "mesh", "surface")
"""Keys of which a wall of its own has one; an entry without them sets properties of a wall of the box."""


class SceneFault(Exception):
    """An error in a recorded scene."""


_LOOSE = frozenset("additionalProperties const default description enum format title".split())
"""Of the schema, what a file may differ in: later versions and plug-ins add keys and names."""
_DRAFT_7 = {"oneOf": "anyOf", "prefixItems": "items"}
"""Words of the schema for fastjsonschema: several choices may fit, and lists of items have their older name."""
_ELSEWHERE = ("SpeciesConfig", "ParticleConfig", "WallConfig")
"""Tables of which no key is needed: numbers and sizes of particles are datasets of the file."""
_INFINITE = frozenset({"friction", "mass"})
"""Keys whose values may be infinite."""
_DIRECTIONS = (
    ("plane", "normal"), ("plane", "along"), ("cylinder", "axis"), ("cone", "axis"), ("motion", "direction"),
    ("rotation", "axis"),
)  # fmt: skip
"""Keys of walls that are directions."""


def parsed(text: str) -> dict[str, Any]:
    """The scene of a TOML text. Raises :class:`SceneFault`, with the key, the value and what is allowed."""
    try:
        scene = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise SceneFault(f"is not valid TOML: {brief(error)}") from None
    _check(scene)
    return scene


def shape_of(wall: dict[str, Any]) -> str | None:
    """Which of :data:`SHAPES` an entry of ``[[wall]]`` has; ``"rectangle"`` for a plane of finite extent.

    ``None`` for an entry that sets properties of a wall of the box.
    """
    key = next((key for key in SHAPES if key in wall), None)
    return "rectangle" if key == "plane" and "extent" in wall["plane"] else key


def shaped_walls(scene: dict[str, Any]) -> list[dict[str, Any]]:
    """The walls that follow those of the box, in the order of their rows: entries with a shape of their own."""
    return [wall for wall in scene.get("wall", ()) if shape_of(wall) is not None]


def pistons(scene: dict[str, Any]) -> list[dict[str, Any]]:
    """The walls of finite mass, in the order of the file."""
    return [wall for wall in shaped_walls(scene) if "mass" in wall]


def mean_displacement(wall: dict[str, Any], time: float) -> list[float]:
    """``[3]`` how far a wall is at a time from where its shape has it [length]; without an oscillation."""
    # What moves a piston is in the frames.
    since = 0.0 if "mass" in wall else time - float(wall.get("reference_time", 0.0))
    offset, velocity = ([*map(float, wall.get(key, ())), 0.0, 0.0, 0.0][:3] for key in ("offset", "velocity"))
    return [x + v * since for x, v in zip(offset, velocity)]


def mean_point(wall: dict[str, Any], time: float) -> list[float]:
    """``[3]`` point of the plane of a wall at a time [length]; of one that oscillates, at its mean position."""
    point = [*map(float, wall["plane"]["point"]), 0.0, 0.0, 0.0][:3]
    return [x + moved for x, moved in zip(point, mean_displacement(wall, time))]


def constant(law: Any) -> float | None:
    """The coefficient of a law of restitution that does not depend on the approach speed; ``None`` for other laws."""
    if isinstance(law, (int, float)):
        return float(law)
    if isinstance(law, dict) and "model" not in law and len(set(law.get("values", ()))) == 1:
        return float(law["values"][0])
    return None


def law_name(law: Any) -> str:
    """A law of restitution in a few words: its coefficient, its model, or that it is a table, and what is added."""
    if (e := constant(law)) is not None:
        return f"{e:g}"
    if "added_speed" in law:
        return f"{law_name(law['restitution'])} and Δ = {law['added_speed']:g}"
    return str(law["model"]) if "model" in law else "table of speeds"


def law_of(scene: dict[str, Any], *entries: dict[str, Any], wall: bool = False) -> Any:
    """The law of restitution of a contact: that of the first table of ``entries`` (a pair, a wall) that has it, or
    ``contact``'s; of a ``wall``, its ``wall_restitution``.

    Where contacts add a speed Δ it is ``{"restitution": law, "added_speed": Δ}``.
    """
    contact = scene.get("contact", {})
    general = contact.get("restitution", 1.0)
    default = contact.get("wall_restitution", general) if wall else general
    law = next((table["restitution"] for table in entries if "restitution" in table), default)
    added = float(next((table["added_speed"] for table in [*entries, contact] if "added_speed" in table), 0.0))
    return {"restitution": law, "added_speed": added} if added else law


def pair_laws(scene: dict[str, Any]) -> list[Any]:
    """The laws of restitution of a scene between particles: the general one, and those of pairs, ``"sticks"`` for some.

    Pairs of a particle and a wall are among them.
    """
    pairs = scene.get("contact", {}).get("pair", ())
    return [law_of(scene), *("sticks" if pair.get("sticks") else law_of(scene, pair) for pair in pairs)]


def roughness(scene: dict[str, Any], *entries: dict[str, Any]) -> tuple[float, float]:
    """β and μ of a contact: those of the first table of ``entries`` (a pair, a wall) that has them, or ``contact``'s.

    β = -1 is a smooth contact; μ is infinite where β alone counts.
    """
    tables = [*entries, scene.get("contact", {})]

    def of(key: str, default: float) -> float:
        return float(next((table[key] for table in tables if key in table), default))

    return of("tangential_restitution", -1.0), of("friction", math.inf)


def is_rough(scene: dict[str, Any]) -> bool:
    """Whether some contact of a scene has tangential impulses."""
    own = [*scene.get("contact", {}).get("pair", ()), *scene.get("wall", ())]
    laws = [roughness(scene), *(roughness(scene, entry) for entry in own)]
    return any(beta > -1 and mu > 0 for beta, mu in laws)


@cache
def _schema() -> dict[str, Any]:
    """The JSON Schema of scenes without :data:`_LOOSE`; one choice alone stands for itself."""
    loosened = _loosened(schema())
    for name in _ELSEWHERE:
        loosened["$defs"][name].pop("required", None)
    return {**loosened, "$schema": "http://json-schema.org/draft-07/schema"}


def _loosened(node: Any, names: bool = False) -> Any:
    """A part of the schema; ``names``: its keys are names."""
    if isinstance(node, list):
        return [_loosened(one) for one in node]
    if not isinstance(node, dict):
        return node
    kept = {
        key if names else _DRAFT_7.get(key, key): _loosened(one, key in ("properties", "$defs") and not names)
        for key, one in node.items()
        if names or key not in _LOOSE
    }
    choices = kept.get("anyOf")
    return choices[0] if not names and choices and all(choice == choices[0] for choice in choices) else kept


@cache
def _validator() -> Callable[[Any], Any]:
    import fastjsonschema

    return fastjsonschema.compile(_schema(), use_default=False, use_formats=False)


def _check(scene: dict[str, Any]) -> None:
    import fastjsonschema

    try:
        _validator()(scene)
    except fastjsonschema.JsonSchemaValueException as error:
        path = [*error.path[1:]]
        if error.rule == "required":
            missing = next(name for name in error.definition["required"] if name not in error.value)
            raise SceneFault(f"{_shown([*path, missing])} is missing") from None
        raise SceneFault(f"{_shown(path)} = {brief(repr(error.value))}: must be {_words(error.definition)}") from None
    _check_numbers(scene, [])
    for k, wall in enumerate(scene.get("wall", ())):
        _check_wall(wall, k)


def _check_wall(wall: dict[str, Any], k: int) -> None:
    """Refuses directions of no length, and cones that are none."""
    given = [([key, name], wall[key][name]) for key, name in _DIRECTIONS if name in wall.get(key, {})]
    if "rotation" in wall.get("mesh", {}):
        given.append((["mesh", "rotation", "0"], wall["mesh"]["rotation"][0]))
    for path, vector in given:
        if not 0 < math.hypot(*vector[:3]) <= LARGEST:
            where = _shown(["wall", str(k), *path])
            raise SceneFault(f"{where} = {brief(repr(vector))}: must be a vector, not all of its numbers 0")
    if not wall.get("cone", {}).get("angle", 0.0) < math.pi / 2:
        raise SceneFault(f"wall[{k}].cone.angle = {wall['cone']['angle']:g}: must be below π/2")


def _check_numbers(node: Any, path: list[Any]) -> None:
    """Refuses numbers that cannot be computed with, and tables of restitution that are none."""
    if isinstance(node, dict):
        for key, value in node.items():
            _check_numbers(value, [*path, key])
        if "speeds" in node or ("values" in node and "model" not in node):
            _check_table(node, path)
    elif isinstance(node, list):
        for k, value in enumerate(node):
            _check_numbers(value, [*path, k])
    elif isinstance(node, (int, float)) and not abs(node) <= LARGEST:
        if math.isnan(node) or not (math.isinf(node) and path[-1] in _INFINITE):
            raise SceneFault(f"{_shown(path)} = {brief(repr(node))}: must be a number of up to {LARGEST:g}")


def _check_table(table: dict[str, Any], path: list[Any]) -> None:
    speeds, values = table.get("speeds", ()), table.get("values", ())
    if not (0 < len(speeds) == len(values) and all(low < high for low, high in pairwise(speeds))):
        must = "must be speeds in ascending order, and a value for each"
        raise SceneFault(f"{_shown(path)} = {brief(repr(table))}: {must}")


def _shown(path: Sequence[Any]) -> str:
    """A path as ``wall[0].plane.normal``."""
    parts = (f"[{part}]" if str(part).isdecimal() else f".{part}" for part in path)
    return "".join(parts).removeprefix(".") or "the scene"


def _words(definition: dict[str, Any]) -> str:
    """What a part of the schema allows."""
    if "$ref" in definition:
        definition = _schema()["$defs"][definition["$ref"].rsplit("/", 1)[-1]]
    if "anyOf" in definition:
        return " or ".join(dict.fromkeys(map(_words, definition["anyOf"])))
    kind = definition.get("type")
    if kind in ("number", "integer"):
        return f"{'a number' if kind == 'number' else 'a whole number'}{_range(definition)}"
    if kind == "array":
        least, most = definition.get("minItems"), definition.get("maxItems")
        count = "" if most is None else f"{least} to {most} " if least != most else f"{most} "
        return f"an array of {count}{_plural(definition.get('items', {}))}"
    return {"string": "text", "boolean": "true or false", "object": "a table"}.get(kind, "something else")


def _range(definition: dict[str, Any]) -> str:
    low, high, above = (definition.get(key) for key in ("minimum", "maximum", "exclusiveMinimum"))
    if above is not None:
        return f" above {above:g}" if high is None else f" in ({above:g}, {high:g}]"
    if low is None:
        return "" if high is None else f" of at most {high:g}"
    return f", {low:g} or more" if high is None else f" in [{low:g}, {high:g}]"


def _plural(definition: dict[str, Any] | list[Any]) -> str:
    if isinstance(definition, list):
        return "values"
    if "$ref" in definition:
        definition = _schema()["$defs"][definition["$ref"].rsplit("/", 1)[-1]]
    return {"number": "numbers", "string": "names", "object": "tables"}.get(definition.get("type", ""), "values")
