"""Packings: which gaps are contacts, rattlers, the number of contacts, and the packing fraction of jamming."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..common import arguments
from ..errors import ArgumentError, NotApplicableError
from ..text import quoted
from .gaps import Gaps, gaps_of, particles

if TYPE_CHECKING:
    from ..files.box import Box

__all__ = [
    "ContactNetwork",
    "JammingFit",
    "contact_network",
    "contact_tolerance",
    "jamming_fraction",
    "rattlers",
]

FEWEST = 3
"""Samples that a fit of two numbers and its error needs."""


class ContactNetwork(NamedTuple):
    """The contacts of a packing."""

    contacts: Gaps
    """All contacts, with those of rattlers."""
    rattlers: NDArray[np.bool_]
    """``[N]`` true for the particles that carry no force."""
    tolerance: float
    """Gaps below it are contacts [contact distances]."""
    dimension: int
    periodic: int
    """Number of ways in which the packing may move as a whole: along periodic axes, and turned in a container."""

    @property
    def backbone(self) -> int:
        """Number of particles that are no rattlers."""
        return int(np.count_nonzero(~self.rattlers))

    @property
    def backbone_pairs(self) -> NDArray[np.bool_]:
        """``[K]`` true for the contacts of two particles of the backbone."""
        return ~self.rattlers[self.contacts.pairs].any(axis=1)

    @property
    def backbone_contacts(self) -> int:
        """Contacts within the backbone and of it with walls, each counted once."""
        walls = np.count_nonzero(~self.rattlers[self.contacts.wall_rows])
        return int(np.count_nonzero(self.backbone_pairs) + walls)

    @property
    def contact_number(self) -> float:
        """Z, contacts of a particle of the backbone with others of it and with walls, their mean; NaN without one."""
        if self.backbone == 0:
            return float("nan")
        return float(np.count_nonzero(self.backbone_pairs) + self.backbone_contacts) / self.backbone

    @property
    def isostatic_contacts(self) -> int:
        """The fewest contacts that hold the backbone of N' particles: d N' − p + 1, with :attr:`periodic` p.

        One contact for each coordinate, without the p motions of the whole, and one more for the volume, which the
        pressure keeps. Without friction and rotation.
        """
        return self.dimension * self.backbone - self.periodic + 1

    @property
    def isostatic_number(self) -> float:
        """Z of an isostatic backbone that is periodic along all axes: 2d (1 − 1/N') + 2/N'; 2d for many particles.

        Each contact with a wall counts for one particle only, so that Z between walls is lower: compare
        :attr:`backbone_contacts` with :attr:`isostatic_contacts` there. NaN without a backbone.
        """
        return 2 * self.isostatic_contacts / self.backbone if self.backbone else float("nan")


class JammingFit(NamedTuple):
    """Where the reduced pressure of a growing system diverges."""

    value: float
    """φ_J."""
    error: float
    """Standard error of φ_J from the scatter of the samples about the line."""
    coefficient: float
    """c of p = c/(1 − φ/φ_J); about d, see :func:`jamming_fraction`."""
    coefficient_error: float
    """Its standard error."""
    samples: int
    """Samples used."""


def contact_tolerance(reduced_pressure: float) -> float:
    r"""The largest gap of a contact at a reduced pressure p = P V/(N T): ½ p^(−5/8) [contact distances].

    Near jamming a contact that carries the mean force f opens and closes: its gap h has the distribution
    :math:`(f/T) e^{-f h/T}`. The virial of an isostatic packing, :math:`(p - 1)\, d N T = \sum f \sigma` over d N
    contacts, gives the mean f σ/T = p − 1 ≈ p: gaps of contacts are of the size σ/p. Weak contacts have wider ones, and
    there are some at any force: about 0.3/(p τ) of all contacts are wider than τ σ at an instant. Particles that almost
    touch have narrow gaps, too: each has about 11 τ^0.6 of them below τ σ (A. Donev, S. Torquato, F. H. Stillinger,
    Phys. Rev. E 71, 011105 (2005), for spheres). Contacts missed and near contacts taken for contacts are together
    fewest at τ = 0.44 p^(−5/8), and about as many.

    In packings of 256 spheres and of 256 disks of two sizes whose contacts were known, each of the two errors was about
    10 % of all contacts at p = 10³, 2 % or less at 10⁵ and 1 % at 10⁶; they nearly cancel in the contact number. At
    moderate pressures, as in a fluid, "contacts" are near neighbors and nothing more.

    Raises :class:`ArgumentError` unless the pressure is a finite number above 0.
    """
    return 0.5 * arguments.positive("reduced_pressure", reduced_pressure) ** -0.625


def rattlers(count: int, pairs: ArrayLike, dimension: int, *, walls: ArrayLike = ()) -> NDArray[np.bool_]:
    """``[N]`` true for particles with fewer than d + 1 contacts, not counting those with such particles.

    Particles with too few contacts are taken out with their contacts until none changes. d + 1 contacts are necessary
    for a particle to be held, and not sufficient: all of them may be on one side.

    Parameters
    ----------
    count
        Number of particles N.
    pairs
        ``[K, 2]`` rows of the particles in contact.
    dimension
        d, 2 or 3.
    walls
        ``[W]`` rows of the particles in contact with walls, one for each contact.

    Raises
    ------
    ArgumentError
        A row is none of the particles.
    """
    count, d = arguments.count("count", count, 1), arguments.count("dimension", dimension, 2, 3)
    both = _rows("pairs", pairs, count, "[K, 2]")
    fixed = _rows("walls", walls, count, "[W]")
    # The contacts of each particle, one after the other: those of particle k are from starts[k] on.
    first, second = np.concatenate([both, both[:, ::-1]]).T
    second = second[np.argsort(first, kind="stable")]
    touching = np.bincount(first, minlength=count)
    starts = np.cumsum(touching) - touching
    contacts = touching + np.bincount(fixed, minlength=count)
    loose = np.zeros(count, bool)
    found = np.flatnonzero(contacts <= d)
    while len(found):
        loose[found] = True
        lost = np.concatenate([second[starts[k] : starts[k] + touching[k]] for k in found])
        np.subtract.at(contacts, lost, 1)
        lost = np.unique(lost)
        found = lost[~loose[lost] & (contacts[lost] <= d)]
    return loose


def _rows(name: str, values: ArrayLike, count: int, shape: str) -> NDArray[np.int64]:
    """Rows of particles, in an array of a shape; an empty one may have any."""
    found, axes = arguments.reals(name, values), shape.count(",") + 1
    if found.size == 0:
        return np.zeros((0, 2)[:axes], np.int64)
    if found.ndim != axes or (axes == 2 and found.shape[1] != 2):
        raise ArgumentError(f"{name} = {quoted(values)}, of shape {found.shape}: must be {shape}")
    if not ((found >= 0) & (found < count) & (found == np.floor(found))).all():
        raise ArgumentError(f"{name} = {quoted(values)}: must be rows, whole numbers from 0 to {count - 1}")
    return found.astype(np.int64)


def contact_network(
    positions: ArrayLike,
    radii: ArrayLike,
    box: Box,
    *,
    reduced_pressure: float | None = None,
    tolerance: float | None = None,
) -> ContactNetwork:
    """Contacts, rattlers and contact number of a packing.

    Parameters
    ----------
    positions, radii, box
        ``[N, 3]`` or ``[N, 2]`` [length], ``[N]`` [length] and the box, as for :func:`close_gaps`.
    reduced_pressure
        p = P V/(N T); gaps below :func:`contact_tolerance` are contacts.
    tolerance
        Largest gap of a contact instead [contact distances R_i + R_j; of a wall: diameters].

    Raises
    ------
    ArgumentError
        Neither pressure nor tolerance is given, or both; or as :func:`close_gaps`.
    NotApplicableError
        As :func:`close_gaps`.

    Examples
    --------
    Disks on a square lattice have four contacts each:

    >>> import haff
    >>> places = [[x + 0.5, y + 0.5] for x in range(4) for y in range(4)]
    >>> box = haff.Box([4.0, 4.0, 1.0], ["periodic", "periodic", "open"], 2)
    >>> found = haff.analysis.contact_network(places, 0.5, box, tolerance=1e-9)
    >>> found.contact_number, found.isostatic_number, int(found.rattlers.sum())
    (4.0, 3.875, 0)
    """
    if (reduced_pressure is None) == (tolerance is None):
        raise ArgumentError(
            f"reduced_pressure = {quoted(reduced_pressure)}, tolerance = {quoted(tolerance)}: "
            "one must be given, not both"
        )
    if tolerance is not None:
        largest = arguments.positive("tolerance", tolerance)
    else:
        largest = contact_tolerance(reduced_pressure)  # type: ignore[arg-type]
    position, radius = particles(positions, radii, box)
    contacts, d = gaps_of(position, radius, box, largest), box.dimension
    loose = rattlers(len(position), contacts.pairs, d, walls=contacts.wall_rows)
    free = int(np.count_nonzero(box.periodic[:d])) + (0 if box.container is None else box.container.turns)
    return ContactNetwork(contacts, loose, largest, d, free)


def jamming_fraction(packing_fraction: ArrayLike, reduced_pressure: ArrayLike, dimension: int) -> JammingFit:
    r"""The packing fraction φ_J at which the reduced pressure p = P V/(N T) of a growing system diverges.

    In the free volume of a jammed packing p = c/(1 − φ/φ_J) with c = d, the dimension (Z. W. Salsburg, W. W. Wood,
    J. Chem. Phys. 37, 798 (1962)): 1/p is linear in φ, and 0 at φ_J. Rattlers add hardly any pressure: with N' of N
    particles in the backbone c is about d N'/N if all have one temperature. Growth with a thermostat heats the backbone
    only, so that rattlers become cold, the backbone has all of the energy, and c is d again; fast growth has a higher
    c. A line is fitted to 1/p, with errors in proportion to it, where the pressure is high: p above d and above the
    square root of the largest p, which is the upper half of its decades.

    Parameters
    ----------
    packing_fraction, reduced_pressure
        ``[S]`` φ and p, in the order of time, φ rising. NaN and infinite ones are left out.
    dimension
        d, 2 or 3.

    Raises
    ------
    ArgumentError
        The arrays are not two series of the same length.
    NotApplicableError
        Fewer than three samples are left, or 1/p does not fall there.

    Examples
    --------
    >>> import haff, numpy as np
    >>> phi = np.linspace(0.60, 0.6399, 50)
    >>> fit = haff.analysis.jamming_fraction(phi, 3 / (1 - phi / 0.64), 3)
    >>> round(fit.value, 9), round(fit.coefficient, 6)
    (0.64, 3.0)
    """
    d = arguments.count("dimension", dimension, 2, 3)
    phi, p = (
        arguments.reals("packing_fraction", packing_fraction),
        arguments.reals("reduced_pressure", reduced_pressure),
    )
    if phi.ndim != 1 or phi.shape != p.shape:
        raise ArgumentError(
            f"packing_fraction, of shape {phi.shape}, and reduced_pressure, of shape {p.shape}: must be [S] both"
        )
    known = np.isfinite(phi) & np.isfinite(p) & (p > 0) & (phi > 0)
    phi, p = phi[known], p[known]
    high = p >= max(float(np.sqrt(p.max(initial=0.0))), d)
    phi, p = phi[high], p[high]
    if len(p) < FEWEST or not np.ptp(phi) > 0:
        raise NotApplicableError(f"{len(p)} samples of a high pressure are too few for φ_J: there must be {FEWEST}")
    # 1/p = a − b (φ − φ_last): φ_J − φ_last = a/b may be many digits smaller than φ_J.
    last = float(phi[np.argmax(p)])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            (slope, a), covariance = np.polyfit(phi - last, 1 / p, 1, w=p, cov=True)
    except (Warning, ValueError, np.linalg.LinAlgError):
        a = slope = 0.0
    if not (a > 0 and slope < 0):
        raise NotApplicableError("the pressure does not rise towards a divergence")
    b = -float(slope)
    value, c = last + float(a) / b, 1 / (b * (last + float(a) / b))
    # Derivatives of φ_J and of c by the slope −b and by a.
    by = np.array([[a / b**2, 1 / b], [(1 - a / (b * value)) / (b * b * value), -1 / (b * value) ** 2]])
    error, c_error = np.sqrt(np.einsum("ki,ij,kj->k", by, covariance, by)).tolist()
    return JammingFit(value, error, c, c_error, len(p))
