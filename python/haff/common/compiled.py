"""The compiled module, and the schema of scenes, which it has."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from ..errors import HaffError

if TYPE_CHECKING:
    from types import ModuleType

__all__ = ["compiled", "schema"]


def compiled() -> ModuleType:
    """The compiled module; functions that need neither simulations nor scenes work without it."""
    try:
        from .. import _engine
    except ImportError as error:
        raise HaffError(f"the compiled part of haff is missing ({error}): pip install .") from None
    return _engine


def schema() -> dict[str, Any]:
    """The JSON Schema of scene files, with a description of every key."""
    return json.loads(compiled().schema())
