"""Packings: gaps against sums over all images, crystals, rattlers, a jammed packing, the fraction of jamming."""

from __future__ import annotations

import doctest
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.spatial import cKDTree

import haff
from haff import analysis
from haff.errors import ArgumentError, NotApplicableError

FCC = np.array([[0, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]])
HEXAGONAL = np.array([[0, 0], [0.5, 0.5]])
WIDE = 1 + 1e-10
"""How much wider the crystals are than with contacts."""


def periodic(*size):
    """A periodic box of two or three dimensions."""
    d = len(size)
    return haff.Box([*size, *[1.0] * (3 - d)], ["periodic"] * d + ["open"] * (3 - d), d)


def crystal(cell, edges, cells):
    """[N, d] points of a crystal of `cells` cells along each axis, and its box."""
    d, edges = cell.shape[1], np.asarray(edges)
    where = np.stack(np.meshgrid(*[np.arange(cells)] * d, indexing="ij"), axis=-1).reshape(-1, 1, d)
    return ((where + cell).reshape(-1, d) + 0.1) * edges, periodic(*(cells * edges))


def fcc(cells):
    return crystal(FCC, [np.sqrt(2) * WIDE] * 3, cells)


def hexagonal(cells):
    return crystal(HEXAGONAL, [WIDE, np.sqrt(3) * WIDE], cells)


def all_gaps(position, radius, box, cutoff):
    """Sorted (i, j, gap) of all images up to three boxes away, and (i, axis, side, gap) at walls."""
    d = box.dimension
    steps = [range(-3, 4) if p else (0,) for p in box.periodic[:d]]
    found, walls = [], []
    for n in itertools.product(*steps):
        apart = position[None, :, :d] + np.array(n) @ box.edges[:d, :d] - position[:, None, :d]
        contact = radius[:, None] + radius[None]
        gap = (np.linalg.norm(apart, axis=2) - contact) / contact
        # Each pair of images once: from the lower row, or for a particle and its own image one of two directions.
        for i, j in zip(*np.nonzero(gap < cutoff)):
            if i < j or (i == j and n > (0,) * d):
                found.append((i, j, gap[i, j]))
    for i, axis, side in itertools.product(range(len(radius)), range(d), (0, 1)):
        if box.boundary[axis] == "wall":
            z = position[i, axis] if side == 0 else box.size[axis] - position[i, axis]
            if (z - radius[i]) / (2 * radius[i]) < cutoff:
                walls.append((i, axis, side, (z - radius[i]) / (2 * radius[i])))
    return sorted(found), sorted(walls)


# --- gaps ----------------------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    d=st.sampled_from([2, 3]),
    boundary=st.sampled_from(["ppp", "pwo", "wwp", "www", "sheared"]),
    ratio=st.sampled_from([1.0, 1.4, 3.0, 20.0]),
    n=st.integers(1, 60),
    cutoff=st.sampled_from([0.01, 0.3, 1.5]),
)
def test_gaps_are_those_of_all_images(seed, d, boundary, ratio, n, cutoff):
    rng = np.random.default_rng(seed)
    size = np.array([*rng.uniform(3.0, 8.0, d), *[1.0] * (3 - d)])
    sides = "ppp" if boundary == "sheared" else boundary
    names = [{"p": "periodic", "w": "wall", "o": "open"}[b] for b in sides[:d]] + ["open"] * (3 - d)
    slid = (1, 0, rng.uniform(-0.5, 0.5) * size[0]) if boundary == "sheared" else None
    box = haff.Box(size, names, d, slid)
    radius = 0.6 * ratio ** -rng.random(n)
    position = rng.random((n, 3)) * size * (np.arange(3) < d)
    found = analysis.close_gaps(position, radius, box, cutoff)
    pairs, walls = all_gaps(position, radius, box, cutoff)
    mine = sorted((*pair, gap) for pair, gap in zip(found.pairs.tolist(), found.gap.tolist()))
    assert [one[:2] for one in mine] == [(i, j) for i, j, _ in pairs]
    np.testing.assert_allclose([one[2] for one in mine], [one[2] for one in pairs], rtol=0, atol=1e-12)
    at = sorted(zip(found.wall_rows.tolist(), *found.wall_sides.T.tolist(), found.wall_gap.tolist()))
    assert [one[:3] for one in at] == [one[:3] for one in walls]
    # The vector leads to an image of the second particle.
    apart = position[found.pairs[:, 1]] - position[found.pairs[:, 0]]
    images = (found.vector - apart)[:, :d] @ np.linalg.inv(box.edges[:d, :d])
    np.testing.assert_allclose(images, np.round(images), atol=1e-9)
    assert np.all(images[:, ~box.periodic[:d]] == 0)


def test_positions_outside_of_the_box_and_of_two_columns_are_those_of_their_images():
    position, box = hexagonal(6)
    far = position + np.array([3.0, -2.0]) * box.size[:2]
    near, moved = (analysis.close_gaps(points, 0.5, box, 1e-8) for points in (position, far))
    np.testing.assert_array_equal(near.pairs, moved.pairs)
    np.testing.assert_allclose(near.vector, moved.vector, atol=1e-12)
    assert near.vector.shape == (6 * 72 // 2, 3) and not near.vector[:, 2].any()


def test_gaps_far_below_the_size_of_the_box_are_known():
    rng = np.random.default_rng(5)
    box, gap = periodic(30.0, 30.0, 30.0), 10.0 ** -rng.uniform(3, 11, 200)
    first = rng.random((200, 3)) * 30
    direction = rng.normal(size=(200, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    second = (first + direction * (0.02 * (1 + gap))[:, None]) % 30
    found = analysis.close_gaps(np.concatenate([first, second]), 0.01, box, 1e-2)
    assert found.pairs.tolist() == [[k, k + 200] for k in range(200)]
    # Coordinates of 30 are rounded to 4·10⁻¹⁵, which is 2·10⁻¹³ of a contact distance.
    np.testing.assert_allclose(found.gap, gap, rtol=0, atol=2e-12)


def test_gaps_reach_some_widths_of_the_box_and_not_for_ever():
    one = [[1.0, 1.0, 1.0]]
    # Centers at all points of a lattice within 7.5 edges, without the sphere itself; each pair of images once.
    shifts = np.array(list(itertools.product(range(-8, 9), repeat=3)))
    expected = np.count_nonzero(np.linalg.norm(shifts, axis=1) < 7.5) // 2
    assert len(analysis.close_gaps(one, 0.5, periodic(1.0, 1.0, 1.0), 6.5).pairs) == expected
    with pytest.raises(NotApplicableError, match=r"the box is too small for pairs up to 2.002e\+06: it is 3 wide"):
        analysis.close_gaps(one, 1e6, periodic(4.0, 3.0, 5.0), 1e-3)


# --- contacts ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cells", [1, 2, 3, 4])
def test_spheres_of_an_fcc_crystal_have_twelve_contacts(cells):
    position, box = fcc(cells)
    found = analysis.contact_network(position, 0.5, box, tolerance=1e-9)
    assert found.contact_number == 12 and not found.rattlers.any()
    assert found.backbone == 4 * cells**3 and found.backbone_contacts == 24 * cells**3
    # Found by the pressure, too: 1e-10 is far below 0.5 · (1e10)^(-5/8) = 3e-7.
    assert analysis.contact_network(position, 0.5, box, reduced_pressure=1e10).contact_number == 12
    assert analysis.contact_network(position, 0.5, box, tolerance=1e-11).contact_number != 12
    d, n = 3, found.backbone
    assert found.isostatic_contacts == 3 * n - 2
    assert found.isostatic_number == pytest.approx(2 * d * (1 - 1 / n) + 2 / n)


@pytest.mark.parametrize("cells", [2, 3, 5])
def test_disks_of_a_hexagonal_crystal_have_six_contacts(cells):
    position, box = hexagonal(cells)
    found = analysis.contact_network(position, 0.5, box, tolerance=1e-9)
    assert found.contact_number == 6 and not found.rattlers.any()
    assert found.isostatic_contacts == 2 * 2 * cells**2 - 1


def test_particle_in_a_cage_is_a_rattler():
    position, box = fcc(3)
    # Smaller, it touches none of its twelve neighbors, which keep eleven contacts.
    radius = np.where(np.arange(len(position)) == 40, 0.48, 0.5)
    found = analysis.contact_network(position, radius, box, tolerance=1e-9)
    assert np.flatnonzero(found.rattlers).tolist() == [40]
    assert found.contact_number == pytest.approx(12 - 12 / 107)
    # Moved into contact with one neighbor it stays one, and its contact is not counted.
    neighbor = analysis.close_gaps(position, 0.5, box, 1e-9)
    row = int(np.flatnonzero((neighbor.pairs == 40).any(axis=1))[0])
    towards = neighbor.vector[row] * (1 if neighbor.pairs[row, 0] == 40 else -1)
    position[40] += 0.02 * towards
    touching = analysis.contact_network(position, radius, box, tolerance=1e-9)
    assert len(touching.contacts.pairs) == len(found.contacts.pairs) + 1
    assert touching.contact_number == found.contact_number
    assert np.array_equal(touching.rattlers, found.rattlers)


def test_rattlers_are_taken_out_in_turn():
    # A triangle of particles with 3 contacts each (d = 2), and a tail that hangs on it.
    tetrahedron = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
    tail = [(3, 4), (4, 5), (3, 5), (5, 6), (4, 6)]
    assert analysis.rattlers(8, tetrahedron + tail, 2).tolist() == [False] * 4 + [True] * 4
    # Contacts with walls hold as others do.
    assert analysis.rattlers(8, tetrahedron + tail, 2, walls=[6]).tolist() == [False] * 7 + [True]
    assert analysis.rattlers(4, tetrahedron, 3).all()
    assert analysis.rattlers(3, [], 2).all()
    nothing = analysis.contact_network([[1.0, 1.0]], 0.5, periodic(9.0, 9.0), tolerance=1e-3)
    assert nothing.backbone == 0 and np.isnan(nothing.contact_number) and np.isnan(nothing.isostatic_number)


def test_rattlers_are_those_of_the_definition():
    rng = np.random.default_rng(6)
    for _ in range(200):
        n, d = int(rng.integers(1, 40)), int(rng.integers(2, 4))
        pairs, walls = rng.integers(0, n, (rng.integers(0, 3 * n), 2)), rng.integers(0, n, rng.integers(0, n))
        loose = np.zeros(n, bool)
        for _ in range(n):
            held = pairs[~loose[pairs].any(axis=1)]
            loose |= np.bincount(held.ravel(), minlength=n) + np.bincount(walls, minlength=n) <= d
        np.testing.assert_array_equal(analysis.rattlers(n, pairs, d, walls=walls), loose)
    # A strip of triangles falls apart from its ends, one particle after the other.
    strip = [(k, k + step) for k in range(20_000) for step in (1, 2) if k + step < 20_000]
    assert analysis.rattlers(20_000, strip, 2).all()


def test_contacts_with_walls_hold_disks():
    # Four disks in a square box: two neighbors and two walls each.
    position = np.array([[0.5, 0.5], [1.5, 0.5], [0.5, 1.5], [1.5, 1.5]]) * WIDE
    box = haff.Box([2 * WIDE, 2 * WIDE, 1.0], ["wall", "wall", "open"], 2)
    found = analysis.contact_network(position, 0.5, box, tolerance=1e-9)
    assert len(found.contacts.pairs) == 4 and len(found.contacts.wall_rows) == 8
    assert found.contact_number == 4 and not found.rattlers.any()
    assert found.backbone_contacts == 12 and found.isostatic_contacts == 9
    assert sorted(zip(found.contacts.wall_rows.tolist(), *found.contacts.wall_sides.T.tolist()))[:2] == [
        (0, 0, 0),
        (0, 1, 0),
    ]


# --- a jammed packing ----------------------------------------------------------------------------------


def overlaps(place, radius):
    """Pairs, vectors, distances and overlaps of particles in a periodic box of edge 1."""
    place = np.mod(place, 1.0) % 1.0
    pairs = cKDTree(place, boxsize=1.0).query_pairs(2 * radius.max(), output_type="ndarray")
    apart = place[pairs[:, 1]] - place[pairs[:, 0]]
    apart -= np.round(apart)
    distance, contact = np.linalg.norm(apart, axis=1), radius[pairs].sum(axis=1)
    deep = distance < contact
    return pairs[deep], apart[deep], distance[deep], contact[deep], 1 - distance[deep] / contact[deep]


def relaxed(place, radius):
    """The nearest state of least energy of harmonic springs at all contacts."""

    def energy(flat, unit):
        pairs, apart, distance, contact, overlap = overlaps(flat.reshape(place.shape), radius)
        force = (overlap / contact / distance)[:, None] * apart
        gradient = np.zeros_like(place)
        np.add.at(gradient, pairs[:, 0], force)
        np.add.at(gradient, pairs[:, 1], -force)
        return 0.5 * np.sum(overlap**2) / unit, gradient.ravel() / unit

    for _ in range(6):
        unit = max(energy(place.ravel(), 1.0)[0], 1e-30)
        options = {"maxiter": 20_000, "maxfun": 40_000, "ftol": 1e-15, "gtol": 1e-9, "maxcor": 30}
        done = minimize(energy, place.ravel(), (unit,), jac=True, method="L-BFGS-B", options=options)
        place = done.x.reshape(place.shape)
        if done.nit < 20:
            break
    return place


@pytest.fixture(scope="module")
def jammed():
    """40 disks of two sizes, jammed: places in a box of edge 1, radii, and the pairs that press on each other."""
    rng = np.random.default_rng(1)
    place = rng.random((40, 2))
    radius = np.where(np.arange(40) < 20, 1.0, 1.4)
    radius *= np.sqrt(0.92 / np.sum(np.pi * radius**2))
    place = relaxed(place, radius)
    for _ in range(60):
        pairs, *_, overlap = overlaps(place, radius)
        if overlap.mean() < 1e-8:
            break
        radius = radius * (1 - (0.8 if overlap.mean() > 1e-3 else 0.5) * overlap.mean())
        place = relaxed(place, radius)
    return np.mod(place, 1.0), radius, np.sort(pairs, axis=1)


@pytest.mark.long
def test_jammed_disks_are_isostatic(jammed):
    place, radius, pairs = jammed
    found = analysis.contact_network(place, radius, periodic(1.0, 1.0), tolerance=1e-7)
    held = found.contacts.pairs[found.backbone_pairs]
    assert found.backbone_contacts == found.isostatic_contacts == len(pairs)
    assert {*map(tuple, held.tolist())} == {*map(tuple, pairs.tolist())}
    assert found.contact_number == pytest.approx(found.isostatic_number)
    assert found.rattlers.sum() < 8


@pytest.mark.long
@pytest.mark.parametrize(("shrunk", "missed"), [(1e-4, 0.12), (1e-6, 0.03)])
def test_contacts_of_moving_disks_are_those_of_the_jammed_packing(jammed, shrunk, missed):
    place, radius, pairs = jammed
    unit = 0.5 / radius.min()
    radius = radius * unit * (1 - shrunk)
    velocity = np.random.default_rng(3).normal(size=(40, 2))
    velocity -= velocity.mean(axis=0)
    bodies = [
        {"position": x.tolist(), "velocity": v.tolist(), "radius": r, "mass": 1.0}
        for x, v, r in zip(place * unit, velocity, radius.tolist())
    ]
    domain = {"size": [unit] * 2, "boundary": ["periodic"] * 2}
    live = haff.Simulation({"dimension": 2, "domain": domain, "particle": bodies, "run": {"until": 1.0}}, threads=1)
    live.advance(np.inf, collisions=20_000)
    live.sample()
    live.advance(np.inf, collisions=40_000)
    sample = live.sample()
    p = sample["pressure"] * unit**2 / (40 * sample["temperature"])
    # Free volume: p = d N'/N / (1 − φ/φ_J), and 1 − φ/φ_J is twice the relative change of the radii.
    held = analysis.contact_network(place, jammed[1], periodic(1.0, 1.0), tolerance=1e-7).backbone
    assert p == pytest.approx(held / 40 / shrunk, rel=0.2)
    found = analysis.contact_network(live.positions, radius, live.box, reduced_pressure=p)
    mine, known = ({*map(tuple, some.tolist())} for some in (found.contacts.pairs, pairs))
    assert len(known - mine) <= missed * len(known) and len(mine - known) <= missed * len(known)


# --- bond order ----------------------------------------------------------------------------------------


def test_bond_order_of_crystals_and_of_random_points():
    position, box = fcc(3)
    found = analysis.bond_order(position, 0.5, box)
    np.testing.assert_allclose(found.local, 0.57452, atol=1e-4)
    np.testing.assert_allclose(found.third, -0.013161, atol=1e-4)
    assert found.whole == pytest.approx(0.57452, abs=1e-4) and found.direction is None
    disks, plane = hexagonal(5)
    flat = analysis.bond_order(disks, 0.5, plane)
    np.testing.assert_allclose(flat.local, 1.0, atol=1e-4)
    np.testing.assert_allclose(flat.direction, 0.0, atol=1e-4)
    assert flat.whole == pytest.approx(1.0, abs=1e-4) and flat.third is None
    points = np.random.default_rng(2).random((3000, 3)) * 20
    random = analysis.bond_order(points, 0.1, periodic(20.0, 20.0, 20.0))
    # Random directions of 12 bonds: q₆² has the mean 1/12.
    assert np.sqrt(np.mean(random.local**2)) == pytest.approx(1 / np.sqrt(12), rel=0.05) and random.whole < 0.03
    with pytest.raises(NotApplicableError, match="12 particles are too few for 12 neighbors each"):
        analysis.bond_order(points[:12], 0.1, periodic(20.0, 20.0, 20.0))


def test_bond_order_between_walls_is_that_of_the_middle():
    position, _ = fcc(4)
    edge = 4 * np.sqrt(2)
    box = haff.Box([edge] * 3, ["wall"] * 3, 3)
    found = analysis.bond_order(position, 0.5, box)
    inside = np.all(np.abs(position - edge / 2) < edge / 2 - 1.2, axis=1)
    assert 20 < inside.sum() < 200
    np.testing.assert_allclose(found.local[inside], 0.57452, atol=1e-4)


# --- the fraction of jamming ---------------------------------------------------------------------------


@pytest.mark.parametrize(("d", "jam", "share"), [(3, 0.64, 0.97), (2, 0.842, 1.0)])
@pytest.mark.parametrize("digits", [4, 10])
def test_jamming_fraction_of_a_known_equation_of_state(d, jam, share, digits):
    rng = np.random.default_rng(7)
    phi = jam * (1 - 10.0 ** -np.linspace(0.3, digits, 200))
    # The next order of 1 − φ/φ_J changes p by a number of order 1.
    p = (d * share / (1 - phi / jam) + 2.0) * (1 + 0.01 * rng.normal(size=len(phi)))
    fit = analysis.jamming_fraction(phi, p, d)
    assert abs(fit.value - jam) < 4 * fit.error + 1e-16
    assert fit.error < 0.01 * jam * 10.0**-digits
    assert fit.coefficient == pytest.approx(d * share, abs=4 * fit.coefficient_error + 0.03)
    assert 50 < fit.samples <= 130


def test_errors_of_the_jamming_fraction_are_those_of_many_fits():
    rng = np.random.default_rng(8)
    phi = 0.64 * (1 - 10.0 ** -np.linspace(1, 6, 60))
    fits = [
        analysis.jamming_fraction(phi, 3 / (1 - phi / 0.64) * (1 + 0.02 * rng.normal(size=60)), 3) for _ in range(400)
    ]
    for value, error, known in (("value", "error", 0.64), ("coefficient", "coefficient_error", 3.0)):
        z = [(getattr(fit, value) - known) / getattr(fit, error) for fit in fits]
        assert abs(np.mean(z)) < 0.25 and np.std(z) == pytest.approx(1.0, abs=0.15)


def test_jamming_fraction_needs_a_divergence():
    with pytest.raises(NotApplicableError, match="2 samples of a high pressure are too few"):
        analysis.jamming_fraction([0.1, 0.2, 0.3, 0.4], [1.0, 2.0, 100.0, 200.0], 3)
    with pytest.raises(NotApplicableError, match="does not rise towards a divergence"):
        analysis.jamming_fraction([0.1, 0.2, 0.3, 0.4], [40.0, 30.0, 20.0, 10.0], 3)
    with pytest.raises(
        ArgumentError, match=r"packing_fraction, of shape \(2,\), and reduced_pressure, of shape \(3,\)"
    ):
        analysis.jamming_fraction([0.1, 0.2], [1.0, 2.0, 3.0], 3)


# --- arguments -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"positions": [[0.0, 0.0]]}, r"positions = .* of shape \(1, 2\): must be \[N, 3\]"),
        ({"positions": [[0.0, 0.0, np.nan]]}, "positions = .*: must be finite"),
        ({"radii": [0.5, 0.5]}, r"radii = \[0\.5, 0\.5\], of shape \(2,\): must be one number, or \[1\]"),
        ({"radii": -1.0}, "radii = -1.0: must be positive"),
        ({"box": [1, 1, 1]}, r"box = \[1, 1, 1\]: must be a haff\.Box"),
        ({"tolerance": 0.0}, "tolerance = 0.0: must be a finite number above 0"),
        ({"reduced_pressure": 10.0}, "one must be given, not both"),
        ({"tolerance": None}, "one must be given, not both"),
        ({"tolerance": None, "reduced_pressure": np.inf}, "reduced_pressure = inf: must be a finite number above 0"),
    ],
)
def test_wrong_arguments_are_named(arguments, message):
    good = {"positions": [[0.0, 0.0, 0.0]], "radii": 0.5, "box": periodic(3.0, 3.0, 3.0), "tolerance": 0.1}
    with pytest.raises(ArgumentError, match=message):
        analysis.contact_network(**(good | arguments))


def test_rows_of_rattlers_are_checked():
    with pytest.raises(ArgumentError, match=r"pairs = \[\[0, 3\]\]: must be rows, whole numbers from 0 to 2"):
        analysis.rattlers(3, [[0, 3]], 2)
    with pytest.raises(ArgumentError, match=r"walls = \[\[1\]\], of shape \(1, 1\): must be \[W\]"):
        analysis.rattlers(3, [[0, 1]], 2, walls=[[1]])


@pytest.mark.parametrize("name", ["gaps", "packings"])
def test_examples_of_the_functions(name):
    assert doctest.testmod(getattr(analysis, name)).failed == 0
