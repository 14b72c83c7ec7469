"""Arrays inside a page: deflated, in base64, each in a script element of its own."""

from __future__ import annotations

import base64
import json
import zlib
from typing import Any, TextIO

import numpy as np

_TYPES = {"u1": "Uint8Array", "i1": "Int8Array", "u2": "Uint16Array", "i2": "Int16Array", "u4": "Uint32Array",
          "f4": "Float32Array", "f8": "Float64Array"}  # fmt: skip


class Blobs:
    """Writes arrays and the header that names them."""

    def __init__(self, out: TextIO) -> None:
        self._out = out
        self._count = 0

    def add(self, *arrays: np.ndarray) -> dict[str, Any]:
        """Writes arrays, little-endian, one after the other; returns their entry of the header."""
        parts, places, offset = [], [], 0
        for array in arrays:
            kind = array.dtype.str[1:]
            data = np.ascontiguousarray(array, "<" + kind).tobytes()
            # Typed arrays of a page must begin at a multiple of their width.
            data += bytes(-len(data) % 8)
            places.append([_TYPES[kind], offset, int(array.size)])
            parts.append(data)
            offset += len(data)
        text = base64.b64encode(zlib.compress(b"".join(parts), 6)).decode("ascii")
        self._out.write(f'<script type="text/plain" id="blob-{self._count}">{text}</script>\n')
        self._count += 1
        return {"blob": self._count - 1, "arrays": places}

    def header(self, header: dict[str, Any]) -> None:
        """Writes the header, as JSON that cannot close its script element."""
        text = json.dumps(header, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
        self._out.write(f'<script type="application/json" id="header">{text}</script>\n')
