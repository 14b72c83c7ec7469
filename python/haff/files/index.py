"""Reading the whole index of a file at once, so that HDF5 reads only rows of datasets afterwards."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import h5py
from h5py import h5a, h5d, h5g, h5o, h5t

__all__ = ["load"]


def load(hdf: h5py.File) -> Iterator[tuple[str, str | None]]:
    """Reads groups, datasets, attributes and the places of all chunks, and has HDF5 keep them.

    What is not with the objects themselves is left to the caller: paths of datasets that hold texts, with ``None``, and
    of groups and datasets with the name of an attribute that does. Damaged objects are passed over.
    """
    keep = hdf.id.get_mdc_config()
    keep.evictions_enabled = False
    # HDF5 demands these with it.
    keep.incr_mode = keep.decr_mode = keep.flash_incr_mode = 0
    hdf.id.set_mdc_config(keep)
    pending, known = [("", h5g.open(hdf.id, b"/"))], set()
    while pending:
        at, group = pending.pop()
        for name in list(group):
            with suppress(Exception):
                node = h5o.open(group, name)
                address = h5o.get_info(node).addr
                if address in known:
                    continue
                known.add(address)
                place = f"{at}{name.decode('utf-8', 'surrogateescape')}"
                for k in range(h5a.get_num_attrs(node)):
                    attribute = h5a.open(node, index=k)
                    if _is_text(attribute.get_type()):
                        yield place, attribute.name.decode("utf-8", "surrogateescape")
                if isinstance(node, h5g.GroupID):
                    pending.append((place + "/", node))
                elif isinstance(node, h5d.DatasetID):
                    if node.get_create_plist().get_layout() == h5d.CHUNKED:
                        node.get_num_chunks()
                    if _is_text(node.get_type()):
                        yield place, None


def _is_text(kind: h5t.TypeID) -> bool:
    return isinstance(kind, h5t.TypeStringID) and kind.is_variable_str()
