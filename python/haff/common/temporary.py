"""Files that exist as long as the objects that use them."""

from __future__ import annotations

import os
import shutil
import tempfile
import weakref
from pathlib import Path

__all__ = ["TemporaryFolder"]


class TemporaryFolder:
    """A folder that is removed with the last reference to this object, or when Python ends.

    Unlike :class:`tempfile.TemporaryDirectory` it is meant to be left to that, and a forked process removes nothing.
    """

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="haff-"))
        """Path of the folder."""
        weakref.finalize(self, _remove, self.path, os.getpid())


def _remove(path: Path, owner: int) -> None:
    if os.getpid() == owner:
        shutil.rmtree(path, ignore_errors=True)
