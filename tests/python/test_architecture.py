"""ARCHITECTURE.md and CONTRIBUTING.md name what exists: each name in code style is a file or occurs in the sources."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = ("crates", "python", "tests", "benches", "packaging", "scripts", "docs", "configs")
CRATES = ("crates/engine/src", "crates/linkage/src", "crates/scene/src")
PLACES = ("", "crates", *CRATES, "python/haff", "benches", "docs", "tests")
# Commands and formats of others, and names of operators.
FOREIGN = {"target", "debug", "cargo", "clippy", "fmt", "deny", "pip", "install", "ruff", "pytest", "lib_engine", "so"}


def _sources() -> set[str]:
    words: set[str] = set()
    for folder in FOLDERS:
        for path in (ROOT / folder).rglob("*"):
            known = path.suffix in {".rs", ".py", ".toml", ".js", ".md", ""} and path.is_file()
            if known and path.stat().st_size < 500_000:
                words |= set(re.findall(r"[A-Za-z_][A-Za-z0-9_]*", path.read_text(errors="replace")))
    return words


def _exists(path: str) -> bool:
    return any((ROOT / place / path).exists() or list((ROOT / place).glob(path + ".*")) for place in PLACES)


@pytest.mark.parametrize("page", ["ARCHITECTURE.md", "CONTRIBUTING.md"])
def test_names_in_code_style_exist(page):
    text = re.sub(r"```.*?```", "", (ROOT / page).read_text(), flags=re.S)
    known, unknown = _sources(), []
    for name in set(re.findall(r"`([^`\n]+)`", text)):
        if " " in name or "=" in name or "<" in name or name.endswith(".so") or name.startswith("target/"):
            continue  # commands, values and what a build makes
        if "/" in name and _exists(name.rstrip("/")):
            continue
        parts = [part for part in re.findall(r"[A-Za-z_][A-Za-z0-9_]*", name) if part not in FOREIGN]
        if "/" in name or [part for part in parts if part not in known]:
            unknown.append(name)
    assert not unknown, f"{page}: {sorted(unknown)}"


def test_examples_of_contributing_are_compiled_ones():
    text = (ROOT / "CONTRIBUTING.md").read_text()
    quoted = re.findall(r"<!-- (\S+\.rs) -->\n```rust\n(.*?)```", text, flags=re.S)
    assert len(quoted) == text.count("```rust") >= 5
    for path, code in quoted:
        assert code in (ROOT / path).read_text(), f"CONTRIBUTING.md: the example is not the one of {path}"
