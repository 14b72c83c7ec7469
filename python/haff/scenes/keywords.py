"""Keywords that change keys of a scene, and the errors of scenes in the words of those who write them in Python.

Keywords are named with the value given, shortened, and a key that was meant becomes the keyword, or the entry of a
dict, to write.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ..errors import SceneError, SceneProblem
from ..text import brief, escaped, quoted

__all__ = ["Given", "dotted"]


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
        keyword = problem.set if problem.set in self.values else None
        if keyword is None:
            return problem if self.scene is None else _with_message(problem, self._message(problem, None))
        message = self._message(problem, keyword)
        text = self.written[keyword]
        shown = text if len(text) <= 80 else quoted(self.values[keyword])
        inside = ""
        if problem.key not in ("", keyword):
            inside = f"{brief(problem.key)}{'' if problem.value is None else f' = {brief(problem.value, 79)}'}: "
        return replace(problem, text=f"{brief(keyword)}={escaped(shown)}: {inside}{escaped(message)}", message=message)

    def _message(self, problem: SceneProblem, keyword: str | None) -> str:
        if keyword == problem.key == "output" and "file" in self.own:
            return f"{problem.message}; did you mean file={_short(self.values[keyword])}?"
        if problem.code != "unknown_key":
            return problem.message
        paths = [path.split(".") for path in problem.meant]
        if keyword is None:
            proposal = self._proposed_entry(problem.key, paths)
        else:
            proposal = self._proposed_keyword(problem.key, keyword, paths)
        if not proposal:
            return problem.message
        return f"unknown key; did you mean {proposal}? (allowed: {problem.allowed})"

    def _proposed_keyword(self, key: str, keyword: str, paths: Sequence[Sequence[str]]) -> str:
        value = _short(self.values[keyword]) if key == keyword else "…"
        names = difflib.get_close_matches(keyword, self.own, 1, 0.8)
        if not names and "." not in keyword:
            # One underscore for the dot, as in contact_restitution.
            known = _names(self.schema())
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


def _names(schema: Mapping[str, Any]) -> dict[str, str]:
    """All keys of scenes as keywords: without the numbers of arrays of tables, and with the number 0 for each."""
    found: dict[str, str] = {}

    def visit(node: Any, path: tuple[str, ...], numbered: tuple[str, ...]) -> None:
        # Keys nest at most four deep.
        if not isinstance(node, Mapping) or len(path) > 4:
            return
        if "$ref" in node:
            visit(schema["$defs"][node["$ref"].rsplit("/", 1)[-1]], path, numbered)
        for key, value in node.get("properties", {}).items():
            found.setdefault("__".join((*path, key)), "__".join((*numbered, key)))
            visit(value, (*path, key), (*numbered, key))
        visit(node.get("items"), path, (*numbered, "0"))
        for choices in ("anyOf", "oneOf", "allOf"):
            for choice in node.get(choices, ()):
                visit(choice, path, numbered)

    visit(schema, (), ())
    return found
