"""A Lorentz gas: one disk among fixed ones has a mean free time that geometry gives exactly."""

import math

import numpy as np
import pytest

import haff
from haff import analysis

RADIUS, MOVING, SPEED = 0.7, 0.01, 1.0


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """One disk among 30 fixed ones on a triangular lattice, with no free line through them."""
    rows, columns, spacing = 6, 5, 1.6
    height = spacing * math.sqrt(3) / 2
    post = {"name": "post", "radius": RADIUS, "mass": math.inf}
    places = [[(c + 0.5 * (r % 2)) * spacing + 0.1, r * height + 0.1] for r in range(rows) for c in range(columns)]
    electron = {"name": "electron", "radius": MOVING, "mass": 1.0, "position": [0.9, 0.56], "velocity": [0.8, 0.6]}
    scene = {
        "dimension": 2,
        "domain": {"size": [columns * spacing, rows * height]},
        "particle": [*({**post, "position": place} for place in places), electron],
        "measure": {"msd": True, "interval": 0.05},
        "run": {"collisions": 200_000},
        "output": {"observables": 50.0, "frames": 1000.0},
    }
    path = tmp_path_factory.mktemp("lorentz") / "lorentz.h5"
    haff.run(scene, file=path)
    with haff.open(path) as file:
        yield file


def test_mean_free_time_is_that_of_geometry(run):
    # π A_free/(perimeter v) (N. Chernov, J. Stat. Phys. 88, 1 (1997)), with disks of the contact distance.
    sigma, area = RADIUS + MOVING, float(np.prod(run.box.size[:2]))
    posts = len(run) - 1
    exact = math.pi * (area - posts * math.pi * sigma**2) / (posts * 2 * math.pi * sigma * SPEED)
    table = run.samples
    # Collisions in equal times are what is averaged: the last interval is shorter.
    rates = analysis.block_average(1 / table["mean_free_time"][1:-1])
    assert abs(rates.z(1 / exact)) < 4, (
        f"rate {rates.mean} ± {rates.error}, exactly {1 / exact}: z = {rates.z(1 / exact)}"
    )
    assert rates.error < 0.01 / exact


def test_one_particle_among_fixed_ones_diffuses(run):
    found = analysis.self_diffusion(run)
    assert found.einstein > 10 * found.einstein_error
