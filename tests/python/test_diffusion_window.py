"""The window of lags from which a coefficient of diffusion follows, for curves of known memory."""

from types import SimpleNamespace

import numpy as np
import pytest

import haff
from haff.analysis import transport


def curve(diffusion, memory, lag):
    """⟨|Δr|²⟩ in three dimensions with the velocity autocorrelation (D d/τ) exp(−t/τ), and errors of a thousandth."""
    value = 6 * diffusion * (lag - memory * (1 - np.exp(-lag / memory)))
    return {"lag": lag, "value": value, "error": 1e-3 * value + 1e-12}


def found(diffusion, memory, longest, end=None):
    msd = curve(diffusion, memory, np.linspace(0.0, longest, 4001))
    window = transport._relaxed(SimpleNamespace(path="run.h5"), msd, (20.0, min(80.0, longest)), end)
    return window, transport._transport(msd, None, window, 1 / 3, 1 / 3).einstein


@pytest.mark.parametrize("memory", [1.0, 3.9, 20.0, 190.0, 2000.0])
def test_the_window_begins_where_velocities_are_forgotten(memory):
    window, diffusion = found(0.2, memory, 20_000.0)
    assert window[0] >= 5 * memory * 0.98
    assert diffusion == pytest.approx(0.2, rel=0.01)
    if memory < 4:
        assert window == (20.0, 80.0)


def test_lags_that_are_too_short_are_refused():
    with pytest.raises(haff.NotApplicableError, match=r"lags up to 400 are too short .*\(measure\.msd"):
        found(0.2, 190.0, 400.0)
    with pytest.raises(haff.NotApplicableError, match="lags up to 300 are too short"):
        found(0.2, 190.0, 20_000.0, end=300.0)
