"""Conditions of the formulas of theory that figures draw and estimates use, checked against a file in one place.

Each formula names its conditions as a tuple, such as :data:`HAFF`. :func:`require` raises
:class:`~haff.NotApplicableError` with the first one that the file does not meet, :func:`unmet` returns it as text; a
figure then leaves the curve out and says why. What a file is, is read from its scene, its particles and its samples.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import NotApplicableError
from ..files.header import packing_fraction
from ..files.layout import AXES
from ..files.measure import correlation_columns
from ..files.scene import constant, is_rough, pair_laws

if TYPE_CHECKING:
    from ..files.recording import Recording

__all__ = ["Condition", "mean_free_time", "require", "restitution", "start", "unmet"]

FREEZING = {2: 0.70, 3: 0.49}
"""Packing fractions above which equal elastic disks and spheres begin to freeze, by dimension."""
FEWEST = 10
"""Particles that make a gas."""
PLACED = 0.1
"""Share of particles that a scene may place one by one in a homogeneous gas."""
SHORT = 0.01
"""Largest contact duration of the TC model that does not change the cooling, in mean free times."""
RARE = 0.2
"""Longest mean time between kicks that are white noise, in mean free times."""
DRIVES = {
    "rescale": "velocities rescaled",
    "andersen": "an Andersen thermostat",
    "white_noise": "white noise",
    "drag": "a drag",
}
"""Drives in words, by their kinds."""
DRIFT = 0.1
"""Relative change of a temperature that is steady, beside its fluctuations."""
CARRIED = 0.02
"""Largest share of the motion of the center of mass in a mean square displacement."""


class Condition(NamedTuple):
    """What a formula needs."""

    needs: str
    """In words, after "needs"."""
    fault: Callable[[Recording], str | None]
    """What is different in a file: a reason, empty if ``needs`` says it all; ``None`` if the condition holds."""


def unmet(file: Recording, conditions: Iterable[Condition]) -> str:
    """The first condition that a file does not meet, such as "needs a periodic box"; empty if it meets all."""
    for condition in conditions:
        fault = condition.fault(file)
        if fault is not None:
            return f"needs {condition.needs}" + (f": {fault}" if fault else "")
    return ""


def require(file: Recording, what: str, conditions: Iterable[Condition]) -> None:
    """Raises :class:`NotApplicableError`, "WHAT needs …", unless a file meets all conditions."""
    if missing := unmet(file, conditions):
        raise NotApplicableError(f"{what} {missing}")


def start(file: Recording) -> float:
    """Time of the first sample or frame: 0, or when a run with other keys (``--resume … --set``) went on in this file.

    [time]
    """
    if "observables" in file and len(file.samples["time"]):
        return float(file.samples["time"][0])
    return float(file.frames.time[0]) if "frames" in file and len(file.frames) else 0.0


def _if(broken: bool, why: str = "") -> str | None:
    return why if broken else None


def _contact(file: Recording, key: str) -> float:
    return float(file.scene.get("contact", {}).get(key, 0.0))


def mean_free_time(file: Recording) -> float:
    """The shortest one in any interval between samples [time]; infinite if none was recorded."""
    table = file.samples if "observables" in file else {}
    times = np.asarray(table.get("mean_free_time", ()), float)
    return float(np.min(times[times > 0], initial=np.inf))


# --- the box and what acts on the particles ------------------------------------------------------------------


def _walls(file: Recording) -> str | None:
    return _if(bool(file.scene.get("wall")) or "wall" in file.box.boundary[: file.dimension])


def _drives(file: Recording) -> str | None:
    kinds = [DRIVES.get(drive["kind"], str(drive["kind"])) for drive in file.scene.get("drive", ())]
    return _if(bool(kinds), f"the scene has {' and '.join(kinds)}")


def _flows(file: Recording) -> str | None:
    why = "the edges of the box change with time" if file.compression is not None else ""
    return _if(file.shear is not None or file.compression is not None, why)


def _joints(file: Recording) -> str | None:
    found = [name for name in ("pendulum", "spring", "rod") if file.scene.get(name)]
    return _if(bool(found) or "sticks" in pair_laws(file.scene))


def _continued(file: Recording) -> str | None:
    return _if(start(file) > 0, f"the file goes on from another run at t = {start(file):.4g}")


PERIODIC = Condition("a periodic box", lambda file: _if(not file.box.fully_periodic))
UNSHEARED = Condition("a gas at rest, not one in a flow", _flows)
NO_WALLS = Condition("a box without walls", _walls)
NO_DRIVE = Condition("a gas that nothing drives", _drives)
NO_JOINTS = Condition("free particles, without joints", _joints)
FROM_START = Condition("a run from its start", _continued)


# --- the particles -------------------------------------------------------------------------------------------


def _dense(file: Recording) -> str | None:
    phi = packing_fraction(file)
    return _if(not phi < FREEZING[file.dimension], f"the packing fraction is {phi:.3g}")


def _placed(file: Recording) -> str | None:
    count = len(file.scene.get("particle", ()))
    return _if(count > PLACED * len(file), f"the scene places {count} of {len(file)} particles one by one")


def _unequal_species(file: Recording) -> str | None:
    table = file.samples if "observables" in file else {}
    counts = np.bincount(file.species, minlength=len(file.species_names))
    first, members = [], []
    for name, count in zip(file.species_names, counts):
        values = table.get(f"species_temperature_{name}", ())
        if count and len(values) and np.isfinite(values[0]):
            first.append(float(values[0]))
            members.append(count)
    if len(first) < 2:
        return None
    # A species of n particles has a temperature with the relative standard deviation √(2/dn).
    allowed = DRIFT + 4 * np.sqrt(2 / (file.dimension * np.array(members)))
    unequal = np.abs(np.array(first) / np.average(first, weights=members) - 1) > allowed
    return _if(bool(np.any(unequal)), "the species start at different ones")


def _kinds(values: np.ndarray) -> int:
    return len(np.unique(values, axis=-1).T)


def _few(file: Recording) -> str | None:
    return _if(len(file) < FEWEST, f"not {len(file)} particle{'s'[: len(file) != 1]}")


FREE_BODIES = Condition("no fixed bodies", lambda file: _if(not np.all(np.isfinite(file.mass))))
GAS = Condition("a gas", _few)
ONE_SIZE = Condition("particles of one size", lambda file: _if(_kinds(file.radius) > 1))
ONE_MASS = Condition("particles of one mass", lambda file: _if(_kinds(file.mass) > 1))
SPHERES = Condition("spheres", lambda file: _if(file.dimension != 3))
FLUID = Condition("a fluid, below the freezing density", _dense)
NOT_PLACED = Condition("a homogeneous gas", _placed)
ONE_TEMPERATURE = Condition("one temperature at the start", _unequal_species)


# --- the contacts --------------------------------------------------------------------------------------------


def restitution(file: Recording) -> float | None:
    """The coefficient of restitution of all pairs of particles; ``None`` if they have not one constant one."""
    laws = {constant(law) for law in pair_laws(file.scene)}
    return laws.pop() if len(laws) == 1 else None


def _soft(file: Recording) -> str | None:
    tc, time = _contact(file, "tc"), mean_free_time(file)
    return _if(tc > SHORT * time, f"contact.tc = {tc:g} is above {SHORT:g} of the mean free time, {time:.3g}")


ONE_RESTITUTION = Condition("one constant coefficient of restitution", lambda file: _if(restitution(file) is None))
SMOOTH = Condition("smooth contacts", lambda file: _if(is_rough(file.scene)))
ELASTIC = Condition("elastic contacts", lambda file: _if(restitution(file) != 1))
INELASTIC = Condition("inelastic contacts", lambda file: _if(not (restitution(file) or 0.0) < 1))
HARD = Condition("contacts of no duration", lambda file: _if(_contact(file, "tc") > 0, "contact.tc is set"))
RESTLESS = Condition("contacts without rest", lambda file: _if(_contact(file, "rest_speed") > 0, "rest_speed is set"))
NOT_PLASTIC = Condition("a restitution above 0", lambda file: _if(restitution(file) == 0))
SHORT_CONTACTS = Condition("short contacts", _soft)


# --- what happens --------------------------------------------------------------------------------------------


def _changing(file: Recording) -> str | None:
    """Compares the mean temperatures in the quarters of the run."""
    table = file.samples if "observables" in file else {}
    time, T = (np.asarray(table.get(name, ()), float) for name in ("time", "temperature"))
    if len(T) < 2 or not np.all(np.isfinite(T)) or not time[-1] > time[0]:
        return _if(restitution(file) != 1, "there are too few samples of the temperature")
    at = np.linspace(time[0], time[-1], 801)[1:]
    means = np.interp(at, time, T).reshape(4, -1).mean(axis=1)
    mean = float(means.mean())
    allowed = DRIFT + np.sqrt(2 / (file.dimension * np.isfinite(file.mass).sum()))
    changed = bool(np.any(np.abs(means - mean) > allowed * mean))
    return _if(changed, f"it goes from {means[0]:.3g} in the first quarter of the run to {means[-1]:.3g} in the last")


def _unsettled(file: Recording) -> str | None:
    """Compares the temperatures in the halves of the time of the frames that distributions are taken from."""
    from .statistics import drawn_frames

    table = file.samples if "observables" in file else {}
    frames = drawn_frames(file, 2)
    time, T = (np.asarray(table.get(name, ()), float) for name in ("time", "temperature"))
    late = time >= frames[0].time if frames else np.zeros(len(time), bool)
    if late.sum() < 2:
        return None
    first, last = (float(half.mean()) for half in np.array_split(T[late], 2))
    allowed = DRIFT + np.sqrt(2 / (file.dimension * len(file)))
    return _if(not abs(first - last) <= allowed * last, f"it goes from {first:.3g} to {last:.3g}")


def _drifting(file: Recording) -> str | None:
    """Compares the way of the center of mass with the mean square displacement, in at most 80 mean free times."""
    msd = correlation_columns(file).get("msd") if "correlations" in file else None
    table, shear = file.samples if "observables" in file else {}, file.shear
    axes = [axis for k, axis in enumerate(AXES) if shear is None or k != shear.flow]
    momenta = [table[f"momentum_{axis}"] for axis in axes if f"momentum_{axis}" in table]
    if msd is None or len(momenta) < len(axes) or not len(momenta[0]):
        return None
    if not len(msd["lag"]):
        return None
    lag = min(80 * mean_free_time(file), float(msd["lag"][-1]))
    mass = float(np.sum(file.mass[np.isfinite(file.mass)]))
    V = float(np.linalg.norm([np.mean(p) for p in momenta])) / mass
    # Where momentum is not conserved, it fluctuates about 0.
    error = float(np.linalg.norm([np.std(p) for p in momenta])) / (mass * np.sqrt(len(momenta[0])))
    # The least of the curves of species.
    values = msd["value"] if msd["value"].ndim == 1 else msd["value"].min(axis=1)
    drifts = (V * lag) ** 2 > CARRIED * np.interp(lag, msd["lag"], values) and V > 4 * error
    return _if(bool(drifts), f"it moves with the velocity {V:.3g}")


def _not_noise(file: Recording) -> str | None:
    drives, names = file.scene.get("drive", ()), set(file.species_names)
    if [drive["kind"] for drive in drives] != ["white_noise"]:
        return _drives(file) or "nothing drives the gas"
    (drive,) = drives
    if not names <= set(drive.get("species", names)):
        return "it acts on some species only"
    between = float(drive.get("interval", 1 / drive["rate"] if "rate" in drive else 0.0))
    time = mean_free_time(file)
    return _if(between > RARE * time, f"the time between kicks, {between:.3g}, is above {RARE:g} mean free times")


def _not_cooling_shape(file: Recording) -> str | None:
    """A drive other than a common factor of all velocities, as of a drag, which leaves their distribution as it is."""
    names = set(file.species_names)
    for drive in file.scene.get("drive", ()):
        if drive["kind"] not in ("rescale", "drag") or not names <= set(drive.get("species", names)):
            return _drives(file)
    return None


STEADY = Condition("a steady temperature", _changing)
SETTLED = Condition("a steady temperature in the frames that it is of", _unsettled)
AT_REST = Condition("a center of mass at rest", _drifting)
WHITE_NOISE = Condition("white noise on all particles", _not_noise)
COOLING_SHAPE = Condition("a gas that cools freely, or whose velocities are rescaled or damped", _not_cooling_shape)


# --- the conditions of each formula --------------------------------------------------------------------------

IMPACTS_OF_A_GAS = (PERIODIC, UNSHEARED, FREE_BODIES, GAS, ONE_RESTITUTION, NO_WALLS, NO_JOINTS)
"""All normal impacts of a periodic gas have one coefficient of restitution."""
ENSKOG = (*IMPACTS_OF_A_GAS, SMOOTH, FLUID, NOT_PLACED, SHORT_CONTACTS)
HAFF = (*ENSKOG, NO_DRIVE, ONE_TEMPERATURE)
"""Haff's law, and with ``ONE_SIZE``, ``ONE_MASS`` and ``INELASTIC`` the a₂ of the homogeneous cooling state."""
ONE_KIND = (ONE_SIZE, ONE_MASS)
HEATED = (*ENSKOG, *ONE_KIND, INELASTIC, WHITE_NOISE)
"""Steady temperature and a₂ of a gas heated by white noise."""
HEATED_A2 = (*HEATED, SETTLED)
"""The velocities of that state, once it is reached."""
SHEAR_FLOW = (SPHERES, *ONE_KIND, FREE_BODIES, ONE_RESTITUTION, SMOOTH, NO_DRIVE, INELASTIC, FLUID, SHORT_CONTACTS)
"""Steady uniform shear flow by Enskog's equation."""
DIFFUSION = (PERIODIC, NO_WALLS, NO_JOINTS, FROM_START, STEADY, AT_REST)
"""Coefficient of self-diffusion by the slope of the mean square displacement and by Green and Kubo."""
CLOSED_FORM = (FROM_START, UNSHEARED, NO_DRIVE, HARD, RESTLESS)
"""Closed forms of few bodies, which start at time 0; each has conditions of its own besides (figures/worked.py)."""
BOUNCES = (NO_DRIVE, HARD, RESTLESS)
"""Heights and times of a ball's bounces give the coefficient of restitution of a floor at rest."""
VISCOSITY = (PERIODIC, UNSHEARED, FREE_BODIES, GAS, ELASTIC, SMOOTH, NO_DRIVE, NO_WALLS, NO_JOINTS, FROM_START)
"""Viscosity from the fluctuations of the stress in equilibrium."""
