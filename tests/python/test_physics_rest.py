"""Grains that come to rest on each other, judged from the recorded frames."""

import pytest

from validation.audit import audit_without_events
from validation.stress import supported

pytestmark = pytest.mark.physics


def test_poured_heap_comes_to_rest_supported_by_contacts(command):
    done = command.run("heap", species__grain__count=120, domain__size=[5.3, 5.3, 40.0])
    report = done.report
    assert report["stopped"] == "rest"
    assert report["rests"] - report["wakes"] >= 120
    assert report["rest_energy"] > 0.0
    with done.open() as run:
        broken = [str(finding) for finding in audit_without_events(run) + supported(run) if not finding.passed]
    assert not broken, "; ".join(broken)
