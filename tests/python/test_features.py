"""benches/features.py: its edits apply to the present sources of the engine."""

import importlib.util
import shutil
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def features():
    sys.path.insert(0, str(ROOT / "benches"))
    spec = importlib.util.spec_from_file_location("features", ROOT / "benches/features.py")
    module = importlib.util.module_from_spec(spec)
    # Its dataclasses need the module in sys.modules.
    sys.modules["features"] = module
    spec.loader.exec_module(module)
    yield module
    sys.path.remove(str(ROOT / "benches"))
    del sys.modules["features"]


def copy(features, folder, edits):
    for name in {edit["file"] for edit in edits}:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / name)


def test_every_feature_can_be_left_out_of_the_present_sources(features, tmp_path):
    known = features.features()
    named = {
        "all of these",
        "events",
        "gravity",
        "sizes",
        "searches",
        "walls",
        "tc",
        "laws",
        "dissipation",
        "sums",
        "rest",
    }
    assert set(known) == named
    for name, edits in known.items():
        assert edits and all(edit["new"] != edit["old"] for edit in edits), name
        copy(features, tmp_path, edits)
        features.leave_out(tmp_path, edits)


def test_edit_without_match_is_an_error(features, tmp_path):
    (tmp_path / "a.rs").write_text("one\n")
    with pytest.raises(SystemExit, match=r"a\.rs does not have this once:\ntwo"):
        features.leave_out(tmp_path, [{"file": "a.rs", "old": "two", "new": ""}])
