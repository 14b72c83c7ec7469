"""Objects that show what is recorded elsewhere: to set one of their attributes would have no effect there."""

from __future__ import annotations

__all__ = ["ReadOnly"]


class ReadOnly:
    """Base of objects whose attributes are set once, and then only read."""

    _why = "cannot be changed: what is recorded is only read"

    def __setattr__(self, name: str, value: object) -> None:
        # Those of this package begin with an underscore, or are set when the object is made.
        if not name.startswith("_") and (name in vars(self) or hasattr(type(self), name) or "_made" in vars(self)):
            raise AttributeError(f"{type(self).__name__}.{name}: {self._why}")
        super().__setattr__(name, value)
