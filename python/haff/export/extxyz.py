"""Extended XYZ: text that ASE, OVITO and many others read."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd

from ..files.extent import extent
from ..files.frames import Frames
from ..text import escaped

_PROPERTIES = "type:S:1:pos:R:3:velo:R:3:radius:R:1:mass:R:1:id:I:1:image:I:3"
_SPIN = ":angular_velocity:R:3"


def write(frames: Frames, path: Path, *, unwrapped: bool = False) -> None:
    """Writes frames with all digits of double precision.

    The lattice is the box, its lower corner ``Origin``; ``pbc`` distinguishes periodic axes from walls and open ones.
    Along open axes the lattice is the extent of the particles; that of a sheared box is tilted, and another one in each
    frame. ``angular_velocity`` is there if the scene has spin.
    """
    file, room = frames.file, extent(frames)
    words = [re.sub(r"\s+", "_", escaped(name)).replace('"', "'") for name in file.species_names]
    names = np.array(words)
    origin = " ".join(f"{edge!r}" for edge in room.origin.tolist())
    pbc = " ".join("T" if flag else "F" for flag in file.box.periodic & (np.arange(3) < file.dimension))
    title = re.sub(r'["\\]', "'", escaped(file.title))
    # No newline translation: the specification demands plain line ends.
    with open(path, "w", encoding="utf-8", newline="\n") as out:
        for frame in frames:
            spins, lattice = frame.angular_velocity, frame.box.edges.copy()
            np.fill_diagonal(lattice, room.of(frame.box).size)
            edges = " ".join(f"{edge!r}" for edge in lattice.ravel().tolist())
            properties = _PROPERTIES if spins is None else _PROPERTIES + _SPIN
            out.write(
                f'{len(frame.id)}\nLattice="{edges}" Origin="{origin}" pbc="{pbc}" Properties={properties} '
                f'Time={frame.time!r} Step={frame.step} Title="{title}"\n'
            )
            position = frame.unwrapped if unwrapped else frame.position
            columns = {"type": names[frame.species]}
            columns |= {f"r{k}": position[:, k] for k in range(3)}
            columns |= {f"v{k}": frame.velocity[:, k] for k in range(3)}
            columns |= {"radius": frame.radius, "mass": frame.mass, "id": frame.id}
            columns |= {f"image{k}": frame.image[:, k] for k in range(3)}
            if spins is not None:
                columns |= {f"w{k}": spins[:, k] for k in range(3)}
            pd.DataFrame(columns).to_csv(out, sep=" ", header=False, index=False, lineterminator="\n")
