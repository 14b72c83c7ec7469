"""Checks and statistics on recorded runs, on top of SciPy, freud and pandas."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import theory
from .errors import ArgumentError, MissingDataError, NotApplicableError
from .layout import AXES, computing
from .measurements import correlation_columns
from .recorded import is_rough

if TYPE_CHECKING:
    import freud
    import xarray

    from .frames import Box, Frame
    from .reader import File

__all__ = [
    "CoolingLaw",
    "Estimate",
    "Overlap",
    "Rheology",
    "Transport",
    "block_average",
    "cluster_sizes",
    "cooling_law",
    "drawn_frames",
    "gas_restitution",
    "kinetic_energy",
    "max_overlap",
    "radial_distribution",
    "rheology",
    "rotational_energy",
    "rotational_temperature",
    "running_integral",
    "scaled_velocities",
    "self_diffusion",
    "shear_viscosity",
    "sonine_a2",
    "structure_factor",
    "temperature",
    "velocity_histogram",
    "viscosity_scale",
]

Array = NDArray[np.float64]


class Overlap(NamedTuple):
    """The deepest overlap of a frame."""

    depth: float
    """(R_i + R_j − |r_ij|)/(R_i + R_j), relative to the contact distance; negative: the closest pair is apart."""
    pair: tuple[int, int]
    """Rows of the two particles, (−1, −1) if no pair is near contact."""


class Estimate(NamedTuple):
    """A mean with its standard error."""

    mean: float
    error: float

    def z(self, expected: float, uncertainty: float = 0.0) -> float:
        """(mean − expected) in standard errors; ``uncertainty`` of the expectation is added in quadrature."""
        return (self.mean - expected) / float(np.hypot(self.error, uncertainty))


def max_overlap(frame: Frame) -> Overlap:
    """Deepest overlap of all close pairs of a frame, relative to the pair's contact distance.

    A k-d tree finds every pair nearer than the largest contact distance, across periodic faces too, those of a sheared
    box among them; sizes may differ. Pairs of two bodies of infinite mass are excluded: they may overlap by
    construction.
    """
    radius, box = frame.radius, frame.box
    if len(radius) < 2:
        return Overlap(-np.inf, (-1, -1))
    # A box side of 0 means "not periodic" to cKDTree; positions must lie in [0, L) where it is.
    sides = np.where(box.periodic, box.size, 0.0)
    position = np.where(box.periodic, np.mod(frame.position, np.where(box.periodic, box.size, 1.0)), frame.position)
    position = np.where(box.periodic & (position >= box.size), 0.0, position)
    reach = 2 * radius.max() * (1 + 1e-9)
    if np.any(box.periodic & (box.size < 2 * reach)):
        blocks = _all_pairs(len(position))
    elif box.displacement is not None:
        blocks = iter([_sheared_pairs(position, box, reach)])
    else:
        from scipy.spatial import cKDTree

        blocks = iter([cKDTree(position, boxsize=sides).query_pairs(reach, output_type="ndarray")])
    heavy = np.isinf(frame.mass)
    deepest = Overlap(-np.inf, (-1, -1))
    for pairs in blocks:
        pairs = pairs[~(heavy[pairs[:, 0]] & heavy[pairs[:, 1]])]
        gap = box.nearest(position[pairs[:, 1]] - position[pairs[:, 0]])
        contact = radius[pairs[:, 0]] + radius[pairs[:, 1]]
        depth = (contact - np.linalg.norm(gap, axis=1)) / contact
        if depth.max(initial=-np.inf) > deepest.depth:
            worst = int(np.argmax(depth))
            deepest = Overlap(float(depth[worst]), (int(pairs[worst, 0]), int(pairs[worst, 1])))
    return deepest


def _sheared_pairs(position: Array, box: Box, reach: float) -> NDArray[np.intp]:
    """Rows of all pairs within ``reach`` in a sheared box; across the faces of the gradient axis by copies there."""
    from scipy.spatial import cKDTree

    assert box.displacement is not None
    gradient, flow, _ = box.displacement
    low = np.flatnonzero(position[:, gradient] <= reach)
    copies = position[low] + box.edges[gradient]
    copies[:, flow] = np.mod(copies[:, flow], box.size[flow])
    copies[copies[:, flow] >= box.size[flow], flow] = 0.0
    sides = box.size.copy()
    sides[gradient] = 0.0
    tree = cKDTree(np.concatenate([position, copies]), boxsize=sides)
    pairs = np.concatenate([np.arange(len(position)), low])[tree.query_pairs(reach, output_type="ndarray")]
    # A particle may be near its own copy only in a box that is thinner than twice the reach.
    return pairs[pairs[:, 0] != pairs[:, 1]]


def _all_pairs(count: int) -> Iterator[NDArray[np.intp]]:
    """Every pair once, about a million at a time: for boxes too small for a periodic tree."""
    rows = max(1, (1 << 20) // count)
    for first in range(0, count, rows):
        i, j = np.meshgrid(np.arange(first, min(first + rows, count)), np.arange(count), indexing="ij")
        yield np.stack([i[i < j], j[i < j]], axis=1)


def kinetic_energy(frame: Frame) -> float:
    """Σ ½ m v² over bodies of finite mass, of translation [energy], summed exactly and rounded once.

    In a sheared box the velocities are those relative to the flow.
    """
    mobile = np.isfinite(frame.mass)
    return _energy(frame.mass[mobile], frame.peculiar_velocity[mobile])


def rotational_energy(frame: Frame) -> float:
    """Σ ½ I ω², I = q m R², over bodies of finite mass [energy], summed exactly and rounded once; 0 without spin."""
    if frame.inertia is None or frame.angular_velocity is None:
        return 0.0
    mobile = np.isfinite(frame.mass)
    moment = (frame.inertia * frame.mass * frame.radius**2)[mobile]
    return _energy(moment, frame.angular_velocity[mobile])


def _energy(mass: Array, velocity: Array) -> float:
    with np.errstate(over="ignore", invalid="ignore"):
        energies = 0.5 * mass * np.einsum("ij,ij->i", velocity, velocity)
    try:
        total = math.fsum(energies)
    except OverflowError:
        total = math.inf
    if not math.isfinite(total):
        raise NotApplicableError("the kinetic energy is too large for a number")
    return total


def temperature(frame: Frame, species: int | None = None) -> float:
    """T = Σ m|v − V|²/(dN) over bodies of finite mass, V their common centre-of-mass velocity [energy].

    ``species`` restricts the sum, not V. In a sheared box the velocities are those relative to the flow.
    """
    mobile = np.isfinite(frame.mass)
    if not mobile.any():
        return float("nan")
    mass, velocity = frame.mass[mobile], frame.peculiar_velocity[mobile]
    velocity = velocity - np.average(velocity, axis=0, weights=mass)
    chosen = np.full(len(mass), True) if species is None else frame.species[mobile] == species
    if not chosen.any():
        return float("nan")
    energy = np.sum(mass[chosen, None] * velocity[chosen] ** 2)
    return float(energy / (frame.box.dimension * chosen.sum()))


def rotational_temperature(frame: Frame, species: int | None = None) -> float:
    """T_rot = Σ I ω²/(rN) over bodies of finite mass [energy], of r = 3 axes of rotation, 1 in two dimensions.

    NaN without such bodies, or without spin. ``species`` restricts the sum.
    """
    if frame.inertia is None or frame.angular_velocity is None:
        return float("nan")
    chosen = np.isfinite(frame.mass) if species is None else np.isfinite(frame.mass) & (frame.species == species)
    if not chosen.any():
        return float("nan")
    moment = (frame.inertia * frame.mass * frame.radius**2)[chosen]
    energy = np.sum(moment[:, None] * frame.angular_velocity[chosen] ** 2)
    return float(energy / ((1 if frame.box.dimension == 2 else 3) * chosen.sum()))


def scaled_velocities(frame: Frame) -> Array:
    """``[M, d]`` velocities c = (v − V)/√(2T/m) of the bodies of finite mass, T the temperature of the frame.

    In a sheared box v is relative to the flow. Raises :class:`NotApplicableError` if there is no such body.
    """
    mobile = np.isfinite(frame.mass)
    if not mobile.any():
        raise NotApplicableError("no body of finite mass: there is no distribution of velocities")
    mass, velocity = frame.mass[mobile], frame.peculiar_velocity[mobile, : frame.box.dimension]
    velocity = velocity - np.average(velocity, axis=0, weights=mass)
    return velocity / np.sqrt(2 * temperature(frame) / mass)[:, None]


def sonine_a2(frame: Frame) -> float:
    """a₂ = d⟨v⁴⟩/[(d + 2)⟨v²⟩²] − 1 of the velocities v − V, each scaled by its own thermal speed."""
    square = np.sum(scaled_velocities(frame) ** 2, axis=1)
    d = frame.box.dimension
    return float(d * np.mean(square**2) / ((d + 2) * np.mean(square) ** 2) - 1)


def block_average(values: ArrayLike, blocks: int = 20, weights: ArrayLike | None = None) -> Estimate:
    """Mean of a correlated series with its standard error from block averages (Flyvbjerg–Petersen 1989).

    The series is cut into ``blocks`` pieces of equal length (a remainder at the start is left out); blocks
    should be much longer than the correlation time.
    """
    series = np.asarray(values, float)
    if len(series) < 2 * blocks:
        raise ArgumentError(f"{len(series)} values are too few for {blocks} blocks")
    weight = np.ones_like(series) if weights is None else np.asarray(weights, float)
    length = len(series) // blocks
    cut = slice(len(series) - blocks * length, None)
    weight, series = weight[cut].reshape(blocks, length), series[cut].reshape(blocks, length)
    means = np.sum(weight * series, axis=1) / np.sum(weight, axis=1)
    return Estimate(float(np.mean(means)), float(np.std(means, ddof=1) / np.sqrt(blocks)))


def drawn_frames(file: File, count: int, after: float = 5.0) -> list[Frame]:
    """Up to ``count`` frames spread over the run, without the first ``after`` collisions per particle.

    From the second half of the run if the whole run is shorter than twice ``after``.
    """
    frames = file.frames
    steps = np.asarray(frames.step, float)
    threshold = min(after * len(file) / 2, steps[-1] / 2) if len(frames) else 0.0
    late = np.flatnonzero(steps >= threshold)
    chosen = np.unique(np.round(np.linspace(0, len(late) - 1, min(count, len(late)))).astype(int))
    return [frames[int(late[k])] for k in chosen]


def radial_distribution(frames: Iterable[Frame], r_max: float, bins: int, r_min: float = 0.0) -> tuple[Array, Array]:
    """Pair distribution g(r) by freud, averaged over frames: bin centres [length] and values.

    Raises :class:`NotApplicableError` unless the box is periodic and wider than 2 ``r_max``. A sheared box is that of
    each frame.
    """
    import freud

    rdf = freud.density.RDF(bins=bins, r_max=r_max, r_min=r_min)
    first = True
    for frame in frames:
        box = frame.box
        if not box.fully_periodic:
            raise NotApplicableError("g(r) needs a periodic box")
        if r_max >= box.widths[: box.dimension].min() / 2:
            raise NotApplicableError(f"the box is too small for g(r) up to {r_max:g}")
        with computing(frame.file.path, "g(r)"):
            rdf.compute(_freud_system(box, frame.position), reset=first)
        first = False
    if first:
        raise NotApplicableError("no frames")
    return np.asarray(rdf.bin_centers, float), np.asarray(rdf.rdf, float)


def structure_factor(frames: Iterable[Frame], k_max: float, bins: int) -> tuple[Array, Array]:
    """Static structure factor S(k) by freud, averaged over frames: wave numbers [1/length] and values.

    Direct sums over wave vectors of the periodic box; bins without a wave vector are left out. In a sheared box these
    are the vectors of each frame, in all directions. Raises :class:`NotApplicableError` unless the box is periodic in
    three dimensions.
    """
    import freud

    sums, counted, centers = np.zeros(bins), np.zeros(bins), np.zeros(bins)
    for frame in frames:
        box = frame.box
        if not box.fully_periodic or box.dimension != 3:
            raise NotApplicableError("S(k) needs a periodic box in three dimensions")
        least = 2 * np.pi / box.size.min()
        if not k_max > least:
            raise NotApplicableError(f"S(k) needs k_max above that of the longest wave, {least:g}")
        with computing(frame.file.path, "S(k)"):
            if box.displacement is None:
                factor = freud.diffraction.StaticStructureFactorDirect(bins=bins, k_max=k_max, k_min=0.99 * least)
                factor.compute(_freud_system(box, frame.position))
                found, centers = np.asarray(factor.S_k, float), np.asarray(factor.bin_centers, float)
            else:
                edges = np.linspace(0.99 * least, k_max, bins + 1)
                found, centers = _sheared_structure(box, frame.position, edges), 0.5 * (edges[1:] + edges[:-1])
        known = np.isfinite(found)
        sums[known] += found[known]
        counted += known
    known = counted > 0
    if not known.any():
        raise NotApplicableError("no frames")
    return centers[known], sums[known] / counted[known]


def _sheared_structure(box: Box, position: Array, edges: Array) -> Array:
    """S(k) of a frame of a sheared box, averaged over all wave vectors in each bin; NaN where there is none.

    freud takes only those with positive indices. A sheared fluid is not the same in all directions.
    """
    most = np.floor(edges[-1] * np.linalg.norm(box.edges, axis=1) / (2 * np.pi)).astype(int)
    index = np.stack(np.meshgrid(*(np.arange(-m, m + 1) for m in most), indexing="ij"), axis=-1).reshape(-1, 3)
    # k and −k have the same value: those after k = 0 are half of all.
    waves = 2 * np.pi * index[len(index) // 2 + 1 :] @ np.linalg.inv(box.edges).T
    number = np.linalg.norm(waves, axis=1)
    inside = (number >= edges[0]) & (number <= edges[-1])
    waves, number = waves[inside], number[inside]
    rows = max(1, (1 << 22) // len(position))
    square = [
        np.abs(np.exp(1j * waves[k : k + rows] @ position.T).sum(axis=1)) ** 2 for k in range(0, len(waves), rows)
    ]
    counts, _ = np.histogram(number, edges)
    sums, _ = np.histogram(number, edges, weights=np.concatenate([*square, np.zeros(0)]))
    return sums / np.where(counts > 0, counts, np.nan) / len(position)


def _freud_system(box: Box, position: Array, edges: Array | None = None) -> tuple[freud.box.Box, Array]:
    """A box for freud, with the ``edges`` [length] of the box if they are not given, and the positions in it.

    freud keeps its box centred at the origin, in single precision. Its matrix of edge vectors is triangular: where the
    gradient of a sheared box is an axis before that of the flow, both are exchanged. Distances stay the same.
    """
    import freud

    d = box.dimension
    edges = box.size[:d] if edges is None else edges
    points = np.zeros((len(position), 3))
    points[:, :d] = position[:, :d] - edges / 2
    if box.displacement is None:
        return freud.box.Box(*edges, is2D=d == 2), points
    gradient, flow, length = box.displacement
    order = [0, 1, 2]
    if flow > gradient:
        order[flow], order[gradient] = gradient, flow
        flow, gradient = gradient, flow
    tilts = {(1, 0): "xy", (2, 0): "xz", (2, 1): "yz"}
    size = box.size[order]
    tilt = {tilts[gradient, flow]: length / size[gradient]}
    cell = freud.box.Box(*size[:d], is2D=d == 2, **tilt)
    # Positions in [0, L) are not in freud's box, which leans.
    return cell, cell.wrap(points[:, order])


def cluster_sizes(frame: Frame, reach: float) -> NDArray[np.int64]:
    """Numbers of particles in the clusters of a frame by freud, the largest first.

    Two particles belong to one cluster if their centres are at most ``reach`` [length] apart, or linked by others.
    """
    import freud

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
        cluster.compute(_freud_system(box, points, edges), neighbors={"r_max": reach})
        return np.sort(np.bincount(np.asarray(cluster.cluster_idx)))[::-1].astype(np.int64)


def velocity_histogram(frames: Iterable[Frame], bins: int = 61, reach: float = 5.0) -> tuple[Array, Array]:
    """Distribution of the components of scaled velocities (:func:`scaled_velocities`), averaged over frames.

    Returns the centres of the bins between -``reach`` and ``reach`` and the density. A Maxwell distribution gives the
    normal density with variance 1/2.
    """
    edges = np.linspace(-reach, reach, bins + 1)
    counts, total = np.zeros(bins), 0
    for frame in frames:
        values = scaled_velocities(frame)[:, : frame.box.dimension].ravel()
        counts += np.histogram(values, edges)[0]
        total += len(values)
    if total == 0:
        raise NotApplicableError("no frames")
    return 0.5 * (edges[1:] + edges[:-1]), counts / (total * (edges[1] - edges[0]))


class Transport(NamedTuple):
    """A coefficient of transport by both ways, from lags in a window."""

    einstein: float
    """From the slope of a mean square."""
    einstein_error: float
    """Standard error: that of the mean square at the end of the window, over the length of the window."""
    green_kubo: float
    """From the integral of an autocorrelation; NaN if that was not measured."""
    green_kubo_error: float
    """Standard error, with the errors of the lags taken as independent."""
    start: float
    """Start of the window [time]."""
    end: float
    """End of the window [time]."""


def self_diffusion(file: File, start: float | None = None, end: float | None = None) -> Transport:
    """D [length²/time] of ``measure.msd`` and ``measure.vacf``: slope/2d of ⟨|Δr|²⟩, and ∫⟨v(t)·v(0)⟩dt/d.

    ``start``, ``end``: the window of lags [time]; default 20 and 80 mean free times, after the fast relaxation and
    most of the flow that a particle drags along.

    In a sheared box the displacements are those across the flow, and the slope is divided by 2(d − 1): the mean of the
    coefficients of the gradient and, in three dimensions, of the third axis. The autocorrelation is that of velocities
    relative to the flow, and its integral is another quantity there.
    """
    found, d = correlation_columns(file), file.dimension
    if "msd" not in found:
        raise MissingDataError(f"{file.path}: no mean square displacement (set measure.msd in the scene)")
    window = _window(file, found["msd"], (start, end), (20.0, 80.0))
    axes = d if file.shear is None else d - 1
    return _transport(found["msd"], found.get("vacf"), window, 1 / axes, 1 / d)


def shear_viscosity(file: File, start: float | None = None, end: float | None = None) -> Transport:
    """η [mass/(length^(d−2) time)] of ``measure.stress_correlation``.

    (V/2T) times the slope of ⟨(∫P_xy dt)²⟩, and (V/T) ∫⟨P_xy(t)P_xy(0)⟩dt, averaged over the independent components of
    the traceless part of the tensor (P. J. Daivis, D. J. Evans, J. Chem. Phys. 100, 541 (1994)).

    ``start``, ``end``: the window of lags [time]; default 15 and 30 mean free times. These are fluctuations in
    equilibrium: a sheared run raises :class:`NotApplicableError`, and :func:`rheology` gives its viscosity.
    """
    if file.shear is not None:
        raise NotApplicableError(f"{file.path}: the run is sheared: analysis.rheology gives its viscosity")
    found = correlation_columns(file)
    if "helfand" not in found:
        raise MissingDataError(
            f"{file.path}: no autocorrelation of the pressure tensor (set measure.stress_correlation)"
        )
    window = _window(file, found["helfand"], (start, end), (15.0, 30.0))
    scale = viscosity_scale(file)
    return _transport(found["helfand"], found["stress"], window, scale, scale)


def viscosity_scale(file: File) -> float:
    """V/T, the factor of the Green–Kubo relation of the viscosity, with the mean temperature of the samples."""
    temperature = float(np.nanmean(file.samples["temperature"]))
    return float(file.box.volume) / temperature


class Rheology(NamedTuple):
    """Stresses of a sheared run, with σ = −P: f is the axis of the flow, g that of its gradient, v the third one."""

    time: Array
    """``[S]`` end of each interval between samples [time]; values are means in it."""
    viscosity: Array
    """``[S]`` η = σ_gf/γ̇ = −P_gf/γ̇ [mass/(length^(d−2) time)]."""
    first_difference: Array
    """``[S]`` N₁ = σ_ff − σ_gg = P_gg − P_ff [energy/length^d]."""
    second_difference: Array
    """``[S]`` N₂ = σ_gg − σ_vv = P_vv − P_gg [energy/length^d]; NaN in two dimensions."""
    mean_viscosity: Estimate
    """Mean of the viscosity from ``start`` on, with its standard error by blocks; so are those that follow."""
    mean_first_difference: Estimate
    mean_second_difference: Estimate
    start: float
    """Start of the means [time]."""


def rheology(file: File, start: float | None = None) -> Rheology:
    """Viscosity and normal stress differences of a sheared run with ``measure.stress``, against time and in the mean.

    ``start``: the means are from there on [time]; default the second half of the run. Their errors are those of up to
    20 blocks (:func:`block_average`), which must be long compared with the correlation time of the stresses. Raises
    :class:`NotApplicableError` for a run without shear, or with less than eight samples from ``start`` on.
    """
    shear = file.shear
    if shear is None or shear.rate == 0:
        raise NotApplicableError(f"{file.path}: no shear (set domain.shear in the scene)")
    names = [AXES[k] for k in (shear.flow, shear.gradient, 3 - shear.flow - shear.gradient)]
    f, g, v = names
    table = file.samples
    if f"pressure_tensor_{g}{f}" not in table:
        raise MissingDataError(f"{file.path}: no pressure tensor (set measure.stress in the scene)")

    def component(a: str, b: str) -> Array:
        return np.asarray(table[f"pressure_tensor_{a}{b}"], float)[1:]

    # The tensor is a mean since the previous sample: the first one has none, and samples at one time have no length.
    end, length = np.asarray(table["time"], float)[1:], np.diff(np.asarray(table["time"], float))
    viscosity = -component(g, f) / shear.rate
    first = component(g, g) - component(f, f)
    second = component(v, v) - component(g, g) if file.dimension == 3 else np.full(len(end), np.nan)
    known = (length > 0) & np.isfinite(viscosity) & np.isfinite(first)
    end, length, viscosity, first, second = (x[known] for x in (end, length, viscosity, first, second))
    if start is None:
        start = 0.5 * float(end[-1]) if len(end) else 0.0
    # Whole intervals only; the slack is the rounding of times.
    late = end - length >= start - 1e-9 * abs(start)
    if np.sum(late) < 8:
        raise NotApplicableError(f"{file.path}: fewer than eight samples of the pressure tensor from t = {start:g} on")
    blocks = min(20, int(np.sum(late)) // 2)
    means = (block_average(x[late], blocks, length[late]) for x in (viscosity, first, second))
    return Rheology(end, viscosity, first, second, *means, float(start))


def running_integral(correlation: xarray.Dataset | Mapping[str, Array]) -> tuple[Array, Array]:
    """Lags, and the integral of an autocorrelation from 0 to each of them, by the rule of trapezoids."""
    lag, value = np.asarray(correlation["lag"]), np.asarray(correlation["value"])
    steps = np.diff(lag) * 0.5 * (value[1:] + value[:-1])
    return lag, np.concatenate([[0.0], np.cumsum(steps)])


def _window(
    file: File, mean_square: Mapping[str, Array], given: tuple[float | None, float | None], default: tuple[float, float]
) -> tuple[float, float]:
    """The window of lags, at most up to the last one with an error."""
    lag, error = mean_square["lag"], mean_square["error"]
    known = lag[np.isfinite(error)]
    if len(known) < 4:
        raise NotApplicableError(f"{file.path}: the run is too short for a slope")
    table = file.samples if "observables" in file else None
    times = table["mean_free_time"] if table is not None and "mean_free_time" in table else np.array([])
    times = times[np.isfinite(times)]
    mean_free_time = float(np.median(times)) if len(times) else np.inf
    start, end = (
        value if value is not None else most * mean_free_time for value, most in zip(given, default, strict=True)
    )
    end = min(end, known[-1])
    start = min(start, end / 4) if given[0] is None and not start < 0.75 * end else start
    if not 0 <= start < end or np.sum((lag >= start) & (lag <= end)) < 2:
        raise NotApplicableError(f"{file.path}: fewer than two lags between {start:g} and {end:g}")
    return start, end


def _transport(
    mean_square: Mapping[str, Array],
    product: Mapping[str, Array] | None,
    window: tuple[float, float],
    scale: float,
    product_scale: float,
) -> Transport:
    """``scale`` is the factor of half the slope, ``product_scale`` that of the integral."""
    start, end = window
    lag, value, error = (mean_square[name] for name in ("lag", "value", "error"))
    inside = (lag >= start) & (lag <= end) & (error > 0)
    slope = np.polyfit(lag[inside], value[inside], 1, w=1 / error[inside])[0]
    slope_error = error[inside][-1] / (end - start)
    integral, integral_error = np.nan, np.nan
    if product is not None:
        times, running = running_integral(product)
        inside = (times >= start) & (times <= end)
        integral = float(np.mean(running[inside]))
        widths = np.gradient(times)
        widths[0] = 0.5 * (times[1] - times[0])
        upto = times <= end
        integral_error = float(np.sqrt(np.nansum((widths * product["error"])[upto] ** 2)))
    return Transport(
        *(0.5 * scale * slope, 0.5 * scale * slope_error),
        *(product_scale * integral, product_scale * integral_error, start, end),
    )


class CoolingLaw(NamedTuple):
    """Haff's law for the gas of a file, without fitted parameters."""

    T0: float
    """Initial temperature [energy]."""
    tau: float
    """Time constant [time]; infinite if elastic."""
    omega0: float
    """Collisions per particle and time at T0, without the a₂ factor [1/time]."""
    restitution: float
    """The one coefficient of restitution."""
    a2: float
    """Sonine coefficient of the homogeneous cooling state; 0 for mixtures, whose theory here is Maxwellian."""
    contact_value: float
    """g₀ of one species, NaN for a mixture."""
    critical_length: float
    """Box side above which the gas becomes unstable [length]; NaN for a mixture."""
    monodisperse: bool
    """Whether all particles have one radius and one mass."""


def cooling_law(file: File) -> CoolingLaw:
    """The cooling law expected for the file's gas: a force-free periodic gas with one constant restitution, smooth.

    One species: Enskog rate with the Carnahan–Starling or Henderson contact value and van Noije–Ernst's a₂.
    Mixtures: Enskog rates with BMCSL contact values at equal temperatures, 1/τ = (1 − e²) R/(dN) with R the
    collisions of the whole gas per time; the non-equipartition of cooling mixtures is neglected.

    Raises :class:`NotApplicableError` with the reason where no closed form applies.
    """
    box, d, e = file.box, file.dimension, gas_restitution(file)
    if is_rough(file.scene):
        raise NotApplicableError("Haff's law is for smooth contacts")
    table = file.samples if "observables" in file else None
    if table is not None and len(table.get("temperature", ())) == 0:
        raise NotApplicableError("Haff's law needs samples of the temperature")
    T0 = float(table["temperature"][0]) if table is not None else temperature(file.frames[0])
    if not T0 > 0:
        raise NotApplicableError("nothing moves at the start")
    kinds, counts = np.unique(np.stack([2 * file.radius, file.mass]), axis=1, return_counts=True)
    sigma, mass = kinds
    n = counts / box.volume
    if len(counts) == 1:
        a2 = float(theory.sonine_a2(e, d))
        g0 = float(theory.contact_value(theory.packing_fraction(n[0], sigma[0], d), d))
        omega = float(theory.collision_frequency(n[0], sigma[0], T0, mass[0], g0, d))
        tau = float(theory.haff_time(e, omega, d, a2))
        return CoolingLaw(T0, tau, omega, e, a2, g0, float(theory.critical_length(n[0], sigma[0], e, d)), True)
    if len(counts) > 2000:
        # Rates are computed for all pairs of sizes: a continuous distribution is grouped by rank.
        kinds, n = _grouped(file.radius, file.mass, 200, box.volume)
        sigma, mass = kinds
    total = theory.mixture_rates(n, sigma, mass, T0, d).total * box.volume
    with np.errstate(divide="ignore"):
        tau = float(np.divide(d * len(file), (1 - e**2) * total))
    return CoolingLaw(T0, tau, 2 * total / len(file), e, 0.0, float("nan"), float("nan"), False)


def gas_restitution(file: File) -> float:
    """The coefficient of restitution of all normal impacts of a periodic gas.

    Raises :class:`NotApplicableError` with the reason if the file is none, or does not have one constant coefficient.
    """
    if not file.box.fully_periodic:
        raise NotApplicableError("Haff's law needs a periodic box")
    if file.shear is not None:
        raise NotApplicableError("Haff's law is for gases at rest, not for sheared ones")
    if not np.all(np.isfinite(file.mass)):
        raise NotApplicableError("Haff's law does not know fixed bodies")
    if len(file) < 10:
        raise NotApplicableError(f"Haff's law needs a gas, not {len(file)} particles")
    contact = file.scene.get("contact", {})
    e = contact.get("restitution", 1.0)
    others = ["sticks" if p.get("sticks") else p.get("restitution", e) for p in contact.get("pair", [])]
    if isinstance(e, dict) or any(o != e for o in others):
        raise NotApplicableError("Haff's law needs one constant coefficient of restitution")
    if file.scene.get("wall"):
        raise NotApplicableError("Haff's law does not know walls")
    return float(e)


def _grouped(radius: Array, mass: Array, groups: int, volume: float) -> tuple[Array, Array]:
    order = np.lexsort((mass, radius))
    parts = np.array_split(order, groups)
    kinds = np.array([[2 * radius[p].mean() for p in parts], [mass[p].mean() for p in parts]])
    return kinds, np.array([len(p) for p in parts]) / volume
