"""What a live simulation has measured and counted."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ArgumentError
from ..files import measure
from ..files.layout import AXES

if TYPE_CHECKING:
    import pandas as pd
    import xarray


class Measured:
    """The observables, counts and events of a :class:`haff.Simulation`."""

    _core: Any
    """The simulation of the engine."""
    _records_events: bool
    """Whether events are kept."""

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
        """Hash of every particle's position, velocity and image, and of pistons; equal for equal trajectories."""
        return self._core.state_hash

    def take_events(self) -> pd.DataFrame:
        """The events since the last call, one row each, with the columns of :attr:`haff.File.events`.

        Needs ``events=True`` at the start.
        """
        import pandas as pd

        if not self._records_events:
            raise ArgumentError("no events are recorded: make the simulation with events=True")
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
            time, centers, species = (columns.pop(key, ()) for key in ("time", "centers", "species"))
            found[name] = measure.profile(self._core.dimension, time, centers, columns, self._named(species))
        return found

    @property
    def correlations(self) -> dict[str, xarray.Dataset]:
        """The correlations in time of ``[measure]`` so far, as :attr:`haff.File.correlations`."""
        found = self._core.correlations()
        for columns in found.values():
            if "species" in columns:
                columns["species"] = np.array(self._named(columns["species"]), dtype=object)
        return {name: measure.correlation(self._core.dimension, name, columns) for name, columns in found.items()}

    def _named(self, species: Iterable[int]) -> list[str]:
        """Names of species by their indices."""
        return [self._core.species_names[k] for k in species]
