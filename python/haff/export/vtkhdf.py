"""VTKHDF, for ParaView and VTK: points with data over time, written by h5py after the format's specification."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from ..common.output import Sink
from ..files.extent import extent
from ..files.frames import Frames
from ..text import escaped

_VERSION = (2, 3)
_CELLS = ("Vertices", "Lines", "Polygons", "Strips")
_CHUNK = 1 << 16  # rows


def write(frames: Frames, path: Path, *, unwrapped: bool = False) -> None:
    """Writes a ``PolyData`` with one vertex a particle and a time step a frame, in double precision.

    Point data: velocity, image, radius, mass, species, id, and with spin angular_velocity; field data: box_origin,
    box_size, periodic, the names of the species, and of a sheared box box_edges, whose rows are the edge vectors at
    each step. Constant data are stored once. VTK's points have no box: positions are those of haff.
    """
    file, room = frames.file, extent(frames)
    counts = np.count_nonzero(frames.present, axis=1).astype(np.int64)
    ends = np.cumsum(counts)
    rows, total = ends - counts, int(counts.sum())
    with Sink(path) as sink, h5py.File(sink, "w", libver=("earliest", "v110")) as hdf:
        root = hdf.create_group("VTKHDF")
        root.attrs["Version"] = np.array(_VERSION, np.int64)
        root.attrs.create("Type", b"PolyData", dtype=h5py.string_dtype("ascii", len("PolyData")))
        # A part for each step where their numbers differ, else one of all.
        parts = counts if file.flows else counts[:1]
        root["NumberOfPoints"] = parts
        for name in _CELLS:
            group = root.create_group(name)
            cells = parts if name == "Vertices" else 0 * parts
            group["NumberOfCells"] = cells
            group["NumberOfConnectivityIds"] = cells
            group["Offsets"] = np.concatenate([np.arange(number + 1, dtype=np.int64) for number in cells])
            group["Connectivity"] = np.concatenate([np.arange(number, dtype=np.int64) for number in cells])

        steps = root.create_group("Steps")
        steps.attrs["NSteps"] = len(frames)
        steps["Values"] = np.asarray(frames.time, float)
        still = np.zeros(len(frames), np.int64)
        steps["PointOffsets"] = rows
        steps["PartOffsets"] = np.arange(len(frames)) if file.flows else still
        steps["NumberOfParts"] = still + 1
        cells = np.zeros((len(frames), len(_CELLS)), np.int64)
        if file.flows:
            cells[:, _CELLS.index("Vertices")] = rows
        steps["CellOffsets"] = steps["ConnectivityIdOffsets"] = cells

        points, offsets = root.create_group("PointData"), steps.create_group("PointDataOffsets")
        fixed = {"radius": file.radius, "mass": file.mass, "species": file.species, "id": np.arange(len(file))}
        moving = {
            "Points": _growing(root, "Points", (total, 3), np.float64),
            "velocity": _growing(points, "velocity", (total, 3), np.float64),
            "image": _growing(points, "image", (total, 3), np.int32),
        }
        if len(frames) and frames[0].angular_velocity is not None:
            moving["angular_velocity"] = _growing(points, "angular_velocity", (total, 3), np.float64)
        for name, values in fixed.items():
            if file.flows:
                moving[name] = _growing(points, name, (total,), values.dtype)
            else:
                points[name], offsets[name] = values, still
        for name in list(moving)[1:]:
            offsets[name] = rows

        field = root.create_group("FieldData")
        sizes, places = steps.create_group("FieldDataSizes"), steps.create_group("FieldDataOffsets")
        periodic = (file.box.periodic & (np.arange(3) < file.dimension)).astype(np.uint8)
        for name, edges in (("box_origin", room.origin), ("box_size", room.size), ("periodic", periodic)):
            field[name] = edges[None, :]
            places[name], sizes[name] = still, np.tile([3, 1], (len(frames), 1))
        if file.compression is not None:
            del field["box_size"], places["box_size"]
            field["box_size"] = np.stack([room.of(box).size for box in frames.boxes()])
            places["box_size"] = np.arange(len(frames))
        if file.shear is not None:
            edges = np.stack([frame.box.edges for frame in frames])
            edges[:, range(3), range(3)] = room.size
            field["box_edges"] = edges.reshape(-1, 3)
            places["box_edges"], sizes["box_edges"] = 3 * np.arange(len(frames)), np.tile([3, 3], (len(frames), 1))
        # VTK reads no strings declared as UTF-8.
        plain = [escaped(name).encode("ascii", "replace") for name in file.species_names]
        field["species_names"] = np.array(plain, h5py.string_dtype("ascii"))
        places["species_names"] = still
        sizes["species_names"] = np.tile([1, len(file.species_names)], (len(frames), 1))

        for row, end, frame in zip(rows, ends, frames):
            written = {"Points": frame.unwrapped if unwrapped else frame.position}
            for name in list(moving)[1:]:
                written[name] = getattr(frame, name)
            for name, values in written.items():
                moving[name][row:end] = values
            sink.check()


def _growing(group: h5py.Group, name: str, shape: tuple[int, ...], dtype: np.typing.DTypeLike) -> h5py.Dataset:
    chunk = (max(1, min(shape[0], _CHUNK)), *shape[1:])
    return group.create_dataset(name, shape, dtype, chunks=chunk, compression="gzip", compression_opts=4, shuffle=True)
