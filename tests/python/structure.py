"""Which file of a crate names which other one, by its `use` lines and paths."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
USE = re.compile(r"^([ \t]*)(pub(?:\([^)]*\))?\s+)?use\s+([^;]+);", re.M)
PATH = re.compile(r"(?<![\w:])(?:crate|super|self)(?:::\w+)+")
TESTS = re.compile(r"#\[cfg\(test\)\]\s*(?:pub(?:\([^)]*\))?\s+)?mod \w+ \{")

Names = dict[Path, dict[Path, set[str]]]


def leaves(tree: str, prefix: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """The paths of a tree of `use`."""
    tree = re.sub(r"\s+as\s+\w+", "", tree.strip())
    if "{" not in tree:
        path = prefix + tuple(part.strip() for part in tree.split("::") if part.strip())
        yield path[:-1] if path and path[-1] == "self" and len(path) > 1 else path
        return
    head, _, rest = tree.partition("{")
    prefix += tuple(part.strip() for part in head.split("::") if part.strip())
    depth, start, inner = 0, 0, rest[: rest.rindex("}")]
    for at, letter in enumerate(inner + ","):
        depth += (letter == "{") - (letter == "}")
        if letter == "," and depth == 0:
            if inner[start:at].strip():
                yield from leaves(inner[start:at], prefix)
            start = at + 1


def code(path: Path) -> str:
    """The text of a Rust file without comments and without its tests."""
    text = re.sub(r"/\*.*?\*/", "", path.read_text(), flags=re.S)
    text = re.sub(r"//[^\n]*", "", text)
    tests = TESTS.search(text)
    return text[: tests.start()] if tests else text


class Crate:
    """The modules of a crate, and what each file takes from others."""

    def __init__(self, root: Path, main: str = "lib.rs") -> None:
        self.root, self.main = root, main
        outside = ("tests.rs", "build.rs", "bin", "examples")
        files = [path for path in root.rglob("*.rs") if not {*path.relative_to(root).parts} & {*outside}]
        self.modules = {self._module(path): path for path in files}
        self.code = {path: code(path) for path in files}
        # A face defines nothing, and only hands names on.
        self.handed = {path: self._handed(path) for path in files}

    def _module(self, path: Path) -> tuple[str, ...]:
        parts = path.relative_to(self.root).with_suffix("").parts
        if parts in (("lib",), ("main",)):
            return ()
        return parts[:-1] if parts[-1] == "mod" else parts

    def _handed(self, path: Path) -> dict[str, tuple[str, ...]]:
        module, names = self._module(path), {}
        for indent, visibility, tree in USE.findall(self.code[path]):
            for leaf in leaves(tree) if visibility and not indent else ():
                names[leaf[-1]] = self._absolute(leaf, module)
        return names

    def _absolute(self, path: tuple[str, ...], module: tuple[str, ...]) -> tuple[str, ...]:
        if path[0] == "crate":
            return path[1:]
        if path[0] == "self":
            return module + path[1:]
        while path and path[0] == "super":
            module, path = module[:-1], path[1:]
            if not path or path[0] != "super":
                return module + path
        return module + path

    def owner(self, path: tuple[str, ...]) -> tuple[Path, str] | None:
        """The file that defines what a path from the root of the crate names, and the name there."""
        for length in range(len(path), -1, -1):
            file = self.modules.get(path[:length])
            if file is None:
                continue
            name = path[length] if length < len(path) else ""
            target = self.handed[file].get(name)
            if target is not None and target != path:
                return self.owner(target) or (file, name)
            return file, name
        return None

    def names(self) -> Names:
        found: Names = defaultdict(lambda: defaultdict(set))
        for module, file in self.modules.items():
            text, paths = self.code[file], []
            for indent, visibility, tree in USE.findall(text):
                for leaf in leaves(tree):
                    if indent and leaf[0] == "super":
                        continue  # of a module within the file
                    local = (*module, leaf[0]) in self.modules
                    if not visibility and (leaf[0] in ("crate", "super", "self") or local):
                        paths.append(leaf)
            paths += [tuple(path.split("::")) for path in PATH.findall(USE.sub("", text))]
            for path in paths:
                owner = self.owner(self._absolute(path, module))
                if owner and owner[0] != file:
                    found[file][owner[0]].add(owner[1] or path[-1])
        return found


def crates() -> dict[str, Crate]:
    found = {path.parent.name: Crate(path) for path in sorted((ROOT / "crates").glob("*/src"))}
    return found | {"cli": Crate(ROOT / "crates" / "cli")}


def circles(names: Names) -> list[list[Path]]:
    """Sets of files each of which leads to all others."""
    index: dict[Path, int] = {}
    low: dict[Path, int] = {}
    stack: list[Path] = []
    found = []

    def visit(file: Path) -> None:
        index[file] = low[file] = len(index)
        stack.append(file)
        for other in sorted(names.get(file, ())):
            if other not in index:
                visit(other)
            if other in stack:
                low[file] = min(low[file], low[other])
        if low[file] == index[file]:
            at = stack.index(file)
            if len(stack) - at > 1:
                found.append(sorted(stack[at:]))
            del stack[at:]

    for file in sorted(names):
        if file not in index:
            visit(file)
    return found


def imports() -> Names:
    """The imports of the Python package, also those within functions and for types alone.

    The package itself hands names on when they are used: what it imports for types is the list of these.
    """
    package = ROOT / "python" / "haff"
    found: Names = defaultdict(lambda: defaultdict(set))

    def file_of(parts: tuple[str, ...]) -> Path | None:
        place = package.joinpath(*parts)
        files = (place.with_suffix(".py"), place / "__init__.py") if parts else (package / "__init__.py",)
        return next((path for path in files if path.is_file()), None)

    def visit(node: ast.AST, file: Path) -> None:
        if file == package / "__init__.py" and isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            return
        if isinstance(node, ast.ImportFrom) and (node.level or (node.module or "").split(".")[0] == "haff"):
            here = file.relative_to(package).parent.parts
            named = tuple((node.module or "").split(".")) if node.module else ()
            base = here[: len(here) - node.level + 1] + named if node.level else named[1:]
            for name in node.names:
                target = file_of((*base, name.name)) or file_of(base)
                if target is not None and target != file:
                    found[file][target].add(name.name)
        for child in ast.iter_child_nodes(node):
            visit(child, file)

    for file in package.rglob("*.py"):
        visit(ast.parse(file.read_text()), file)
    return found
