"""Short forms of the stress scenes, checked from their output; `scripts/validate stress` runs them in full."""

import dataclasses

import numpy as np
import pytest

import haff
from conftest import executable
from validation import audit, long
from validation.stress import ENDS, OWN, SCENES, SHORT, judge


@pytest.mark.long
@pytest.mark.physics
@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.stem)
def test_stress_scene_passes_its_audit(scene, tmp_path):
    findings, _ = judge(executable(), scene, tmp_path / "run.h5", short=True)
    broken = [str(finding) for finding in findings if not finding.passed]
    assert not broken, f"{scene.stem}: " + "; ".join(broken)


def test_every_stress_scene_states_its_conditions():
    for scene in SCENES:
        assert "# Must hold: " in scene.read_text(), scene
    assert {scene.stem for scene in SCENES} >= {*OWN, *SHORT, *ENDS}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A run whose log the next test corrupts."""
    scene = next(scene for scene in SCENES if scene.stem == "touching")
    path = tmp_path_factory.mktemp("audit") / "run.h5"
    judge(executable(), scene, path)
    return path


@pytest.mark.physics
@pytest.mark.parametrize(
    ("column", "change", "finding"),
    [
        ("time", lambda x: x + 1e-9 * (np.arange(len(x)) == 40), "place of an event"),
        ("time", lambda x: x[::-1], "time goes back"),
        ("impulse", lambda x: x * (1 + 1e-13), "law: impulse"),
        ("energy_loss", lambda x: x + 1e-9, "energy, relative"),
        ("approach_speed", lambda x: x * (1 + 1e-13), "approach speed, off"),
        ("normal", lambda x: x * (1 + 1e-13), "law: normal's length"),
        ("position", lambda x: x + 1e-12, "place of an event"),
        ("carnot_energy", lambda x: np.where(np.arange(len(x)) == 3, np.nan, x), "law: Carnot"),
    ],
)
def test_audit_detects_a_corrupted_log(recorded, column, change, finding):
    with haff.open(recorded) as file:
        columns = {name: file.events[name] for name in file.events.columns}
        columns[column] = change(columns[column])
        findings = audit.audit(_With(file, columns, file.events.kinds))
    broken = [finding.name for finding in findings if not finding.passed]
    assert any(name.startswith(finding) for name in broken), broken


class _With:
    """A file with another event log."""

    def __init__(self, file, columns, kinds):
        self._file, self.events = file, _Columns(columns, kinds)

    def __getattr__(self, name):
        return getattr(self._file, name)

    def __len__(self):
        return len(self._file)


@dataclasses.dataclass
class _Columns:
    columns: dict
    kinds: dict

    def __getitem__(self, name):
        return self.columns[name]


def test_audit_finds_overlaps_across_periodic_faces_and_at_walls(recorded):
    with haff.open(recorded) as file:
        scene = audit.Scene(file)
    x = np.full((len(scene.mass), 3), 7.5) + 2.0 * np.arange(len(scene.mass))[:, None]
    scene.walls, scene.size, scene.periodic = [], np.full(3, 1000.0), np.array([True, True, True])
    assert audit.overlap(scene, x, 0.0) == 0
    x[0], x[1] = (0.2, 500.0, 900.0), (999.7, 500.0, 900.0)
    assert audit.overlap(scene, x, 0.0) == pytest.approx(0.5)
    scene.periodic = np.zeros(3, bool)
    assert audit.overlap(scene, x, 0.0) == 0
    scene.walls = [audit.Wall("moving", np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([0.1, 0.0, 0.0]))]
    assert audit.overlap(scene, x, 0.0) == pytest.approx(0.6)
    assert audit.overlap(scene, x, 1.0) == pytest.approx(0.8)


@pytest.mark.long
@pytest.mark.physics
@pytest.mark.parametrize(
    "gas",
    [
        long.Gas((4000,), (1.0,), 10_000_000),
        long.Gas((3,), (1.0,), 1_000_000),
        long.Gas((4, 4), (1.0, 3.0), 1_000_000),
    ],
    ids=lambda gas: gas.system,
)
def test_energy_and_momentum_errors_are_a_random_walk_in_a_long_run(gas):
    broken = [row for row in long.rows(gas, long.follow(gas, checks=10)) if not row.passed]
    assert not broken, broken
