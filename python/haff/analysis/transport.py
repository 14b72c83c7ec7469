"""Coefficients of transport, from correlations and from sheared runs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..common.arguments import reals
from ..errors import ArgumentError, MissingDataError, NotApplicableError
from ..files.layout import AXES, Array
from ..files.measure import correlation_columns, curves
from ..text import quoted
from . import conditions
from .checked import checked
from .statistics import Estimate, block_average

if TYPE_CHECKING:
    import xarray

    from ..files.recording import Recording


RELAXED = 5.0
"""A window of diffusion starts after so many times of the memory of velocities, where e⁻⁵ of it is left."""


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


@checked
def self_diffusion(
    file: Recording, start: float | None = None, end: float | None = None, species: str | None = None
) -> Transport:
    """D [length²/time] of ``measure.msd`` and ``measure.vacf``: slope/2d of ⟨|Δr|²⟩, and ∫⟨v(t)·v(0)⟩dt/d.

    ``start``, ``end``: the window of lags [time]; default 20 and 80 mean free times, after the fast relaxation and
    most of the flow that a particle drags along, and not before five times the time in which the particles forget their
    velocity, D d/⟨v²⟩: of a heavy intruder it is longer by the ratio of masses.

    Raises :class:`NotApplicableError` where lags do not reach twice that time, and unless the conditions of
    :data:`.conditions.DIFFUSION` hold: a periodic box, since walls bound displacements; a steady temperature and the
    same scene all the time, since correlations are means over the whole run; and a center of mass that does not move
    on.

    ``species``: where ``measure.msd`` has curves of species, which of them; it can be left out if there is one. With
    ``measure.msd = true`` it is the mean over the particles of all species.

    In a sheared box the displacements are those across the flow, and the slope is divided by 2(d − 1): the mean of the
    coefficients of the gradient and, in three dimensions, of the third axis. The autocorrelation is that of velocities
    relative to the flow, and its integral is another quantity there.
    """
    found, d = correlation_columns(file), file.dimension
    if "msd" not in found:
        raise MissingDataError(f"{file.path}: no mean square displacement (set measure.msd in the scene)")
    msd = _curve(file, "msd", found["msd"], species)
    conditions.require(file, f"{file.path}: the coefficient of self-diffusion", conditions.DIFFUSION)
    vacf = None
    if "vacf" in found:
        # Of other particles it is another quantity.
        same = list(found["vacf"].get("species", ())) == list(found["msd"].get("species", ()))
        vacf = _curve(file, "vacf", found["vacf"], species) if same else None
    window = _window(file, msd, (start, end), (20.0, 80.0))
    if start is None:
        window = _relaxed(file, msd, window, end)
    axes = d if file.shear is None else d - 1
    return _transport(msd, vacf, window, 1 / axes, 1 / d)


def _curve(file: Recording, name: str, columns: Mapping[str, Array], species: str | None) -> Mapping[str, Array]:
    """The curve of a species, or the only one."""
    known = curves(columns)
    if species is None and len(known) == 1:
        return next(iter(known.values()))
    if species is None:
        raise ArgumentError(f"{file.path}: {name} has curves of species: name one by species=…: {', '.join(known)}")
    if species not in known or "" in known:
        of = ", ".join(known) if "" not in known else f"none: set measure.{name} = {{ species = […] }} in the scene"
        raise ArgumentError(f"species = {quoted(species)}: {file.path} has curves of {of}")
    return known[species]


@checked
def shear_viscosity(file: Recording, start: float | None = None, end: float | None = None) -> Transport:
    """η [mass/(length^(d−2) time)] of ``measure.stress_correlation``.

    (V/2T) times the slope of ⟨(∫P_xy dt)²⟩, and (V/T) ∫⟨P_xy(t)P_xy(0)⟩dt, averaged over the independent components of
    the traceless part of the tensor (P. J. Daivis, D. J. Evans, J. Chem. Phys. 100, 541 (1994)).

    ``start``, ``end``: the window of lags [time]; default 15 and 30 mean free times. These are fluctuations in
    equilibrium: a sheared run raises :class:`NotApplicableError`, and :func:`rheology` gives its viscosity; so do other
    files that do not meet the conditions of :data:`.conditions.VISCOSITY`, such as inelastic or driven gases.
    """
    if file.shear is not None:
        raise NotApplicableError(f"{file.path}: the run is sheared: analysis.rheology gives its viscosity")
    conditions.require(file, f"{file.path}: the viscosity of an equilibrium", conditions.VISCOSITY)
    found = correlation_columns(file)
    if "helfand" not in found:
        raise MissingDataError(
            f"{file.path}: no autocorrelation of the pressure tensor (set measure.stress_correlation)"
        )
    window = _window(file, found["helfand"], (start, end), (15.0, 30.0))
    scale = viscosity_scale(file)
    return _transport(found["helfand"], found["stress"], window, scale, scale)


@checked
def viscosity_scale(file: Recording) -> float:
    """V/T, the factor of the Green–Kubo relation of the viscosity, with the mean temperature of the samples.

    Raises :class:`NotApplicableError` if there is none, or it is 0.
    """
    found = file.samples["temperature"]
    temperature = float(found[np.isfinite(found)].mean()) if np.isfinite(found).any() else 0.0
    if temperature <= 0:
        raise NotApplicableError(f"{file.path}: has no temperature above 0")
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


@checked
def rheology(file: Recording, start: float | None = None) -> Rheology:
    """Viscosity and normal stress differences of a sheared run with ``measure.stress``, against time and in the mean.

    ``start``: the means are from there on [time]; default the second half of the file. Their errors are those of up to
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
        start = 0.5 * (conditions.start(file) + float(end[-1])) if len(end) else 0.0
    # Whole intervals only; the slack is the rounding of times.
    late = end - length >= start - 1e-9 * abs(start)
    if np.sum(late) < 8:
        raise NotApplicableError(f"{file.path}: fewer than eight samples of the pressure tensor from t = {start:g} on")
    blocks = min(20, int(np.sum(late)) // 2)
    means = (block_average(x[late], blocks, length[late]) for x in (viscosity, first, second))
    return Rheology(end, viscosity, first, second, *means, float(start))


def running_integral(correlation: xarray.Dataset | Mapping[str, Array]) -> tuple[Array, Array]:
    """Lags, and the integral of an autocorrelation from 0 to each of them, by the rule of trapezoids."""
    try:
        lag, value = (reals(f"correlation[{name!r}]", correlation[name]) for name in ("lag", "value"))
    except (TypeError, KeyError, IndexError):
        raise ArgumentError(f"correlation = {quoted(correlation)}: must have the columns lag and value") from None
    if lag.ndim != 1 or lag.shape != value.shape:
        raise ArgumentError(
            f"correlation: lag of shape {lag.shape}, value of shape {value.shape}; must be one series each"
        )
    steps = np.diff(lag) * 0.5 * (value[1:] + value[:-1])
    return lag, np.concatenate([[0.0], np.cumsum(steps)])


def _window(
    file: Recording,
    mean_square: Mapping[str, Array],
    given: tuple[float | None, float | None],
    default: tuple[float, float],
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


def _relaxed(
    file: Recording, msd: Mapping[str, Array], window: tuple[float, float], end: float | None
) -> tuple[float, float]:
    """The window, or a later one if velocities are still correlated in it: there the slope is too small."""
    lag, value, error = (msd[name] for name in ("lag", "value", "error"))
    first = np.flatnonzero(lag > 0)[0]
    longest = lag[np.isfinite(error)][-1]
    while True:
        start, last = window
        memory = _memory(lag[first], value[first] / _slope(msd, window))
        if start >= RELAXED * memory:
            return window
        start = RELAXED * memory * (1 + 1e-9)
        if start > longest / 2 or (end is not None and start > end / 2):
            raise NotApplicableError(
                f"{file.path}: lags up to {longest if end is None else end:g} are too short for particles that keep "
                f"their velocity for a time of {memory:.3g} or more: longer lags (measure.msd of the scene), or start=…"
            )
        window = start, min(max(last, 4 * start), longest) if end is None else end


def _memory(lag: float, delayed: float) -> float:
    """τ of an exponential memory from a mean square over its final slope at one lag: t − τ (1 − exp(−t/τ))."""
    from scipy.optimize import brentq

    def excess(memory: float) -> float:
        return lag + memory * float(np.expm1(-lag / memory)) - delayed

    shortest, longest = 1e-3 * lag, 1e6 * lag
    if excess(shortest) <= 0:
        return 0.0
    return float(brentq(excess, shortest, longest, xtol=1e-9 * lag)) if excess(longest) < 0 else longest


def _slope(curve: Mapping[str, Array], window: tuple[float, float]) -> float:
    lag, value, error = (curve[name] for name in ("lag", "value", "error"))
    inside = (lag >= window[0]) & (lag <= window[1]) & (error > 0)
    return float(np.polyfit(lag[inside], value[inside], 1, w=1 / error[inside])[0])


def _transport(
    mean_square: Mapping[str, Array],
    product: Mapping[str, Array] | None,
    window: tuple[float, float],
    scale: float,
    product_scale: float,
) -> Transport:
    """``scale`` is the factor of half the slope, ``product_scale`` that of the integral."""
    start, end = window
    lag, error = mean_square["lag"], mean_square["error"]
    inside = (lag >= start) & (lag <= end) & (error > 0)
    slope = _slope(mean_square, window)
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
