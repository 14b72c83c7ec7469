"""Scenes from Python: dicts as the TOML of scene files, overrides as keywords, starter scenes.

A scene is the same whether it stands in a file or in a dict: ``{"contact": {"restitution": 0.8}}`` is
``[contact] restitution = 0.8``. Every key is described in the reference of scene files (``haff schema``).

*What to change here.* How a scene in Python is written as TOML, or an error of it is told.

*May import* ``common``, ``files`` and ``reader``.

*Begin with* :func:`validate`, then :mod:`.keywords`.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from .. import reader
from ..common import arguments
from ..common.compiled import compiled, schema
from ..common.temporary import TemporaryFolder
from ..errors import (
    ArgumentError,
    FileError,
    MissingDataError,
    SceneError,
    SceneProblem,
    UnknownNameError,
)
from ..files import foreign
from ..text import brief, quoted
from .keywords import Given, dotted

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    import tomli as tomllib  # type: ignore[no-redef]

__all__ = ["Scene", "load_scene", "save_scene", "schema", "template", "templates", "validate"]

Scene: TypeAlias = "Mapping[str, Any] | str | os.PathLike[str]"
"""A scene: a dict with the keys of a scene file, or the path of one."""


class ProposedName(str):
    """Name of the output file in a template: :func:`haff.run` writes it only if it is told to."""

    __slots__ = ()


def source(scene: Scene, overrides: Mapping[str, Any]) -> dict[str, Any]:
    """The scene in the form that the compiled module takes: name, text, overrides, and whether the text is a file's."""
    if isinstance(scene, Mapping):
        name, text, has_file = "scene", scene_text(scene), False
    else:
        path = scene_path(scene)
        try:
            name, text, has_file = str(path), path.read_text(encoding="utf-8"), True
        except UnicodeDecodeError:
            problem = SceneProblem(f"{path}: not UTF-8 text", str(path), message="not UTF-8 text", code="not_text")
            raise SceneError([problem]) from None
        except OSError as error:
            name = str(path)
            hint = f'; haff.template("{name}") is a shipped scene of this name' if name in templates() else ""
            raise FileError(f"{path}: {error.strerror or error}{hint}") from None
    return {"name": name, "text": text, "overrides": settings(overrides), "has_file": has_file}


def scene_path(scene: object) -> Path:
    """The path of a scene that is no dict. Raises :class:`ArgumentError` otherwise."""
    if isinstance(scene, (str, bytes, os.PathLike)):
        return arguments.file("scene", scene)
    raise ArgumentError(f"scene = {quoted(scene)}: must be a dict, or the path of a scene file")


def settings(overrides: Mapping[str, Any]) -> list[str]:
    """Keywords as ``KEY=VALUE``: two underscores stand for the dot of a path."""
    with briefly():
        return [f"{key}={compiled().value(value, key)}" for key, value in dotted(overrides).items()]


@contextmanager
def briefly() -> Iterator[None]:
    """Shortens errors of values that TOML cannot hold: they quote the value."""
    try:
        yield
    except (TypeError, ValueError) as error:
        raise type(error)(brief(error, 150)) from None


@contextmanager
def explained(scene: Scene, overrides: Mapping[str, Any], own: Sequence[str] = ()) -> Iterator[None]:
    """Raises errors of the scene in the words of Python; ``own``: names of the caller's own arguments."""
    try:
        yield
    except SceneError as error:
        values = dotted(overrides)
        written = (text.partition("=")[2] for text in settings(overrides))
        given = Given(scene if isinstance(scene, Mapping) else None, values, dict(zip(values, written)), own, schema)
        raise given.retold(error) from None


def scene_text(scene: Mapping[str, Any]) -> str:
    """A scene as the text of a scene file, keys in the order of the dict.

    Raises :class:`TypeError` for a value that TOML cannot hold, naming its key.
    """
    if not isinstance(scene, Mapping):
        raise ArgumentError(f"scene = {quoted(scene)}: must be a dict")
    with briefly():
        return compiled().document(dict(scene))


def save_scene(scene: Mapping[str, Any], path: str | os.PathLike[str]) -> Path:
    """Write a scene to a TOML file, for ``haff run`` and :func:`haff.run`.

    Numbers, strings, booleans, lists, tuples, dicts, paths and NumPy arrays are allowed values. The scene is not
    checked: use :func:`validate` or ``haff check``.

    Examples
    --------
    >>> import haff
    >>> scene = haff.template("cooling")
    >>> scene["contact"]["restitution"] = 0.8
    >>> haff.save_scene(scene, "my_gas.toml")                             # doctest: +SKIP
    """
    path, text = arguments.file("path", path), scene_text(scene)
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise FileError(f"{path}: {error.strerror or error}") from None
    return path


def load_scene(path: str | os.PathLike[str]) -> dict[str, Any]:
    """A scene file as a dict, to be changed and run or saved. Comments are lost.

    Files of meshes that are beside the scene file get its folder, so that the dict can be run from anywhere.
    """
    given = source(arguments.file("path", path), {})
    try:
        scene = tomllib.loads(given["text"])
    except (ValueError, RecursionError) as error:
        problem = SceneProblem(f"{path}: {error}", str(path), message=str(error), code="syntax")
        raise SceneError([problem]) from None
    walls = scene.get("wall", ())
    for wall in walls if isinstance(walls, list) else ():
        mesh = wall.get("mesh") if isinstance(wall, dict) else None
        if isinstance(mesh, dict) and isinstance(mesh.get("file"), str) and not Path(mesh["file"]).exists():
            beside = Path(given["name"]).resolve().parent / mesh["file"]
            if beside.exists():
                mesh["file"] = str(beside)
    return scene


def validate(scene: Scene, /, **overrides: Any) -> dict[str, Any]:
    """Check a scene without running it; returns it with every default written out.

    Raises :class:`haff.SceneError` with all errors.
    """
    with explained(scene, overrides):
        return tomllib.loads(compiled().validate(source(scene, overrides)))


def templates() -> dict[str, str]:
    """Titles of the shipped scenes, by name; see :func:`template`."""
    return {name: title for name, title, _, _ in compiled().templates()}


def template(name: str) -> dict[str, Any]:
    """A shipped scene as a dict, to be changed and run.

    Its ``output.file`` is a proposal for ``haff run``: :func:`run` writes a temporary file instead, unless it is told
    where.

    Examples
    --------
    >>> import haff
    >>> haff.template("cooling")["contact"]
    {'restitution': 0.9}
    """
    found = {key: (text, files) for key, _, text, files in compiled().templates()}
    if not isinstance(name, str) or name not in found:
        near = difflib.get_close_matches(name, found) if isinstance(name, str) else []
        meant = f", did you mean {' or '.join(near)}?" if near else ""
        raise UnknownNameError(f"name = {quoted(name)}: no such template{meant}; haff.templates() has their names")
    text, files = found[name]
    scene = tomllib.loads(text)
    if files:
        _add_files(scene, dict(files))
    if "file" in scene.get("output", {}):
        scene["output"]["file"] = ProposedName(scene["output"]["file"])
    return scene


def _add_files(scene: dict[str, Any], files: Mapping[str, str]) -> None:
    """Writes the meshes of a scene to a folder that exists until Python ends."""
    for wall in scene.get("wall", ()):
        mesh = wall.get("mesh", {})
        if mesh.get("file") in files:
            path = _folder().path / Path(mesh["file"]).name
            path.write_text(files[mesh["file"]], encoding="utf-8")
            mesh["file"] = str(path)


@cache
def _folder() -> TemporaryFolder:
    return TemporaryFolder()


def recorded_state(path: str | os.PathLike[str], index: int = -1) -> dict[str, Any]:
    """A frame of an output file, or of one of another program, for scenes with ``positions = { file = … }``."""
    if Path(path).suffix.lower() in foreign.ENDINGS:
        return {"image": None, "angular_velocity": None, **foreign.read(path, index)._asdict()}
    with reader.open(path) as file:
        if len(file.frames) == 0:
            raise MissingDataError(f"{path}: no complete frame")
        if not -len(file.frames) <= index < len(file.frames):
            raise MissingDataError(f"{path}: has {len(file.frames)} frames; there is no frame {index}")
        frame = file.frames[index]
        spins = frame.angular_velocity
        return {
            "precision": 0.0,
            "size": np.asarray(frame.box.size, np.float64),
            # Where a sheared scene goes on, its images are displaced as in the file.
            "edges": None if file.shear is None else np.asarray(frame.box.edges, np.float64),
            "position": np.asarray(frame.position, np.float64),
            "velocity": np.asarray(frame.velocity, np.float64),
            "angular_velocity": None if spins is None else np.asarray(spins, np.float64),
            "image": np.asarray(frame.image, np.int32),
            "radius": np.asarray(frame.radius, np.float64),
            "mass": np.asarray(frame.mass, np.float64),
        }
