"""Live simulations: advance step by step, with access to the state in between."""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..common import arguments
from ..common.compiled import compiled
from ..common.notebook import table
from ..common.output import require_free
from ..common.words import warn
from ..errors import ArgumentError
from ..scenes import Scene, explained, settings, source
from ..text import quoted
from .forking import living
from .measured import Measured
from .model import Model

__all__ = ["Simulation"]


Callback: TypeAlias = "Callable[[Simulation], object]"
_NEVER = 2**64 - 1
_MOST_ROOM = 10**6
_MOST = 2**62
"""Largest number of collisions that a caller may give."""


_CHANGEABLE = ("positions", "velocities", "angular_velocities")


@dataclass
class _Call:
    """A function that is called at times, or every so many collisions."""

    function: Callback
    interval: float = math.inf
    count: int = _NEVER
    done: int = 0
    """Number of calls since time 0, or number of collisions at the last one."""

    @property
    def time(self) -> float:
        return (self.done + 1) * self.interval

    @property
    def collisions(self) -> int:
        return _NEVER if self.count == _NEVER else self.done + self.count

    def make(self, simulation: Simulation) -> bool:
        """Calls it; returns whether to stop."""
        self.done = self.done + 1 if self.count == _NEVER else simulation.collisions
        return self.function(simulation) is True


class Simulation(Model, Measured):
    """A simulation in this process, advanced call by call.

    Parameters
    ----------
    scene
        A dict with the keys of a scene file, or the path of one. Its ``output.file`` is not used.
    threads
        Threads of this simulation; default: all processors, shared with other simulations. No result depends on it.
    events
        Whether events are kept for :meth:`take_events`; costs time and memory.
    file
        An output file of what is advanced, with frames, observables and events as ``[output]`` of the scene says, for
        :func:`haff.open`, :func:`haff.plot` and :func:`haff.view`. :meth:`close` writes its end, and so does a ``with``
        block; it cannot be resumed.
    overwrite
        Whether an existing file is replaced.
    room
        How many particles :meth:`add` can add to a simulation with a ``file``; default 0. Each has a row of its own in
        the file, also after it has been removed. Frames are of those that are there.
    overrides
        Keys of the scene, two underscores for the dot: ``contact__restitution=0.8``.

    Raises
    ------
    SceneError
        The scene is invalid; ``error.problems`` lists all errors.

    Notes
    -----
    :attr:`positions`, :attr:`velocities`, :attr:`angular_velocities` and :attr:`images` are read-only *snapshots*: the
    engine keeps each particle as it was at its last collision, so positions of one instant are computed on demand, once
    per instant, and do not change when the simulation continues.

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

    Balls that fall one after the other, in a file:

    >>> board = haff.load_scene("board.toml")                                      # doctest: +SKIP
    >>> with haff.Simulation(board, file="board.h5", room=50) as stream:           # doctest: +SKIP
    ...     stream.every(0.5, lambda now: now.add([0.0, 9.0, 0.0], species="ball"))
    ...     stream.advance(until=25.0)
    >>> haff.view("board.h5")                                                      # doctest: +SKIP
    """

    def __init__(
        self,
        scene: Scene,
        /,
        *,
        threads: int | None = None,
        events: bool = False,
        file: str | os.PathLike[str] | None = None,
        overwrite: bool = False,
        room: int = 0,
        **overrides: Any,
    ) -> None:
        if threads is not None:
            threads = arguments.count("threads", threads, 1, 1024)
        kept: dict[str, Any] = {"threads": threads, "events": arguments.flag("events", events)}
        arguments.flag("overwrite", overwrite)
        arguments.count("room", room, 0, _MOST_ROOM)
        if file is not None:
            path = arguments.file("file", file)
            require_free(path, overwrite=overwrite)
            kept |= {"file": path, "overwrite": overwrite, "room": room}
        elif room or overwrite:
            raise ArgumentError("room and overwrite are for a simulation with a file: give file = …")
        with explained(scene, overrides, ("threads", "events", "file", "overwrite", "room")):
            self._core = compiled().Simulation(source(scene, overrides), **kept)
        self._records_events = events
        self._calls: list[_Call] = []
        self._frame: tuple[Any, ...] | None = None
        self._balance_due: int | None = 0
        """At how many collisions the balance of energies is looked at next; ``None`` after a warning."""
        warn(self._core.warnings, stacklevel=3)
        living.add(self)

    def close(self) -> None:
        """Write the end of the output file, and close it; the simulation can go on, but nothing is recorded then.

        Without a file nothing is done. Raises :class:`haff.FileError` if the file cannot be written.
        """
        self._core.close()

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __setattr__(self, name: str, value: Any) -> None:
        own = getattr(type(self), name, None)
        if name.startswith("_") or (isinstance(own, property) and own.fset is not None):
            super().__setattr__(name, value)
        elif own is not None:
            raise AttributeError(f"{name}: cannot be changed; {', '.join(_CHANGEABLE)}, add() and remove() can")
        else:
            near = difflib.get_close_matches(name, dir(self), 1)
            raise AttributeError(
                f"{name}: a simulation has no such attribute{f'; did you mean {near[0]}?' if near else ''}"
            )

    def __reduce__(self) -> Any:
        raise TypeError("a Simulation cannot be pickled or copied: make another one from its scene (scene_text)")

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
        ``"until"``, ``"collisions"``, ``"rest"``: nothing moves any more, or ``"call"``: a function of :meth:`every` or
        :meth:`every_collisions` has stopped it.

        Raises
        ------
        SimulationError
            The simulation cannot continue, for example after an inelastic collapse.
        """
        until = arguments.time("until", until, self.time)
        if collisions is None and math.isinf(until):
            raise ArgumentError("until = inf: needs collisions = …, or this would never end")
        if collisions is not None:
            collisions = arguments.count("collisions", collisions, 0, _MOST)
        return self._advance(until, collisions)

    def step(self, collisions: int = 1, *, until: float = math.inf) -> str:
        """Run until ``collisions`` more collisions between particles have happened, at most up to a time.

        Returns as :meth:`advance`. A scene in which only walls are hit needs ``until``.
        """
        collisions = arguments.count("collisions", collisions, 1, _MOST)
        return self._advance(arguments.time("until", until, self.time), self.collisions + collisions)

    def run(self) -> str:
        """Run to the end given in the scene (``run.until``, ``run.collisions``). Returns as :meth:`advance`."""
        until = math.inf if self._core.until is None else max(self._core.until, self.time)
        reason = self._advance(until, self._core.collisions_asked)
        self._check_balance(always=True)
        return reason

    def _check_balance(self, *, always: bool = False) -> None:
        """Warn once if energies no longer balance; unless ``always``, so seldom that it takes no time."""
        if self._balance_due is None or not (always or self.collisions >= self._balance_due):
            return
        self._balance_due = self.collisions + len(self)
        if (text := self._core.residual_warning()) is not None:
            self._balance_due = None
            warn([text], stacklevel=4)

    def _advance(self, until: float, collisions: int | None) -> str:
        reason = self._run_events(until, collisions)
        self._check_balance()
        return reason

    def _run_events(self, until: float, collisions: int | None) -> str:
        most = _NEVER if collisions is None else collisions
        while True:
            self._frame = None
            time = min((call.time for call in self._calls), default=math.inf)
            total = min((call.collisions for call in self._calls), default=_NEVER)
            # A call may set in motion what is at rest; without a bound of time it would have to.
            waits = math.isfinite(time) and math.isfinite(until)
            reason = self._core.advance(min(until, time), min(most, total), waits)
            due = [
                call
                for call in self._calls
                if (reason in ("until", "rest") and call.time <= self.time)
                or (reason == "collisions" and call.collisions <= self.collisions)
            ]
            if not due:
                return reason
            # In the order in which they were made; each sees the changes of those before.
            stops = [call.make(self) for call in due]
            if any(stops):
                return "call"
            if reason == "until" and self.time >= until:
                return reason
            if reason == "collisions" and self.collisions >= most:
                return reason

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
        """``[N, 3]`` centres [length], within [0, L) along periodic axes; z = 0 in 2D.

        A read-only snapshot; assign an array to move the particles. Positions outside of a periodic box are wrapped
        into it, and the images count that.
        """
        return self._snapshot()[2]

    @positions.setter
    def positions(self, values: ArrayLike) -> None:
        self._change(positions=self._vectors("positions", values))

    @property
    def velocities(self) -> NDArray[np.float64]:
        """``[N, 3]`` velocities [length/time]; z = 0 in 2D. A read-only snapshot; assign an array to change them."""
        return self._snapshot()[3]

    @velocities.setter
    def velocities(self, values: ArrayLike) -> None:
        self._change(velocities=self._vectors("velocities", values))

    @property
    def angular_velocities(self) -> NDArray[np.float64] | None:
        """``[N, 3]`` angular velocities [1/time], along z in 2D; ``None`` if the scene has no spin.

        A read-only snapshot; assign an array to change them.
        """
        return self._snapshot()[5]

    @angular_velocities.setter
    def angular_velocities(self, values: ArrayLike) -> None:
        self._change(angular_velocities=self._vectors("angular_velocities", values))

    @property
    def images(self) -> NDArray[np.int32]:
        """``[N, 3]`` how often each particle has left through the periodic faces. A read-only snapshot."""
        return self._snapshot()[4]

    @property
    def unwrapped(self) -> NDArray[np.float64]:
        """``[N, 3]`` positions that do not jump at periodic faces, position + Σ image · edge vector [length]."""
        return self.box.unwrap(self.positions, self.images)

    # --- changing the state ----------------------------------------------------------------------------------

    def add(
        self,
        positions: ArrayLike,
        velocities: ArrayLike = 0.0,
        *,
        species: str | None = None,
        radius: ArrayLike | None = None,
        mass: ArrayLike | None = None,
        angular_velocities: ArrayLike = 0.0,
    ) -> NDArray[np.int64]:
        """Add particles at the present time; returns their rows, the last ones.

        Parameters
        ----------
        positions
            ``[M, 3]`` or ``[3]`` centres [length].
        velocities
            The same shape, or one for all [length/time].
        species
            Name of a species of the scene; default the first. It gives the laws of contact.
        radius, mass
            One for all, or ``[M]``; default those of the species, if all its particles have the same.
        angular_velocities
            ``[M, 3]``, or one for all [1/time]. Their moments of inertia are those of the species.

        Raises
        ------
        ValueError
            An overlap, a value that is not possible, a scene whose correlations follow its particles, or an output file
            without ``room`` for them. Nothing is changed then.
        """
        places = np.atleast_2d(arguments.reals("positions", positions))
        if places.ndim != 2 or places.shape[1] != 3:
            raise ArgumentError(
                f"positions = {quoted(positions)}, of shape {np.shape(positions)}: must be [M, 3] or [3]"
            )
        count = len(places)
        kind = self.species_names[0] if species is None else arguments.choice("species", species, self.species_names)
        index = self.species_names.index(kind)
        members = self.species == index
        values = []
        for name, given, present in (("radius", radius, self.radii), ("mass", mass, self.masses)):
            known = np.unique(present[members])
            if given is None and len(known) != 1:
                why = "has no particles" if len(known) == 0 else "has particles of several"
                raise ArgumentError(f"{name}: must be given, for the species {quoted(kind)} {why}")
            value = known[0] if given is None else given
            values.append(arguments.shaped(name, value, [count], f"one number, or [{count}]").tolist())
        speeds, spins = (
            arguments.shaped(name, given, [count, 3], f"[{count}, 3], or one vector [3] for all").tolist()
            for name, given in (("velocities", velocities), ("angular_velocities", angular_velocities))
        )
        before = len(self)
        self._change(add=list(zip(places.tolist(), speeds, spins, *values, [index] * count)))
        return np.arange(before, before + count)

    def remove(self, rows: ArrayLike) -> None:
        """Remove particles at the present time, by their rows or by a mask ``[N]``; the rows of later ones move up.

        Raises :class:`ArgumentError` for rows that there are not, or twice, and if no particle would be left; nothing
        is changed then.
        """
        self._change(remove=self._rows(rows).tolist())

    def _rows(self, rows: ArrayLike) -> NDArray[np.int64]:
        """Rows of particles, from 0, each once."""
        allowed = f"must be rows, whole numbers from {-len(self)} to {len(self) - 1}, or a mask [{len(self)}]"
        try:
            chosen = np.atleast_1d(np.asarray(rows))
        except Exception:
            chosen = np.empty(0, object)
        if np.ma.is_masked(rows) or chosen.ndim != 1:
            raise ArgumentError(f"rows = {quoted(rows)}: {allowed}")
        if chosen.dtype == bool:
            if chosen.shape != (len(self),):
                raise ArgumentError(f"rows = {quoted(rows)}, a mask of shape {chosen.shape}: {allowed}")
            chosen = np.flatnonzero(chosen)
        if len(chosen) == 0 and chosen.dtype != object:
            return chosen.astype(np.int64)
        if chosen.dtype.kind not in "iu":
            raise ArgumentError(f"rows = {quoted(rows)}: {allowed}")
        beyond = (chosen >= len(self)) | (chosen < -len(self) if chosen.dtype.kind == "i" else False)
        if np.any(beyond):
            raise ArgumentError(f"rows = {quoted(rows)}: {allowed}; there is no row {chosen[np.argmax(beyond)]}")
        chosen = chosen.astype(np.int64) % len(self)
        if len(np.unique(chosen)) < len(chosen):
            raise ArgumentError(f"rows = {quoted(rows)}: must name each particle once")
        if len(chosen) == len(self):
            raise ArgumentError(f"rows = {quoted(rows)}: must leave at least one particle")
        return chosen

    def set(self, **keys: Any) -> None:
        """Change keys of the scene from now on: of ``contact`` and ``wall``, and ``domain.gravity``.

        Parameters
        ----------
        keys
            Keys of the scene, two underscores for the dot: ``contact__restitution=0.8``,
            ``wall__floor__motion__frequency=0.301``, ``domain__gravity=[0, 0, -2]``.

        Raises
        ------
        SceneError
            A key that cannot change, or a value that is not possible.
        ValueError
            A particle would overlap with a wall now. Nothing is changed in either case.

        Notes
        -----
        A wall goes on from where it is. ``wall__NAME__velocity`` moves it from there, or stops it; ``motion`` makes it
        oscillate from there on. With another frequency its phase and position are continuous. With another amplitude,
        too: its mean position moves, so that the wall stays where it is at this phase. A wall jumps only if its
        ``plane__point`` (of other shapes ``offset``), its ``displacement`` or its ``motion__phase`` is set.
        :attr:`scene_text` has the walls as they are then. The command does the same with
        ``haff run --resume FILE --set KEY=VALUE``, :func:`haff.resume` too.

        Examples
        --------
        >>> import haff
        >>> piston = {
        ...     "schema": 1,
        ...     "domain": {"boundary": ["open"] * 3},
        ...     "particle": [{"position": [0, 0, 1], "velocity": [0, 0, 1], "radius": 0.2, "mass": 1.0}],
        ...     "wall": [{"name": "top", "plane": {"point": [0, 0, 9], "normal": [0, 0, -1]}, "velocity": [0, 0, -1]}],
        ...     "run": {"until": 10.0},
        ... }
        >>> live = haff.Simulation(piston)
        >>> live.advance(2.0)
        'until'
        >>> live.set(wall__top__velocity=[0, 0, 0])                            # it stops at z = 7
        >>> "point = [0.0, 0.0, 7.0]" in live.scene_text
        True
        """
        if not keys:
            return
        # The resolved scene is no file of the caller: errors name keywords.
        with explained("", keys):
            self._core.set(settings(keys))
        self._frame = None

    def _change(self, **what: Any) -> None:
        self._core.change(**what)
        self._frame = None

    def _vectors(self, name: str, values: ArrayLike) -> NDArray[np.float64]:
        allowed = f"[{len(self)}, 3], or one vector [3] for all"
        return np.array(arguments.shaped(name, values, [len(self), 3], allowed), order="C")

    # --- calls at times or every so many collisions --------------------------------------------------------------

    def every(self, interval: float, call: Callback) -> None:
        """Call ``call(simulation)`` at each multiple of ``interval`` [time] from now on, after all events at that time.

        It may change the state. If it returns ``True``, :meth:`advance` stops there, with ``"call"``. Where nothing
        moves, time passes up to the bound of :meth:`advance`, so that a call can add particles or set some in motion.
        """
        interval = arguments.positive("interval", interval)
        least = max(arguments.SMALLEST, 4 * math.ulp(self.time))
        if not least <= interval <= arguments.LARGEST:
            raise ArgumentError(f"interval = {interval}: must be from {least:g} to {arguments.LARGEST:g}")
        done = math.floor(self.time / interval * (1 + 1e-15))
        self._calls.append(_Call(arguments.function("call", call), interval=interval, done=done))

    def every_collisions(self, count: int, call: Callback) -> None:
        """Call ``call(simulation)`` whenever ``count`` more collisions have happened; see :meth:`every`."""
        count = arguments.count("count", count, 1, _MOST)
        self._calls.append(_Call(arguments.function("call", call), count=count, done=self.collisions))

    def _snapshot(self) -> tuple[Any, ...]:
        # After Ctrl-C, or while another thread advances, the time shows whether the last snapshot is still valid.
        if self._frame is None or self._frame[0] != self.time:
            self._frame = self._core.frame()
        return self._frame

    # --- how it is shown ---------------------------------------------------------------------

    def _repr_html_(self) -> str:
        """A table for notebooks."""
        rows = [
            ("time", f"{self.time:g}"),
            ("particles", f"{len(self):,} ({', '.join(self.species_names)})"),
            ("box", self.box),
            ("packing fraction", f"{self.packing_fraction:.4g}"),
            ("collisions", f"{self.collisions:,}"),
            ("wall collisions", f"{self.wall_collisions:,}"),
            ("seed", self.seed),
        ]
        return table(f"Simulation: {self.title or 'untitled'}", rows)

    def __repr__(self) -> str:
        done = f"t = {self.time:g}, {self.collisions:,} collisions"
        return f"<haff.Simulation {self.title!r}: {len(self):,} particles, {done}>"
