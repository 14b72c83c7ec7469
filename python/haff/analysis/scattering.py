"""Static structure factor with its error, on the reciprocal lattice of the box, from a stated number of waves."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..common.arguments import MOST_ROWS, count, positive
from ..errors import ArgumentError, NotApplicableError
from ..files.layout import Array, computing
from ..text import quoted
from .checked import checked
from .species import Species, index_of

if TYPE_CHECKING:
    from ..files.box import Box
    from ..files.frames import Frame

__all__ = ["Peak", "StaticStructure", "intensities", "lattice", "peak", "static_structure", "vectors"]

MOST_LISTED = 100_000
"""Wave vectors that are listed one by one; in shells beyond them a sample is drawn."""

_MOST_INDICES = 10_000_000

_PARTICLES, _WAVES = 2048, 16
"""Phases are computed for so many particles and waves at once."""


class StaticStructure(NamedTuple):
    """Static structure factor; ``B`` shells that have a wave vector."""

    k: Array
    """``[B]`` mean wave numbers of the shells [1/length]."""
    value: Array
    """``[B]`` S(k) = ⟨|Σ exp(i **k**·**r**)|²⟩/N."""
    error: Array
    """``[B]`` standard errors, with all waves and frames taken as independent; NaN for a single one."""
    waves: NDArray[np.int64]
    """``[B]`` wave vectors used for each frame, of each **k** and −**k** one."""


@checked
def static_structure(
    frames: Iterable[Frame],
    k_max: float,
    bins: int,
    *,
    most_waves: int = 200,
    seed: int = 0,
    species: Species | tuple[Species, Species] | None = None,
) -> StaticStructure:
    """S(k) = ⟨|Σ exp(i **k**·**r**)|²⟩/N in two and three dimensions, averaged over shells of wave vectors and frames.

    The wave vectors are those of the periodic box: **k** = 2π **n** E⁻¹ with whole numbers **n** and edge vectors E, of
    each frame in a sheared box. Phases are computed in single precision, after whole turns have been taken off in
    double: S(k) is good to 10⁻⁵ of itself.

    Parameters
    ----------
    k_max, bins
        Largest wave number [1/length], and the number of shells of equal width between 0 and it. Shells without a wave
        vector are left out.
    most_waves
        Wave vectors of a shell; a random sample of this size where there are more of them.
    seed
        Of that sample.
    species
        Name or index of the species whose particles are counted; or two of them for their partial structure factor
        S_ab(k) = ⟨Re ρ_a(**k**) ρ_b(−**k**)⟩/√(N_a N_b) (Ashcroft and Langreth). By default all particles.

    Raises
    ------
    ArgumentError
        An argument is not positive, or there is no such species.
    NotApplicableError
        A species has no particles, the box is not periodic, no wave of it is as short as ``k_max``, or there are no
        frames.
    """
    k_max, bins, most_waves = positive("k_max", k_max), count("bins", bins), count("most_waves", most_waves)
    seed = count("seed", seed, 0, MOST_ROWS)
    edges = np.linspace(0.0, k_max, bins + 1)
    sums, squares, numbers, lengths = (np.zeros(bins) for _ in range(4))
    waves, used = np.zeros(bins, np.int64), 0
    for frame in frames:
        if used == 0 or frame.box.displacement is not None:
            index = _index(frame, edges, most_waves, seed)
        length, shell, value = _values(frame, index, edges, species)
        waves = np.bincount(shell, minlength=bins)
        numbers += waves
        lengths += np.bincount(shell, length, bins)
        sums += np.bincount(shell, value, bins)
        squares += np.bincount(shell, value**2, bins)
        used += 1
    if used == 0:
        raise NotApplicableError("no frames")
    known = numbers > 0
    n, mean = numbers[known], sums[known] / numbers[known]
    with np.errstate(invalid="ignore", divide="ignore"):
        error = np.sqrt(np.maximum(squares[known] / n - mean**2, 0.0) / (n - 1))
    error[n < 2] = np.nan
    return StaticStructure(lengths[known] / n, mean, error, waves[known])


class Peak(NamedTuple):
    """The long waves of one frame."""

    peak: float
    """The largest S(k) of a shell."""
    peak_error: float
    """Its standard error, with the waves of the shell taken as independent; NaN for a single one."""
    peak_k: float
    """Mean wave number of that shell [1/length]."""
    length: float
    """2π/⟨k⟩ with ⟨k⟩ = ∫ k S dk / ∫ S dk [length]."""


def peak(
    frame: Frame,
    k_max: float,
    bins: int,
    *,
    most_waves: int = 200,
    seed: int = 0,
    species: Species | tuple[Species, Species] | None = None,
) -> Peak:
    """The largest S(k), and the length of the waves up to ``k_max``, of one frame; see :func:`static_structure`.

    The integrals of the length are sums over waves. Each stands for the same volume of reciprocal space, so that it
    counts as 1/k^(d−1), and more in a shell of which a sample is taken. So the length does not depend on the shells.
    """
    edges = np.linspace(0.0, k_max, bins + 1)
    box, d = frame.box, frame.box.dimension
    k, shell, value = _values(frame, _index(frame, edges, most_waves, seed), edges, species)
    number = np.bincount(shell, minlength=bins)
    # Waves of all shells, of each k and −k one.
    expected = 0.5 * box.volume * np.diff((edges / (2 * np.pi)) ** d) * (4 / 3 * np.pi if d == 3 else np.pi)
    share = np.where(number < most_waves, 1.0, np.maximum(expected / np.maximum(number, 1), 1.0))
    weight = share[shell] * value / k ** (d - 1)
    known = np.flatnonzero(number)
    mean = np.bincount(shell, value)[known] / number[known]
    at = int(np.argmax(mean))
    inside = shell == known[at]
    error = np.std(value[inside], ddof=1) / np.sqrt(inside.sum()) if inside.sum() > 1 else np.nan
    mean_k = float(k @ weight / weight.sum())
    return Peak(float(mean[at]), float(error), float(np.mean(k[inside])), 2 * np.pi / mean_k)


def _index(frame: Frame, edges: Array, most_waves: int, seed: int) -> Array:
    """Whole numbers of the waves of a frame, up to so many in each shell."""
    box = frame.box
    if not box.fully_periodic:
        raise NotApplicableError("S(k) needs a periodic box")
    with computing(frame.file.path, "S(k)"):
        index = _sample(box, edges, most_waves, np.random.default_rng(seed))
    if len(index) == 0:
        longest = 2 * np.pi / box.size[: box.dimension].max()
        raise NotApplicableError(f"S(k) needs k_max above that of the longest wave, {longest:g}")
    return index


def _values(
    frame: Frame, index: Array, edges: Array, species: Species | tuple[Species, Species] | None
) -> tuple[Array, NDArray[np.intp], Array]:
    """Wave numbers, shells and structure factors of waves."""
    length = np.linalg.norm(vectors(frame.box, index), axis=1)
    with computing(frame.file.path, "S(k)"):
        return length, _shell(length, edges), _partial(frame, index, species)


def vectors(box: Box, index: Array) -> Array:
    """``[W, d]`` wave vectors 2π **n** E⁻¹ [1/length] of whole numbers ``[W, d]``."""
    d = box.dimension
    return 2 * np.pi * np.asarray(index, float) @ np.linalg.inv(box.edges[:d, :d]).T


def lattice(box: Box, k_max: float) -> Array:
    """``[W, d]`` whole numbers of the waves up to ``k_max`` [1/length]: of each **k** and −**k** one, without 0."""
    d = box.dimension
    most = np.floor(k_max * np.linalg.norm(box.edges[:d, :d], axis=1) / (2 * np.pi))
    if np.prod(2.0 * most + 1) > _MOST_INDICES:
        raise NotApplicableError("the box is too long and thin: there are too many wave vectors along it")
    ranges = [np.arange(-m, m + 1) for m in most]
    index = np.stack(np.meshgrid(*ranges, indexing="ij"), axis=-1).reshape(-1, d)
    # In this order −n is as far from the end as n from the start.
    index = index[len(index) // 2 + 1 :]
    return index[np.linalg.norm(vectors(box, index), axis=1) <= k_max]


def intensities(box: Box, position: Array, index: Array, *, single: bool = True) -> Array:
    """``[W]`` |Σ exp(i **k**·**r**)|² of waves ``[W, d]`` of the box.

    In single precision, after whole turns are taken off in double, a phase takes an eighth of the time.
    """
    real, imaginary = _amplitudes(box, position, index, single)
    return real**2 + imaginary**2


def _partial(frame: Frame, index: Array, species: Species | tuple[Species, Species] | None) -> Array:
    """``[W]`` the structure factor of the particles of a species, or of a pair of them."""
    if species is None:
        return intensities(frame.box, frame.position, index) / len(frame.position)
    pair = species if isinstance(species, tuple | list) else (species, species)
    if len(pair) != 2:
        raise ArgumentError(f"species = {quoted(species)}: must be one species, or two of them")
    sums, numbers = {}, []
    for one in pair:
        kind = index_of(frame, one)
        of = frame.species == kind
        if not of.any():
            raise NotApplicableError(f"{frame.file.path}: there are no particles of species {quoted(one)}")
        if kind not in sums:
            sums[kind] = _amplitudes(frame.box, frame.position[of], index)
        numbers.append((sums[kind], int(of.sum())))
    (a, count_a), (b, count_b) = numbers
    return (a[0] * b[0] + a[1] * b[1]) / np.sqrt(count_a * count_b)


def _amplitudes(box: Box, position: Array, index: Array, single: bool = True) -> Array:
    """``[2, W]`` real and imaginary part of Σ exp(i **k**·**r**)."""
    d = box.dimension
    place = (np.asarray(position, float)[:, :d] @ np.linalg.inv(box.edges[:d, :d])).T
    index = np.asarray(index, float)
    sums = np.zeros((2, len(index)))
    # Pieces of both that the cache holds.
    for first in range(0, place.shape[1], _PARTICLES):
        some = np.ascontiguousarray(place[:, first : first + _PARTICLES])
        for start in range(0, len(index), _WAVES):
            turns = index[start : start + _WAVES] @ some
            turns -= np.rint(turns)
            turns *= 2 * np.pi
            phase = turns.astype(np.float32) if single else turns
            for k, wave in enumerate((np.cos, np.sin)):
                sums[k, start : start + _WAVES] += wave(phase).sum(axis=1, dtype=float)
    return sums


def _shell(length: Array, edges: Array) -> NDArray[np.intp]:
    return np.minimum(np.searchsorted(edges, length, side="left") - 1, len(edges) - 2)


def _sample(box: Box, edges: Array, most: int, rng: np.random.Generator) -> Array:
    """Whole numbers of up to ``most`` waves of each shell."""
    d = box.dimension
    # Waves up to k, of each pair one: half of the ball's volume times V/(2π)^d.
    density = 0.5 * box.volume / (2 * np.pi) ** d * (4 / 3 * np.pi if d == 3 else np.pi)
    listed = edges[np.searchsorted(edges, min((MOST_LISTED / density) ** (1 / d), edges[-1]), side="right") - 1]
    chosen = []
    if listed > 0:
        index = lattice(box, listed)
        shell = _shell(np.linalg.norm(vectors(box, index), axis=1), edges)
        for k in np.unique(shell):
            rows = np.flatnonzero(shell == k)
            chosen.append(index[rows if len(rows) <= most else np.sort(rng.choice(rows, most, replace=False))])
    for low, high in pairwise(edges):
        if high > listed:
            chosen.append(_drawn(box, low, high, most, rng))
    return np.concatenate([*chosen, np.zeros((0, d), int)])


def _drawn(box: Box, low: float, high: float, most: int, rng: np.random.Generator) -> Array:
    """Whole numbers of different waves in a shell of very many, every one with the same probability."""
    d = box.dimension
    edges = box.edges[:d, :d]
    # A wave is drawn if a random point is in the cell around it: points reach beyond the shell by the size of a cell.
    beyond = np.pi * np.linalg.norm(np.linalg.inv(edges), axis=0).sum()
    found = np.zeros((0, d), int)
    for _ in range(100):
        direction = rng.normal(size=(8 * most, d))
        direction /= np.linalg.norm(direction, axis=1)[:, None]
        inner, outer = max(0.0, low - beyond) ** d, (high + beyond) ** d
        length = rng.uniform(inner, outer, 8 * most) ** (1 / d)
        index = np.rint(direction * length[:, None] @ edges.T / (2 * np.pi)).astype(int)
        number = np.linalg.norm(vectors(box, index), axis=1)
        index = index[(number > low) & (number <= high)]
        # Of k and −k the one whose first number other than 0 is positive.
        first = index[np.arange(len(index)), np.argmax(index != 0, axis=1)]
        index = np.concatenate([found, index * np.sign(first)[:, None]])
        found = index[np.sort(np.unique(index, axis=0, return_index=True)[1])]
        if len(found) >= most:
            break
    return found[:most]
