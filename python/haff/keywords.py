"""Keywords that change keys of a scene, and the errors of scenes in the words of those who write them in Python.

The reader of scenes says what is wrong as a user of the command needs it: overrides as text, the key that was meant by
its dotted path. Here keywords are named with the value given, shortened, and a key that was meant becomes the keyword,
or the entry of a dict, to write.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from .errors import SceneError, SceneProblem
from .text import brief, escaped, quoted

__all__ = ["Given", "dotted"]

_LISTS = frozenset("species particle wall pendulum spring rod drive contact.pair".split())
"""Arrays of tables, whose entries a path names by their numbers."""
_UNKNOWN = re.compile(r"unknown key(?:; did you mean (?P<meant>.*?)\?)?(?P<allowed> \(allowed: .*\))?$", re.DOTALL)
_MEANT = re.compile(r"`([^`]+)`(, above all tables)?")


def dotted(overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Keywords as dotted keys of a scene: two underscores stand for the dot."""
    return {name.replace("__", "."): value for name, value in overrides.items()}


@dataclass(frozen=True)
class Given:
    """What a caller has given, for errors in its words."""

    scene: Mapping[str, Any] | None
    """The scene if it is a dict; ``None`` if it is a file, whose errors remain as they are."""
    values: Mapping[str, Any]
    """Values of keywords by dotted key."""
    written: Mapping[str, str]
    """The same as TOML."""
    own: Sequence[str]
    """Names of the arguments of the function called, one of which a misspelled keyword may stand for."""
    schema: Callable[[], Mapping[str, Any]]
    """Gives the JSON Schema of scenes; called if a key is unknown."""

    def retold(self, error: SceneError) -> SceneError:
        """The error in the words of Python."""
        return SceneError([self._retold(problem) for problem in error.problems])

    def _retold(self, problem: SceneProblem) -> SceneProblem:
        keyword = self._keyword(problem)
        if keyword is None:
            return problem if self.scene is None else _with_message(problem, self._message(problem, None))
        message = self._message(problem, keyword)
        text = self.written[keyword]
        shown = text if len(text) <= 80 else quoted(self.values[keyword])
        inside = ""
        if problem.key not in ("", keyword):
            inside = f"{brief(problem.key)}{'' if problem.value is None else f' = {brief(problem.value, 79)}'}: "
        return replace(problem, text=f"{brief(keyword)}={escaped(shown)}: {inside}{escaped(message)}", message=message)

    def _keyword(self, problem: SceneProblem) -> str | None:
        """The dotted key of the keyword that a problem is about; ``None`` if it is about the scene."""
        if problem.line is not None:
            return None
        # The reader cuts long texts.
        return next((key for key in self.values if problem.text.startswith(f"{escaped(key)}="[:70])), None)

    def _message(self, problem: SceneProblem, keyword: str | None) -> str:
        found = _UNKNOWN.match(problem.message)
        if found is None:
            if keyword == problem.key == "output" and "file" in self.own:
                return f"{problem.message}; did you mean file={_short(self.values[keyword])}?"
            return problem.message
        paths = _meant(problem.key, found["meant"])
        if keyword is None:
            proposal = self._proposed_entry(problem.key, paths)
        else:
            proposal = self._proposed_keyword(problem.key, keyword, paths)
        return f"unknown key{proposal and f'; did you mean {proposal}?'}{found['allowed'] or ''}"

    def _proposed_keyword(self, key: str, keyword: str, paths: Sequence[Sequence[str]]) -> str:
        value = _short(self.values[keyword]) if key == keyword else "…"
        names = difflib.get_close_matches(keyword, self.own, 1, 0.8)
        if not names and "." not in keyword:
            # One underscore for the dot, as in contact_restitution.
            known = {"__".join(path): "__".join(_numbered(path)) for path in _paths(self.schema())}
            names = [known[name] for name in difflib.get_close_matches(keyword, known, 1, 0.9)]
        return " or ".join(f"{name}={value}" for name in names or ["__".join(path) for path in paths])

    def _proposed_entry(self, key: str, paths: Sequence[Sequence[str]]) -> str:
        value = _at(self.scene, key.split("."))
        return " or ".join(_entry(path, value) for path in paths)


def _with_message(problem: SceneProblem, message: str) -> SceneProblem:
    end = escaped(problem.message)
    if message == problem.message or not problem.text.endswith(end):
        return problem
    return replace(problem, text=problem.text.removesuffix(end) + escaped(message), message=message)


def _short(value: Any) -> str:
    """A value in a proposal."""
    return quoted(value, 40)


def _meant(key: str, hint: str | None) -> list[list[str]]:
    """Paths of the keys that a hint names; ``key`` is the unknown one."""
    table = key.split(".")[:-1]
    paths = []
    for name, above in _MEANT.findall(hint or ""):
        parts = name.split(".")
        if not above and (len(parts) == 1 or parts[:-1] == [part for part in table if not part.isdecimal()]):
            # Of the same table.
            paths.append([*table, parts[-1]])
        else:
            paths.append(list(_numbered(parts)))
    return paths


def _numbered(parts: Sequence[str]) -> Iterator[str]:
    """A path with the number 0 after each array of tables."""
    for depth, part in enumerate(parts, 1):
        yield part
        if ".".join(parts[:depth]) in _LISTS and depth < len(parts):
            yield "0"


def _entry(path: Sequence[str], value: str) -> str:
    """``"contact": {"restitution": 0.9}``."""
    first, *rest = path
    if not rest:
        return f'"{first}": {value}'
    if rest[0].isdecimal():
        return f'"{first}": [{{{_entry(rest[1:], value)}}}]'
    return f'"{first}": {{{_entry(rest, value)}}}'


def _at(node: Any, path: Sequence[str]) -> str:
    """The value at a path of a scene; an ellipsis where it is not found."""
    for part in path:
        if isinstance(node, Mapping) and part in node:
            node = node[part]
        elif isinstance(node, Sequence) and part.isdecimal() and int(part) < len(node):
            node = node[int(part)]
        else:
            return "…"
    return _short(node)


def _paths(schema: Mapping[str, Any]) -> set[tuple[str, ...]]:
    """Paths of all keys of scenes, without the numbers of arrays."""
    found: set[tuple[str, ...]] = set()

    def visit(node: Any, path: tuple[str, ...]) -> None:
        # Keys nest at most four deep.
        if not isinstance(node, Mapping) or len(path) > 4:
            return
        if "$ref" in node:
            visit(schema["$defs"][node["$ref"].rsplit("/", 1)[-1]], path)
        for key, value in node.get("properties", {}).items():
            found.add((*path, key))
            visit(value, (*path, key))
        visit(node.get("items"), path)
        for choices in ("anyOf", "oneOf", "allOf"):
            for choice in node.get(choices, ()):
                visit(choice, path)

    visit(schema, ())
    return found
