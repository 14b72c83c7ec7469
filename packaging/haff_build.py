"""How `pip install .` makes the wheel (PEP 517): maturin builds the Python package with its compiled module, and the
command `haff` rides along in the wheel's data, with its man pages and completions.

maturin puts either an extension or binaries into a wheel, never both (github.com/PyO3/maturin/issues/368).
"""

from __future__ import annotations

import json
import shutil
import subprocess
import tarfile
import tempfile
from email import message_from_bytes
from pathlib import Path

import maturin
from maturin import get_requires_for_build_sdist

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]

get_requires_for_build_wheel = maturin.get_requires_for_build_wheel
get_requires_for_build_editable = maturin.get_requires_for_build_editable

# As `tool.maturin.data` in pyproject.toml names it.
DATA = Path("target/wheel.data")
# Where shells look for completions, below share/.
COMPLETIONS = {
    "bash": "bash-completion/completions/haff",
    "fish": "fish/vendor_completions.d/haff.fish",
    "zsh": "zsh/site-functions/_haff",
}


def prepare_metadata_for_build_wheel(metadata_directory, config_settings=None):
    # maturin asks for the folder before there is anything to put into it.
    DATA.mkdir(parents=True, exist_ok=True)
    return maturin.prepare_metadata_for_build_wheel(metadata_directory, config_settings)


prepare_metadata_for_build_editable = prepare_metadata_for_build_wheel


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    gather_data()
    return maturin.build_wheel(wheel_directory, config_settings, metadata_directory)


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    gather_data()
    return maturin.build_editable(wheel_directory, config_settings, metadata_directory)


def build_sdist(sdist_directory, config_settings=None):
    """All of the repository: maturin would leave out the command, which the extension does not depend on."""
    listed = subprocess.run(["git", "ls-files", "-z"], stdout=subprocess.PIPE, text=True, check=True).stdout
    with tempfile.TemporaryDirectory() as folder:
        metadata = Path(folder) / prepare_metadata_for_build_wheel(folder) / "METADATA"
        name = f"haff-{message_from_bytes(metadata.read_bytes())['Version']}"
        with tarfile.open(Path(sdist_directory) / f"{name}.tar.gz", "w:gz") as archive:
            for path in filter(None, listed.split("\0")):
                archive.add(path, f"{name}/{path}")
            archive.add(metadata, f"{name}/PKG-INFO")
    return f"{name}.tar.gz"


def gather_data() -> None:
    """Builds the command and lays out what goes beside the package, as in the environment's root."""
    command = build_command()
    shutil.rmtree(DATA, ignore_errors=True)
    scripts = DATA / "scripts"
    scripts.mkdir(parents=True)
    shutil.copy2(command, scripts / command.name)
    share = DATA / "data" / "share"
    subprocess.run([command, "man", share / "man" / "man1"], check=True)
    for shell, place in COMPLETIONS.items():
        path = share / place
        path.parent.mkdir(parents=True)
        path.write_bytes(subprocess.run([command, "completions", shell], stdout=subprocess.PIPE, check=True).stdout)


def build_command() -> Path:
    """Builds `haff` with the features of the extension, which then needs no other build; strips it."""
    cargo = ["cargo", "rustc", "--release", "--locked", "--features", "python", "--bin", "haff"]
    cargo += ["--message-format", "json-render-diagnostics"]
    built = subprocess.run([*cargo, "--", "-C", "strip=symbols"], stdout=subprocess.PIPE, text=True, check=False)
    if built.returncode != 0:
        raise SystemExit(f"cargo could not build the command haff (exit status {built.returncode}); see above")
    messages = map(json.loads, filter(None, built.stdout.splitlines()))
    return Path(next(m["executable"] for m in messages if m.get("executable")))
