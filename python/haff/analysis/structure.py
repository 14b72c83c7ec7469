"""Pair distribution, structure factor and sizes of clusters by freud."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..common.arguments import count, positive, real
from ..common.output import library
from ..errors import ArgumentError, NotApplicableError
from ..files.conversions import freud_system
from ..files.layout import Array, computing
from ..text import quoted
from .checked import checked
from .scattering import intensities, lattice, vectors

if TYPE_CHECKING:
    from ..files.box import Box
    from ..files.frames import Frame


@checked
def radial_distribution(frames: Iterable[Frame], r_max: float, bins: int, r_min: float = 0.0) -> tuple[Array, Array]:
    """Pair distribution g(r) by freud, averaged over frames: bin centres [length] and values.

    Raises :class:`NotApplicableError` unless the box is periodic and wider than 2 ``r_max``. A sheared box is that of
    each frame.
    """
    r_max, bins = positive("r_max", r_max), count("bins", bins)
    if not 0 <= real("r_min", r_min) < r_max:
        raise ArgumentError(f"r_min = {quoted(r_min)}: must be a number from 0 to below r_max = {r_max:g}")
    freud = library("freud", package="freud-analysis")
    rdf = freud.density.RDF(bins=bins, r_max=r_max, r_min=r_min)
    first = True
    for frame in frames:
        box = frame.box
        if not box.fully_periodic:
            raise NotApplicableError("g(r) needs a periodic box")
        if r_max >= box.widths[: box.dimension].min() / 2:
            raise NotApplicableError(f"the box is too small for g(r) up to {r_max:g}")
        with computing(frame.file.path, "g(r)"):
            rdf.compute(freud_system(box, frame.position), reset=first)
        first = False
    if first:
        raise NotApplicableError("no frames")
    return np.asarray(rdf.bin_centers, float), np.asarray(rdf.rdf, float)


@checked
def structure_factor(frames: Iterable[Frame], k_max: float, bins: int) -> tuple[Array, Array]:
    """Static structure factor S(k), averaged over frames: wave numbers [1/length] and values.

    Direct sums over all wave vectors of the periodic box, by freud in rectangular boxes of three dimensions; bins
    without a wave vector are left out. In a sheared box these are the vectors of each frame, in all directions.
    :func:`static_structure` has errors, and takes a sample of the waves: use it for large systems. Raises
    :class:`NotApplicableError` unless the box is periodic.
    """
    k_max, bins = positive("k_max", k_max), count("bins", bins)
    sums, counted, centers = np.zeros(bins), np.zeros(bins), np.zeros(bins)
    for frame in frames:
        box = frame.box
        if not box.fully_periodic:
            raise NotApplicableError("S(k) needs a periodic box")
        least = 2 * np.pi / box.size[: box.dimension].min()
        if not k_max > least:
            raise NotApplicableError(f"S(k) needs k_max above that of the longest wave, {least:g}")
        with computing(frame.file.path, "S(k)"):
            if box.displacement is None and box.dimension == 3:
                freud = library("freud", package="freud-analysis")
                factor = freud.diffraction.StaticStructureFactorDirect(bins=bins, k_max=k_max, k_min=0.99 * least)
                factor.compute(freud_system(box, frame.position))
                found, centers = np.asarray(factor.S_k, float), np.asarray(factor.bin_centers, float)
            else:
                edges = np.linspace(0.99 * least, k_max, bins + 1)
                found, centers = _all_waves(box, frame.position, edges), 0.5 * (edges[1:] + edges[:-1])
        known = np.isfinite(found)
        sums[known] += found[known]
        counted += known
    known = counted > 0
    if not known.any():
        raise NotApplicableError("no frames")
    return centers[known], sums[known] / counted[known]


def _all_waves(box: Box, position: Array, edges: Array) -> Array:
    """S(k) of a frame, averaged over all wave vectors in each bin; NaN where there is none.

    freud takes three dimensions, and only vectors with positive indices. A sheared fluid is not the same in all
    directions.
    """
    index = lattice(box, edges[-1])
    number = np.linalg.norm(vectors(box, index), axis=1)
    index, number = index[number >= edges[0]], number[number >= edges[0]]
    square = intensities(box, position, index, single=False)
    counts, _ = np.histogram(number, edges)
    sums, _ = np.histogram(number, edges, weights=square)
    return sums / np.where(counts > 0, counts, np.nan) / len(position)


@checked
def cluster_sizes(frame: Frame, reach: float) -> NDArray[np.int64]:
    """Numbers of particles in the clusters of a frame by freud, the largest first.

    Two particles belong to one cluster if their centres are at most ``reach`` [length] apart, or linked by others.
    """
    reach = positive("reach", reach)
    freud = library("freud", package="freud-analysis")
    box = frame.box
    points = np.asarray(frame.position, float).copy()
    size = np.where(box.periodic, box.size, 0.0)[: box.dimension]
    # Along other axes a box wide enough that no pair is linked through its faces.
    span = np.ptp(points[:, : box.dimension], axis=0) + 4 * reach
    edges = np.where(size > 0, size, span)
    if np.any(np.minimum(edges, box.widths[: box.dimension])[size > 0] <= 2 * reach):
        raise NotApplicableError(f"the box is too small for clusters of reach {reach:g}")
    low = np.where(size > 0, 0.0, points[:, : box.dimension].min(axis=0) - 2 * reach)
    points[:, : box.dimension] -= low
    with computing(frame.file.path, "clusters"):
        cluster = freud.cluster.Cluster()
        cluster.compute(freud_system(box, points, edges), neighbors={"r_max": reach})
        return np.sort(np.bincount(np.asarray(cluster.cluster_idx)))[::-1].astype(np.int64)
