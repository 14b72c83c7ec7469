"""Conditions of homogeneous gases: those that the law of their cooling itself tests."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import NotApplicableError
from .conditions import (
    COOLING_SHAPE,
    ENSKOG,
    FLUID,
    IMPACTS_OF_A_GAS,
    INELASTIC,
    NOT_PLACED,
    NOT_PLASTIC,
    ONE_KIND,
    ONE_MASS,
    SHORT_CONTACTS,
    Condition,
    restitution,
)  # fmt: skip
from .cooling import cooling_law, fitted

if TYPE_CHECKING:
    from ..files.recording import Recording


def _clustered(file: Recording) -> str | None:
    """Whether a gas that cools freely is off Haff's law before its end."""
    if restitution(file) == 1 or "observables" not in file:
        return None
    try:
        fit = fitted(file, cooling_law(file))
    except NotApplicableError:
        return None
    return None if fit is None or fit.complete else f"T is off Haff's law from t = {fit.until:.3g} on"


HOMOGENEOUS = Condition("a gas that stays homogeneous", _clustered)

COOLING_A2 = (*ENSKOG, *ONE_KIND, INELASTIC, COOLING_SHAPE, HOMOGENEOUS)
"""Velocities of the homogeneous cooling state. A factor common to all velocities does not change their distribution."""
LOSSES = (*IMPACTS_OF_A_GAS, INELASTIC, ONE_MASS, NOT_PLACED, SHORT_CONTACTS, HOMOGENEOUS)
"""Exponential distribution of the losses by normal impulses."""
CONTACT_VALUE = (*IMPACTS_OF_A_GAS, NOT_PLASTIC, FLUID, NOT_PLACED, SHORT_CONTACTS, HOMOGENEOUS)
"""g(σ⁺) of a homogeneous fluid; seen in frames (1 + e)/2e times that of approaching pairs."""
