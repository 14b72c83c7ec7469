"""What a live simulation is of: its particles, its box and its scene."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..files.box import Box, Shear
from ..files.container import Container, container_of
from ..files.layout import AXES
from ..files.scene import parsed


class Model:
    """The system of a :class:`haff.Simulation`: what motion does not change, and the box of the present time."""

    _core: Any
    """The simulation of the engine."""

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
    def inertias(self) -> NDArray[np.float64] | None:
        """``[N]`` numbers q = I/(m R²) of the moments of inertia I; ``None`` if the scene has no spin."""
        return self._core.inertia

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

    @property
    def box(self) -> Box:
        """The simulation box, at the present time if it deforms."""
        edges = self._core.moving_edges
        size = self._core.box_size if edges is None else np.diag(edges)
        container = self._container
        if container is not None:
            container = container.scaled(float(size[0] / self._core.box_size[0]))
        return Box(size, self._core.boundary, self._core.dimension, self._displacement(), container)

    @cached_property
    def _container(self) -> Container | None:
        """The container that shrinks with the box, at its size at the start."""
        return container_of(parsed(self.scene_text), self._core.dimension)

    @cached_property
    def shear(self) -> Shear | None:
        """Simple shear of the box (``domain.shear`` of the scene); ``None`` if there is none."""
        given = self._domain.get("shear")
        if given is None:
            return None
        return Shear(AXES.index(given["flow"]), AXES.index(given["gradient"]), float(given["rate"]))

    @cached_property
    def _domain(self) -> dict[str, Any]:
        return parsed(self.scene_text).get("domain", {})

    def _displacement(self) -> tuple[int, int, float] | None:
        """That of :class:`Box`."""
        if self.shear is None:
            return None
        flow, gradient, _ = self.shear
        return gradient, flow, self._core.moving_edges[gradient][flow]

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
