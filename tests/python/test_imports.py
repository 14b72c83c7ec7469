"""What is loaded when: `import haff`, --help and wrong arguments load no library, a figure loads what it draws with."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import haff
from patience import HANGS

HEAVY = ("numpy", "h5py", "pandas", "scipy", "matplotlib", "xarray", "freud")
INIT = Path(haff.__file__)


def loaded(code: str, *arguments: str) -> set[str]:
    """The libraries of `HEAVY` that are loaded after `code`, in a process of its own; `SystemExit` ends it as well."""
    program = (
        "import atexit, sys\n"
        f"found = lambda: ' '.join(m for m in {HEAVY!r} if m in sys.modules)\n"
        "atexit.register(lambda: sys.stderr.write('\\nloaded ' + found()))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program + code, *arguments], capture_output=True, text=True, check=False, timeout=HANGS
    )
    last = done.stderr.splitlines()[-1]
    assert last.startswith("loaded"), done.stderr
    return set(last.split()[1:])


def test_import_loads_no_library():
    assert loaded("import haff") == set()
    # The probe sees libraries.
    assert "numpy" in loaded("import haff; haff.analysis")


@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        *([command, "--help"] for command in ("plot", "export", "view")),
        *([command, "missing.h5"] for command in ("plot", "export", "view")),
        ["plot", "missing.h5", "--movie", "a.gif"],
        ["plot", "missing.h5", "--kind", "pie"],
        ["plot", "missing.h5", "--frames", "::2"],
        ["plot", ".", "--kind", "snapshot"],
    ],
    ids=" ".join,
)
def test_help_and_errors_of_arguments_load_no_library(arguments, tmp_path):
    assert loaded("from haff.command.main import main; sys.exit(main(sys.argv[1:]))", *arguments) == set()


@pytest.mark.long
@pytest.mark.parametrize("kind", ["temperature", "energy", "velocity", "losses", "snapshot"])
def test_figures_of_a_gas_load_numpy_h5py_and_matplotlib_only(files, kind, tmp_path):
    code = "from haff.command.main import main; sys.exit(main(sys.argv[1:]))"
    found = loaded(code, "plot", str(files["cooling"]), "--kind", kind, "-o", str(tmp_path))
    assert found == {"numpy", "h5py", "matplotlib"}
    assert (tmp_path / f"cooling-{kind}.png").exists()


def test_names_for_type_checkers_are_those_of_the_package():
    """The imports under TYPE_CHECKING, the table of `__getattr__` and `__all__` name the same."""
    tree = ast.parse(INIT.read_text(encoding="utf-8"))
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    seen: dict[str, str | None] = {}
    for node in block.body:
        if isinstance(node, ast.ImportFrom):
            seen |= {name.name: node.module for name in node.names}
    modules = {name for name, module in seen.items() if module is None}
    assert {name: module for name, module in seen.items() if module} == haff._MODULE
    assert sorted(seen) == sorted(haff.__all__) and modules == {"analysis", "mechanics", "theory"}


def test_every_name_is_the_one_of_its_module():
    for name in haff.__all__:
        value = getattr(haff, name)
        assert value.__name__ in (name, f"haff.{name}")
    assert dir(haff) == sorted([*haff.__all__, "__all__", "__doc__", "__file__", "__name__", "__path__", "__version__"])
    assert haff.__version__[0].isdigit()
    # A module does not hide the function of its name.
    from haff.command import sweeps

    assert haff.sweep is sweeps.sweep
    assert haff.figures.KINDS
    with pytest.raises(AttributeError, match="has no attribute 'tenperature'"):
        _ = haff.tenperature
    with pytest.raises(ImportError):
        exec("from haff import tenperature")


def test_star_import_brings_the_public_names():
    names: dict[str, object] = {}
    exec("from haff import *", names)
    assert set(haff.__all__) <= set(names)
