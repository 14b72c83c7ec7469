"""``python -m haff``: the commands of ``haff`` which are written in Python: ``plot``, ``export``, ``view``, ``table``.

Exit status: 0 done · 2 the arguments are invalid, or the requested figure or format does not apply · 4 a file cannot be
read or written, or a library is not installed.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import NoReturn

from ..common.words import for_command
from ..errors import FileError, HaffError, MissingPackageError
from ..files.regular import require_file
from ..text import escaped


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        super().error(escaped(message))


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="haff", description="Figures, exports and pages of the runs of haff.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for add in (_add_plot, _add_export, _add_view, _add_table):
        add(commands)
    return parser


def _command(commands, name: str, about: str, description: str, epilog: str) -> argparse.ArgumentParser:
    command = commands.add_parser(
        name,
        help=about,
        description=description,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("file", type=Path, metavar="FILE", help="HDF5 file of haff run")
    return command


def _add_plot(commands) -> None:
    plot = _command(
        commands,
        "plot",
        "draws the standard figures of an output file",
        "Draws the standard figures of an output file; without --kind those of the first list that apply.",
        "figures:\n"
        + "\n".join(f"  {name:<16} {about}" for name, about in _KINDS.items() if name not in _BY_NAME)
        + "\nand by --kind only:\n"
        + "\n".join(f"  {name:<16} {_KINDS[name]}" for name in _BY_NAME)
        + "\n\nexamples:\n  haff plot cooling.h5\n  haff plot cooling.h5 --kind temperature --format pdf -o paper"
        "\n  haff plot cooling.h5 --movie cooling.mp4 --frames ::5\n\n"
        "mp4 needs pip install 'haff[movie]', gif nothing more.",
    )
    plot.add_argument("--kind", action="append", metavar="KIND", help="a figure of the list below; repeatable")
    plot.add_argument("-o", "--output", type=Path, metavar="DIR", help="directory of the figures (default: figures)")
    plot.add_argument("--format", choices=("png", "pdf", "svg"), default="png", help="default: png")
    plot.add_argument(
        "--frame",
        type=int,
        metavar="I",
        help="frame of figures of frames (default: the last, or several that the figure names)",
    )
    plot.add_argument("--no-title", dest="title", action="store_false", help="figures without titles, for papers")
    plot.add_argument("--show", action="store_true", help="shows the figures on the screen, too")
    plot.add_argument("--movie", type=Path, metavar="OUT", help="draws a movie instead: OUT.mp4 or OUT.gif")
    _add_frames(plot, "of the movie; ")
    plot.add_argument("--fps", type=float, default=25.0, help="pictures a second of the movie (default: 25)")
    plot.add_argument("--overwrite", action="store_true", help="replaces existing figures, or an existing movie")
    plot.set_defaults(run=_plot)


def _add_export(commands) -> None:
    export = _command(
        commands,
        "export",
        "writes a file for other programs",
        "Writes a file for other programs: frames as gsd (HOOMD-blue, OVITO, freud), extxyz (ASE, OVITO) or vtkhdf\n"
        "(ParaView, VTK); frames, observables or events as csv or parquet (pandas and others).",
        "examples:\n"
        "  haff export cooling.h5 --to gsd\n"
        "  haff export cooling.h5 --to extxyz --frames ::10 --unwrapped -o few.extxyz\n"
        "  haff export cooling.h5 --to parquet --table events\n\n"
        "gsd and parquet need pip install 'haff[export]'. Boxes, open sides and precision: docs/export.md.",
    )
    export.add_argument(
        "--to", choices=_FORMATS, metavar="FORMAT", help=f"{', '.join(_FORMATS)}; default: OUT's suffix"
    )
    export.add_argument("-o", "--output", type=Path, metavar="OUT", help="file to write (default: named after FILE)")
    _add_frames(export)
    export.add_argument(
        "--table",
        choices=_TABLES,
        metavar="TABLE",
        help=f"for csv and parquet: {', '.join(_TABLES)} (default: the first)",
    )
    export.add_argument("--unwrapped", action="store_true", help="positions that do not jump at periodic faces")
    export.add_argument("--overwrite", action="store_true", help="replaces an existing file")
    export.set_defaults(run=_export)


def _add_view(commands) -> None:
    view = _command(
        commands,
        "view",
        "makes a web page that plays an output file",
        "Makes one self-contained web page that plays the particles, with temperature, energies and collision rate\n"
        "moving along. It needs no network, only a browser with WebGL 2.",
        "examples:\n  haff view cooling.h5 --open\n  haff view cooling.h5 --frames ::10 -o talk.html",
    )
    view.add_argument("-o", "--output", type=Path, metavar="PAGE", help="page to write (default: FILE's name, .html)")
    _add_frames(view)
    view.add_argument(
        "--size",
        type=float,
        default=40.0,
        metavar="MB",
        help="about the largest page: frames are thinned (default: 40)",
    )
    view.add_argument(
        "--color", metavar="NAME", help=f"color at first: {', '.join(_COLORINGS)} (default: speed or species)"
    )
    view.add_argument(
        "--color-range",
        type=float,
        nargs=2,
        metavar=("MIN", "MAX"),
        help="fixed range of the colors (default: it follows the frames)",
    )
    view.add_argument("--open", action="store_true", help="opens the page in the browser")
    view.add_argument("--overwrite", action="store_true", help="replaces an existing file")
    view.set_defaults(run=_view)


def _add_table(commands) -> None:
    table = _command(
        commands,
        "table",
        "writes the impacts of a run as a table",
        "Writes the impacts of a run of few bodies as a table: names, velocities before and after, angles to the\n"
        "normal, e, impulse, the loss of energy, and what is missing in Carnot's theorem. It needs an event log.",
        "examples:\n  haff table breakshot.h5\n  haff table breakshot.h5 -o impacts.tex\n"
        "  haff table breakshot.h5 --columns time,first,second,e --digits 4",
    )
    table.add_argument("-o", "--output", type=Path, metavar="OUT", help="file to write (default: standard output)")
    table.add_argument(
        "--to", metavar="FORMAT", help="markdown, csv or latex (default: by the ending of OUT, or markdown)"
    )
    table.add_argument(
        "--columns", metavar="NAMES", help="names separated by commas, in this order (default: all that are not 0)"
    )
    table.add_argument("--digits", type=int, metavar="N", help="digits of numbers, 1 to 17 (default: 6; of csv all)")
    table.add_argument("--overwrite", action="store_true", help="replaces an existing file")
    table.set_defaults(run=_table)


def _add_frames(command: argparse.ArgumentParser, which: str = "") -> None:
    command.add_argument(
        "--frames", metavar="START:STOP:STEP", help=f"frames {which}as in Python: 0:100, ::10, -1 (default: all)"
    )


# Repeated from the modules that do the work, so that --help and wrong arguments answer without loading them.
_KINDS = {
    "temperature": "granular temperature against Haff's law",
    "energy": "energy ledger: where the energy went, and its residual",
    "velocity": "velocity distribution with its Sonine correction",
    "structure": "pair distribution g(r) with the contact value of theory",
    "profiles": "density, temperature and pressure along an axis, or maps",
    "msd": "mean square displacement with its slope, and the running coefficient of self-diffusion",
    "stress": "pressure tensor, and the running shear viscosity",
    "shear": "sheared runs: temperature, viscosity, normal stresses and velocities against theory",
    "means": "observables against time, with their means and standard errors",
    "probes": "columns of the probes of a program that adds some, against time",
    "snapshot": "picture of a frame",
    "losses": "histogram of the energy lost per event",
    "closed_form": "few bodies: heights, angles, compression or velocities against theory",
    "trajectories": "few bodies: coordinates against time with the events",
    "paths": "few bodies: paths in the plane of motion",
    "density": "picture of the packing fraction on a grid; in 3D its mean along an axis, and a slice",
    "clusters": "clusters of particles near contact: the largest against time, and their sizes",
    "structure_history": "static structure factor against time: its peak, and the length of its waves",
    "structure_factor": "static structure factor S(k) with its error",
    "contacts": "packings: contacts and rattlers of a frame; in 3D those of a layer",
    "partials": "mixtures: pair distribution of each pair of species",
    "heights": "gravity or walls: density, temperature and velocity against height, from frames",
}
_BY_NAME = ("density", "clusters", "structure_history", "structure_factor", "contacts", "partials", "heights")
_COLORINGS = ("speed", "species", "loss", "recent-loss", "density")
_FORMATS = ("gsd", "extxyz", "vtkhdf", "csv", "parquet")
_TABLES = ("observables", "frames", "events")


def main(arguments: list[str] | None = None) -> int:
    """Runs the command; returns the exit status."""
    parser = _parser()
    options = parser.parse_args(arguments)
    for kind in getattr(options, "kind", None) or ():
        if kind not in _KINDS:
            parser.error(f"--kind {kind}: must be one of {', '.join(_KINDS)}")
    try:
        with for_command():
            return options.run(options)
    except HaffError as error:
        return _fail(*error.lines, status=4 if isinstance(error, (FileError, MissingPackageError)) else 2)
    except MemoryError:
        return _fail(f"{options.file}: not enough memory", status=4)
    except OSError as error:
        return _fail(f"{error.filename or options.file}: {error.strerror or error}", status=4)
    except KeyboardInterrupt:
        return _fail("interrupted", status=130)


def _export(options: argparse.Namespace) -> int:
    require_file(options.file)
    from .. import reader
    from ..export import export

    with reader.open(options.file) as file:
        path = export(
            file,
            options.output,
            to=options.to,
            frames=options.frames,
            table=options.table,
            unwrapped=options.unwrapped,
            overwrite=options.overwrite,
        )
    print(escaped(path))
    return 0


def _table(options: argparse.Namespace) -> int:
    require_file(options.file)
    from .. import reader
    from .table import write

    with reader.open(options.file) as file:
        text = write(
            file, options.output, options.to, options.columns, digits=options.digits, overwrite=options.overwrite
        )
    print(escaped(options.output) if text is None else text, end="\n" if text is None else "")
    return 0


def _view(options: argparse.Namespace) -> int:
    require_file(options.file)
    from ..viewer import view

    notes: list[str] = []
    path = view(
        options.file,
        options.output,
        frames=options.frames,
        size=options.size,
        color=options.color,
        color_range=options.color_range,
        overwrite=options.overwrite,
        show=options.open,
        notes=notes,
    )
    _tell(notes)
    print(escaped(path))
    return 0


def _plot(options: argparse.Namespace) -> int:
    if options.movie is not None:
        if options.kind or options.show or options.output:
            return _fail("--movie draws no figures: leave out --kind, --show and -o", status=2)
        return _movie(options)
    if options.frames is not None:
        return _fail("--frames: several frames go with --movie; a snapshot takes --frame", status=2)
    require_file(options.file)
    from .. import figures, reader

    directory = options.output or Path("figures")
    with reader.open(options.file) as file:
        if options.frame is not None and options.kind and not set(options.kind) & set(figures.OF_FRAMES):
            return _fail(f"--frame: goes with the figures {', '.join(figures.OF_FRAMES)}", status=2)
        kinds = options.kind or [name for name, kind in figures.KINDS.items() if kind.standard]
        how = {"overwrite": options.overwrite, "title": options.title}
        results = figures.save_all(file, kinds, directory, options.format, options.frame, **how)
        for result in results:
            if result.path is not None:
                print(escaped(result.path))
            elif options.kind:
                # Only figures requested by name are reported as skipped.
                print(f"skipped {result.kind}: {escaped(result.reason)}", file=sys.stderr)
        drawn = [result for result in results if result.path is not None]
        if options.show:
            _show(drawn, file, options)
    missing = [result for result in results if result.path is None]
    if options.kind and missing:
        return 2
    return 0 if drawn else _fail(f"{options.file}: no figure applies", status=2)


def _movie(options: argparse.Namespace) -> int:
    require_file(options.file)
    from .. import reader
    from ..figures import movie

    notes: list[str] = []
    with reader.open(options.file) as file:
        how = {name: getattr(options, name) for name in ("frames", "fps", "overwrite", "title")}
        path = movie.save(file, options.movie, notes=notes, **how)
    _tell(notes)
    print(escaped(path))
    return 0


def _tell(notes: list[str]) -> None:
    for note in notes:
        print(f"haff: {escaped(note)}", file=sys.stderr)


def _show(drawn, file, options: argparse.Namespace) -> None:
    """Opens windows with the figures, where there is a screen."""
    import matplotlib.pyplot as plt

    from .. import figures

    if plt.get_backend().lower() == "agg":
        print("no screen to show the figures on", file=sys.stderr)
        return
    for result in drawn:
        figure = figures.draw(file, result.kind, title=options.title, **figures.of_frame(result.kind, options.frame))
        canvas = plt.figure().canvas
        canvas.figure = figure
        figure.set_canvas(canvas)
    plt.show()


def _fail(*lines: str, status: int) -> int:
    for line in lines:
        print(f"haff: error: {escaped(line)}", file=sys.stderr)
    return status
