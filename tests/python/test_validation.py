"""The arithmetic behind `scripts/validate`: z-scores, bounds, and a record that keeps what is not measured again."""

import json
import math

import numpy as np
import pytest
from scipy import stats

from validation import report
from validation.registry import Part, discover
from validation.rows import Row, at_most, chi_square, compare
from validation.runs import SCENES, toml

NAMES = ("pressure", "mean_free_time")


def test_parts_have_names_titles_and_an_order():
    parts = discover()
    assert set(NAMES) <= set(parts)
    assert all(part.title and part.about.endswith(".") for part in parts.values())
    assert [part.order for part in parts.values()] == sorted(part.order for part in parts.values())
    assert list(SCENES.glob("*.toml"))


def test_row_of_independent_runs_has_their_standard_error():
    row = compare("gas", "Z", [1.0, 2.0, 3.0, 2.0], 2.5, "theory", 0.3)
    assert row.measured == 2.0 and row.error == pytest.approx(math.sqrt(2 / 3) / 2) and row.samples == 4
    assert row.z < 0


def test_deviation_of_few_runs_is_students():
    # Three degrees of freedom: t = 4 is as unlikely as z = 2.2 of a normal variable.
    row = compare("gas", "Z", [1.0, 2.0, 3.0, 2.0], 0.0, "theory")
    t = 2.0 / row.error
    assert row.z == pytest.approx(stats.norm.isf(stats.t.sf(t, 3))) and row.z < t
    # Where the theory's uncertainty dominates, its own normal variable remains.
    sure = Row("gas", "Z", 1.0, 0.0, "theory", error=1e-6, uncertainty=0.5, samples=4)
    assert sure.z == pytest.approx(2.0, rel=1e-9)


def test_z_scores_of_good_runs_are_normal():
    random = np.random.default_rng(1)
    z = [compare("", "", random.normal(3, 2, 8), 3, "").z for _ in range(2000)]
    assert stats.kstest(z, "norm").pvalue > 1e-3
    total, count, _ = chi_square([compare("", "", random.normal(3, 2, 8), 3, "") for _ in range(200)])
    assert count == 200 and 120 < total < 300


def test_a_wrong_figure_fails_and_a_bound_is_kept_or_not():
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
    assert "1 of 2 passed" in page and "**fails**" in page and page.index("## One") < page.index("## Two")
    assert (tmp_path / "validation.png").stat().st_size > 1000


def test_settings_are_written_as_toml():
    assert toml({"log": [1.0, 1.5]}) == "{ log = [1.0, 1.5] }" and toml(True) == "true" and toml("fcc") == '"fcc"'
