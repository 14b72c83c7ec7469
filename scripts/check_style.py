#!/usr/bin/env python3
"""Checks of style that rustfmt and ruff do not make.

* Comments in Rust sources are at most 110 characters wide, the ``max_width`` of rustfmt.toml, which rustfmt does
  not apply to comments. Rows of Markdown tables and lines with a URL are exempt, since they cannot be wrapped.
* Sources and pages contain no word of ``PERSONS``: particles and programs are not persons.
* A file that they name in backquotes is there, from the root or from that of their crate, unless a build makes it.

Prints one line per finding, ``file:line: message``, and exits with status 1 if there are any.

    python3 scripts/check_style.py
"""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

WIDTH = 110
"""Largest width of a line with a comment [characters]."""

COMMENTED = ("crates", "tests", "benches")
"""Folders whose Rust sources are checked for the width of comments."""

PERSONS = ("nobody", "somebody", "everybody", "anybody", "whom", "whoever")
"""Words for persons, which must not occur."""

WORDED = ("crates", "python", "scripts", "docs", "tests", "benches", "README.md", "CONTRIBUTING.md", "CHANGELOG.md")
"""Files and folders that are checked for these words."""

EXEMPT = ("scripts/check_style.py", "python/haff/viewer/vendor/")
"""Files and folders with these words: this list of them, and licenses of third parties."""

PATH = re.compile(r"`((?:python|crates|tests|benches|scripts|packaging|configs|docs|examples)/[\w./-]+\.\w+)`")
"""A file that is named."""

TOKEN = re.compile(
    r"""
      (?P<line>//[^\n]*)
    | (?P<open>/\*) | (?P<close>\*/)
    | b?r(?P<hashes>\#*)".*?"(?P=hashes)  # raw string
    | b?"(?:[^"\\]|\\.)*"                 # string
    | b?'(?:[^'\\\n]|\\[^\n][^'\n]*)'     # character; what it does not match is a lifetime
    | \w+                                 # so that no name ends in a prefix of a string
    """,
    re.VERBOSE | re.DOTALL,
)


def files(places: tuple[str, ...]) -> list[Path]:
    """Returns the files of the repository at these places that git does not ignore, relative to its root."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", "--", *places]
    listed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return [path for path in map(Path, sorted(set(listed.split("\0")) - {""})) if (ROOT / path).is_file()]


def comments(source: str) -> Iterator[tuple[int, int]]:
    """Yields the first and last line, counted from 1, of each comment in a Rust source."""
    position, depth, start = 0, 0, 0
    while match := TOKEN.search(source, position):
        position = match.end()
        if depth > 0 and match["open"] is None and match["close"] is None:
            # Within a block comment only its delimiters count.
            position = match.start() + 1
        elif match["line"] is not None:
            line = source.count("\n", 0, match.start()) + 1
            # A comment that begins beyond the width follows a long string, which rustfmt leaves alone.
            if match.start() - (source.rfind("\n", 0, match.start()) + 1) < WIDTH:
                yield line, line
        elif match["open"] is not None:
            start = match.start() if depth == 0 else start
            depth += 1
        elif match["close"] is not None and depth > 0:
            depth -= 1
            if depth == 0:
                yield source.count("\n", 0, start) + 1, source.count("\n", 0, position) + 1


def is_exempt(line: str) -> bool:
    """Whether a line cannot be wrapped: it has a URL, or is a row of a table."""
    return "://" in line or line.strip().lstrip("/!* ").startswith("|")


def wide_comments(path: Path, source: str) -> Iterator[str]:
    """Yields a finding for each line of a comment that is too wide."""
    lines = source.split("\n")
    for first, last in comments(source):
        for number in range(first, last + 1):
            line = lines[number - 1]
            if len(line) > WIDTH and not is_exempt(line):
                yield f"{path}:{number}: comment of {len(line)} characters, at most {WIDTH} are allowed"


def persons(path: Path, source: str) -> Iterator[str]:
    """Yields a finding for each line with a word for a person."""
    pattern = re.compile(rf"\b(?:{'|'.join(PERSONS)})\b", re.IGNORECASE)
    for number, line in enumerate(source.split("\n"), 1):
        if found := pattern.search(line):
            yield f'{path}:{number}: "{found[0]}": name the particle, program or user instead'


def is_ignored(name: str) -> bool:
    """Whether git ignores a file: it is made by a build."""
    return subprocess.run(["git", "check-ignore", "--quiet", name], cwd=ROOT).returncode == 0


def missing(path: Path, source: str) -> Iterator[str]:
    """Yields a finding for each file that is named and is not there."""
    roots = [ROOT, *(ROOT / parent for parent in path.parents if (ROOT / parent / "Cargo.toml").is_file())]
    for number, line in enumerate(source.split("\n"), 1):
        for name in PATH.findall(line):
            if not any((root / name).exists() for root in roots) and not is_ignored(name):
                yield f"{path}:{number}: {name}: there is no such file"


def findings() -> Iterator[str]:
    """Yields all findings, those of one check after those of the other."""
    for path in files(COMMENTED):
        if path.suffix == ".rs":
            yield from wide_comments(path, (ROOT / path).read_text(encoding="utf-8"))
    for path in files(WORDED):
        if not path.as_posix().startswith(EXEMPT):
            # Files that are not text have no words.
            source = (ROOT / path).read_bytes().decode("utf-8", errors="replace")
            yield from persons(path, source)
            if path.suffix in {".rs", ".py", ".js", ".md"}:
                yield from missing(path, source)


def main() -> int:
    """Prints the findings; returns the exit status."""
    found = list(findings())
    print("\n".join(found), end="\n" if found else "")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
