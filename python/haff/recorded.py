"""The scene recorded in a file. It may come from another program, so every value used is checked first."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .column import LARGEST
from .layout import AXES
from .text import brief

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    import tomli as tomllib  # type: ignore[no-redef]

if TYPE_CHECKING:
    from .reader import File

__all__ = [
    "SceneFault",
    "constant",
    "is_rough",
    "law_name",
    "mean_point",
    "pair_laws",
    "parsed",
    "roughness",
    "shaped_walls",
]


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


def _is_fraction(value: Any) -> bool:
    return _is_number(value) and 0 <= value <= 1


def _is_law(value: Any) -> bool:
    if isinstance(value, dict):
        return _is_table(value) if "model" not in value else isinstance(value["model"], str)
    return _is_fraction(value)


def _is_count(value: Any) -> bool:
    # TOML has integers and floats; scenes may write 10 as 1e1.
    return _is_number(value) and value == int(value) and 1 <= value <= 1e6


def _is_table(value: dict[str, Any]) -> bool:
    """Whether these are approach speeds in ascending order, and a coefficient of restitution for each."""
    speeds, values = value.get("speeds"), value.get("values")
    if not (isinstance(speeds, list) and isinstance(values, list) and 0 < len(speeds) == len(values)):
        return False
    rising = all(map(_is_number, speeds)) and all(low < high for low, high in pairwise(speeds))
    return rising and speeds[0] >= 0 and all(map(_is_fraction, values))


def _is_tangential(value: Any) -> bool:
    return _is_number(value) and -1 <= value <= 1


def _is_friction(value: Any) -> bool:
    # Infinite where only the tangential restitution counts.
    return isinstance(value, (int, float)) and not isinstance(value, bool) and value >= 0


def _is_axis(value: Any) -> bool:
    return isinstance(value, str) and value in AXES


def _are_texts(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(one, str) for one in value)


_TEXT = _Value(lambda value: isinstance(value, str), "text")
_FLAG = _Value(lambda value: isinstance(value, bool), "true or false")
_NUMBER = _Value(_is_number, "a number")
_AXIS = _Value(_is_axis, "x, y or z")
_POSITIVE = _Value(lambda value: _is_number(value) and value > 0, "a positive number")
_NOT_NEGATIVE = _Value(lambda value: _is_number(value) and value >= 0, "a number, 0 or more")
_FRACTION = _Value(_is_fraction, "a number in [0, 1]")
_COUNT = _Value(_is_count, "a whole number from 1 to 1e6")
_VECTOR = _Value(_is_vector, "a vector of up to 3 numbers")
_DIRECTION = _Value(_is_direction, "a vector of up to 3 numbers, not all of them 0")
_LAW = _Value(_is_law, "a number in [0, 1], a table with a model, or one with speeds and values")
_TANGENTIAL = _Value(_is_tangential, "a number in [-1, 1]")
_FRICTION = _Value(_is_friction, "a number, 0 or more")
_TWO = _Value(lambda value: _are_texts(value) and len(value) == 2, "two names")
_NAMES = _Value(_are_texts, "a list of names")
_ENDS = _Value(lambda value: _are_texts(value) and len(value) in (1, 2), "one or two names")
_SIDES = _Value(lambda value: _are_texts(value) and len(value) <= 3, "up to 3 names of boundaries")
_DIMENSION = _Value(lambda value: value in (2, 3) and isinstance(value, int), "2 or 3")

_ROUGHNESS = {"tangential_restitution": _TANGENTIAL, "friction": _FRICTION}

# The keys that this package reads from a scene; other keys are not checked. A list of one table is an array of such
# tables, and "!" marks required keys.
_SCENE: dict[str, Any] = {
    "title": _TEXT,
    "dimension": _DIMENSION,
    "domain": {
        "boundary": _SIDES,
        "gravity": _VECTOR,
        "shear": {"flow!": _AXIS, "gradient!": _AXIS, "rate!": _NUMBER, "offset": _NUMBER},
    },
    "contact": {
        "restitution": _LAW,
        "wall_restitution": _LAW,
        "pair": [{"between!": _TWO, "restitution": _LAW, "sticks": _FLAG, **_ROUGHNESS}],
        "tc": _NOT_NEGATIVE,
        "rest_speed": _NOT_NEGATIVE,
        **_ROUGHNESS,
    },
    "initial": {"temperature": _NOT_NEGATIVE},
    "species": [{"name": _TEXT, "temperature": _NOT_NEGATIVE}],
    "particle": [{"name": _TEXT}],
    "wall": [
        {
            "name": _TEXT,
            "plane": {
                "point!": _VECTOR,
                "normal!": _DIRECTION,
                "hole": {"center!": _VECTOR, "radius!": _POSITIVE},
                "two-sided": _FLAG,
            },
            "velocity": _VECTOR,
            "reference_time": _NUMBER,
            "displacement": _NUMBER,
            "temperature": _POSITIVE,
            "motion": {"kind!": _TEXT, "amplitude!": _POSITIVE, "frequency!": _POSITIVE, "phase": _NUMBER},
            "restitution": _LAW,
            "sticks": _FLAG,
            **_ROUGHNESS,
        }
    ],
    "drive": [
        {
            "kind!": _TEXT,
            "temperature": _NOT_NEGATIVE,
            "strength": _NOT_NEGATIVE,
            "interval": _POSITIVE,
            "rate": _POSITIVE,
            "species": _NAMES,
        }
    ],
    "measure": {"profiles": [{"axis!": _TEXT, "interval!": _POSITIVE, "samples": _COUNT, "spread": _FLAG}]},
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


def mean_point(wall: dict[str, Any], time: float) -> list[float]:
    """``[3]`` point of the plane of a wall at a time [length]; of one that oscillates, at its mean position."""
    since = time - float(wall.get("reference_time", 0.0))
    point, velocity = (
        [*map(float, given), 0.0, 0.0, 0.0][:3] for given in (wall["plane"]["point"], wall.get("velocity", ()))
    )
    return [x + v * since for x, v in zip(point, velocity)]


def constant(law: Any) -> float | None:
    """The coefficient of a law of restitution that does not depend on the approach speed; ``None`` for other laws."""
    if isinstance(law, (int, float)):
        return float(law)
    if isinstance(law, dict) and "model" not in law and len(set(law.get("values", ()))) == 1:
        return float(law["values"][0])
    return None


def law_name(law: Any) -> str:
    """A law of restitution in a few words: its coefficient, its model, or that it is a table."""
    if (e := constant(law)) is not None:
        return f"{e:g}"
    return str(law["model"]) if "model" in law else "table of speeds"


def pair_laws(scene: dict[str, Any]) -> list[Any]:
    """The laws of restitution of a scene between particles: the general one, and those of pairs, ``"sticks"`` for some.

    Pairs of a particle and a wall are among them.
    """
    contact = scene.get("contact", {})
    general = contact.get("restitution", 1.0)
    own = ("sticks" if pair.get("sticks") else pair.get("restitution", general) for pair in contact.get("pair", ()))
    return [general, *own]


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


def packing_fraction(file: File) -> float:
    """Volume (area) of the particles over that of the box; NaN with open axes, whose size is a placeholder."""
    if "open" in file.box.boundary[: file.dimension]:
        return float("nan")
    d, r = file.dimension, file.radius
    volume = np.sum(4 / 3 * np.pi * r**3) if d == 3 else np.sum(np.pi * r**2)
    return float(volume / file.box.volume)
