"""Self-diffusion and shear viscosity of the elastic fluid."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import haff
from haff import theory

from ..registry import Part
from ..rows import Row, compare
from ..runs import Context

MELTING = 100
"""Collisions per particle before anything is measured."""
SPACING = 5.0
"""Collisions per particle between frames."""
WINDOWS = (15, 30)
"""Between these times, in mean free times, the mean squares of the Helfand moments are straight lines."""


def enskog_rate(eta: float) -> float:
    """Collisions per particle and time at T = 1."""
    n = theory.number_density(eta, 1.0)
    return float(theory.collision_frequency(n, 1.0, g0=theory.contact_value(eta, 3, "klm")))


SYSTEMS = ((1000, 0.01), (500, 0.1), (500, 0.2618), (500, 0.3702), (500, 0.45), (2048, 0.2618), (2048, 0.3702))
"""Number and packing fraction of the diffusing spheres."""


class Lags(NamedTuple):
    """Between these times, in mean free times, the mean square displacement is a straight line."""

    first: float
    last: float


def diffusion_coefficient(lags: Lags, file: haff.File, report: dict[str, Any]) -> float:
    """D/√T from the slope of the mean square displacement, Einstein's relation."""
    frames = file.frames
    position = np.array([f.unwrapped for f in frames])[int(MELTING / SPACING) :]
    interval = float(frames.time[1] - frames.time[0])
    T = float(np.mean(np.sum(frames[-1].velocity ** 2, axis=1)) / 3)
    first, last = (round(lag / SPACING) for lag in lags)

    def displaced(lag: int) -> float:
        return float(np.mean(np.sum((position[lag:] - position[:-lag]) ** 2, axis=2)))

    return (displaced(last) - displaced(first)) / (6 * interval * (last - first)) / np.sqrt(T)


def diffusion(context: Context) -> list[Row]:
    """Slope of the mean square displacement, 8 seeds. A dilute gas against Enskog's theory with its Sonine
    correction, 1.01895, to 1 %. Dense fluids against simulations: 500 spheres against Speedy's fit (1987) to
    such systems; 2048 against the fit of Ruckenstein and Liu (1997) to the figures of Erpenbeck and Wood
    (1991) for infinite systems, with what the periodic images take away added by Yeh and Hummer (2004), its
    viscosity from Enskog. Both fits are good to about 2 %. The flow that a sphere drags along reaches its
    images after some 50 mean free times, or 20 in the smaller box: the slope is taken after that, between 75
    and 200, or 40 and 100.
    """
    rows = []
    for count, eta in SYSTEMS:
        n = float(theory.number_density(eta, 1.0))
        rate = enskog_rate(eta)
        lags = Lags(15, 40) if eta <= 0.01 else Lags(40, 100) if count <= 500 else Lags(75, 200)
        collisions = 300 if eta <= 0.01 else context.effort(1000 if count <= 500 else 600, 250)
        settings = {
            "domain.packing_fraction": eta,
            "species.0.count": count,
            "run.until": (MELTING + collisions) / rate,
            "output.frames": SPACING / rate,
            "output.observables": False,
        }
        given = [settings | {"seed": seed} for seed in context.seeds()]
        found = context.each("fluid", given, functools.partial(diffusion_coefficient, lags))
        quantity = "D/√T"
        if eta <= 0.01:
            expected, source, doubt = float(theory.enskog_diffusion(n, 1.0)), "Enskog", 0.01
        elif count <= 500:
            expected, source, doubt = float(theory.diffusion_speedy(n, 1.0)), "Speedy, 500 spheres", 0.02
        else:
            viscosity = theory.enskog_viscosity(n, 1.0)
            images = float(theory.diffusion_finite_size(viscosity, (count / n) ** (1 / 3)))
            found = [d + images for d in found]
            quantity = f"D/√T, with {images:.4f} for the images"
            expected, source, doubt = float(theory.diffusion_ruckenstein_liu(n, 1.0)), "Erpenbeck–Wood, N → ∞", 0.02
        rows.append(compare(f"{count} spheres, φ = {eta:g}", quantity, found, expected, source, doubt * expected))
    return rows


def stress(file: haff.File, interval: float) -> NDArray[np.float64]:
    """∫ of the shear stress times volume over every interval: five independent components, ``[K, 5]``.

    Σ m v v changes at collisions only and is followed exactly; a collision itself carries σ J n n.
    """
    events = file.events.to_pandas(["time", "i", "j", "impulse", "normal"])
    normal = events[["normal_x", "normal_y", "normal_z"]].to_numpy()
    impulse, time = events["impulse"].to_numpy()[:, None], events["time"].to_numpy()
    count = len(time)
    # Velocities of both partners before and after, by summing up every particle's own impulses.
    particle = np.concatenate([events["i"], events["j"]])
    change = np.concatenate([-impulse * normal, impulse * normal])
    order = np.lexsort((np.tile(np.arange(count), 2), particle))
    owner = particle[order]
    summed = np.cumsum(change[order], axis=0)
    first = np.searchsorted(owner, np.arange(len(file)))
    before_first = np.vstack([np.zeros(3), summed])[first]
    after = np.empty_like(change)
    after[order] = summed - before_first[owner] + file.frames[0].velocity[owner]
    before = after - change
    jump = _shear(after) - _shear(before)
    kinetic = np.sum(_shear(file.frames[0].velocity), axis=0) + np.cumsum(jump[:count] + jump[count:], axis=0)
    flown = np.vstack([np.zeros(5), np.cumsum(kinetic[:-1] * np.diff(time)[:, None], axis=0)])
    carried = np.vstack([np.zeros(5), np.cumsum(impulse * _shear(normal), axis=0)])
    edges = np.arange(time[0], time[-1], interval)
    moment = np.stack([np.interp(edges, time, flown[:, k]) for k in range(5)], axis=1)
    moment += carried[np.searchsorted(time, edges)]
    return np.diff(moment, axis=0)


def _shear(v: NDArray[np.float64]) -> NDArray[np.float64]:
    """Five traceless products of components, normalised alike, ``[M, 5]``."""
    x, y, z = v.T
    return np.stack([x * y, x * z, y * z, (x * x - y * y) / 2, (2 * z * z - x * x - y * y) / np.sqrt(12)], axis=1)


def viscosity_coefficient(file: haff.File, report: dict[str, Any]) -> float:
    """η/√T from the slope of the Helfand moment's mean square, Einstein's relation."""
    frame = file.frames[0]
    T = float(np.mean(np.sum(frame.velocity**2, axis=1)) / 3)
    interval = 1 / enskog_rate(float(file.summary["packing_fraction"]))
    moment = np.cumsum(stress(file, interval)[MELTING:], axis=0)

    def spread(lag: int) -> float:
        return float(np.mean((moment[lag:] - moment[:-lag]) ** 2))

    first, last = WINDOWS
    slope = (spread(last) - spread(first)) / (interval * (last - first))
    return slope / (2 * file.box.volume * T) / np.sqrt(T)


def viscosity(context: Context) -> list[Row]:
    """Slope of the mean square of the Helfand moments between 15 and 30 mean free times, five components, 500
    spheres, 16 seeds. The moments come from the event log: the momentum carried by flights and through
    contacts, both exact. Against Enskog's theory with its Sonine correction, 1.01603. Simulations since
    Alder, Gass and Wainwright (1970) are within 2 % of it up to twice the volume of closest packing, φ =
    0.37, and above from there: the stated uncertainty is 2 %, and 3 % for φ = 0.37.
    """
    count, rows = 500, []
    for eta in (0.05, 0.1, 0.2, 0.3, 0.3702):
        n, rate = float(theory.number_density(eta, 1.0)), enskog_rate(eta)
        end = (MELTING + context.effort(1400, 150)) / rate
        settings = {
            "domain.packing_fraction": eta,
            "species.0.count": count,
            "run.until": end,
            "output.frames": end,
            "output.observables": False,
            "output.events": {"columns": ["i", "j", "impulse", "normal"]},
            "output.compression": "none",
        }
        given = [settings | {"seed": seed} for seed in context.seeds(16)]
        found = context.each("fluid", given, viscosity_coefficient)
        expected = float(theory.enskog_viscosity(n, 1.0))
        doubt = (0.03 if eta > 0.3 else 0.02) * expected
        rows.append(compare(f"{count} spheres, φ = {eta:g}", "η/√T", found, expected, "Enskog", doubt))
    return rows


PARTS = (
    Part("diffusion", "Self-diffusion", diffusion, 30),
    Part("viscosity", "Shear viscosity", viscosity, 40),
)
