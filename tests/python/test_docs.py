"""Code in the README, docs/ and notebooks runs, page by page, in order.

`toml` blocks with a `title` become that file, others must be TOML; `sh` blocks run with the command on the path,
`python` blocks share their names within a page. `text` and blocks after `<!-- not run: why -->` are skipped.
"""

import importlib
import io
import json
import os
import re
import subprocess
import sys
from contextlib import redirect_stdout
from pathlib import Path

import pytest

import haff
from conftest import ROOT, executable
from patience import HANGS

pytestmark = pytest.mark.physics

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    import tomli as tomllib

FENCE = re.compile(
    r"(?P<skip><!-- not run: [^>]+ -->\n)?^```(?P<language>\w+)(?P<options>[^\n]*)\n(?P<code>.*?)^```$",
    flags=re.MULTILINE | re.DOTALL,
)
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("**/*.md"))]
LANGUAGES = {"python", "sh", "text", "toml"}


def blocks(page: Path):
    """Line, language, options and code of the blocks that run."""
    text = page.read_text()
    for match in FENCE.finditer(text):
        if not match["skip"]:
            yield text.count("\n", 0, match.start("code")), match["language"], match["options"], match["code"]


def with_code(page: Path) -> bool:
    return any(language in ("python", "sh", "toml") for _, language, _, _ in blocks(page))


@pytest.mark.long
@pytest.mark.parametrize("page", list(filter(with_code, PAGES)), ids=lambda page: str(page.relative_to(ROOT)))
def test_code_of_the_page_runs(page, tmp_path, monkeypatch):
    folder = tmp_path / "bin"
    folder.mkdir()
    (folder / "haff").symlink_to(executable())
    (folder / "python").symlink_to(sys.executable)
    (folder / "python3").symlink_to(sys.executable)
    # `haff plot` calls the Python beside it; a symlinked one finds its packages by these variables.
    environment = os.environ | {
        "PATH": f"{folder}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": os.pathsep.join([str(Path(haff.__file__).parents[1]), *sys.path[1:]]),
        "MPLBACKEND": "Agg",
    }
    monkeypatch.chdir(tmp_path)
    (tmp_path / "configs").symlink_to(ROOT / "configs")
    names: dict[str, object] = {"__name__": "__main__"}
    for line, language, options, code in blocks(page):
        location = f"{page.relative_to(ROOT)}:{line}"
        assert language in LANGUAGES, f"{location}: {language}?"
        if language == "toml":
            tomllib.loads(code)
            if title := re.search(r'title="([^"]+)"', options):
                Path(title[1]).write_text(code)
        elif language == "sh":
            shell = ["bash", "-euo", "pipefail", "-c", code]
            done = subprocess.run(shell, env=environment, capture_output=True, text=True, timeout=HANGS, check=False)
            assert done.returncode == 0, f"{location}: exit {done.returncode}\n{code}\n{done.stdout}{done.stderr}"
        elif language == "python":
            exec(compile(code, location, "exec"), names)


@pytest.mark.long
@pytest.mark.parametrize("notebook", sorted((ROOT / "examples").glob("*.ipynb")), ids=lambda path: path.name)
def test_cells_of_the_notebook_run(notebook, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "__main__"}
    cells = [cell for cell in json.loads(notebook.read_text())["cells"] if cell["cell_type"] == "code"]
    for number, cell in enumerate(cells, 1):
        # Lines such as %matplotlib are Jupyter's.
        code = "".join(line for line in cell["source"] if not line.startswith("%"))
        with redirect_stdout(io.StringIO()) as printed:
            exec(compile(code, f"{notebook.name}:{number}", "exec"), names)
        assert cell["outputs"] or "import" in code, f"{notebook.name}:{number} has not been run"
        stored = "".join(line for output in cell["outputs"] for line in output.get("text", ()))
        # Only sums of energies may differ in their last bits between machines.
        lines = [
            [line for line in text.splitlines() if "residual" not in line] for text in (stored, printed.getvalue())
        ]
        assert lines[0] == lines[1], f"{notebook.name}:{number} must be run again"
    assert cells


def test_reference_pages_are_those_of_the_command(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "packaging")
    reference = importlib.import_module("reference")
    monkeypatch.setenv("HAFF", str(executable()))
    pages = reference.pages()
    assert {page.name for page in reference.PAGES.glob("*.md")} == {*pages, "python.md"}
    for name, text in pages.items():
        page = reference.PAGES / name
        assert page.read_text(encoding="utf-8") == text, f"{page}: `python packaging/reference.py` writes it again"


def test_code_blocks_are_found():
    found = [language for page in PAGES for _, language, _, _ in blocks(page)]
    assert min(found.count("sh"), found.count("python")) > 5, found
