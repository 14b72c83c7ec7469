"""GSD, the format of HOOMD-blue, by the library gsd."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..common.output import library
from ..errors import NotApplicableError
from ..files.extent import extent
from ..files.frames import Frame, Frames
from ..files.header import not_triangular
from ..text import escaped

if TYPE_CHECKING:
    from ..files.recording import Recording

_TILTS = {(1, 0): 0, (2, 0): 1, (2, 1): 2}
"""Where the tilt of an edge (row of the matrix) along an axis (column) stands among xy, xz, yz."""


def write(frames: Frames, path: Path, *, unwrapped: bool = False) -> None:
    """Writes frames in single precision, as the format's readers expect.

    GSD boxes are centered at the origin and periodic: positions are those of haff minus the center of the box, which is
    logged as ``box_center``; ``time`` is logged, too. Along open axes the box is the extent of the particles.

    A sheared box is tilted, and positions are moved along the flow into it, an image on. Raises
    :class:`NotApplicableError` if the format cannot hold that box.

    Where particles come and go, a frame has those that are there, and ``particles/id`` in the log says which they are.

    With spin, ``moment_inertia`` is I about each axis of rotation, and ``angmom`` the quaternion (0, 2 I ω) that
    HOOMD-blue has for the default orientation, (1, 0, 0, 0); both are 0 for bodies of infinite mass.
    """
    del unwrapped
    gsd = library("gsd.hoomd", "export")
    file, room = frames.file, extent(frames)
    if fault := not_triangular(file):
        raise NotApplicableError(f"{file.path}: gsd cannot hold the box: {fault}; extxyz can")
    flat = file.dimension == 2
    shapes = _shapes(file)
    moments = _moments(file)
    with gsd.open(str(path), "w") as trajectory:
        for frame in frames:
            here = room.of(frame.box)
            size = here.size.astype(np.float32)
            shifted, velocity = frame.position - here.center, frame.velocity
            position, image = shifted.astype(np.float32), frame.image.astype(np.int32)
            # A coordinate that rounds up to the upper face goes to the lower face of the next image.
            over = file.box.periodic & (position >= size / 2)
            position, image = np.where(over, position - size, position), image + over
            tilts = np.zeros(3, np.float32)
            if (displacement := frame.box.displacement) is not None:
                position, velocity, image = _leaning(frame, position, velocity, image, over)
                gradient, flow, length = displacement
                tilts[_TILTS[gradient, flow]] = length / file.box.size[gradient]
            written = gsd.Frame()
            written.configuration.step = frame.step
            written.configuration.dimensions = file.dimension
            written.configuration.box = [size[0], size[1], 0 if flat else size[2], *tilts]
            particles = written.particles
            particles.N = len(frame.id)
            particles.types = [escaped(name) for name in file.species_names]
            particles.typeid = frame.species
            particles.type_shapes = shapes
            particles.mass = frame.mass
            particles.diameter = 2 * frame.radius
            particles.position, particles.image = position, image
            particles.velocity = velocity
            if moments is not None and frame.angular_velocity is not None:
                moment = moments[frame.id]
                particles.moment_inertia = moment
                particles.angmom = np.pad(2 * moment * frame.angular_velocity, ((0, 0), (1, 0)))
            written.log = {"time": np.array([frame.time]), "box_center": np.asarray(here.center)}
            if file.flows:
                written.log["particles/id"] = frame.id.astype(np.uint32)
            trajectory.append(written)


def _leaning(
    frame: Frame, position: np.ndarray, velocity: np.ndarray, image: np.ndarray, over: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, velocities and images in the leaning box of a sheared frame; ``over``: what went to lower faces."""
    shear, box = frame.file.shear, frame.box
    assert shear is not None and box.displacement is not None
    gradient, flow, length = box.displacement
    up = over[:, gradient]
    edge, lean = np.float32(box.size[flow]), np.float32(length)
    along = position[:, flow] - up * lean
    # The centre of a slice of the box is displaced in proportion to its height.
    centre = position[:, gradient] / np.float32(box.size[gradient]) * lean
    turns = np.floor((along - centre) / edge + np.float32(0.5)).astype(np.int32)
    position, velocity, image = position.copy(), velocity.copy(), image.copy()
    position[:, flow] = along - turns * edge
    image[:, flow] += turns
    # An image lower along the gradient is slower by the flow over one edge.
    velocity[:, flow] -= up * shear.rate * box.size[gradient]
    return position, velocity, image


def _moments(file: Recording) -> np.ndarray | None:
    """``[N, 3]`` moments of inertia about each axis, 0 about those of no rotation; ``None`` without spin."""
    if file.inertia is None:
        return None
    mobile = np.isfinite(file.mass)
    moment = np.where(mobile, file.inertia * np.where(mobile, file.mass, 0.0) * file.radius**2, 0.0)
    return moment[:, None] * [1.0, 1.0, 1.0] if file.dimension == 3 else moment[:, None] * [0.0, 0.0, 1.0]


def _shapes(file: Recording) -> list[dict[str, object]]:
    """Shapes by species: GSD omits diameters that are all 1, and some readers do not apply that default."""
    shapes: list[dict[str, object]] = []
    for species in range(len(file.species_names)):
        sizes = np.unique(2 * file.radius[file.species == species])
        shapes.append({"type": "Sphere", "diameter": float(sizes[0])} if len(sizes) == 1 else {})
    return shapes
