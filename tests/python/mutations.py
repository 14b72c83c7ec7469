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
"""Numbers of a dataset that a change reads, and bytes of a chunk that it writes: changes take no memory to speak of."""
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
    way = rng.randrange(6)
    if way == 0:
        cut = rng.choice((0, 1, 8, 100, rng.randrange(len(data)), len(data) - 1))
        target.write_bytes(data[:cut])
        return f"cut at {cut}"
    places = [match.start() for match in MARKS.finditer(bytes(data))]
    count = rng.choice((1, 1, 2, 8, 64))
    start = rng.randrange(len(data)) if way == 1 else rng.choice(places)
    for _ in range(count):
        # Mostly in structures of HDF5, although plain data are most of the file.
        at = start + rng.randrange(4096 if way == 1 else 256)
        if at < len(data):
            data[at] = rng.choice((rng.randrange(256), 0, 255, data[at] ^ 1 << rng.randrange(8)))
    if way == 2:
        size = rng.choice((8, 512, 4096))
        data[start : start + size] = rng.choice((bytes(size), b"\xff" * size, rng.randbytes(size)))
    target.write_bytes(data)
    return f"{count} bytes from {start}" + (", a block" if way == 2 else "")


# --- through HDF5 --------------------------------------------------------------------------------------


def _place(file: h5py.File, rng: random.Random, kind: type = h5py.Dataset) -> str:
    """A path, mostly of a dataset that is read."""
    found: list[str] = []
    file.visititems(lambda name, node: found.append(name) if isinstance(node, kind) else None)
    read = [name for name in found if not name.startswith("checkpoint")]
    return rng.choice(read if read and rng.random() < 0.95 else found)


def _data(file: h5py.File, place: str) -> Any:
    """All of a dataset, unless an earlier change has declared it to be large."""
    if (file[place].size or 0) > MOST:
        raise ValueError(f"{place} is large")
    return file[place][()]


def _delete(file: h5py.File, rng: random.Random) -> str:
    place = _place(file, rng, rng.choice((h5py.Dataset, h5py.Dataset, h5py.Group)))
    del file[place]
    return place


def _replace(file: h5py.File, place: str, **options) -> None:
    del file[place]
    file.create_dataset(place, **options)


def _retype(file: h5py.File, rng: random.Random) -> str:
    place = _place(file, rng)
    data = _data(file, place)
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
        _replace(file, place, shape=shape, dtype=[("a", "f8"), ("b", "i4")])
    elif kind == "text":
        _replace(file, place, data=np.full(shape, rng.choice(NASTY), object), dtype=h5py.string_dtype())
    elif kind == "enum":
        _replace(file, place, shape=shape, dtype=h5py.enum_dtype({"=a": -1, "collision": 0, "b\n": 200}, "i2"))
    elif kind == "reference":
        _replace(file, place, shape=shape, dtype=h5py.ref_dtype)
    elif kind in ("S5", "V3"):
        _replace(file, place, shape=shape, dtype=kind)
    else:
        with np.errstate(all="ignore"):
            _replace(file, place, data=np.asarray(data).astype(kind))
    return f"{place} to {kind}"


def _reshape(file: h5py.File, rng: random.Random) -> str:
    place = _place(file, rng)
    data = np.asarray(_data(file, place))
    shapes = [
        data[None], data[..., None], data.ravel(), data[:1], data[:-1], data[..., :2], data[()], data.T, data[:0],
        np.concatenate([data, data]), data.reshape(-1)[0], np.broadcast_to(data.reshape(-1)[:1], (1,) * 32),
    ]  # fmt: skip
    chosen = np.array(rng.choice(shapes))
    _replace(file, place, data=chosen, dtype=file[place].dtype)
    return f"{place} to {chosen.shape}"


def _empty(file: h5py.File, rng: random.Random) -> str:
    place = _place(file, rng)
    _replace(file, place, data=h5py.Empty("f8"))
    return place


def _declare(file: h5py.File, rng: random.Random) -> str:
    """Declares a shape without stored data."""
    place = _place(file, rng)
    data = file[place]
    rows, width, dtype = 1 << rng.randrange(16, 45), data.shape[1:], data.dtype
    way = rng.choice(("resize", "contiguous", "chunked", "filtered", "wide"))
    if way == "resize" and data.maxshape and data.maxshape[0] is None:
        data.resize(rows, axis=0)
    elif way == "filtered":
        most = max(1, MOST // max(1, dtype.itemsize * int(np.prod(width))))
        chunk = (rng.randrange(1, most + 1), *width)
        _replace(file, place, shape=(rows, *width), dtype=dtype, chunks=chunk, compression="gzip", shuffle=True)
        file[place][:1] = np.zeros((1, *width), dtype)
    elif way == "wide":
        _replace(file, place, shape=(2, rows), dtype=dtype, chunks=(1, 4096))
    else:
        _replace(file, place, shape=(rows, *width), dtype=dtype, chunks=(1024, *width) if way == "chunked" else None)
    return f"{place} {way} {rows}"


def _value(file: h5py.File, rng: random.Random) -> str:
    place = _place(file, rng)
    data = file[place]
    values = np.asarray(_data(file, place))
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
    return f"{place} {ascii(value)[:20]} {at if isinstance(at, slice) else at[:3]}"


def _order(file: h5py.File, rng: random.Random) -> str:
    place = _place(file, rng)
    values = np.asarray(_data(file, place))
    way = rng.choice(("reverse", "shuffle", "noise", "scale"))
    if way == "reverse":
        values = values[::-1]
    elif way == "shuffle":
        values = np.random.default_rng(rng.randrange(1 << 30)).permutation(values)
    elif way == "noise":
        values = np.frombuffer(rng.randbytes(values.nbytes), values.dtype).reshape(values.shape)
    else:
        with np.errstate(all="ignore"):
            values = (values * rng.choice((-1, 1e9, 1e-9, 1e60, 0))).astype(values.dtype)
    file[place][...] = values
    return f"{place} {way}"


def _swap(file: h5py.File, rng: random.Random) -> str:
    if rng.random() < 0.5:
        place = _place(file, rng)
        del file[place]
        file.create_group(place)["value"] = 1.0
    else:
        place = _place(file, rng, h5py.Group)
        del file[place]
        file[place] = 1.0
    return place


def _link(file: h5py.File, rng: random.Random) -> str:
    place, other = _place(file, rng, rng.choice((h5py.Dataset, h5py.Group))), _place(file, rng, h5py.Dataset)
    way = rng.choice(("nowhere", "soft", "itself", "outside", "missing", "hard", "loop", "device"))
    if way == "hard":
        target = file[other]
    elif way == "loop":
        target = file["/"]
    else:
        target = {
            "nowhere": h5py.SoftLink("/no/such/place"),
            "soft": h5py.SoftLink("/" + other),
            "itself": h5py.SoftLink("/" + place),
            "outside": h5py.ExternalLink(file.filename, other),
            "missing": h5py.ExternalLink("missing.h5", "x"),
            "device": h5py.ExternalLink("/dev/zero", "x"),
        }[way]
    del file[place]
    file[place] = target
    return f"{place} {way} {other}"


def _elsewhere(file: h5py.File, rng: random.Random) -> str:
    """Data of other files: a virtual dataset, or one whose bytes are those of any file."""
    place = _place(file, rng)
    shape, dtype = file[place].shape, file[place].dtype
    if rng.random() < 0.5:
        size = max(1, int(np.prod(shape)) * dtype.itemsize)
        _replace(file, place, shape=shape, dtype=dtype, external=[("/dev/zero", 0, size)])
        return f"{place} external"
    layout = h5py.VirtualLayout(shape=shape, dtype=dtype)
    layout[...] = h5py.VirtualSource(file.filename, "particles/all/mass", shape=shape)
    del file[place]
    file.create_virtual_dataset(place, layout)
    return f"{place} virtual"


def _storage(file: h5py.File, rng: random.Random) -> str:
    """Other valid ways to store the same data."""
    place = _place(file, rng)
    values = _data(file, place)
    way = rng.choice(("lzf", "gzip", "scaleoffset", "fletcher", "holes"))
    options: dict = {
        "lzf": {"compression": "lzf"},
        "gzip": {"compression": "gzip", "compression_opts": 9},
        "scaleoffset": {"scaleoffset": 3},
        "fletcher": {"fletcher32": True},
        "holes": {},
    }[way]
    dtype = file[place].dtype
    if way == "holes":
        _replace(file, place, shape=np.shape(values), dtype=dtype, chunks=True)
    else:
        _replace(file, place, data=values, dtype=dtype, **options)
    return f"{place} {way}"


def _attribute(file: h5py.File, rng: random.Random) -> str:
    place = rng.choice(("particles/all/box", "particles/all/box", "parameters", "h5md", "particles/all", "events"))
    attrs = file[place].attrs
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
    return f"{place}@{name} = {ascii(value)[:30]}"


def _scene(file: h5py.File, rng: random.Random) -> str:
    """Another value for a key, another key, another title, or no TOML at all."""
    text = _data(file, "parameters/scene").decode()
    lines = text.splitlines()
    way = rng.choice(
        ("value", "value", "value", "value", "title", "names", "drop", "twice", "text", "bytes", "deep", "add")
    )
    keys = [k for k, line in enumerate(lines) if " = " in line]
    tables = [k for k, line in enumerate(lines) if line.startswith("[")]
    value: bytes | None = None
    if way == "value":
        k = rng.choice(keys)
        lines[k] = lines[k].split(" = ")[0] + " = " + rng.choice(VALUES)
    elif way in ("title", "names"):
        key = "title" if way == "title" else "name"
        nasty = rng.choice(NASTY)
        told = '"' + "".join(f"\\U{ord(c):08x}" if not c.isalnum() else c for c in nasty) + '"'
        lines = [f"{key} = {told}" if line.startswith(f"{key} =") else line for line in lines]
        if way == "names":
            del file["parameters/species_names"]
    elif way == "drop":
        del lines[rng.randrange(len(lines))]
    elif way == "twice":
        lines.insert(rng.randrange(len(lines)), rng.choice(lines))
    elif way == "text":
        lines = [rng.choice(NASTY)]
    elif way == "bytes":
        value = rng.randbytes(50)
    elif way == "deep":
        lines.append("x = " + "[" * 5000 + "]" * 5000)
    elif tables:
        k = rng.choice(tables)
        lines[k] = rng.choice(
            ("[domain]", "[[wall]]", "[[pendulum]]", "[[spring]]", "[[rod]]", "[[contact.pair]]", "[title]")
        )
    del file["parameters/scene"]
    file["parameters/scene"] = value.replace(b"\0", b"0") if value is not None else "\n".join(lines)
    return way


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
