"""The energies of the event log add up to the observables at every sample, as docs/format.md and docs/theory.md say."""

from __future__ import annotations

import numpy as np
import pytest

import haff
from conftest import CONFIGS

BALL = {
    "domain": {"size": [10, 10, 10], "boundary": ["wall"] * 3, "gravity": [0, 0, -10.0]},
    "particle": [{"position": [5, 5, 3], "radius": 0.5, "mass": 1.0}],
    "contact": {"restitution": 0.5},
    "run": {"until": 4.0},
}
"""Its bounces end at t = 2.1213."""
SLIDER = BALL | {
    "particle": [{"position": [2, 5, 0.6], "velocity": [3, 0, 0], "radius": 0.5, "mass": 1.0}],
    "contact": {"restitution": 0.5, "tangential_restitution": 0.0, "friction": 0.1},
}
SCENES = {
    "bouncing ball": BALL,
    "sliding ball": SLIDER,
    **{
        name: CONFIGS / f"{name}.toml"
        for name in (
            "brazil_nut", "heap", "heated_gas", "hot_wall", "rolling", "sheared_gas", "vibrated_layer",
            "textbook/bouncing_ball", "textbook/newtons_cradle", "textbook/pendulums", "textbook/stick_to_rod",
        )
    },
}  # fmt: skip


def sums(folder, scene):
    """Times of samples; ``dissipated_energy`` + ``rest_energy``, ``carnot_energy``; both sums of rows; the events."""
    if not isinstance(scene, dict):
        scene = haff.load_scene(scene)
        scene["run"]["until"] = min(scene["run"].get("until", 3.0), 3.0)
    scene["output"] = {"observables": scene["run"]["until"] / 200, "events": True}
    with haff.run(scene, file=folder / "run.h5", threads=1) as run:
        events = run.file.events.to_pandas(["time", "kind", "energy_loss", "carnot_energy"])
        samples = run.file.samples
        rows = np.searchsorted(events.time, samples["time"], side="right")
        added = {
            name: np.concatenate([[0.0], np.cumsum(events[name].to_numpy(), dtype=np.longdouble)])[rows]
            for name in ("energy_loss", "carnot_energy")
        }
        lost = samples["dissipated_energy"] + samples.get("rest_energy", 0.0)
        return samples["time"], lost, samples["carnot_energy"], added, events


@pytest.mark.parametrize("name", SCENES)
def test_losses_of_the_event_log_add_up_to_the_observables_at_every_sample(name, tmp_path):
    time, lost, carnot, added, events = sums(tmp_path, SCENES[name])
    # Rounding of a sum of so many terms, in units of its size.
    tolerance = 1e-15 * max(len(events), 10) * max(carnot.max(), np.abs(lost).max(), 1e-300)
    np.testing.assert_allclose(added["carnot_energy"].astype(float), carnot, rtol=0, atol=tolerance)
    ahead = lost - added["energy_loss"].astype(float)
    if name not in ("sliding ball", "rolling"):
        np.testing.assert_allclose(ahead, 0.0, rtol=0, atol=tolerance)
        return
    # What friction has taken of a slide that goes on is ahead of its row.
    assert (ahead > -tolerance).all() and (ahead > tolerance).any()
    slides = events[events.kind == "slide"]
    for t, energy in zip(time[ahead > tolerance], ahead[ahead > tolerance]):
        later = slides[slides.time > t]
        assert later.empty or energy <= later.energy_loss.iloc[0] + tolerance, f"{energy} at t = {t}"
    for end in slides.time:
        assert ahead[time >= end][0] <= tolerance, f"after the slide that ends at t = {end}: {ahead[time >= end][0]}"


def test_a_series_of_bounces_is_in_neither_sum_before_its_end():
    """The last bounces of the ball are completed in closed form: one row, at their end."""
    whole = haff.Simulation(BALL, events=True)
    whole.run()
    events = whole.take_events()
    rest = events[events.kind == "rest"].iloc[0]
    before = events[events.time < rest.time]
    live = haff.Simulation(BALL, events=True)
    live.advance(0.5 * (before.time.iloc[-1] + rest.time))
    pending = live.sample()
    assert len(live.take_events()) == len(before)
    assert pending["dissipated_energy"] == pytest.approx(before.energy_loss.sum(), rel=1e-14)
    assert abs(pending["ledger_residual"]) < 1e-14
    live.advance(rest.time + 1e-9)
    ended = live.sample()["dissipated_energy"]
    assert ended == pytest.approx(events.energy_loss.sum(), rel=1e-14) and ended > pending["dissipated_energy"]
