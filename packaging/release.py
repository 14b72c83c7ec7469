"""The files of a release: wheels, an sdist, the command alone without libraries, and their checksums.

`scripts/release` calls this in a clone of a commit. The libraries are built by zig, so that the wheel runs wherever
there is glibc 2.28 (manylinux_2_28), and by one build for all Pythons from 3.10 on (abi3). Paths, times and names of
this machine are kept out of the files, so that the same commit, the same versions of Rust and of packaging/release.txt
give the same bytes.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import haff_build

GLIBC = "2.28"
STATIC = ["README.md", "LICENSE-APACHE", "LICENSE-MIT", "CHANGELOG.md"]
"""Files beside the static command."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="where the files go")
    parser.add_argument("--only", choices=("sdist", "wheel", "static"), action="append", help="these files alone")
    options = parser.parse_args()
    folder = options.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    environment = reproducible()
    for name, make in (("sdist", sdist), ("wheel", wheel), ("static", static)):
        if not options.only or name in options.only:
            print(f"== {name}", flush=True)
            make(folder, environment)
    sums = [f"{digest(path)}  {path.name}\n" for path in sorted(folder.iterdir()) if path.name != "SHA256SUMS"]
    (folder / "SHA256SUMS").write_text("".join(sums), encoding="utf-8")
    print("".join(sums), end="")


def reproducible() -> dict[str, str]:
    """The environment of all builds: the time is that of the commit, paths are those of no machine."""
    here, home = Path.cwd(), Path(os.environ.get("CARGO_HOME", Path.home() / ".cargo"))
    remapped = {here: "/haff", home: "/cargo"}
    time = subprocess.run(["git", "log", "-1", "--format=%ct"], stdout=subprocess.PIPE, text=True, check=True).stdout
    prefixes = " ".join(f"-ffile-prefix-map={path}={name}" for path, name in remapped.items())
    return os.environ | {
        "SOURCE_DATE_EPOCH": time.strip(),
        "RUSTFLAGS": " ".join(f"--remap-path-prefix={path}={name}" for path, name in remapped.items()),
        "CFLAGS": prefixes,
        "CXXFLAGS": prefixes,
        "ZERO_AR_DATE": "1",
        "CARGO_INCREMENTAL": "0",
        "LC_ALL": "C.UTF-8",
        "TZ": "UTC",
    }


def host() -> str:
    """The target of this machine."""
    machine = {"arm64": "aarch64", "AMD64": "x86_64"}.get(platform.machine(), platform.machine())
    return f"{machine}-unknown-linux-gnu"


def sdist(folder: Path, environment: dict[str, str]) -> None:
    os.environ["SOURCE_DATE_EPOCH"] = environment["SOURCE_DATE_EPOCH"]
    print(haff_build.build_sdist(str(folder)))


def wheel(folder: Path, environment: dict[str, str]) -> None:
    target = host()
    haff_build.gather_data(["cargo-zigbuild", "rustc", "--target", f"{target}.{GLIBC}"], environment)
    subprocess.run(
        [
            sys.executable, "-m", "maturin", "build", "--release", "--locked", "--zig", "--target", target,
            "--compatibility", f"manylinux_{GLIBC.replace('.', '_')}", "--out", str(folder),
        ],
        env=environment,
        check=True,
    )  # fmt: skip


def static(folder: Path, environment: dict[str, str]) -> None:
    """The command with the C library linked in, which needs no other file; man pages and completions beside it."""
    target = host()
    flags = f"{environment['RUSTFLAGS']} -C target-feature=+crt-static"
    haff_build.gather_data(["cargo", "rustc", "--target", target], environment | {"RUSTFLAGS": flags})
    name = f"haff-{version()}-{target}-static"
    with tempfile.TemporaryDirectory() as work:
        root = Path(work) / name
        shutil.copytree(haff_build.DATA / "data" / "share", root / "share")
        (root / "bin").mkdir()
        shutil.copy2(haff_build.DATA / "scripts" / "haff", root / "bin" / "haff")
        for file in STATIC:
            shutil.copy2(file, root / file)
        paths = {path: path.relative_to(work).as_posix() for path in sorted(root.rglob("*")) if path.is_file()}
        haff_build.write_archive(folder / f"{name}.tar.gz", paths, int(environment["SOURCE_DATE_EPOCH"]))


def version() -> str:
    told = subprocess.run(["cargo", "pkgid", "-p", "haff"], stdout=subprocess.PIPE, text=True, check=True).stdout
    return told.strip().rsplit("#", 1)[1].rsplit("@", 1)[-1]


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


if __name__ == "__main__":
    main()
