"""A row of the table: a measured value, and its expectation or bound."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy import stats

Z_LIMIT = 4.0


@dataclass(frozen=True)
class Row:
    """A measured mean against its expectation, or a worst case against its bound."""

    system: str
    """What was simulated, in words and numbers."""
    quantity: str
    measured: float
    expected: float
    """The expected value; of a bound, what ``measured`` must not exceed."""
    source: str
    """Where the expectation is from."""
    error: float = 0.0
    """Standard error of ``measured``, from independent runs."""
    uncertainty: float = 0.0
    """Standard uncertainty of ``expected``: of the theory, of finite size, of a published fit."""
    samples: int = 0
    """How many independent runs ``error`` is from; 0: it is exact."""
    bound: bool = False
    """Whether ``expected`` is an upper bound: such a row has no z-score."""

    @property
    def z(self) -> float:
        """Deviation in standard errors, as that of a normal variable which is as unlikely.

        An error from few runs is uncertain itself: the deviation has a t distribution, its degrees of freedom by
        Welch and Satterthwaite.
        """
        total = math.hypot(self.error, self.uncertainty)
        if total == 0:
            return 0.0 if self.measured == self.expected else math.copysign(math.inf, self.measured - self.expected)
        t = (self.measured - self.expected) / total
        if self.samples < 2 or self.error == 0:
            return t
        freedom = (self.samples - 1) * (total / self.error) ** 4
        return float(math.copysign(stats.norm.isf(stats.t.sf(abs(t), freedom)), t))

    @property
    def passed(self) -> bool:
        """Whether \\|z\\| is below :data:`Z_LIMIT`, or the value is within the bound."""
        if self.bound:
            return bool(self.measured <= self.expected)
        return bool(abs(self.z) < Z_LIMIT)

    def to_json(self) -> dict[str, Any]:
        """All fields, with z and whether it passed."""
        return asdict(self) | {"z": None if self.bound else self.z, "passed": self.passed}

    @classmethod
    def from_json(cls, stored: dict[str, Any]) -> Row:
        """The inverse of :meth:`to_json`."""
        return cls(**{key: value for key, value in stored.items() if key not in ("z", "passed")})


def compare(
    system: str, quantity: str, values: Sequence[float], expected: float, source: str, uncertainty: float = 0.0
) -> Row:
    """A row from one value of each independent run: their mean, with its standard error."""
    found = np.asarray(values, float)
    error = float(np.std(found, ddof=1) / np.sqrt(len(found)))
    return Row(system, quantity, float(np.mean(found)), float(expected), source, error, float(uncertainty), len(found))


def at_most(system: str, quantity: str, measured: float, limit: float, source: str) -> Row:
    """A row for a worst case that must not exceed a bound."""
    return Row(system, quantity, float(measured), float(limit), source, bound=True)


def chi_square(rows: Sequence[Row]) -> tuple[float, int, float]:
    """Σ z² over the rows that have a z-score, their number, and how likely a larger sum is.

    The stated uncertainties of theory are not random errors, so the sum may be too small.
    """
    scores = np.array([row.z for row in rows if not row.bound])
    total = float(np.sum(scores**2))
    return total, len(scores), float(stats.chi2.sf(total, len(scores))) if len(scores) else 1.0
