"""Processes that only compute, beside which other scripts measure."""

from __future__ import annotations

import contextlib
import multiprocessing
from collections.abc import Iterator


def compute(stop) -> None:  # type: ignore[no-untyped-def]
    while not stop.is_set():
        sum(range(10_000))


@contextlib.contextmanager
def busy_processes(count: int) -> Iterator[None]:
    """Some processes that only compute, until the end of the block."""
    context = multiprocessing.get_context("fork")
    stop = context.Event()
    for _ in range(count):
        context.Process(target=compute, args=(stop,), daemon=True).start()
    try:
        yield
    finally:
        stop.set()
