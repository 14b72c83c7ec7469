"""Damaged and foreign files: an output file of ``haff run``, changed at random by bytes or through HDF5."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

NASTY = (
    "{{content}} {{styles}} {{title}}", "</script><script>alert(1)</script>", "cost $x_$ and $\\frac{$",
    "\x1b[31mred\x1b[0m", "gas\nerror: forged", "=1+1", "@SUM(A1)", "\tname", "a\rb", "", "_hidden", "x" * 100_000,
    "\u202egas", "\u65e5\u672c", '"quoted", and \\', "%s %d {0} {x}", "&amp;<b>",
)  # fmt: skip
VALUES = (
    "5", "-1", "0", '"text"', "true", "[]", "[1, 2, 3, 4]", "{}", "nan", "inf", "-inf", "1e300", "1e-300", "[[1]]",
    '["a"]', '""', "[0, 0, 0]", "[nan, 1, 1]", "99999999999999999999", "1979-05-27", "{ model = 5 }", "[{}]",
    '["a", "b"]', "[1, 2]",
)  # fmt: skip
MOST = 1 << 20
"""Most numbers that a change reads and bytes that it writes to a chunk: changes must need little memory."""
MARKS = re.compile(rb"TREE|HEAP|SNOD|GCOL|OHDR|OCHK|FRHP|BTHD|\x89HDF")


def mutate(source: Path, target: Path, seed: int) -> str:
    """Writes a changed copy; returns a description of the change."""
    rng = random.Random(seed)
    if rng.random() < 0.4:
        return _bytes(source, target, rng)
    target.write_bytes(source.read_bytes())
    done = []
    with h5py.File(target, "r+") as file:
        for _ in range(rng.choice((1, 1, 2))):
            change = rng.choice(CHANGES)
            try:
                done.append(f"{change.__name__[1:]} {change(file, rng)}")
            except Exception as error:
                # An earlier change may have removed the object of this one; its partial changes stay.
                done.append(f"{change.__name__[1:]} failed: {error}")
    return ascii("; ".join(done))


# --- bytes -------------------------------------------------------------------------------------------


def _bytes(source: Path, target: Path, rng: random.Random) -> str:
    data = bytearray(source.read_bytes())
    mode = rng.randrange(6)
    if mode == 0:
        cut = rng.choice((0, 1, 8, 100, rng.randrange(len(data)), len(data) - 1))
        target.write_bytes(data[:cut])
        return f"cut at {cut}"
    marks = [match.start() for match in MARKS.finditer(bytes(data))]
    count = rng.choice((1, 1, 2, 8, 64))
    start = rng.randrange(len(data)) if mode == 1 else rng.choice(marks)
    for _ in range(count):
        # Mostly in structures of HDF5, although plain data are most of the file.
        at = start + rng.randrange(4096 if mode == 1 else 256)
        if at < len(data):
            data[at] = rng.choice((rng.randrange(256), 0, 255, data[at] ^ 1 << rng.randrange(8)))
    if mode == 2:
        size = rng.choice((8, 512, 4096))
        data[start : start + size] = rng.choice((bytes(size), b"\xff" * size, rng.randbytes(size)))
    target.write_bytes(data)
    return f"{count} bytes from {start}" + (", a block" if mode == 2 else "")


# --- through HDF5 --------------------------------------------------------------------------------------


def _path(file: h5py.File, rng: random.Random, kind: type = h5py.Dataset) -> str:
    """A path, mostly of a dataset that is read."""
    found: list[str] = []
    file.visititems(lambda name, node: found.append(name) if isinstance(node, kind) else None)
    read = [name for name in found if not name.startswith("checkpoint")]
    return rng.choice(read if read and rng.random() < 0.95 else found)


def _data(file: h5py.File, path: str) -> Any:
    """All of a dataset, unless an earlier change has declared it to be large."""
    if (file[path].size or 0) > MOST:
        raise ValueError(f"{path} is large")
    return file[path][()]


def _delete(file: h5py.File, rng: random.Random) -> str:
    path = _path(file, rng, rng.choice((h5py.Dataset, h5py.Dataset, h5py.Group)))
    del file[path]
    return path


def _replace(file: h5py.File, path: str, **options) -> None:
    del file[path]
    file.create_dataset(path, **options)


def _retype(file: h5py.File, rng: random.Random) -> str:
    path = _path(file, rng)
    data = _data(file, path)
    kinds: list = [
        "f2",
        "f4",
        ">f8",
        "i1",
        ">i4",
        "i8",
        "u8",
        "c16",
        "S5",
        "V3",
        "?",
        "compound",
        "text",
        "enum",
        "reference",
    ]
    kind = rng.choice(kinds)
    shape = np.shape(data)
    if kind == "compound":
        _replace(file, path, shape=shape, dtype=[("a", "f8"), ("b", "i4")])
    elif kind == "text":
        _replace(file, path, data=np.full(shape, rng.choice(NASTY), object), dtype=h5py.string_dtype())
    elif kind == "enum":
        _replace(file, path, shape=shape, dtype=h5py.enum_dtype({"=a": -1, "collision": 0, "b\n": 200}, "i2"))
    elif kind == "reference":
        _replace(file, path, shape=shape, dtype=h5py.ref_dtype)
    elif kind in ("S5", "V3"):
        _replace(file, path, shape=shape, dtype=kind)
    else:
        with np.errstate(all="ignore"):
            _replace(file, path, data=np.asarray(data).astype(kind))
    return f"{path} to {kind}"


def _reshape(file: h5py.File, rng: random.Random) -> str:
    path = _path(file, rng)
    data = np.asarray(_data(file, path))
    shapes = [
        data[None], data[..., None], data.ravel(), data[:1], data[:-1], data[..., :2], data[()], data.T, data[:0],
        np.concatenate([data, data]), data.reshape(-1)[0], np.broadcast_to(data.reshape(-1)[:1], (1,) * 32),
    ]  # fmt: skip
    chosen = np.array(rng.choice(shapes))
    _replace(file, path, data=chosen, dtype=file[path].dtype)
    return f"{path} to {chosen.shape}"


def _empty(file: h5py.File, rng: random.Random) -> str:
    path = _path(file, rng)
    _replace(file, path, data=h5py.Empty("f8"))
    return path


def _declare(file: h5py.File, rng: random.Random) -> str:
    """Declares a shape without stored data."""
    path = _path(file, rng)
    data = file[path]
    rows, width, dtype = 1 << rng.randrange(16, 45), data.shape[1:], data.dtype
    mode = rng.choice(("resize", "contiguous", "chunked", "filtered", "wide"))
    if mode == "resize" and data.maxshape and data.maxshape[0] is None:
        data.resize(rows, axis=0)
    elif mode == "filtered":
        most = max(1, MOST // max(1, dtype.itemsize * int(np.prod(width))))
        chunk = (rng.randrange(1, most + 1), *width)
        _replace(file, path, shape=(rows, *width), dtype=dtype, chunks=chunk, compression="gzip", shuffle=True)
        file[path][:1] = np.zeros((1, *width), dtype)
    elif mode == "wide":
        _replace(file, path, shape=(2, rows), dtype=dtype, chunks=(1, 4096))
    else:
        _replace(file, path, shape=(rows, *width), dtype=dtype, chunks=(1024, *width) if mode == "chunked" else None)
    return f"{path} {mode} {rows}"


def _value(file: h5py.File, rng: random.Random) -> str:
    path = _path(file, rng)
    data = file[path]
    values = np.asarray(_data(file, path))
    flat = values.reshape(-1)
    count = rng.choice((1, 1, 3, flat.size))
    at = [rng.randrange(flat.size) for _ in range(min(count, 200))] if count < flat.size else slice(None)
    if values.dtype.kind == "f":
        value = rng.choice((np.nan, np.inf, -np.inf, -1.0, 0.0, 1e300, -1e300, 1e-300, 1e99, 1e-99, 5e-324, 1e10))
    elif values.dtype.kind in "iu":
        limits = np.iinfo(values.dtype)
        value = rng.choice((limits.min, limits.max, 0, 1, limits.max // 2, 7))
    else:
        value = rng.choice((b"\xff\xfe", *NASTY))
    if values.ndim == 0:
        data[()] = value
    else:
        flat[at] = value
        data[...] = flat.reshape(values.shape)
    return f"{path} {ascii(value)[:20]} {at if isinstance(at, slice) else at[:3]}"


def _order(file: h5py.File, rng: random.Random) -> str:
    path = _path(file, rng)
    values = np.asarray(_data(file, path))
    mode = rng.choice(("reverse", "shuffle", "noise", "scale"))
    if mode == "reverse":
        values = values[::-1]
    elif mode == "shuffle":
        values = np.random.default_rng(rng.randrange(1 << 30)).permutation(values)
    elif mode == "noise":
        values = np.frombuffer(rng.randbytes(values.nbytes), values.dtype).reshape(values.shape)
    else:
        with np.errstate(all="ignore"):
            values = (values * rng.choice((-1, 1e9, 1e-9, 1e60, 0))).astype(values.dtype)
    file[path][...] = values
    return f"{path} {mode}"


def _swap(file: h5py.File, rng: random.Random) -> str:
    if rng.random() < 0.5:
        path = _path(file, rng)
        del file[path]
        file.create_group(path)["value"] = 1.0
    else:
        path = _path(file, rng, h5py.Group)
        del file[path]
        file[path] = 1.0
    return path


def _link(file: h5py.File, rng: random.Random) -> str:
    path, other = _path(file, rng, rng.choice((h5py.Dataset, h5py.Group))), _path(file, rng, h5py.Dataset)
    mode = rng.choice(("nowhere", "soft", "itself", "outside", "missing", "hard", "loop", "device"))
    if mode == "hard":
        target = file[other]
    elif mode == "loop":
        target = file["/"]
    else:
        target = {
            "nowhere": h5py.SoftLink("/no/such/place"),
            "soft": h5py.SoftLink("/" + other),
            "itself": h5py.SoftLink("/" + path),
            "outside": h5py.ExternalLink(file.filename, other),
            "missing": h5py.ExternalLink("missing.h5", "x"),
            "device": h5py.ExternalLink("/dev/zero", "x"),
        }[mode]
    del file[path]
    file[path] = target
    return f"{path} {mode} {other}"


def _elsewhere(file: h5py.File, rng: random.Random) -> str:
    """Data of other files: a virtual dataset, or one whose bytes are those of any file."""
    path = _path(file, rng)
    shape, dtype = file[path].shape, file[path].dtype
    if rng.random() < 0.5:
        size = max(1, int(np.prod(shape)) * dtype.itemsize)
        _replace(file, path, shape=shape, dtype=dtype, external=[("/dev/zero", 0, size)])
        return f"{path} external"
    layout = h5py.VirtualLayout(shape=shape, dtype=dtype)
    layout[...] = h5py.VirtualSource(file.filename, "particles/all/mass", shape=shape)
    del file[path]
    file.create_virtual_dataset(path, layout)
    return f"{path} virtual"


def _storage(file: h5py.File, rng: random.Random) -> str:
    """Other valid ways to store the same data."""
    path = _path(file, rng)
    values = _data(file, path)
    mode = rng.choice(("lzf", "gzip", "scaleoffset", "fletcher", "holes"))
    options: dict = {
        "lzf": {"compression": "lzf"},
        "gzip": {"compression": "gzip", "compression_opts": 9},
        "scaleoffset": {"scaleoffset": 3},
        "fletcher": {"fletcher32": True},
        "holes": {},
    }[mode]
    dtype = file[path].dtype
    if mode == "holes":
        _replace(file, path, shape=np.shape(values), dtype=dtype, chunks=True)
    else:
        _replace(file, path, data=values, dtype=dtype, **options)
    return f"{path} {mode}"


def _attribute(file: h5py.File, rng: random.Random) -> str:
    path = rng.choice(("particles/all/box", "particles/all/box", "parameters", "h5md", "particles/all", "events"))
    attrs = file[path].attrs
    name = rng.choice(("boundary", "boundary", "dimension", "title", "seed", "scene", "version", "species_names"))
    value = rng.choice(
        (
            None,
            5,
            -1.5,
            "text",
            "",
            b"\xff\xfe",
            np.nan,
            np.zeros(7000),
            ["periodic"] * 7,
            ["wall"] * 3,
            ["none"],
            np.array([b"periodic"] * 3),
            np.array([b"\xff\xff"] * 3),
            h5py.Empty("f8"),
            [[1, 2], [3, 4]],
            *NASTY[:10],
        )
    )
    if name in attrs:
        del attrs[name]
    if value is not None:
        attrs[name] = value
    return f"{path}@{name} = {ascii(value)[:30]}"


def _scene(file: h5py.File, rng: random.Random) -> str:
    """Another value for a key, another key, another title, or no TOML at all."""
    text = _data(file, "parameters/scene").decode()
    lines = text.splitlines()
    mode = rng.choice(
        ("value", "value", "value", "value", "title", "names", "drop", "twice", "text", "bytes", "deep", "add")
    )
    keys = [k for k, line in enumerate(lines) if " = " in line]
    tables = [k for k, line in enumerate(lines) if line.startswith("[")]
    value: bytes | None = None
    if mode == "value":
        k = rng.choice(keys)
        lines[k] = lines[k].split(" = ")[0] + " = " + rng.choice(VALUES)
    elif mode in ("title", "names"):
        key = "title" if mode == "title" else "name"
        nasty = rng.choice(NASTY)
        escaped = '"' + "".join(f"\\U{ord(c):08x}" if not c.isalnum() else c for c in nasty) + '"'
        lines = [f"{key} = {escaped}" if line.startswith(f"{key} =") else line for line in lines]
        if mode == "names":
            del file["parameters/species_names"]
    elif mode == "drop":
        del lines[rng.randrange(len(lines))]
    elif mode == "twice":
        lines.insert(rng.randrange(len(lines)), rng.choice(lines))
    elif mode == "text":
        lines = [rng.choice(NASTY)]
    elif mode == "bytes":
        value = rng.randbytes(50)
    elif mode == "deep":
        lines.append("x = " + "[" * 5000 + "]" * 5000)
    elif tables:
        k = rng.choice(tables)
        lines[k] = rng.choice(
            ("[domain]", "[[wall]]", "[[pendulum]]", "[[spring]]", "[[rod]]", "[[contact.pair]]", "[title]")
        )
    del file["parameters/scene"]
    file["parameters/scene"] = value.replace(b"\0", b"0") if value is not None else "\n".join(lines)
    return mode


def _add(file: h5py.File, rng: random.Random) -> str:
    name = rng.choice(
        ("=1+1", "\x1b[31m", "time", "step", "a\nb", "axis", "species", "species_x", "momentum_x", "x" * 1000)
    )
    group = rng.choice(("observables", "events", "parameters"))
    if group == "observables":
        samples = file["observables/kinetic_energy/time"].shape[0]
        width = rng.choice(((), (1,), (2,), (3,), (17,), (3, 3)))
        element = file[group].require_group(name)
        element["value"] = np.ones((samples, *width))
        for part in ("time", "step"):
            element[part] = file[f"observables/kinetic_energy/{part}"]
    else:
        file[group][name] = rng.choice((np.zeros((5, 40)), 5, np.zeros(3), "text", np.ones((2, 2, 2))))
    return f"{group}/{ascii(name)[:20]}"


CHANGES: tuple[Callable[[h5py.File, random.Random], str], ...] = (
    _delete, _retype, _retype, _reshape, _reshape, _empty, _declare, _declare, _value, _value, _value, _order,
    _swap, _link, _elsewhere, _storage, _attribute, _scene, _scene, _scene, _add,
)  # fmt: skip
