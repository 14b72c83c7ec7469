"""The installed (release) build gives the state hashes that are pinned for all builds."""

import json
import os
import subprocess
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parent.parent
PINS = json.loads((TESTS / "pinned_hashes.json").read_text())["scenes"]


@pytest.mark.parametrize("pin", PINS, ids=lambda pin: pin["name"])
@pytest.mark.parametrize("threads", [1, 2])
def test_state_hash_is_pinned(pin, threads, tmp_path):
    command = [os.environ.get("HAFF", "haff"), "run", str(TESTS / "gas.toml"), "--json", "-q"]
    command += ["--threads", str(threads), "-o", str(tmp_path / "gas.h5")]
    for override in pin["set"]:
        command += ["--set", override]
    report = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    assert report["state_hash"] == pin["state_hash"]
