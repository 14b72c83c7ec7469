"""The standard figures, ready for print: ``haff plot FILE``, or :func:`draw` from Python."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure

from ..errors import ArgumentError, MissingDataError, NotApplicableError
from ..layout import computing
from ..output import replacing
from ..reader import File
from ..text import escaped, quoted
from . import (
    closed_form,
    ledger,
    losses,
    msd,
    profiles,
    shear,
    snapshot,
    stress,
    structure,
    temperature,
    trajectories,
    velocity,
)
from .style import style

__all__ = ["KINDS", "Kind", "Result", "draw", "save_all"]


class Kind(NamedTuple):
    """One standard figure."""

    draw: Callable[..., Figure]
    about: str


KINDS: dict[str, Kind] = {
    "temperature": Kind(temperature.draw, "granular temperature against Haff's law"),
    "energy": Kind(ledger.draw, "energy ledger: where the energy went, and its residual"),
    "velocity": Kind(velocity.draw, "velocity distribution with its Sonine correction"),
    "structure": Kind(structure.draw, "pair distribution g(r) with the contact value of theory"),
    "profiles": Kind(profiles.draw, "density, temperature and pressure along an axis, or maps"),
    "msd": Kind(msd.draw, "mean square displacement with its slope, and the running coefficient of self-diffusion"),
    "stress": Kind(stress.draw, "pressure tensor, and the running shear viscosity"),
    "shear": Kind(shear.draw, "sheared runs: temperature, viscosity, normal stresses and velocities against theory"),
    "snapshot": Kind(snapshot.draw, "picture of a frame"),
    "losses": Kind(losses.draw, "histogram of the energy lost per event"),
    "closed_form": Kind(closed_form.draw, "few bodies: heights, angles, compression or velocities against theory"),
    "trajectories": Kind(trajectories.draw, "few bodies: coordinates against time with the events"),
    "paths": Kind(trajectories.draw_paths, "few bodies: paths in the plane of motion"),
}


class Result(NamedTuple):
    """Outcome of one figure of :func:`save_all`."""

    kind: str
    path: Path | None
    """The file written, ``None`` if skipped."""
    reason: str
    """Why it was skipped."""


def draw(file: File, kind: str, **options: object) -> Figure:
    """Draws one standard figure.

    Parameters
    ----------
    kind
        A key of :data:`KINDS`.
    options
        ``index``: the frame of a snapshot, −1 by default.

    Raises
    ------
    NotApplicableError, MissingDataError
        The figure does not apply to this file, or the data that it needs were not recorded.
    """
    if kind not in KINDS:
        raise ArgumentError(f"no figure {quoted(kind)}; there are {', '.join(KINDS)}")
    with style(), computing(file.path, f"figure {kind}"):
        figure = KINDS[kind].draw(file, **options)
        # Lay out here: figures are also saved outside of this style's context.
        figure.draw_without_rendering()
        return figure


def save_all(
    file: File, kinds: Sequence[str], directory: Path, extension: str = "png", frame: int = -1
) -> list[Result]:
    """Draws figures into files ``STEM-KIND.EXTENSION``; those that do not apply are skipped, with the reason."""
    directory.mkdir(parents=True, exist_ok=True)
    results = []
    for kind in kinds:
        try:
            options = {"index": frame} if kind == "snapshot" else {}
            figure = draw(file, kind, **options)
        except (NotApplicableError, MissingDataError) as error:
            results.append(Result(kind, None, str(error).removeprefix(f"{escaped(file.path)}: ")))
            continue
        path = directory / f"{file.path.stem}-{kind}.{extension}"
        with replacing(path, source=file.path, overwrite=True) as part, style(), computing(file.path, f"figure {kind}"):
            # No date in the metadata: equal data give equal files.
            metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(extension)
            figure.savefig(part, metadata=metadata)
        results.append(Result(kind, path, ""))
    return results
