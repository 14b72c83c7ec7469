"""The conduction of heat between two walls of different temperature."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..common.arguments import number
from ..errors import ArgumentError, MissingDataError, NotApplicableError
from ..files.layout import AXES
from .checked import checked
from .statistics import Estimate, mean

if TYPE_CHECKING:
    from ..files.recording import Recording

__all__ = ["Conduction", "heat_conduction"]

_DEGREE = 2
"""Of the polynomial for T^(3/2), which is linear in the place at low density and uniform pressure."""


class Conduction(NamedTuple):
    """Heat that flows through a gas between two walls, from its profile and the heat of the walls."""

    flux: Estimate
    """Heat from the hot wall to the cold one, per area and time [1/(length^(d−1) time), energy]."""
    gradient: Estimate
    """|∂T/∂x| in the middle [energy/length]."""
    conductivity: Estimate
    """Flux over gradient in the middle."""
    temperature: float
    """Temperature in the middle [energy]."""
    density: float
    """Number density in the middle [1/length^d]."""
    hot_jump: Estimate
    """|T_gas − T_wall|/|∂T/∂x| at the hot wall, of the profile continued to where centers touch it [length]."""
    cold_jump: Estimate
    hot_density: float
    """Number density, continued to the hot wall [1/length^d]."""
    cold_density: float


@checked
def heat_conduction(file: Recording, start: float | None = None, margin: float = 0.2) -> Conduction:
    """Thermal conductivity, and the jumps of the temperature at the walls, of a gas between two thermal walls.

    Parameters
    ----------
    start
        Rows of the profile and samples are taken from this time on [time]; default a quarter of the run.
    margin
        The part of the distance of the walls that is left out at each of them: some mean free paths.

    Notes
    -----
    To each row of the profile a parabola for T^(3/2) is fitted between the margins. Errors are those of
    :func:`mean` over the rows, and NaN of fewer than 16; those of quotients are added as independent. Compare
    with :func:`haff.theory.thermal_conductivity` at ``temperature`` and ``density``, and with
    :func:`haff.theory.temperature_jump` at ``hot_density`` and ``cold_density``.

    Raises
    ------
    MissingDataError
        No profile of the temperature along the axis (``measure.profiles``), or no heat of walls
        (``measure.wall_forces``).
    NotApplicableError
        There are no two opposite walls of the box with different temperatures, the profile has less than four cells
        between the margins, or fewer than two rows from ``start`` on.
    """
    margin = number("margin", margin)
    if not 0 <= margin < 0.5:
        raise ArgumentError(f"margin = {margin:g}: must be at least 0 and less than 0.5")
    axis, walls = _walls(file)
    name = AXES[axis]
    profile = file.profiles.get(name) if file.profiles else None
    if profile is None or "temperature" not in profile:
        raise MissingDataError(f'{file.path}: no profile along {name} (measure.profiles = [{{ axis = "{name}", … }}])')
    if any(f"wall_heat_flow_{wall}" not in file.samples for wall in walls):
        raise MissingDataError(f"{file.path}: no heat of walls (measure.wall_forces = true)")
    start = 0.25 * float(profile["time"][-1]) if start is None else number("start", start)

    extent = float(file.box.size[axis])
    radius = float(np.min(file.radius[np.isfinite(file.mass)]))
    x = np.asarray(profile[name], float)
    inner = np.abs(x / extent - 0.5) < 0.5 - margin
    late = np.asarray(profile["time"], float) > start
    if inner.sum() < 4 or late.sum() < 2:
        raise NotApplicableError(f"{file.path}: the profile has {inner.sum()} cells and {late.sum()} rows to be fitted")
    # Around the middle, so that the fit is well conditioned.
    center = 0.5 * extent
    places = [radius - center, center - radius]
    T = np.asarray(profile["temperature"], float)[late][:, inner]
    rows = [np.polynomial.Polynomial.fit(x[inner] - center, row**1.5, _DEGREE) for row in T]
    value = [mean([max(fit(at), 0.0) ** (2 / 3) for fit in rows]) for at in (*places, 0.0)]
    slope = [mean([fit.deriv()(at) / (1.5 * fit(at) ** (1 / 3)) for fit in rows]) for at in (*places, 0.0)]
    density = np.asarray(profile["density"], float)[late][:, inner].mean(axis=0)
    of_density = np.polynomial.Polynomial.fit(x[inner] - center, density, _DEGREE)

    area = float(file.box.volume) / extent
    times = np.asarray(file.samples["time"], float) > start
    flows = [mean(np.asarray(file.samples[f"wall_heat_flow_{wall}"], float)[times]) for wall in walls]
    temperatures = list(walls.values())
    hot = int(np.argmax(temperatures))
    signs = (1, -1) if hot == 0 else (-1, 1)
    flux = 0.5 * sum(sign * flow.mean for sign, flow in zip(signs, flows)) / area
    flux_error = float(np.mean([flow.error for flow in flows])) / area
    jumps = [_ratio(abs(T_gas.mean - T_wall), T_gas.error, abs(k.mean), k.error)
             for T_gas, T_wall, k in zip(value, temperatures, slope)]  # fmt: skip
    return Conduction(
        Estimate(flux, flux_error),
        Estimate(abs(slope[2].mean), slope[2].error),
        _ratio(flux, flux_error, abs(slope[2].mean), slope[2].error),
        value[2].mean,
        float(of_density(0.0)),
        *(jumps[hot], jumps[1 - hot]),
        *(float(of_density(places[k])) for k in (hot, 1 - hot)),
    )


def _walls(file: Recording) -> tuple[int, dict[str, float]]:
    """The axis between two walls of the box with different temperatures, and these."""
    known = {wall["name"]: wall["temperature"] for wall in file.scene.get("wall", ()) if "temperature" in wall}
    for axis, name in enumerate(AXES[: file.dimension]):
        pair = [f"{name}-", f"{name}+"]
        if file.box.boundary[axis] == "wall" and all(wall in known for wall in pair):
            if known[pair[0]] != known[pair[1]]:
                return axis, {wall: float(known[wall]) for wall in pair}
    raise NotApplicableError(f"{file.path}: no two opposite walls of the box have different temperatures")


def _ratio(a: float, a_error: float, b: float, b_error: float) -> Estimate:
    from uncertainties import ufloat

    ratio = ufloat(a, a_error) / ufloat(b, b_error)
    return Estimate(ratio.nominal_value, ratio.std_dev)
