"""Links between the pages of the repository, and the paths of records that sources name, lead to what is there."""

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"\]\((?P<target>[^)\s]+)\)")
HEADING = re.compile(r"^#+ (.+)$", flags=re.MULTILINE)
FENCE = re.compile(r"^```.*?^```$", flags=re.MULTILINE | re.DOTALL)
RECORD = re.compile(r"benches/record/[\w./-]*\w")


def tracked() -> list[str]:
    done = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.skip("not a git checkout")
    return [name for name in done.stdout.splitlines() if (ROOT / name).is_file()]


def anchor(heading: str) -> str:
    """The anchor of a heading, on the site and on a forge."""
    return re.sub(r"\s", "-", re.sub(r"[^\w\s-]", "", heading.replace("`", "").lower()).strip())


def test_links_between_pages_lead_to_files_and_headings():
    broken = []
    for page in [name for name in tracked() if name.endswith(".md")]:
        for match in LINK.finditer(FENCE.sub("", (ROOT / page).read_text(encoding="utf-8"))):
            path, _, heading = match["target"].partition("#")
            if "://" in path or path.startswith("mailto:"):
                continue
            target = (ROOT / page).parent / path if path else ROOT / page
            if not target.exists():
                broken.append(f"{page}: {match['target']} does not exist")
            elif heading and heading not in map(anchor, HEADING.findall(target.read_text(encoding="utf-8"))):
                broken.append(f"{page}: {match['target']} has no such heading")
    assert not broken, "\n".join(broken)


def test_records_named_in_sources_and_pages_exist():
    missing = []
    for name in tracked():
        if name.startswith("benches/record/") or Path(name).suffix not in {".md", ".rs", ".py", ".toml", ".yml", ""}:
            continue
        for path in RECORD.findall((ROOT / name).read_text(encoding="utf-8")):
            # `scripts/validate` writes validation.{json,md,png}: the brace ends the path.
            if not ((ROOT / path).exists() or list((ROOT / path).parent.glob(f"{Path(path).name}.*"))):
                missing.append(f"{name}: {path}")
    assert not missing, "\n".join(missing)
