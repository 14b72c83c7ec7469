"""The arithmetic of `scripts/validate`: z-scores, bounds, and records that keep earlier parts."""

import json
import math

import numpy as np
import pytest
from scipy import stats

from validation import boltzmann, report
from validation.parts import atmosphere, cooling, equilibrium, mixtures, transport
from validation.registry import Part, discover
from validation.rows import Row, at_most, chi_square, compare
from validation.runs import ROOT, SCENES, Context, executable, toml

NAMES = {
    "pressure",
    "mean_free_time",
    "diffusion",
    "viscosity",
    "haff_rate",
    "velocity_distribution",
    "viscoelastic",
    "freezing",
    "equipartition",
    "barometric",
}


@pytest.fixture(scope="module")
def context():
    context = Context(executable(), 2, quick=True)
    yield context
    context.close()


def test_parts_have_names_titles_and_an_order():
    parts = discover()
    assert set(parts) >= NAMES
    assert all(part.title and part.about.endswith(".") for part in parts.values())
    assert [part.order for part in parts.values()] == sorted(part.order for part in parts.values())
    assert list(SCENES.glob("*.toml"))


def test_row_of_independent_runs_has_their_standard_error():
    row = compare("gas", "Z", [1.0, 2.0, 3.0, 2.0], 2.5, "theory", 0.3)
    assert row.measured == 2.0 and row.error == pytest.approx(math.sqrt(2 / 3) / 2) and row.samples == 4
    assert row.z < 0


def test_deviation_of_few_runs_has_a_student_distribution():
    # Three degrees of freedom: t = 4 is as unlikely as z = 2.2 of a normal variable.
    row = compare("gas", "Z", [1.0, 2.0, 3.0, 2.0], 0.0, "theory")
    t = 2.0 / row.error
    assert row.z == pytest.approx(stats.norm.isf(stats.t.sf(t, 3))) and row.z < t
    # If the theory's uncertainty dominates, the deviation is normal.
    sure = Row("gas", "Z", 1.0, 0.0, "theory", error=1e-6, uncertainty=0.5, samples=4)
    assert sure.z == pytest.approx(2.0, rel=1e-9)


def test_z_scores_of_unbiased_runs_are_normal():
    random = np.random.default_rng(1)
    z = [compare("", "", random.normal(3, 2, 8), 3, "").z for _ in range(2000)]
    assert stats.kstest(z, "norm").pvalue > 1e-3
    total, count, _ = chi_square([compare("", "", random.normal(3, 2, 8), 3, "") for _ in range(200)])
    assert count == 200 and 120 < total < 300


def test_biased_mean_fails_and_bounds_pass_or_fail():
    assert not compare("gas", "Z", np.random.default_rng(1).normal(1, 0.01, 8), 1.2, "theory").passed
    assert at_most("gas", "overlap", 1e-13, 1e-12, "rounding").passed
    assert not at_most("gas", "overlap", 1e-11, 1e-12, "rounding").passed
    assert not at_most("gas", "overlap", math.nan, 1e-12, "rounding").passed
    assert not Row("gas", "Z", 1.0, 1.1, "exact").passed and Row("gas", "Z", 1.0, 1.0, "exact").passed


def test_numbers_are_printed_to_two_digits_of_their_error():
    assert report.digits(1.234567, 0.0123) == "1.235"
    assert report.digits(12345.6, 32) == "12346"
    assert report.digits(1.23456e-7, 1.2e-9) == "1.235e-07"
    assert report.digits(0.5, 0.0) == "0.5"


def test_record_keeps_parts_that_are_not_measured_again(tmp_path):
    def part(name: str, order: int) -> Part:
        return Part(name, name.title(), lambda context: [], order)

    parts = {"one": part("one", 1), "two": part("two", 2)}
    stored = {"collisions": 1e6, "seconds": 1.0, "jobs": 2, "machine": "m", "version": "0", "date": "2026-01-31"}
    row = compare("gas", "Z", [1.0, 1.1, 0.9, 1.0], 1.0, "theory", 0.01)
    record = report.load(tmp_path / "validation.json")
    record["parts"]["two"] = {"rows": [row.to_json()], **stored}
    report.write(record, tmp_path, parts)
    record = report.load(tmp_path / "validation.json")
    record["parts"]["one"] = {"rows": [at_most("gas", "overlap", 2.0, 1.0, "rounding").to_json()], **stored}
    report.write(record, tmp_path, parts)
    kept = json.loads((tmp_path / "validation.json").read_text())["parts"]
    assert list(kept) == ["one", "two"] and Row.from_json(kept["two"]["rows"][0]) == row
    page = (tmp_path / "validation.md").read_text()
    assert "1 of 2 passed" in page and page.index("**One**") < page.index("**Two**")
    assert "**fails** in 1" in (tmp_path / "validation-bounds.md").read_text()
    assert (tmp_path / "validation.png").stat().st_size > 1000


def test_page_has_every_score_the_worst_case_of_a_bound_and_at_most_150_lines():
    part = Part("stress", "Stress", lambda context: [], 1)
    scored = compare("gas", "Z", [1.0, 1.1, 0.9, 1.0], 1.0, "theory", 0.01)
    cases = [at_most(f"scene {k}", "overlap", k * 1e-14, 1e-12, "rounding") for k in range(50)]
    stored = {"collisions": 1e6, "seconds": 1.0, "jobs": 2, "machine": "m", "version": "0", "date": "2026-01-31"}
    record = {"parts": {"stress": {"rows": [row.to_json() for row in [scored, *cases]], **stored}}}
    assert "| stress | gas | Z |" in report.markdown(record, {"stress": part})
    assert [line for line in report.bounds_page(record).splitlines() if "overlap" in line] == [
        "| stress | overlap | 50 | 4.9e-13 | ≤ 1e-12 | scene 49 | rounding | kept |"
    ]
    for name in ("validation.md", "validation-rough-shear.md", "validation-bounds.md"):
        assert (ROOT / "benches/record" / name).read_text().count("\n") <= 150


def test_settings_are_written_as_toml():
    assert toml({"log": [1.0, 1.5]}) == "{ log = [1.0, 1.5] }" and toml(True) == "true" and toml("fcc") == '"fcc"'


def test_seeds_give_independent_runs_of_the_given_length(context):
    settings = [equilibrium.settings(0.2, 3, 100, 20, 5, seed, melting=5) for seed in (1, 2)]
    first, second = context.each("fluid", settings, last_state)
    assert first[0] == second[0] == 100 and first[1] != second[1]
    # 25 collisions per particle by Enskog's rate; ±10 % are six standard errors of 1250 counts and the short melting.
    assert first[2] == pytest.approx(1250, rel=0.15) and context.collisions == first[2] + second[2]
    assert context.worst_overlap <= 1e-12 and context.worst_residual <= 1e-12


def last_state(file, outcome):
    return outcome["particles"], outcome["state_hash"], outcome["events"]


def test_samples_of_a_cooling_gas_are_a_collision_apart_at_most(context):
    for e in (0.5, 0.99):
        settings = cooling.schedule(e, 12) | {"species.0.count": 1000}
        counts = context.each("cooling", [settings], collisions_at_samples)[0]
        steps = np.diff(counts)
        assert counts[-1] >= 12 and np.all(steps < 1.6) and len(steps) < 40, (e, steps)


def collisions_at_samples(file, outcome):
    return 2 * file.observables["collisions"].to_numpy() / len(file)


def test_stress_of_the_event_log_is_that_of_the_frames_and_of_the_virial(context):
    # Replaying all impulses must end with the velocities of the last frame, which detects a wrong sign or partner.
    rate = transport.enskog_rate(0.2)
    settings = {
        "domain.packing_fraction": 0.2,
        "species.0.count": 100,
        "run.until": 20 / rate,
        "output.frames": 20 / rate,
        "output.events": {"columns": ["i", "j", "impulse", "normal"]},
    }
    moments, expected = context.each("fluid", [settings], replayed)[0]
    assert moments == pytest.approx(expected, rel=1e-9, abs=1e-9)


def replayed(file, outcome):
    """∫ of the stress over the whole run by `transport.stress`, and event by event."""
    events = file.events.to_pandas(["time", "i", "j", "impulse", "normal"])
    v, total = file.frames[0].velocity.copy(), np.zeros(5)
    edges = np.arange(events["time"].iloc[0], events["time"].iloc[-1], 0.01)
    last = edges[0]
    for row in events.itertuples():
        if row.time >= edges[-1]:
            break
        total += transport._shear(v).sum(axis=0) * (row.time - last)
        normal = np.array([row.normal_x, row.normal_y, row.normal_z])
        v[row.i] -= row.impulse * normal
        v[row.j] += row.impulse * normal
        total += row.impulse * transport._shear(normal[None])[0]
        last = row.time
    total += transport._shear(v).sum(axis=0) * (edges[-1] - last)
    return transport.stress(file, 0.01).sum(axis=0), total


def test_hydrostatic_profile_of_a_thin_gas_is_exponential():
    height, shares = atmosphere.hydrostatic(2.0, 1e-6)
    edges = np.exp(-np.array(atmosphere.EDGES))
    assert height == pytest.approx(2.0 / atmosphere.GRAVITY, rel=1e-4)
    assert shares == pytest.approx(-np.diff(edges), rel=1e-4)


def test_pressure_of_a_hydrostatic_profile_equals_the_weight_above():
    # The pressure at the floor is the weight of the column: swollen by B₂ = 4η, heights grow by 1 + 2η₀ to first order.
    column = 0.1
    height, shares = atmosphere.hydrostatic(1.0, column)
    eta = math.pi / 6 * column * atmosphere.GRAVITY
    assert height * atmosphere.GRAVITY == pytest.approx(1 + 2 * eta, rel=2 * eta**1.5)
    assert np.all(shares > 0)


def test_species_temperature_correction_for_zero_total_momentum():
    mixture = mixtures.Mixture((3, 1), 10.0, 1.0, 0.01, 1.0)
    # T_i = T(1 − m_i/M) of each, M = 13.
    assert mixture.ratio(1 - 1 / 13, 1 - 10 / 13) == pytest.approx(1)


def test_monte_carlo_pairs_are_independent():
    rng = np.random.default_rng(1)
    lengths = []
    for _ in range(200):
        pairs = boltzmann.draw_pairs(rng, 1000)
        assert len(np.unique(pairs)) == pairs.size
        lengths.append(len(pairs))
    assert 10 < np.mean(lengths) < 18 and max(lengths) == 18


@pytest.mark.parametrize("e", [1.0, 0.6])
def test_monte_carlo_collisions_conserve_momentum_and_lose_energy(e):
    rng = np.random.default_rng(2)
    v = rng.standard_normal((2000, 3))
    before, momentum = v.copy(), v.sum(axis=0)
    done = sum(boltzmann.collide(rng, v, e, 20.0) for _ in range(200))
    assert 100 < done < np.count_nonzero(np.any(v != before, axis=1))
    assert np.allclose(v.sum(axis=0), momentum, atol=1e-11)
    lost = 1 - np.sum(v**2) / np.sum(before**2)
    # Each collision dissipates (1 − e²) g_n²/4, ⟨g_n²⟩ = 4T over colliding pairs, of 3T/2 a particle.
    expected = done * (1 - e**2) / (1.5 * len(v))
    assert lost == pytest.approx(expected, rel=4 / done**0.5, abs=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("e", [1.0, 0.5])
def test_tabulated_velocity_distributions_are_those_of_the_boltzmann_equation(e):
    expected, error = boltzmann.A2.get(e, (0.0, 0.0))
    found = [boltzmann.sonine_a2(e, particles=1000, collisions=20, seed=seed)[0] for seed in range(8)]
    row = compare("gas", "a₂", found, expected, "table", error)
    assert abs(row.z) < 4 and row.error < 0.01
