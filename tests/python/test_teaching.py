"""docs/teaching.md: every block of it runs, in order, and says what the page says."""

import re
import shlex
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs/teaching.md"


@pytest.mark.physics
def test_the_page_runs_from_top_to_bottom(command, tmp_path, monkeypatch, capsys):
    (tmp_path / "configs").symlink_to(PAGE.parents[1] / "configs")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```(\w+)\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    assert len(blocks) > 15 and {language for language, _ in blocks} == {"sh", "python"}
    names: dict[str, object] = {}
    for language, text in blocks:
        if language == "python":
            exec(compile(text, f"{PAGE.name}:\n{text}", "exec"), names)
            continue
        for line in text.splitlines():
            program, *arguments = shlex.split(line)
            assert program == "haff"
            command(*arguments)
    assert "e = 0.800 ± 0.002" in capsys.readouterr().out
    assert (tmp_path / "figures/ball-closed_form.png").exists()
