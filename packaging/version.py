"""The version, which stands in Cargo.toml: whether all that name it agree, and what is new in it.

python packaging/version.py              that of Cargo.toml; CITATION.cff and CHANGELOG.md must have it
python packaging/version.py v0.1.0       so must this tag, and the changelog must have a date for it
python packaging/version.py --notes      its part of the changelog
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent


def version() -> str:
    workspace = (ROOT / "Cargo.toml").read_text(encoding="utf-8").split("[workspace.package]", 1)[1]
    return re.search(r'^version = "([^"]+)"', workspace, re.MULTILINE)[1]


def section(of: str) -> tuple[str, str]:
    """Head and text of the part of the changelog about a version."""
    parts = re.split(r"^## ", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    found = [part for part in parts if re.search(rf"(?<![\d.]){re.escape(of)}(?![\d.])", part.split("\n", 1)[0])]
    if len(found) != 1:
        raise SystemExit(f"CHANGELOG.md: {len(found)} parts about {of}, there must be one")
    head, text = found[0].split("\n", 1)
    return head, text.strip()


def check(tag: str | None) -> None:
    own = version()
    if f"\nversion: {own}\n" not in (ROOT / "CITATION.cff").read_text(encoding="utf-8"):
        raise SystemExit(f"CITATION.cff: another version than {own} of Cargo.toml")
    head, _ = section(own)
    if tag is not None:
        if tag != f"v{own}":
            raise SystemExit(f"tag {tag}: Cargo.toml has the version {own}")
        if not re.fullmatch(rf"{re.escape(own)} \(\d{{4}}-\d\d-\d\d\)", head):
            raise SystemExit(
                f"CHANGELOG.md: {head!r}, must be {own} with the date of the release, as 0.1.0 (2026-12-01)"
            )
    print(own)


if __name__ == "__main__":
    if sys.argv[1:] == ["--notes"]:
        print(section(version())[1])
    else:
        check(sys.argv[1] if len(sys.argv) > 1 else None)
