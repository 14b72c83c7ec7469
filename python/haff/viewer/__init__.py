"""One self-contained web page that plays a run: ``haff view``, or :func:`view`.

*What to change here.* What the page shows: :mod:`.content` packs it, the scripts beside it draw it.

*May import* ``common``, ``files``, ``analysis``, ``figures`` and ``reader``.

*Begin with* :mod:`.content`, then ``shaders.js``.
"""

from __future__ import annotations

import html
import os
import re
import webbrowser
from collections.abc import Sequence
from pathlib import Path

from .. import reader
from ..common import arguments
from ..common.output import replacing
from ..errors import ArgumentError
from ..files.layout import computing
from ..reader import File
from ..text import escaped, quoted
from . import coloring
from .blobs import Blobs

__all__ = ["view"]

_HERE = Path(__file__).parent
_SCRIPTS = (
    "data.js", "flight.js", "timeline.js", "density.js", "picking.js", "shaders.js", "particles.js", "surroundings.js",
    "shapes.js", "marks.js", "curves.js", "colors.js", "inspector.js", "camera.js", "smooth.js", "keys.js", "player.js",
)  # fmt: skip


def view(
    source: File | str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    *,
    frames: str | slice | int | None = None,
    size: float = 40.0,
    color: str | None = None,
    color_range: Sequence[float] | None = None,
    overwrite: bool = False,
    show: bool = False,
    notes: list[str] | None = None,
) -> Path:
    """Makes a web page that plays the particles of a file, with curves moving along; returns its path.

    The page needs no network and no server. Between frames particles fly freely, with gravity and the collision
    between them; few bodies with an event log follow their exact paths.

    Parameters
    ----------
    source
        An open file, or a path.
    output
        The page to write; by default ``STEM.html`` in the current directory.
    frames
        The frames to play, ``"start:stop:step"`` or a slice; all by default.
    size
        About the largest size of the page [MB]; if the frames need more, only every second, third, … is kept.
    color
        How particles are colored at first: ``"speed"``, ``"species"``, ``"loss"`` (energy lost so far),
        ``"recent-loss"`` or ``"density"`` (local packing fraction); by default speed or species.
    color_range
        Minimum and maximum of the colors, in units of that quantity (of the speed, if ``color`` is not given); by
        default the range follows the frames. Both can be changed in the page.
    overwrite
        Whether an existing file is replaced.
    show
        Opens the page in the browser.
    notes
        A list to which messages are appended, one line each: what was left out, and why.

    Raises
    ------
    ArgumentError, MissingDataError, NotApplicableError
        An argument is invalid, the file has no frames, or too many particles for a page.
    """
    source = reader.source_of(source)
    size = arguments.positive("size", size)
    for name, given in (("overwrite", overwrite), ("show", show)):
        arguments.flag(name, given)
    if notes is not None and not isinstance(notes, list):
        raise ArgumentError(f"notes = {quoted(notes)}: must be a list, to which messages are appended")
    if not isinstance(source, File):
        with reader.open(source) as file:
            return view(
                file, output, frames=frames, size=size, color=color, color_range=color_range, overwrite=overwrite,
                show=show, notes=notes,
            )  # fmt: skip
    chosen = coloring.checked(color, color_range)
    path = arguments.file("output", output) if output is not None else Path(f"{source.path.stem}.html")
    messages = notes if notes is not None else []
    with replacing(path, source=source.path, overwrite=overwrite) as part:
        _write(source, part, frames, size, chosen, messages)
    if show:
        webbrowser.open(path.resolve().as_uri())
    return path


def _write(file: File, path: Path, frames, size: float, chosen: coloring.Coloring, notes: list[str]) -> None:
    # These import matplotlib: only when a page is made, not with `import haff`.
    from . import content

    shell = (_HERE / "page.html").read_text(encoding="utf-8")
    before, after = shell.split("{{content}}")
    styles = "\n".join((_HERE / name).read_text(encoding="utf-8") for name in ("vendor/uPlot.min.css", "page.css"))
    libraries = [
        (_HERE / "vendor" / name).read_text(encoding="utf-8") for name in ("three.min.js", "uPlot.iife.min.js")
    ]
    scripts = "\n".join((_HERE / name).read_text(encoding="utf-8") for name in _SCRIPTS)
    # The title comes from the file: it may contain markup, or a placeholder of the page's template.
    parts = {"title": html.escape(escaped(file.title or file.path.stem)), "styles": styles}
    with open(path, "w", encoding="utf-8", newline="\n") as out, computing(file.path, "page"):
        out.write(re.sub(r"\{\{(\w+)\}\}", lambda place: parts[place[1]], before))
        # The header names the blobs by number, so it comes last, and frames are never all in memory.
        content.write(file, Blobs(out), frames, size, chosen, notes)
        for library in libraries:
            out.write(f"<script>{library}</script>\n")
        out.write(f'<script>"use strict";\n{scripts}</script>\n')
        out.write(after)
