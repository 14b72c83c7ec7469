"""Pair distributions of all particles and of pairs of species, from a stated number of pairs."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..common.arguments import MOST_ROWS, count, positive
from ..errors import NotApplicableError
from ..files.layout import Array, computing
from .checked import checked
from .pairs import close_pairs, require_room

if TYPE_CHECKING:
    from ..files.frames import Frame

__all__ = ["PairDistributions", "pair_distributions"]


class PairDistributions(NamedTuple):
    """Pair distributions with their standard errors; ``S`` species that occur, ``B`` bins."""

    r: Array
    """``[B]`` centers of the bins [length]."""
    species: tuple[int, ...]
    """``[S]`` species indices, in the order of ``partial``."""
    partial: Array
    """``[S, S, B]`` g_ab(r), symmetric; NaN for a species of one particle with itself."""
    partial_error: Array
    """``[S, S, B]`` standard errors of independent pairs."""
    total: Array
    """``[B]`` g(r) of all particles, whatever their species."""
    total_error: Array
    """``[B]`` standard errors."""
    frames: int
    """Frames used."""
    centers: int
    """Particles that distances were counted from, in all frames together."""
    pairs: int
    """Distances counted; a pair of two centers is counted from both."""


@checked
def pair_distributions(
    frames: Iterable[Frame], r_max: float, bins: int, *, most_pairs: float | None = None, seed: int = 0
) -> PairDistributions:
    """g(r) of all particles, and g_ab(r) of each pair of species, averaged over frames, with errors.

    g_ab(r) is the number density of particles b at the distance r from a particle a over their density in the box,
    (N_b − δ_ab)/V, so that it is 1 for independent random points. In a sheared box distances are those of the nearest
    images in the box of the frame.

    Parameters
    ----------
    r_max, bins
        Largest distance [length], and the number of bins from 0 to it.
    most_pairs
        About the largest number of distances to count in all frames together: where it does not suffice, they are
        counted from a random sample of the particles to all others. Default: from all particles.
    seed
        Of that sample.

    Errors are those of counts of independent pairs (Poisson), g/√pairs. Correlations of many pairs, such as those of
    frames that follow one another closely, are not in them.

    Raises
    ------
    ArgumentError
        An argument is not positive.
    NotApplicableError
        The box is not periodic, or not wider than 2 ``r_max``; there are no frames, or none with two
        particles; others do not count.
    """
    r_max, bins, seed = positive("r_max", r_max), count("bins", bins), count("seed", seed, 0, MOST_ROWS)
    limit = math.inf if most_pairs is None else positive("most_pairs", most_pairs)
    found = list(frames)
    if not found:
        raise NotApplicableError("no frames")
    # Where particles come and go, some frames may have none.
    chosen = [frame for frame in found if len(frame.species) > 1]
    if not chosen:
        raise NotApplicableError("fewer than two particles: there is no pair")
    present = np.unique(np.concatenate([frame.species for frame in chosen]))
    tally = _Tally(len(present), bins, r_max)
    rng = np.random.default_rng(seed)
    for frame in chosen:
        box = frame.box
        if not box.fully_periodic:
            raise NotApplicableError("g(r) needs a periodic box")
        require_room(box, r_max, "g(r)")
        species = frame.species
        near = len(species) / box.volume * _ball(r_max, box.dimension)
        share = min(1.0, limit / max(1.0, len(chosen) * len(species) * near))
        centers = np.zeros(len(species), bool)
        centers[rng.permutation(len(species))[: math.ceil(share * len(species))]] = True
        with computing(frame.file.path, "g(r)"):
            tally.add(frame, np.searchsorted(present, species), centers)
    return tally.result(tuple(int(s) for s in present), len(chosen))


class _Tally:
    """Counts of distances by species of both particles and bin, and what they would be for random points."""

    def __init__(self, species: int, bins: int, r_max: float) -> None:
        self.kinds, self.bins, self.r_max = species, bins, r_max
        self.counts = np.zeros((species, species, bins))
        self.random = np.zeros((species, species, bins))
        self.centers = self.particles = 0

    def add(self, frame: Frame, kind: Array, centers: Array) -> None:
        box = frame.box
        size, width = self.kinds * self.kinds * self.bins, self.r_max / self.bins
        shape = self.counts.shape
        for pairs in close_pairs(box, frame.position, self.r_max, centers):
            at = np.minimum((pairs.distance / width).astype(np.intp), self.bins - 1)
            if self.kinds > 1:
                at += self.bins * (self.kinds * kind[pairs.first] + kind[pairs.second])
            self.counts += np.bincount(at, minlength=size).reshape(shape)
        edges = np.linspace(0.0, self.r_max, self.bins + 1)
        shell = np.diff(_ball(edges, box.dimension))
        numbers = np.bincount(kind, minlength=self.kinds).astype(float)
        of_centers = np.bincount(kind[centers], minlength=self.kinds).astype(float)
        others = (numbers[None, :] - np.eye(self.kinds)) / box.volume
        self.random += (of_centers[:, None] * others)[..., None] * shell
        self.centers += int(np.count_nonzero(centers))
        self.particles += len(centers)

    def result(self, species: tuple[int, ...], frames: int) -> PairDistributions:
        # A pair of two centers is counted from both: of a share f of centers, 1 − f/2 of the counts are distinct pairs.
        distinct = 1 - 0.5 * self.centers / self.particles
        counts, random = (both + both.transpose(1, 0, 2) for both in (self.counts, self.random))
        # Of a species with itself the sum of both orders is twice its counts.
        order = np.where(np.eye(self.kinds, dtype=bool)[..., None], 0.5, 1.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            partial = np.where(random > 0, counts / random, np.nan)
            partial_error = partial / np.sqrt(counts * order * distinct)
            total = self.counts.sum(axis=(0, 1)) / self.random.sum(axis=(0, 1))
            total_error = total / np.sqrt(self.counts.sum(axis=(0, 1)) * distinct)
        r = (np.arange(self.bins) + 0.5) * self.r_max / self.bins
        return PairDistributions(
            r, species, partial, partial_error, total, total_error, frames, self.centers, int(self.counts.sum())
        )


def _ball(radius: Array | float, d: int) -> Array:
    """Volume of a ball, or area of a disk."""
    return np.asarray(4 / 3 * np.pi * np.power(radius, 3) if d == 3 else np.pi * np.power(radius, 2))
