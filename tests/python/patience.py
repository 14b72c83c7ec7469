"""How long tests wait for what must come: no test may fail because a machine is slow or busy."""

from __future__ import annotations

import os
from pathlib import Path

HANGS = 3600
"""Seconds after which a process is taken to hang: far more than a slow machine needs."""


def processor_time(process: int) -> float:
    """Processor time that a process has used [s], which other processes do not change; 0 where it is not known."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
