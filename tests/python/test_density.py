"""Density fields and profiles along the height against sums, single particles and closed forms."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import haff
from haff import analysis
from haff.errors import ArgumentError, NotApplicableError


class Placed:
    """A substitute for a frame, with a scene."""

    def __init__(
        self, position, size, boundary, *, velocity=None, mass=None, radius=0.5, gravity=(), displacement=None
    ):
        d, n = len(size), len(position)
        self.position = np.zeros((n, 3))
        self.position[:, :d] = np.asarray(position, float)[:, :d]
        self.radius = np.broadcast_to(np.asarray(radius, float), n)
        self.mass = np.ones(n) if mass is None else np.asarray(mass, float)
        self.peculiar_velocity = np.zeros((n, 3)) if velocity is None else np.asarray(velocity, float)
        names = [{"p": "periodic", "w": "wall", "o": "open"}[b] for b in boundary] + ["open"] * (3 - d)
        self.box = haff.Box([*size, *[1.0] * (3 - d)], names, d, displacement)
        scene = {"domain": {"gravity": list(gravity)}} if len(gravity) else {}
        self.file = SimpleNamespace(path="here", scene=scene, box=self.box, dimension=d)


# --- density fields --------------------------------------------------------------------------------------


@pytest.mark.parametrize("quantity", ["number_density", "packing_fraction"])
@pytest.mark.parametrize(
    ("size", "boundary", "displacement"),
    [
        ((9.0, 7.0), "pp", None),
        ((9.0, 7.0), "pp", (1, 0, 4.1)),
        ((9.0, 7.0, 5.0), "ppp", None),
        ((9.0, 7.0, 5.0), "ppp", (0, 2, -2.2)),
        ((9.0, 7.0, 5.0), "wpo", None),
    ],
)
def test_density_field_sums_to_the_particles(size, boundary, displacement, quantity):
    rng = np.random.default_rng(4)
    d = len(size)
    radius = rng.uniform(0.1, 0.7, 500)
    frames = [
        Placed(rng.random((500, d)) * size, size, boundary, radius=radius, displacement=displacement) for _ in range(3)
    ]
    for cells in (13, [4, 9, 3][:d], 1):
        field = analysis.density_field(frames, cells, quantity)
        volume = np.sum(4 / 3 * np.pi * radius**3 if d == 3 else np.pi * radius**2)
        total = 500 if quantity == "number_density" else volume
        assert field.value.sum() * field.cell_volume == pytest.approx(total, rel=1e-12)
        assert field.value.shape == tuple(len(edge) - 1 for edge in field.edges)
        assert np.all(field.value >= 0) and field.quantity == quantity
        for k in range(d):
            if boundary[k] != "o":
                assert field.edges[k][0] == 0 and field.edges[k][-1] == pytest.approx(size[k])
            else:
                assert field.edges[k][0] < frames[0].position[:, k].min()
    assert analysis.density_field(frames[0], 9, quantity).value.shape == {2: (9, 7), 3: (9, 7, 5)}.get(
        d
    ) or boundary.endswith("o")


def test_number_density_of_random_points_is_that_of_the_gas():
    rng = np.random.default_rng(7)
    frames = [Placed(rng.random((2000, 2)) * 10, (10.0, 10.0), "pp") for _ in range(5)]
    value = analysis.density_field(frames, 8, "number_density").value
    # Counts of 64 cells: chi-square about the mean of 5 · 2000/64.
    square = np.sum((value - 20.0) ** 2) / 20.0 * 5 * 100 / 64
    assert 63 - 4 * np.sqrt(126) < square < 63 + 4 * np.sqrt(126)


def test_particle_inside_a_cell_and_on_a_corner_is_where_it_is():
    inside = analysis.density_field(Placed([[1.5, 2.5, 0.5]], (4.0,) * 3, "ppp", radius=0.49), 4)
    assert inside.value[1, 2, 0] == pytest.approx(4 / 3 * np.pi * 0.49**3, rel=1e-12)
    assert np.count_nonzero(inside.value) == 1
    corner = analysis.density_field(Placed([[0.0, 0.0]], (4.0, 4.0), "pp"), 4).value
    # A quarter each, to a point of 32 or two on the edges.
    for at in ((0, 0), (3, 0), (0, 3), (3, 3)):
        assert corner[at] == pytest.approx(np.pi / 16, abs=2 / 32 * np.pi / 4)
    assert np.count_nonzero(corner) == 4


def test_parts_across_the_gradient_face_of_a_sheared_box_are_displaced():
    # The upper image of the box is displaced by 1.5: what is above y = 4 is at x − 1.5 below.
    frame = Placed([[2.5, 4.0 - 1e-9]], (4.0, 4.0), "pp", displacement=(1, 0, 1.5))
    value = analysis.density_field(frame, 4).value
    assert set(zip(*np.nonzero(value))) == {(2, 3), (0, 0), (1, 0)}
    assert value[2, 3] == pytest.approx(np.pi / 8, abs=2 / 32 * np.pi / 4)
    assert value[:, 0].sum() == pytest.approx(np.pi / 8, abs=2 / 32 * np.pi / 4)


def test_points_of_a_particle_have_its_moments():
    """What stands for a ball or disk has its centre, and its mean square radius, 3/5 or 1/2."""
    from haff.analysis.density import _within

    for d in (2, 3):
        points = _within(d)
        assert np.sum(points**2) / len(points) == pytest.approx(d / (d + 2), abs=0.01)
        assert np.linalg.norm(points.mean(axis=0)) < 0.06 and np.linalg.norm(points, axis=1).max() < 1


@pytest.mark.parametrize(
    ("cells", "quantity", "why"),
    [
        (0, "number_density", "cells = 0: must be a whole number"),
        (2.5, "number_density", "cells = 2.5"),
        ([3, 3, 3], "number_density", r"must be one number, or 2, of x, y"),
        ([3, -1], "number_density", r"cells\[1\] = -1"),
        (100_000, "number_density", "cells; must be"),
        (5, "mass", "quantity = 'mass': must be one of packing_fraction, number_density"),
    ],
)
def test_arguments_of_density_fields_are_checked(cells, quantity, why):
    with pytest.raises(ArgumentError, match=why):
        analysis.density_field(Placed([[1, 1]], (4.0, 4.0), "pp"), cells, quantity)
    with pytest.raises(NotApplicableError, match="no frames"):
        analysis.density_field([], 4)


# --- heights -----------------------------------------------------------------------------------------------

MASS, PULL, TEMPERATURE = 2.0, 0.5, 1.5


def atmosphere(frames, n=800, seed=1, d=3, drift=(0.3, 0.0, 0.0)):
    """Frames of an ideal gas over a floor: heights of exponential distribution with mean T/(m g)."""
    rng = np.random.default_rng(seed)
    for _ in range(frames):
        place = rng.random((n, d)) * 10
        place[:, d - 1] = rng.exponential(TEMPERATURE / (MASS * PULL), n)
        velocity = np.zeros((n, 3))
        velocity[:, :d] = rng.normal(size=(n, d)) * np.sqrt(TEMPERATURE / MASS) + np.array(drift)[:d]
        gravity = [0.0] * (d - 1) + [-PULL]
        yield Placed(place, [10.0] * d, "p" * (d - 1) + "o", velocity=velocity, mass=np.full(n, MASS), gravity=gravity)


@pytest.mark.parametrize(("d", "frames"), [(3, 40), (2, 40), (3, 1)])
def test_profile_of_an_atmosphere_is_barometric(d, frames):
    found = analysis.height_profile(atmosphere(frames, d=d, n=800 if frames > 1 else 20_000), 12, limits=(0.0, 6.0))
    n = 800 if frames > 1 else 20_000
    assert found.axis == "xyz"[d - 1] and found.frames == frames
    scale = TEMPERATURE / (MASS * PULL)
    inside = np.diff(-np.exp(-found.edges / scale))
    volume = 10.0 ** (d - 1) * 0.5
    for name, value, error, expected in (
        ("density", found.density, found.density_error, n * inside / volume),
        ("temperature", found.temperature, found.temperature_error, np.full(12, TEMPERATURE)),
        ("velocity", found.velocity[:, 0], found.velocity_error[:, 0], np.full(12, 0.3)),
        ("velocity", found.velocity[:, d - 1], found.velocity_error[:, d - 1], np.zeros(12)),
    ):
        z = (value - expected) / error
        assert 12 - 2.4 * np.sqrt(24) < np.sum(z**2) < 12 + 5 * np.sqrt(24), (name, z)
        assert abs(np.sum(z)) < 4 * np.sqrt(12), (name, z)
    assert found.count.sum() == pytest.approx(frames * n * (1 - np.exp(-6 / scale)), rel=0.01)


def test_profile_of_four_particles_is_that_by_hand():
    frame = Placed(
        [[1, 1, 0.5], [2, 2, 1.5], [3, 3, 1.9], [4, 4, 4.0]],
        [5.0, 5.0, 4.0],
        "pww",
        velocity=[[1, 0, 0], [0, 0, 1], [0, 0, -2], [7, 7, 7]],
        mass=[1.0, 2.0, 1.0, np.inf],
        gravity=[0, 0, -1],
    )
    found = analysis.height_profile([frame], 4)
    assert list(found.edges) == [0, 1, 2, 3, 4] and list(found.height) == [0.5, 1.5, 2.5, 3.5]
    assert list(found.density) == [1 / 25, 2 / 25, 0, 0] and list(found.count) == [1, 2, 0, 0]
    # The second layer: u = (2·1 − 2)/3 = 0, Σ m v² = 2 + 4, over d (n − 1) = 3.
    assert found.temperature[1] == pytest.approx(2.0) and np.isnan(found.temperature[[0, 2, 3]]).all()
    assert np.allclose(found.velocity[:2], [[1, 0, 0], [0, 0, 0]]) and np.isnan(found.velocity[2:]).all()


def test_every_particle_is_counted_along_open_axes_and_at_the_walls():
    frames = list(atmosphere(3))
    found = analysis.height_profile(frames, 7)
    assert found.count.sum() == 3 * 800 and found.edges[0] == 0
    edge = Placed([[1, 1, 0.0], [2, 2, 4.0]], [5.0, 5.0, 4.0], "ppw", gravity=[0, 0, -1])
    assert list(analysis.height_profile([edge], 4).count) == [1, 0, 0, 1]


def test_axis_of_the_height_is_that_of_gravity_or_of_walls():
    def axis(boundary, gravity=()):
        return analysis.height_axis(Placed([[1, 1, 1]], [4.0] * 3, boundary, gravity=gravity).file)

    assert axis("pwp", [0, -1, 0]) == (1, 1) and axis("ppw", [0, 0, 2.0]) == (2, -1) and axis("wpw") == (0, 1)
    with pytest.raises(NotApplicableError, match="no gravity and no walls"):
        axis("ppp")
    with pytest.raises(NotApplicableError, match="give one of x, y, z"):
        axis("www", [1, 0, -1])
    slope = Placed([[1, 1, 1], [2, 2, 2]], [4.0] * 3, "www", gravity=[1, 0, -1])
    assert analysis.height_profile([slope], 4, axis="z").count.sum() == 2


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        ({"bins": 0}, "bins = 0"),
        ({"bins": 4, "axis": "w"}, "axis = 'w': must be one of x, y, z"),
        ({"bins": 4, "limits": (2, 1)}, "must be two finite numbers"),
        ({"bins": 4, "limits": "high"}, "must be two finite numbers"),
        ({"bins": 4, "limits": (0, np.inf)}, "must be two finite numbers"),
    ],
)
def test_arguments_of_profiles_are_checked(arguments, why):
    with pytest.raises(ArgumentError, match=why):
        analysis.height_profile([Placed([[1, 1, 1]], [4.0] * 3, "ppw")], **arguments)


def test_profiles_that_do_not_apply_are_refused():
    with pytest.raises(NotApplicableError, match="no frames"):
        analysis.height_profile([], 4)
    with pytest.raises(NotApplicableError, match="the x axis is open"):
        analysis.height_profile([Placed([[1, 1, 1]], [4.0] * 3, "opw")], 4)
    with pytest.raises(NotApplicableError, match="finite mass"):
        analysis.height_profile([Placed([[1, 1, 1]], [4.0] * 3, "ppw", mass=[np.inf])], 4)
