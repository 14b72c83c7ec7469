"""Granular temperature against time, with Haff's law where it applies."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from .. import analysis, theory
from ..errors import NotApplicableError
from ..reader import File
from ..recorded import roughness
from .style import BLACK, BLUE, CYCLE, GREY, ORANGE, RED, headline, label, note, number, zoom

# Fewer bodies have no meaningful distribution of velocities.
FEWEST = 30
_ROTATION = r"rotation, $T_\mathrm{rot}$"


def draw(file: File) -> Figure:
    """T(t), log–log against Haff's law with the ratio below; for other gases, T(t) alone. With spin, T_rot(t), too."""
    table = file.observables
    if "temperature" not in table or not np.any(table["temperature"] > 0) or len(file) < FEWEST:
        raise NotApplicableError(f"{len(file):,} particle{'s'[: len(file) != 1]}: no temperature to speak of")
    if len(table) < 3:
        raise NotApplicableError("fewer than three samples")
    try:
        law = analysis.cooling_law(file)
    except NotApplicableError as reason:
        return _plain(file, label(str(reason)))
    if law.restitution < 1:
        return _haff(file, law)
    if len(file.species_names) < 2:
        raise NotApplicableError("an elastic gas of one species keeps its temperature")
    return _plain(file, "elastic: no cooling")


def facts(file: File) -> str:
    """One line that describes the gas."""
    parts = [f"N = {len(file):,}"]
    phi = file.summary["packing_fraction"]
    if np.isfinite(phi):
        parts.append(f"packing fraction {phi:.3g}")
    parts += _restitutions(file)
    beta, friction = roughness(file.scene)
    if beta > -1 and friction > 0:
        parts += [f"β = {beta:g}"] + ([f"μ = {friction:g}"] if np.isfinite(friction) else [])
    return f"{label(file.title) + '  ·  ' if file.title else ''}{',  '.join(parts)}"


def _restitutions(file: File) -> list[str]:
    """Restitution of the contacts that can happen: between particles, and with walls where it differs."""

    def name(e: object) -> str:
        return f"{e:g}" if isinstance(e, (int, float)) else label(e.get("model", "?")) if isinstance(e, dict) else "?"

    contact, walls = file.scene.get("contact", {}), file.scene.get("wall", [])
    between = contact.get("restitution", 1.0)
    general = contact.get("wall_restitution", between)
    at_walls = {name(wall.get("restitution", general)) for wall in walls}
    if "wall" in file.box.boundary:
        at_walls.add(name(general))
    found = [f"e = {name(between)}"] if len(file) > 1 else []
    if (at_walls and at_walls != {name(between)}) or not found:
        found.append(f"{'walls ' if found else 'e = '}{', '.join(sorted(at_walls)) or name(between)}")
    return found


def _haff(file: File, law: analysis.CoolingLaw) -> Figure:
    table = file.observables
    late = table["time"].to_numpy() > 0
    t, T = table["time"].to_numpy()[late], table["temperature"].to_numpy()[late]
    alive = T > 0
    t, T = t[alive], T[alive]
    expected = theory.haff_temperature(t, law.T0, law.tau)

    fit = _fitted_time(file, law)
    measured = "simulation" if fit is None else rf"simulation,  $\tau$ = {number(fit)} measured"
    figure = Figure(figsize=(6.4, 6.2), layout="constrained")
    top, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.6, 1))
    curve = np.geomspace(t[0], t[-1], 400)
    top.loglog(curve, theory.haff_temperature(curve, law.T0, law.tau), color=RED, lw=4.5, alpha=0.45,
               solid_capstyle="round",
               label=rf"Haff’s law  $T_0\,(1+t/\tau)^{{-2}}$,  $\tau$ = {number(law.tau)} in theory")  # fmt: skip
    stride = max(1, len(t) // 4000)
    top.loglog(t[::stride], T[::stride], color=BLUE, marker="." if len(t) < 80 else "", lw=1.4, label=measured)
    if t[0] < law.tau < t[-1]:
        top.axvline(law.tau, color=GREY, lw=0.8, ls=":", zorder=0)
        top.text(law.tau, 0.985, r" $t=\tau$", transform=top.get_xaxis_transform(), color="#555555", va="top")
    rotation = _rotational(table)[late][alive]
    if np.any(rotation > 0):
        top.loglog(t[::stride], rotation[::stride], color=ORANGE, lw=1.4, label=_ROTATION)
    top.set_ylabel(r"granular temperature $T$  [$k_\mathrm{B}=1$]")
    top.legend(loc="lower left", title=_stability(file, law), alignment="left", title_fontsize=8.8)
    # Space for the legend below the start of the curve, however little the gas has cooled.
    low, high = top.get_ylim()
    top.set_ylim(low / (high / low) ** 0.35, high)

    ratio = T / expected
    below.axhline(1, color=RED, lw=2.5, alpha=0.45)
    below.semilogx(t[::stride], ratio[::stride], color=BLUE, lw=1.3, marker="." if len(t) < 80 else "")
    zoom(below, float(ratio.min()), float(ratio.max()), around=1.0, least=0.02)
    below.set_ylabel(r"$T\,/\,T_\mathrm{Haff}$")
    below.set_xlabel("simulated time $t$  [scene’s unit of time]")
    below.set_xlim(t[0], t[-1] * 1.02)
    _collisions_axis(top, table, len(file))
    headline(figure, "Cooling by Haff’s law", facts(file))
    return figure


def _rotational(table) -> np.ndarray:
    """Rotational temperatures of the samples; NaN without spin."""
    name = "rotational_temperature"
    return table[name].to_numpy() if name in table else np.full(len(table), np.nan)


def _stability(file: File, law: analysis.CoolingLaw) -> str | None:
    """Whether the box is small enough for the gas to stay homogeneous."""
    if not np.isfinite(law.critical_length):
        return None
    side = file.box.size[: file.dimension].max()
    if side < law.critical_length:
        return rf"box {side:.3g} < $L_c$ ≈ {law.critical_length:.3g}: stays homogeneous"
    return rf"box {side:.3g} > $L_c$ ≈ {law.critical_length:.3g}: clusters in the end"


def _fitted_time(file: File, law: analysis.CoolingLaw) -> float | None:
    """τ from the slope of √(T0/T) = 1 + t/τ, from 5 to 50 collisions per particle."""
    table = file.observables
    if "collisions" not in table:
        return None
    per_particle = 2 * table["collisions"].to_numpy() / len(file)
    chosen = (per_particle > 5) & (per_particle < 50) & (table["temperature"].to_numpy() > 0)
    if chosen.sum() < 4:
        return None
    t, T = table["time"].to_numpy()[chosen], table["temperature"].to_numpy()[chosen]
    slope, _ = np.polyfit(t, np.sqrt(law.T0 / T), 1)
    return float(1 / slope)


def _collisions_axis(axes, table, number_of_particles: int) -> None:
    """Second scale above: collisions per particle at round numbers."""
    count = table["collisions"].to_numpy(float)
    time = table["time"].to_numpy()
    particles = 2 * count / number_of_particles
    low, high = axes.get_xlim()
    wanted = [10.0**k for k in range(-3, 7)] + [3 * 10.0**k for k in range(-3, 7)]
    ticks, labels = [], []
    last = -np.inf
    for value in sorted(wanted):
        if particles[-1] < value or not np.any(particles >= value):
            continue
        at = float(np.interp(value, particles, time))
        if not max(low, time[1]) <= at <= high:
            continue
        place = np.log(at / low) / np.log(high / low)
        if place - last > 0.09:
            ticks.append(at)
            labels.append(f"{value:g}")
            last = place
    if len(ticks) < 2:
        return
    upper = axes.secondary_xaxis("top")
    upper.set_xticks(ticks, labels)
    upper.minorticks_off()
    upper.tick_params(direction="in", labelsize=8.5, colors="#555555")
    upper.set_xlabel("collisions per particle", fontsize=9, color="#555555", labelpad=3)


def _plain(file: File, why: str) -> Figure:
    table = file.observables
    t, T = table["time"].to_numpy(), table["temperature"].to_numpy()
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    axes = figure.subplots()
    names = [n for n in table if n.startswith("species_temperature_")]
    cooled = T[-1] < 0.1 * T[0] and len(file) >= 100
    rotation = _rotational(table)
    if len(names) > 1:
        for color, name in zip(CYCLE, names):
            values = table[name].to_numpy()
            if np.isfinite(values).any():
                axes.plot(t, values, color=color, lw=1.0, label=label(name.removeprefix("species_temperature_")))
        axes.plot(t, T, color=BLACK, lw=1.8, label="all")
    else:
        axes.plot(t, T, color=BLUE, lw=1.4, label="translation, $T$")
    if np.isfinite(rotation).any():
        axes.plot(t, rotation, color=BLACK if len(names) > 1 else ORANGE, lw=1.4, ls=(0, (4, 1.5)), label=_ROTATION)
    if len(axes.lines) > 1:
        axes.legend(loc="best", ncols=2)
    if cooled:
        axes.set_yscale("log")
        later = t[t > 0]
        if len(later) > 1 and later[-1] > 1000 * later[0]:
            # Output at logarithmic times: a linear axis would show the last decade only.
            axes.set_xscale("log")
            axes.set_xlim(later[0], later[-1])
    else:
        shown = np.column_stack([table[[*names, "temperature"]].to_numpy(), rotation])
        zoom(axes, float(np.nanmin(shown)), float(np.nanmax(shown)), least=1e-3 * float(np.nanmax(T)))
        axes.ticklabel_format(axis="y", useOffset=False)
    axes.set_xlabel("simulated time $t$  [scene’s unit of time]")
    axes.set_ylabel(r"granular temperature $T$  [$k_\mathrm{B}=1$]")
    axes.margins(x=0)
    if not why.startswith("elastic"):
        # A curve that falls ends in the right corner.
        note(axes, f"no closed form drawn: {why}", x=0.02 if cooled else 0.98, ha="left" if cooled else "right")
    headline(figure, "Granular temperature", facts(file))
    return figure
