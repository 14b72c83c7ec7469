"""Live simulations: advance step by step, with access to the state in between."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from . import measurements
from .frames import Box
from .layout import AXES
from .scenes import Scene, compiled, source

if TYPE_CHECKING:
    import xarray

__all__ = ["Simulation"]


class Simulation:
    """A simulation in this process, advanced call by call.

    Parameters
    ----------
    scene
        A dict with the keys of a scene file, or the path of one. Its ``[output]`` is not used: nothing is written.
    threads
        Threads of this simulation; default: all processors, shared with other simulations. No result depends on it.
    events
        Whether events are kept for :meth:`take_events`; costs time and memory.
    overrides
        Keys of the scene, two underscores for the dot: ``contact__restitution=0.8``.

    Raises
    ------
    SceneError
        The scene is invalid; ``error.problems`` lists all errors.

    Notes
    -----
    :attr:`positions`, :attr:`velocities` and :attr:`images` are read-only *snapshots*: the engine keeps each particle
    as it was at its last collision, so positions of one instant are computed on demand, once per instant, and
    do not change when the simulation continues.

    The trajectory is that of ``haff run``: :attr:`state_hash` is equal at equal times, however the way there was cut
    into steps. While it advances, other Python threads run and may read it, and Ctrl-C stops it between two events; it
    can then go on.

    Examples
    --------
    >>> import haff
    >>> gas = haff.Simulation(haff.template("cooling"), species__0__count=1000, seed=7)
    >>> gas.advance(until=20.0)
    'until'
    >>> gas.positions.shape, gas.velocities.flags.writeable
    ((1000, 3), False)
    >>> gas.sample()["temperature"] < 0.5
    True
    """

    def __init__(self, scene: Scene, /, *, threads: int | None = None, events: bool = False, **overrides: Any) -> None:
        self._core = compiled().Simulation(source(scene, overrides), threads=threads, events=events)
        self._records_events = events
        self._frame: tuple[Any, ...] | None = None

    # --- advancing --------------------------------------------------------------------------------

    def advance(self, until: float, *, collisions: int | None = None) -> str:
        """Run all events up to and including a time.

        Parameters
        ----------
        until
            Simulated time [time], not before :attr:`time`. :data:`math.inf` for no bound, with ``collisions``.
        collisions
            Stop as well when so many collisions have happened since the start.

        Returns
        -------
        ``"until"``, ``"collisions"``, or ``"rest"``: nothing moves any more.

        Raises
        ------
        SimulationError
            The simulation cannot continue, for example after an inelastic collapse.
        """
        until = float(until)
        if math.isnan(until) or until < self.time:
            raise ValueError(f"until = {until}: must not be before the present time {self.time}")
        if collisions is None and math.isinf(until):
            raise ValueError("until = inf: needs collisions = …, or this would never end")
        return self._advance(until, collisions)

    def step(self, collisions: int = 1, *, until: float = math.inf) -> str:
        """Run until ``collisions`` more collisions between particles have happened, at most up to a time.

        Returns as :meth:`advance`. A scene in which only walls are hit needs ``until``.
        """
        if collisions < 1:
            raise ValueError(f"collisions = {collisions}: must be at least 1")
        return self._advance(float(until), self.collisions + collisions)

    def run(self) -> str:
        """Run to the end given in the scene (``run.until``, ``run.collisions``). Returns as :meth:`advance`."""
        until = math.inf if self._core.until is None else max(self._core.until, self.time)
        return self._advance(until, self._core.collisions_asked)

    def _advance(self, until: float, collisions: int | None) -> str:
        self._frame = None
        return self._core.advance(until, 2**64 - 1 if collisions is None else int(collisions))

    # --- present state ---------------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Simulated time [time]."""
        return self._core.time

    @property
    def collisions(self) -> int:
        """Collisions between particles so far."""
        return self.counters["collisions"]

    @property
    def wall_collisions(self) -> int:
        """Collisions with walls so far."""
        return self.counters["wall_collisions"]

    @property
    def positions(self) -> NDArray[np.float64]:
        """``[N, 3]`` centres [length], within [0, L) along periodic axes; z = 0 in 2D. A read-only snapshot."""
        return self._snapshot()[2]

    @property
    def velocities(self) -> NDArray[np.float64]:
        """``[N, 3]`` velocities [length/time]; z = 0 in 2D. A read-only snapshot."""
        return self._snapshot()[3]

    @property
    def images(self) -> NDArray[np.int32]:
        """``[N, 3]`` how often each particle has left through the periodic faces. A read-only snapshot."""
        return self._snapshot()[4]

    @property
    def unwrapped(self) -> NDArray[np.float64]:
        """``[N, 3]`` positions that do not jump at periodic faces, position + image · L [length]."""
        return self.positions + self.images * np.where(self.box.periodic, self.box.size, 0.0)

    def _snapshot(self) -> tuple[Any, ...]:
        # After Ctrl-C, or while another thread advances, the time shows whether the last snapshot is still valid.
        if self._frame is None or self._frame[0] != self.time:
            self._frame = self._core.frame()
        return self._frame

    def sample(self) -> dict[str, Any]:
        """The observables now, named as the columns of :attr:`haff.File.observables`; vectors are arrays ``[3]``.

        ``pressure``, ``collision_rate`` and ``mean_free_time`` are means since the previous call, NaN in the first.
        """
        return self._core.sample()

    @property
    def counters(self) -> dict[str, int]:
        """Counts since the start: ``collisions``, ``wall_collisions``, ``predictions``, …"""
        return self._core.counters()

    @property
    def max_overlap(self) -> float:
        """Largest overlap of any two close particles, now and in earlier calls [contact distances]."""
        return self._core.max_overlap()

    @property
    def state_hash(self) -> str:
        """Hash of every particle's position, velocity and image; equal for equal trajectories."""
        return self._core.state_hash

    def take_events(self) -> pd.DataFrame:
        """The events since the last call, one row each, with the columns of :attr:`haff.File.events`.

        Needs ``events=True`` at the start.
        """
        if not self._records_events:
            raise ValueError("no events are recorded: make the simulation with events=True")
        columns: dict[str, Any] = {}
        for name, values in self._core.take_events().items():
            if name == "kind":
                columns[name] = pd.Categorical.from_codes(values, categories=self._core.event_kinds)
            elif values.ndim == 2:
                columns |= {f"{name}_{axis}": values[:, c] for c, axis in enumerate(AXES)}
            else:
                columns[name] = values
        return pd.DataFrame(columns)

    def take_profiles(self) -> dict[str, xarray.Dataset]:
        """The rows of ``measure.profiles`` since the last call, as :attr:`haff.File.profiles`."""
        found = {}
        for name, columns in self._core.take_profiles().items():
            time, centers = columns.pop("time"), columns.pop("centers")
            found[name] = measurements.profile(time, centers, columns)
        return found

    @property
    def correlations(self) -> dict[str, xarray.Dataset]:
        """The correlations in time of ``[measure]`` so far, as :attr:`haff.File.correlations`."""
        return {name: measurements.correlation(name, columns) for name, columns in self._core.correlations().items()}

    # --- the scene ---------------------------------------------------------------------------

    def __len__(self) -> int:
        """Number of particles N."""
        return len(self.masses)

    @property
    def radii(self) -> NDArray[np.float64]:
        """``[N]`` radii [length]."""
        return self._core.radius

    @property
    def masses(self) -> NDArray[np.float64]:
        """``[N]`` masses; infinite for fixed and driven bodies."""
        return self._core.mass

    @property
    def species(self) -> NDArray[np.int64]:
        """``[N]`` indices into :attr:`species_names`."""
        return self._core.species

    @property
    def species_names(self) -> list[str]:
        """Names of the species, then of named particles."""
        return self._core.species_names

    @property
    def wall_names(self) -> list[str]:
        """Names of the walls, by the index that event rows use."""
        return self._core.wall_names

    @cached_property
    def box(self) -> Box:
        """The simulation box."""
        return Box(self._core.box_size, self._core.boundary, self._core.dimension)

    @property
    def gravity(self) -> NDArray[np.float64]:
        """``[3]`` acceleration [length/time²]."""
        return self._core.gravity

    @property
    def packing_fraction(self) -> float:
        """Volume of all particles over that of the box; NaN with open axes."""
        return self._core.packing_fraction

    @property
    def title(self) -> str:
        """Title of the scene."""
        return self._core.title

    @property
    def seed(self) -> int:
        """Seed of all random numbers."""
        return self._core.seed

    @property
    def scene_text(self) -> str:
        """The scene with every default written out, as TOML."""
        return self._core.resolved

    @property
    def threads(self) -> int:
        """Number of threads that this simulation may use."""
        return self._core.threads

    @property
    def neighbors(self) -> str:
        """Method of the neighbor search: ``"windows"``, ``"lists"``, ``"cells"``, …"""
        return self._core.neighbors

    def __repr__(self) -> str:
        done = f"t = {self.time:g}, {self.collisions:,} collisions"
        return f"<haff.Simulation {self.title!r}: {len(self):,} particles, {done}>"
