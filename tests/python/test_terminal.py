"""Output on a terminal: an emulator renders the output of the command on a pseudo-terminal."""

from __future__ import annotations

import os
import re
import select
import signal
import struct
import time
from dataclasses import dataclass

import pytest

from patience import HANGS
from validation.runs import ROOT, executable

pty, fcntl, termios = (pytest.importorskip(name) for name in ("pty", "fcntl", "termios"))
pyte = pytest.importorskip("pyte", reason="no pyte: pip install 'haff[test]'")

GAS = str(ROOT / "tests" / "gas.toml")
LINES = 30
INTERRUPT = b"\x03"


@dataclass
class Seen:
    """The final screen, without empty lines and trailing space, and the exit status."""

    lines: list[str]
    status: int

    def __str__(self) -> str:
        return "\n".join(self.lines)


def look(*arguments: str, columns: int, interrupt: str = "") -> Seen:
    """Runs the command on a terminal of a given width; sends Ctrl-C once ``interrupt`` is on the screen."""
    child, terminal = pty.fork()
    if child == 0:
        try:
            fcntl.ioctl(0, termios.TIOCSWINSZ, struct.pack("HHHH", LINES, columns, 0, 0))
            os.execve(executable(), ["haff", *arguments], {**os.environ, "TERM": "xterm", "LANG": "C.UTF-8"})
        finally:
            os._exit(127)
    screen = pyte.Screen(columns, LINES)
    stream = pyte.ByteStream(screen)
    give_up = time.monotonic() + HANGS
    try:
        while time.monotonic() < give_up:
            if not select.select([terminal], [], [], 1.0)[0]:
                continue
            try:
                stream.feed(os.read(terminal, 1 << 16))
            except OSError:  # The command has ended.
                break
            if interrupt and re.search(interrupt, "\n".join(screen.display)):
                os.write(terminal, INTERRUPT)
                interrupt = ""
        else:
            os.kill(child, signal.SIGKILL)
    finally:
        os.close(terminal)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return Seen([line.rstrip() for line in screen.display if line.strip()], status)


ENDLESS = ["--set", "run.until=1e7", "--set", "output.frames=false"]


@pytest.mark.long
@pytest.mark.parametrize(("columns", "cells"), [(40, 3), (80, 5)])
def test_rows_of_a_watched_run_fit_the_terminal(columns, cells, tmp_path, command):
    path = str(tmp_path / "gas.h5")
    row = r"^ *\d+\.\d{6} +\d+ +\d\.\d{4}e.*$"
    run = look("run", GAS, "--watch", *ENDLESS, "-o", path, columns=columns, interrupt=rf"(?m:({row}\s+){{3}})")
    command("run", GAS, "--quiet", "--overwrite", "-o", path)
    file = look("info", path, "--watch", columns=columns)
    assert (run.status, file.status) == (130, 0), f"{run}\n{file}"
    for seen in (run, file):
        heads = ["time", "collisions", "temperature", "ledger residual", "collisions/s"][:cells]
        assert re.split("  +", seen.lines[0].strip()) == heads, seen
        rows = re.findall(row, str(seen), flags=re.MULTILINE)
        assert rows and seen.lines[1 : 1 + len(rows)] == rows, seen
        assert all(len(text.split()) == cells and len(text) == len(seen.lines[0]) for text in rows), seen


@pytest.mark.parametrize("columns", [40, 80])
@pytest.mark.parametrize("study", [False, True], ids=["run", "sweep"])
def test_progress_bar_is_cleared_after_ctrl_c(study, columns, tmp_path):
    arguments = ["sweep", GAS, "--set", "contact.restitution=0.8,0.9"] if study else ["run", GAS]
    shown = r"\d %" + (r"(.|\n)*t = \d" if columns == 80 else "")
    seen = look(*arguments, *ENDLESS, "-o", str(tmp_path / "out"), columns=columns, interrupt=shown)
    assert seen.status == 130, seen
    assert not re.search("[━╸─]", str(seen)) and "^C" not in str(seen), seen
    assert seen.lines[0].startswith("0 of 2 runs are complete" if study else "Small gas"), seen
