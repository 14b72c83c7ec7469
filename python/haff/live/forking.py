"""Live simulations in a process that makes a copy of itself."""

from __future__ import annotations

import os
import threading
import weakref
from typing import Any

living: weakref.WeakSet[Any] = weakref.WeakSet()
"""All simulations of this process."""
_held: list[Any] = []
_forking = threading.Lock()


def _before_fork() -> None:
    """A copy made while another thread advances a simulation would find it locked for ever, between two events."""
    _forking.acquire()
    for simulation in list(living):
        simulation._core.hold()
        _held.append(simulation)


def _after_fork() -> None:
    while _held:
        _held.pop()._core.release()
    _forking.release()


def _in_child() -> None:
    """Files are written by the first process: the threads that do so are not copied."""
    copies = list(_held)
    _after_fork()
    for simulation in copies:
        simulation._core.abandon()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_before_fork, after_in_parent=_after_fork, after_in_child=_in_child)
