"""How `pip install .` makes the wheel (PEP 517): maturin builds the Python package with its compiled module, and the
command `haff` rides along in the wheel's data, with its man pages and completions.

maturin puts either an extension or binaries into a wheel, never both (github.com/PyO3/maturin/issues/368).
"""

from __future__ import annotations

import gzip
import json
import os
import shutil
import subprocess
import tarfile
import tempfile
from collections.abc import Mapping, Sequence
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
    if config := os.environ.get("HAFF_CARGO_CONFIG"):
        # The same build for the extension.
        os.environ["MATURIN_PEP517_ARGS"] = f"{os.environ.get('MATURIN_PEP517_ARGS', '')} --config {config}".strip()
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
        paths = {Path(path): f"{name}/{path}" for path in sorted(filter(None, listed.split("\0")))}
        time = int(os.environ.get("SOURCE_DATE_EPOCH", "315532800"))  # 1980, as of the files in a wheel
        write_archive(Path(sdist_directory) / f"{name}.tar.gz", paths | {metadata: f"{name}/PKG-INFO"}, time)
    return f"{name}.tar.gz"


def write_archive(target: Path, paths: Mapping[Path, str], time: int) -> None:
    """Files by their names in an archive, all of one time and of no owner: equal files give equal archives."""

    def plain(entry: tarfile.TarInfo) -> tarfile.TarInfo:
        entry.mtime, entry.uid, entry.gid, entry.uname, entry.gname = time, 0, 0, "", ""
        entry.mode = 0o755 if entry.mode & 0o100 else 0o644
        return entry

    with (
        open(target, "wb") as file,
        gzip.GzipFile("", "wb", fileobj=file, mtime=time) as packed,
        tarfile.open(mode="w", fileobj=packed, format=tarfile.PAX_FORMAT) as archive,
    ):
        for path, name in paths.items():
            archive.add(path, name, filter=plain)


def gather_data(cargo: Sequence[str] = ("cargo", "rustc"), environment: Mapping[str, str] | None = None) -> None:
    """Builds the command and lays out what goes beside the package, as in the environment's root."""
    command = build_command(cargo, environment)
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


def build_command(cargo: Sequence[str], environment: Mapping[str, str] | None) -> Path:
    """Builds `haff` with the features of the extension, which then needs no other build; strips it."""
    # A file of settings of cargo, such as packaging/tests.toml.
    config = os.environ.get("HAFF_CARGO_CONFIG")
    build = [
        *cargo,
        *(["--config", config] if config else []),
        "--release",
        "--locked",
        "--features",
        "python",
        "--bin",
        "haff",
    ]
    build += ["--message-format", "json-render-diagnostics", "--", "-C", "strip=symbols"]
    built = subprocess.run(build, stdout=subprocess.PIPE, text=True, check=False, env=environment)
    if built.returncode != 0:
        raise SystemExit(f"cargo could not build the command haff (exit status {built.returncode}); see above")
    messages = map(json.loads, filter(None, built.stdout.splitlines()))
    return Path(next(m["executable"] for m in messages if m.get("executable")))
