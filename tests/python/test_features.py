"""benches/features.py: what it leaves out of the engine is there."""

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
    # Its dataclasses look themselves up.
    sys.modules["features"] = module
    spec.loader.exec_module(module)
    yield module
    sys.path.remove(str(ROOT / "benches"))
    del sys.modules["features"]


def copy(features, folder, edits):
    for name in {edit["file"] for edit in edits}:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / name)


def test_every_feature_can_be_left_out_of_the_sources_of_now(features, tmp_path):
    absent = features.features()
    assert set(absent) >= {"events", "gravity", "sizes", "searches", "walls", "tc", "laws", "dissipation", "sums"}
    for name, edits in (absent | {"all": [edit for every in absent.values() for edit in every]}).items():
        copy(features, tmp_path, edits)
        features.leave_out(tmp_path, edits)
        for edit in edits:
            assert (tmp_path / edit["file"]).read_text() != (ROOT / edit["file"]).read_text(), name


def test_what_is_not_there_is_told(features, tmp_path):
    (tmp_path / "a.rs").write_text("one\n")
    with pytest.raises(SystemExit, match=r"a\.rs does not have this once:\ntwo"):
        features.leave_out(tmp_path, [{"file": "a.rs", "old": "two", "new": ""}])
