"""Grains that come to rest on each other, judged from the recorded frames."""

import numpy as np
import pytest
from scipy.optimize import nnls
from scipy.spatial import cKDTree

pytestmark = pytest.mark.physics


def standing(position, radius, size, gap):
    """Of every grain how much of its weight the cone of its contact normals leaves: 0 if it stands."""
    pairs = cKDTree(position).query_pairs(2 * radius.max() + gap, output_type="ndarray")
    r = position[pairs[:, 1]] - position[pairs[:, 0]]
    distance = np.linalg.norm(r, axis=1)
    touching = distance <= radius[pairs].sum(axis=1) + gap
    normals = [[] for _ in position]
    for (i, j), n in zip(pairs[touching], r[touching] / distance[touching, None], strict=True):
        normals[i].append(-n)
        normals[j].append(n)
    for axis in range(3):
        for side, unit in ((position[:, axis], 1.0), (size[axis] - position[:, axis], -1.0)):
            for i in np.nonzero(side <= radius + gap)[0]:
                normals[i].append(unit * np.eye(3)[axis])
    up = np.array([0.0, 0.0, 1.0])
    return np.array([nnls(np.transpose(n), up)[1] if n else 1.0 for n in normals]), pairs, distance


def test_a_poured_heap_comes_to_rest_and_stands(command):
    done = command.run("heap")
    report = done.report
    assert report["stopped"] == "rest"
    assert report["rests"] - report["wakes"] >= 300
    assert abs(report["ledger_residual"]) <= 1e-12
    assert report["max_overlap"] <= 1e-12
    assert report["kinetic_energy"] == 0.0
    with done.open() as run:
        size = np.array([7.3, 7.3, 40.0])
        radius = run.radius
        position = run.frames.array("position")[-1]
        assert np.all(run.frames.array("velocity")[-1] == 0.0)
        # v²/4g with the scene's v.
        gap = 0.04**2 / 4
        left, pairs, distance = standing(position, radius, size, gap)
        assert left.max() < 2e-3, f"{np.sum(left > 2e-3)} grains do not stand"
        assert np.all(distance >= radius[pairs].sum(axis=1) * (1 - 1e-12))
        assert np.all((position >= radius[:, None] * (1 - 1e-12)) & (position <= size - radius[:, None] * (1 - 1e-12)))
        table = run.observables
        balance = (
            table["kinetic_energy"] + table["potential_energy"] + table["dissipated_energy"] + table["rest_energy"]
        )
        assert np.ptp(balance) <= 1e-12 * np.abs(balance).max()
