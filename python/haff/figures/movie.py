"""A movie of snapshots: mp4 by ffmpeg, gif by Pillow."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from ..common.output import library, replacing
from ..errors import ArgumentError, FileError
from ..files.extent import Extent, extent
from ..files.frames import Frames
from ..files.layout import computing
from ..files.selection import choose
from . import shapes, snapshot
from .style import style

if TYPE_CHECKING:
    from ..files.recording import Recording

__all__ = ["MOST", "save"]

MOST = 600
"""Pictures of a movie; of more frames, every second, third, … is drawn."""
DPI = 110
PIXELS = 700


def save(
    file: Recording,
    path: str | os.PathLike[str],
    *,
    frames: str | slice | int | None = None,
    fps: float = 25.0,
    overwrite: bool = False,
    title: bool = True,
    notes: list[str] | None = None,
) -> Path:
    """Writes a movie, one picture a frame, all of the same region; returns its path.

    Parameters
    ----------
    path
        Ends in ``.mp4`` (needs ``pip install 'haff[movie]'``) or ``.gif``.
    frames
        The frames to draw, ``"start:stop:step"`` or a slice; all by default.
    fps
        Pictures a second.
    title
        Whether the pictures have a title, with the time.
    notes
        A list to which messages are appended: what was left out, and why.
    """
    target = Path(path)
    writers = {".mp4": _mp4, ".gif": _gif}
    if target.suffix not in writers:
        raise ArgumentError(f"{target}: a movie must end in .mp4 or .gif")
    if not 0 < fps <= 120:
        raise ArgumentError(f"fps {fps:g}: must be in (0, 120]")
    chosen = choose(file, frames)
    every = -(-len(chosen) // MOST)
    if every > 1:
        if notes is not None:
            notes.append(f"{len(chosen[::every])} of {len(chosen)} frames, one in {every}")
        chosen = chosen[::every]
    with replacing(target, source=file.path, overwrite=overwrite) as part:
        scenery = shapes.find(file, extent(chosen), float(chosen.time[0]), float(chosen.time[-1]))
        if notes is not None:
            notes += scenery.missing
        wrong = writers[target.suffix](_pictures(file, chosen, scenery.room, title), part, fps)
        if wrong:
            raise FileError(f"{target}: {wrong}")
    return target


def _pictures(file: Recording, frames: Frames, room: Extent, title: bool) -> Iterator[np.ndarray]:
    """``[H, W, 3]`` pictures, of even height and width, as video codecs require."""
    for frame in frames:
        with style(title=title), computing(file.path, "movie"):
            figure = snapshot.draw(file, frame.index, room=room, pixels=PIXELS)
            figure.set_dpi(DPI)
            canvas = FigureCanvasAgg(figure)
            canvas.draw()
        picture = np.asarray(canvas.buffer_rgba())[..., :3]
        yield np.ascontiguousarray(picture[: picture.shape[0] // 2 * 2, : picture.shape[1] // 2 * 2])


def _mp4(pictures: Iterator[np.ndarray], path: Path, fps: float) -> str | None:
    """Writes the file; returns the reason of a failure, if any."""
    ffmpeg = library("imageio_ffmpeg", "movie")
    writer, drawn, found = None, 0, None
    try:
        for picture in pictures:
            drawn += 1
            # Errors from here on are those of ffmpeg; errors of reading are raised by the pictures.
            try:
                if writer is None:
                    size = (picture.shape[1], picture.shape[0])
                    options = {"fps": fps, "quality": 7, "macro_block_size": 2, "ffmpeg_log_level": "quiet"}
                    writer = ffmpeg.write_frames(str(path), size, **options)
                    writer.send(None)
                writer.send(picture)
            except (OSError, IndexError):  # the latter where it does not list its encoders
                break
    finally:
        if writer is not None:
            writer.close()
    # ffmpeg may have exited, or written a file that is not a movie.
    with suppress(RuntimeError, OSError):
        found, _ = ffmpeg.count_frames_and_secs(str(path))
    if found != drawn:
        # ffmpeg does not report the cause: a write of our own shows whether the disk is full.
        with open(path, "ab", buffering=0) as file:
            file.write(bytes(1 << 16))
        return f"ffmpeg has failed: pictures drawn {drawn}, in the file {found or 0}"
    return None


def _gif(pictures: Iterator[np.ndarray], path: Path, fps: float) -> None:
    images = (Image.fromarray(picture).quantize(256, dither=Image.Dither.NONE) for picture in pictures)
    first = next(images)
    # The format counts hundredths of a second.
    first.save(path, save_all=True, append_images=images, duration=max(20, round(100 / fps) * 10), loop=0)
