"""The scene recorded in a file. It may come from another program, so every value used is checked first."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from .column import LARGEST
from .text import brief

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    import tomli as tomllib  # type: ignore[no-redef]

__all__ = ["SceneFault", "parsed"]


class SceneFault(Exception):
    """An error in a recorded scene."""


class _Value(NamedTuple):
    allowed: Callable[[Any], bool]
    words: str


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= LARGEST


def _is_vector(value: Any) -> bool:
    return isinstance(value, list) and len(value) <= 3 and all(map(_is_number, value))


def _is_direction(value: Any) -> bool:
    return _is_vector(value) and 0 < math.hypot(*value) <= LARGEST


def _is_law(value: Any) -> bool:
    model = isinstance(value, dict) and isinstance(value.get("model"), str)
    return model or (_is_number(value) and 0 <= value <= 1)


def _are_texts(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(one, str) for one in value)


_TEXT = _Value(lambda value: isinstance(value, str), "text")
_FLAG = _Value(lambda value: isinstance(value, bool), "true or false")
_NUMBER = _Value(_is_number, "a number")
_POSITIVE = _Value(lambda value: _is_number(value) and value > 0, "a positive number")
_VECTOR = _Value(_is_vector, "a vector of up to 3 numbers")
_DIRECTION = _Value(_is_direction, "a vector of up to 3 numbers, not all of them 0")
_LAW = _Value(_is_law, "a number in [0, 1] or a table with a model")
_TWO = _Value(lambda value: _are_texts(value) and len(value) == 2, "two names")
_ENDS = _Value(lambda value: _are_texts(value) and len(value) in (1, 2), "one or two names")
_SIDES = _Value(lambda value: _are_texts(value) and len(value) <= 3, "up to 3 names of boundaries")
_DIMENSION = _Value(lambda value: value in (2, 3) and isinstance(value, int), "2 or 3")

# The keys that this package reads from a scene; other keys are not checked. A list of one table is an array of such
# tables, and "!" marks required keys.
_SCENE: dict[str, Any] = {
    "title": _TEXT,
    "dimension": _DIMENSION,
    "domain": {"boundary": _SIDES, "gravity": _VECTOR},
    "contact": {
        "restitution": _LAW,
        "wall_restitution": _LAW,
        "pair": [{"between!": _TWO, "restitution": _LAW, "sticks": _FLAG}],
    },
    "species": [{"name": _TEXT}],
    "particle": [{"name": _TEXT}],
    "wall": [
        {
            "name": _TEXT,
            "plane": {"point!": _VECTOR, "normal!": _DIRECTION},
            "velocity": _VECTOR,
            "motion": {"kind!": _TEXT, "amplitude!": _POSITIVE, "frequency!": _POSITIVE, "phase": _NUMBER},
            "restitution": _LAW,
            "sticks": _FLAG,
        }
    ],
    "pendulum": [{"bob!": _TEXT, "pivot!": _VECTOR, "length": _POSITIVE}],
    "spring": [{"between!": _ENDS, "point": _VECTOR, "length": _NUMBER, "stiffness!": _POSITIVE}],
    "rod": [{"between!": _TWO, "length": _POSITIVE}],
}


def parsed(text: str) -> dict[str, Any]:
    """The scene of a TOML text. Raises :class:`SceneFault`, with the key, the value and what is allowed."""
    try:
        scene = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise SceneFault(f"is not valid TOML: {brief(error)}") from None
    _check(scene, _SCENE, "")
    return scene


def shaped_walls(scene: dict[str, Any]) -> list[dict[str, Any]]:
    """The walls that follow those of the box. Entries without a shape set properties of a wall of the box."""
    return [wall for wall in scene.get("wall", ()) if "plane" in wall]


def _check(value: Any, wanted: Any, key: str) -> None:
    if isinstance(wanted, _Value):
        if not wanted.allowed(value):
            raise SceneFault(f"{key} = {brief(repr(value))}: must be {wanted.words}")
    elif isinstance(wanted, list):
        if not isinstance(value, list):
            raise SceneFault(f"{key} = {brief(repr(value))}: must be an array of tables")
        for k, one in enumerate(value):
            _check(one, wanted[0], f"{key}[{k}]")
    else:
        if not isinstance(value, dict):
            raise SceneFault(f"{key} = {brief(repr(value))}: must be a table")
        for name, inner in wanted.items():
            plain = name.rstrip("!")
            path = f"{key}.{plain}" if key else plain
            if plain in value:
                _check(value[plain], inner, path)
            elif name != plain:
                raise SceneFault(f"{path} is missing")
