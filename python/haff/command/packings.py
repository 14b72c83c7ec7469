"""Packings made by the command ``haff pack``, called from Python."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from .. import reader
from ..common import arguments
from ..common.compiled import compiled
from ..common.temporary import TemporaryFolder
from ..common.words import warn
from ..errors import ArgumentError
from ..packing import Packing
from ..scenes import briefly
from ..text import quoted
from .call import call, failure

__all__ = ["pack"]

MOST = 10_000_000
"""Particles of a packing, at most."""
CONTAINERS = ("periodic", "box", "cylinder", "tube", "sphere")
DENSEST = {2: math.pi / math.sqrt(12), 3: math.pi / math.sqrt(18)}
"""Largest packing fraction of equal disks and spheres, by dimension."""
HIGHEST = 1e12
"""Largest reduced pressure: beyond it rounding decides about gaps."""
PRESSURES = f"must be a number above 1, at most {HIGHEST:g}"
LONGEST = 100_000
"""Characters that sizes may take in an argument of the command: Linux allows 131,072."""


def pack(
    n: int,
    packing_fraction: float | str = "jammed",
    *,
    sizes: Any = None,
    dimension: int = 3,
    container: str = "periodic",
    aspect: float | None = None,
    rate: float | None = None,
    reduced_pressure: float = 1e9,
    seed: int = 0,
    path: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    threads: int | None = None,
    progress: bool = False,
) -> Packing:
    r"""Make a packing of hard spheres or disks: they start as a dilute gas and grow while they collide.

    All diameters grow as σ(t) = σ₀ (1 + γ t) (B. D. Lubachevsky, F. H. Stillinger, J. Stat. Phys. 60, 561 (1990)).
    Growth in a box at rest is, exactly, compression of the box around particles of constant size: with
    x = r/(1 + γ t) and τ = t/(1 + γ t) flights stay straight, and the edge is L (1 − γ τ). The file has that run, with
    constant radii and a box that shrinks; its last frame is the packing.

    Parameters
    ----------
    n
        Number of particles, at least 2.
    packing_fraction
        Where the growth ends, exactly to rounding; ``"jammed"``: at ``reduced_pressure``.
    sizes
        Radii [length], as the ``radius`` of a species in scenes: a number, or a distribution such as
        ``{"lognormal": [0.5, 0.1]}``; a list gives them to the particles in turn. Default: 0.5, diameter 1.
    dimension
        3 for spheres, 2 for disks.
    container
        ``"periodic"``; ``"box"``: walls on all sides; ``"cylinder"``, with flat ends (of disks a circle), ``"tube"``, a
        cylinder that is periodic along its axis z, or ``"sphere"``: it shrinks with the box.
    aspect
        Length of a cylinder or tube [its diameter]; 2 by default.
    rate
        Growth of the largest diameter in the time in which a particle at thermal speed √(T/m) flies by it,
        (dσ/dt)/√(T/m). Slow growth (10⁻³ and less) gives a denser packing, and crystals of equal particles. By default
        0.035 until the particles jam, 0.1 to packing fractions of 0.6 (disks: 0.82), 0.01 to higher ones.
    reduced_pressure
        P V/(N T) at which a packing is jammed, above 1, at most 10¹²; gaps of contacts are then about that part of the
        diameters.
    seed
        Seed of all random numbers.
    path
        File of the packing; by default a temporary one, which :meth:`Packing.save` keeps.
    overwrite
        Whether an existing file is replaced.
    threads
        Default: all processors. No result depends on it.
    progress
        Show the progress bar on standard error.

    Raises
    ------
    ArgumentError
        An argument is invalid; the message says what is allowed.
    SceneError
        The command refuses the sizes; or they cannot be packed to that fraction.
    SimulationError
        The growth ends before the packing fraction is reached: it has jammed. The file has what was reached, if
        ``path`` names it.
    FileError
        The file cannot be written, or exists already.
    KeyboardInterrupt
        Ctrl-C.

    Examples
    --------
    >>> import haff
    >>> packing = haff.pack(1000, 0.6, seed=1)                          # doctest: +SKIP
    >>> packing.packing_fraction, packing.rattlers.sum()                # doctest: +SKIP
    >>> disks = haff.pack(500, sizes=[0.5, 0.7], dimension=2)           # doctest: +SKIP
    >>> disks.contact_number, disks.jamming_fraction().value            # doctest: +SKIP
    """
    count = arguments.count("n", n, 2, MOST)
    d = arguments.count("dimension", dimension, 2, 3)
    text = "" if sizes is None else _sizes(sizes)
    options = ["pack", str(count), "--json", f"--dimension={d}"]
    options.append(_end(packing_fraction, d, sizes is None or np.isscalar(sizes)))
    options.append(f"--container={arguments.choice('container', container, CONTAINERS)}")
    if aspect is not None:
        options.append(f"--aspect={arguments.positive('aspect', aspect)!r}")
    options.append(f"--seed={arguments.count('seed', seed, 0, 2**63 - 1)}")
    if text:
        options.append(f"--sizes={text}")
    pressure = arguments.real("reduced_pressure", reduced_pressure, PRESSURES)
    if not 1 < pressure <= HIGHEST:
        raise ArgumentError(f"reduced_pressure = {quoted(reduced_pressure)}: {PRESSURES}")
    if isinstance(packing_fraction, str):
        options.append(f"--reduced-pressure={pressure!r}")
    if rate is not None:
        options.append(f"--rate={arguments.positive('rate', rate)!r}")
    if threads is not None:
        options.append(f"--threads={arguments.count('threads', threads, 1, 1024)}")
    if not arguments.flag("progress", progress):
        options.append("--quiet")
    if arguments.flag("overwrite", overwrite):
        options.append("--overwrite")
    folder = None
    if path is None:
        folder = TemporaryFolder()
        written = folder.path / "packing.h5"
    else:
        written = arguments.file("path", path)
    done = call([*options, f"--output={written}"], show=progress)
    report = json.loads(done.stdout) if done.stdout.strip() else {}
    if done.returncode != 0:
        raise failure(done, report.get("error"))
    # With progress the command has shown them.
    if not progress:
        warn(report.get("warnings", ()), stacklevel=2)
    return Packing(reader.open(written), folder)


def _end(packing_fraction: object, d: int, equal: bool) -> str:
    """The option that says where the growth ends."""
    if isinstance(packing_fraction, str) and packing_fraction == "jammed":
        return "--jammed"
    most, why = (DENSEST[d], f", the densest of equal {'disks' if d == 2 else 'spheres'}") if equal else (1.0, "")
    allowed = f'must be "jammed", or a number above 0 and below {most:.6g}{why}'
    found = arguments.real("packing_fraction", packing_fraction, allowed)
    if not 0 < found < most:
        raise ArgumentError(f"packing_fraction = {quoted(packing_fraction)}: {allowed}")
    return f"--packing-fraction={found!r}"


def _sizes(sizes: object) -> str:
    """Radii as the TOML value of ``radius`` in scenes."""
    if isinstance(sizes, Mapping):
        value: object = dict(sizes)
    elif np.ndim(found := arguments.reals("sizes", sizes)) == 0:
        value = arguments.positive("sizes", float(found))
    elif found.ndim == 1 and len(found) and (found > 0).all() and np.isfinite(found).all():
        value = {"list": found.tolist()}
    else:
        raise ArgumentError(f"sizes = {quoted(sizes)}: must be positive radii, one or a list, or a distribution")
    with briefly():
        text: str = compiled().value(value, "sizes")
    if len(text) > LONGEST:
        raise ArgumentError(
            f"sizes = {quoted(sizes)}: too long, {len(text):,} characters; give a distribution or a table"
        )
    return text
