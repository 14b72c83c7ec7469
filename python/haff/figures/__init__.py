"""The standard figures of open files, ready for print: ``haff plot FILE``, or :func:`haff.plot` from Python.

*What to change here.* A new figure: a module here, a line of :data:`KINDS`, and the same in ``command/main.py``. A new
shape of walls: :mod:`.solids` and :mod:`.shapes`, from which pages and figures have their triangles and lines.

*May import* ``common``, ``theory``, ``mechanics``, ``files`` and ``analysis``.

*Begin with* :data:`KINDS`, then :mod:`.temperature`.
"""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ..common import arguments
from ..common.output import replacing, require_free
from ..errors import ArgumentError, MissingDataError, NotApplicableError
from ..files.layout import computing
from ..text import escaped, quoted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..files.recording import Recording

__all__ = ["FORMATS", "KINDS", "Kind", "Result", "draw", "plot", "save_all"]

FORMATS = ("png", "pdf", "svg")
"""Formats of pictures: suffixes of their files."""
PACKED = 2
"""How far PNG files are packed, from 1 to 9."""
SHOWN_DPI = 110
"""Resolution of a figure in a notebook."""


def _from(module: str, function: str = "draw") -> Callable[..., Figure]:
    """A function of a module of this package, which is imported at the first call: few runs need all figures."""

    def call(file: Recording, **options: Any) -> Figure:
        return getattr(import_module(f".{module}", __name__), function)(file, **options)

    return call


class Kind(NamedTuple):
    """One standard figure."""

    draw: Callable[..., Figure]
    about: str
    standard: bool = True
    """Whether ``haff plot`` draws it without being asked for it by name."""


KINDS: dict[str, Kind] = {
    "temperature": Kind(_from("temperature"), "granular temperature against Haff's law"),
    "energy": Kind(_from("ledger"), "energy ledger: where the energy went, and its residual"),
    "velocity": Kind(_from("velocity"), "velocity distribution with its Sonine correction"),
    "structure": Kind(_from("structure"), "pair distribution g(r) with the contact value of theory"),
    "profiles": Kind(_from("profiles"), "density, temperature and pressure along an axis, or maps"),
    "msd": Kind(_from("msd"), "mean square displacement with its slope, and the running coefficient of self-diffusion"),
    "stress": Kind(_from("stress"), "pressure tensor, and the running shear viscosity"),
    "shear": Kind(
        _from("shear"), "sheared runs: temperature, viscosity, normal stresses and velocities against theory"
    ),
    "means": Kind(_from("means"), "observables against time, with their means and standard errors"),
    "probes": Kind(_from("probes"), "columns of the probes of a program that adds some, against time"),
    "snapshot": Kind(_from("snapshot"), "picture of a frame"),
    "losses": Kind(_from("losses"), "histogram of the energy lost per event"),
    "closed_form": Kind(_from("closed_form"), "few bodies: heights, angles, compression or velocities against theory"),
    "trajectories": Kind(_from("trajectories"), "few bodies: coordinates against time with the events"),
    "paths": Kind(_from("trajectories", "draw_paths"), "few bodies: paths in the plane of motion"),
    "density": Kind(
        _from("density"),
        "picture of the packing fraction on a grid; in 3D its mean along an axis, and a slice",
        standard=False,
    ),
    "clusters": Kind(
        _from("clusters"),
        "clusters of particles near contact: the largest against time, and their sizes",
        standard=False,
    ),
    "structure_history": Kind(
        _from("structure_history"),
        "static structure factor against time: its peak, and the length of its waves",
        standard=False,
    ),
    "structure_factor": Kind(_from("scattering"), "static structure factor S(k) with its error", standard=False),
    "contacts": Kind(
        _from("contacts"), "packings: contacts and rattlers of a frame; in 3D those of a layer", standard=False
    ),
    "partials": Kind(_from("partials"), "mixtures: pair distribution of each pair of species", standard=False),
    "heights": Kind(
        _from("heights"),
        "gravity or walls: density, temperature and velocity against height, from frames",
        standard=False,
    ),
}

OF_A_FRAME = ("contacts", "density", "snapshot")
"""Figures of one frame, which ``index`` chooses, the last by default."""

OF_FRAMES = (*OF_A_FRAME, "clusters", "heights", "partials", "structure", "structure_factor", "velocity")
"""Those, and figures of several frames, of which ``index`` chooses one."""


class Result(NamedTuple):
    """Outcome of one figure of :func:`save_all`."""

    kind: str
    path: Path | None
    """The file written, ``None`` if skipped."""
    reason: str
    """Why it was skipped."""


def draw(file: Recording, kind: str, *, title: bool = True, **options: object) -> Figure:
    """Draws one standard figure.

    Parameters
    ----------
    kind
        A key of :data:`KINDS`.
    title
        Whether the figure has its title and the line of facts below it.
    options
        ``index``: the frame of a figure of frames (:data:`OF_FRAMES`). Figures of one frame are by default
        of the last, others of several.

    Raises
    ------
    NotApplicableError, MissingDataError
        The figure does not apply to this file, or the data that it needs were not recorded.
    """
    from .style import style

    figure = _drawn(file, kind, title=title, **options)
    with style(), computing(file.path, f"figure {kind}"):
        # Lay out here: figures are also saved outside of this style's context.
        figure.draw_without_rendering()
    return figure


def _drawn(file: Recording, kind: str, *, title: bool, **options: object) -> Figure:
    """As :func:`draw`, but not laid out."""
    from .style import style

    if not isinstance(kind, str) or kind not in KINDS:
        raise ArgumentError(f"kind = {quoted(kind)}: no such figure; there are {', '.join(KINDS)}")
    with style(title=arguments.flag("title", title)), computing(file.path, f"figure {kind}"):
        return KINDS[kind].draw(file, **options)


def of_frame(kind: str, frame: int | None) -> dict[str, int]:
    """The options of a figure for a frame, if one is asked for and the figure is of frames."""
    return {} if frame is None or kind not in OF_FRAMES else {"index": frame}


def check_picture(output: object, overwrite: object) -> Path | None:
    """The picture to write, if there is one; raises :class:`ArgumentError` for what is none."""
    path = None if output is None else arguments.file("output", output)
    arguments.flag("overwrite", overwrite)
    if path is not None and path.suffix.removeprefix(".") not in FORMATS:
        raise ArgumentError(
            f"output = {quoted(str(path))}: a picture must end in {', '.join(f'.{name}' for name in FORMATS)}"
        )
    return path


def plot(
    file: Recording,
    kind: str,
    output: str | os.PathLike[str] | None = None,
    *,
    overwrite: bool = False,
    title: bool = True,
    **options: object,
) -> Figure:
    """Draws one standard figure of an open file, as :func:`haff.plot`; writes it if ``output`` is given."""
    path = check_picture(output, overwrite)
    if path is not None:
        require_free(path, source=file.path, overwrite=overwrite)
    figure = draw(file, kind, title=title, **options)
    if path is not None:
        _save(file, figure, kind, path, overwrite)
    # IPython shows figures without it only after %matplotlib or an import of pyplot.
    figure._repr_png_ = partial(_shown, figure)  # type: ignore[attr-defined]
    return figure


def _shown(figure: Figure) -> bytes:
    """The figure as PNG, for notebooks."""
    from .style import style

    picture = io.BytesIO()
    with style():
        figure.savefig(picture, format="png", dpi=SHOWN_DPI)
    return picture.getvalue()


def save_all(
    file: Recording,
    kinds: Sequence[str],
    directory: Path,
    extension: str = "png",
    frame: int | None = None,
    *,
    overwrite: bool = False,
    title: bool = True,
) -> list[Result]:
    """Draws figures into files ``STEM-KIND.EXTENSION``; those that do not apply are skipped, with the reason.

    Raises :class:`ArgumentError` if one of the files exists and ``overwrite`` is false.
    """
    directory.mkdir(parents=True, exist_ok=True)
    paths = {kind: directory / f"{file.path.stem}-{kind}.{extension}" for kind in kinds}
    # Before the first is drawn: all are written, or none.
    for path in paths.values():
        require_free(path, source=file.path, overwrite=overwrite)
    results = []
    for kind, path in paths.items():
        try:
            figure = _drawn(file, kind, title=title, **of_frame(kind, frame))
        except (NotApplicableError, MissingDataError) as error:
            results.append(Result(kind, None, str(error).removeprefix(f"{escaped(file.path)}: ")))
            continue
        _save(file, figure, kind, path, overwrite)
        results.append(Result(kind, path, ""))
    return results


def _save(file: Recording, figure: Figure, kind: str, path: Path, overwrite: bool) -> None:
    from .style import style

    with replacing(path, source=file.path, overwrite=overwrite) as part:
        with style(), computing(file.path, f"figure {kind}"):
            if path.suffix == ".png":
                _save_png(figure, part)
            else:
                # No date in the metadata: equal data give equal files.
                figure.savefig(part, metadata={".svg": {"Date": None}, ".pdf": {"CreationDate": None}}[path.suffix])


def _save_png(figure: Figure, path: Path) -> None:
    """As ``savefig``, which draws twice and packs three times as long for a file that is a tenth smaller."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    shown, canvas = figure.dpi, figure.canvas
    try:
        figure.set_dpi(mpl.rcParams["savefig.dpi"])
        FigureCanvasAgg(figure).print_png(path, pil_kwargs={"compress_level": PACKED})
    finally:
        figure.set_dpi(shown)
        figure.set_canvas(canvas)
