"""``python -m haff plot FILE``, the Python part of the command ``haff``.

Exit status: 0 done · 2 the arguments are invalid, or the figure asked for does not apply · 4 a file cannot be
read or written.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from .errors import FileError, HaffError


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="haff", description="Figures of the runs of haff.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    plot = commands.add_parser(
        "plot",
        help="draws the standard figures of an output file",
        description="Draws the standard figures of an output file; without --kind all that apply.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    plot.add_argument("file", type=Path, metavar="FILE", help="HDF5 file of haff run")
    plot.add_argument("--kind", action="append", metavar="KIND", help="a figure of the list below; repeatable")
    plot.add_argument("-o", "--output", type=Path, metavar="DIR", help="directory of the figures (default: figures)")
    plot.add_argument("--format", choices=("png", "pdf", "svg"), default="png", help="default: png")
    plot.add_argument("--frame", type=int, default=-1, metavar="I", help="frame of the snapshot (default: the last)")
    plot.add_argument("--show", action="store_true", help="shows the figures on the screen, too")
    plot.epilog = "figures:\n" + "\n".join(f"  {name:<13} {about}" for name, about in _KINDS.items())
    return parser


# Repeated from haff.figures so that --help and wrong arguments answer without loading matplotlib.
_KINDS = {
    "temperature": "granular temperature against Haff's law",
    "energy": "energy ledger: where the energy went, and its residual",
    "velocity": "velocity distribution with its Sonine correction",
    "structure": "pair distribution g(r) with the contact value of theory",
    "snapshot": "picture of a frame",
    "losses": "histogram of the energy lost per event",
    "trajectories": "few bodies: coordinates against time with the events",
    "paths": "few bodies: paths in the plane of motion",
}


def main(arguments: list[str] | None = None) -> int:
    """Runs the command; returns the exit status."""
    parser = _parser()
    options = parser.parse_args(arguments)
    for kind in options.kind or ():
        if kind not in _KINDS:
            parser.error(f"--kind {kind}: must be one of {', '.join(_KINDS)}")
    try:
        return _plot(options)
    except FileError as error:
        return _fail(str(error), 4)
    except HaffError as error:
        return _fail(str(error), 2)
    except OSError as error:
        return _fail(f"{error.filename or options.file}: {error.strerror or error}", 4)
    except KeyboardInterrupt:
        return _fail("interrupted", 130)


def _plot(options: argparse.Namespace) -> int:
    from . import figures, reader

    directory = options.output or Path("figures")
    with reader.open(options.file) as file:
        kinds = options.kind or list(figures.KINDS)
        results = figures.save_all(file, kinds, directory, options.format, options.frame)
        for result in results:
            if result.path is not None:
                print(result.path)
            else:
                print(f"skipped {result.kind}: {result.reason}", file=sys.stderr)
        drawn = [result for result in results if result.path is not None]
        if options.show:
            _show(drawn, file, options.frame)
    missing = [result for result in results if result.path is None]
    if options.kind and missing:
        return 2
    return 0 if drawn else _fail(f"{options.file}: no figure applies", 2)


def _show(drawn, file, frame: int) -> None:
    """Opens windows with the figures, where there is a screen."""
    import matplotlib.pyplot as plt

    from . import figures

    if plt.get_backend().lower() == "agg":
        print("no screen to show the figures on", file=sys.stderr)
        return
    for result in drawn:
        figure = figures.draw(file, result.kind, **({"index": frame} if result.kind == "snapshot" else {}))
        canvas = plt.figure().canvas
        canvas.figure = figure
        figure.set_canvas(canvas)
    plt.show()


def _fail(message: str, status: int) -> int:
    print(f"haff: error: {message}", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
