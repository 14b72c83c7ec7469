"""Pairs, pair distributions, structure factors and clusters against sums over all images, closed forms and freud."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import haff
from haff import analysis
from haff.analysis import scattering
from haff.analysis.pairs import close_pairs
from haff.errors import ArgumentError, NotApplicableError


class Placed:
    """A substitute for a frame."""

    def __init__(self, position, size, *, boundary="ppp", displacement=None, radius=0.5, species=None):
        size = np.asarray(size, float)
        d, n = len(size), len(position)
        self.position = np.zeros((n, 3))
        self.position[:, :d] = np.asarray(position, float)[:, :d]
        self.radius, self.mass = np.broadcast_to(np.asarray(radius, float), n), np.ones(n)
        self.species = np.zeros(n, np.int64) if species is None else np.asarray(species)
        names = [{"p": "periodic", "w": "wall", "o": "open"}[b] for b in boundary[:d]] + ["open"] * (3 - d)
        self.box = haff.Box([*size, *[1.0] * (3 - d)], names, d, displacement)
        self.file = SimpleNamespace(path="here")


def nearest(frame):
    """[N, N] distances, the least of all images up to two boxes away; infinite on the diagonal."""
    box, d = frame.box, frame.box.dimension
    apart = frame.position[None] - frame.position[:, None]
    steps = [(-2, -1, 0, 1, 2) if p else (0,) for p in box.periodic[:d]] + [(0,)] * (3 - d)
    found = np.min([np.linalg.norm(apart + n @ box.edges, axis=2) for n in itertools.product(*steps)], axis=0)
    np.fill_diagonal(found, np.inf)
    return found


def lattice(cells, spacing, d=3):
    """[cells^d, 3] points of a simple cubic or square lattice, not on the faces."""
    points = np.stack(np.meshgrid(*[np.arange(cells)] * d, indexing="ij"), axis=-1).reshape(-1, d)
    return np.pad((points + 0.25) * spacing, ((0, 0), (0, 3 - d)))


# --- pairs ---------------------------------------------------------------------------------------------


@pytest.mark.long
@settings(max_examples=150, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    d=st.sampled_from([2, 3]),
    boundary=st.sampled_from(["ppp", "pwo", "wwp", "ooo", "sheared"]),
    share=st.floats(0.05, 0.49),
    n=st.integers(2, 400),
)
def test_pairs_are_those_of_all_images(seed, d, boundary, share, n):
    rng = np.random.default_rng(seed)
    size, displacement = rng.uniform(3, 9, d), None
    if boundary == "sheared":
        flow, gradient = rng.permutation(d)[:2]
        displacement = int(gradient), int(flow), rng.uniform(-0.5, 0.5) * size[flow]
    frame = Placed(rng.random((n, d)) * size, size, boundary="ppp" if displacement else boundary)
    frame.box = haff.Box(frame.box.size, frame.box.boundary, d, displacement)
    reach = share * frame.box.widths[:d].min()
    centers = rng.random(n) < 0.7
    expected = nearest(frame)
    found = np.full((n, n), np.inf)
    for pairs in close_pairs(frame.box, frame.position, reach, centers):
        assert np.all(found[pairs.first, pairs.second] == np.inf), "a pair is found twice"
        found[pairs.first, pairs.second] = pairs.distance
    sure = np.abs(expected - reach) > 1e-9
    wanted = np.where((expected <= reach) & centers[:, None], expected, np.inf)
    assert np.allclose(found[sure], wanted[sure], rtol=0, atol=1e-11)


# --- pair distributions --------------------------------------------------------------------------------


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("most", [None, 3e5])
def test_partial_distributions_of_random_points_are_one(d, most):
    rng = np.random.default_rng(10 * d)
    n, size = 3000, np.array([20.0, 24.0, 22.0][:d])
    species = (np.arange(n) % 3 == 0).astype(int) * 2
    frames = [Placed(rng.random((n, d)) * size, size, species=species) for _ in range(6)]
    found = analysis.pair_distributions(frames, 5.0, 20, most_pairs=most)
    assert found.species == (0, 2) and found.partial.shape == (2, 2, 20) and found.frames == 6
    if most is None:
        assert found.centers == 6 * n
    else:
        assert found.centers < 6 * n and abs(found.pairs / most - 1) < 0.05
    assert np.array_equal(found.partial[0, 1], found.partial[1, 0])
    assert np.allclose(found.r, np.arange(0.125, 5, 0.25))
    for g, error in ((found.total, found.total_error), *((found.partial[a, b], found.partial_error[a, b])
                     for a, b in ((0, 0), (0, 1), (1, 1)))):  # fmt: skip
        z = ((g - 1) / error)[4:]
        # Sixteen bins: the sum of squares is within five standard deviations of its mean, errors are not too large.
        assert 16 - 2.8 * np.sqrt(32) < np.sum(z**2) < 16 + 5 * np.sqrt(32), z
        assert abs(np.sum(z)) < 5 * 4


def test_partial_distributions_of_a_crystal_of_two_species_count_its_neighbors():
    points = lattice(8, 1.25)
    species = np.round((points / 1.25 - 0.25).sum(axis=1)).astype(int) % 2
    frame = Placed(points, [10.0] * 3, species=species)
    found = analysis.pair_distributions([frame], 2.4, 24)
    edges = np.linspace(0, 2.4, 25)
    shell, n, same = 4 / 3 * np.pi * np.diff(edges**3), 256 / 1000, 255 / 1000
    unlike, alike = found.partial[0, 1] * n * shell, found.partial[0, 0] * same * shell
    # Rock salt: six unlike neighbors at a, twelve alike at √2 a, eight unlike at √3 a.
    expected = {12: (6, 0), 17: (0, 12), 21: (8, 0)}
    for k in range(24):
        assert (unlike[k], alike[k]) == pytest.approx(expected.get(k, (0, 0)), abs=1e-9), k
    assert found.pairs == 512 * 26


def test_distribution_of_all_particles_is_that_of_freud():
    rng = np.random.default_rng(3)
    for displacement in (None, (1, 0, 2.7), (0, 2, -4.0)):
        size = np.array([12.0, 11.0, 13.0])
        points = rng.random((1500, 3)) * size
        frame = Placed(points, size, displacement=displacement)
        found = analysis.pair_distributions([frame], 4.0, 16)
        r, g = analysis.radial_distribution([frame], 4.0, 16)
        assert np.allclose(found.r, r)
        # freud divides by N instead of N - 1; its distances are in single precision.
        assert np.allclose(found.total * 1499 / 1500, g, rtol=2e-3, atol=1e-3)


def test_distributions_that_do_not_apply_are_refused():
    points = np.random.default_rng(0).random((50, 3)) * 6
    frame = Placed(points, [6.0] * 3)
    for r_max, bins, why in ((0, 5, "r_max = 0"), (-1.0, 5, "r_max"), (np.nan, 5, "r_max"), ("2", 5, "r_max = '2'"),
                             (2.0, 0, "bins = 0"), (2.0, 2.5, "bins"), (2.0, True, "bins")):  # fmt: skip
        with pytest.raises(ArgumentError, match=why):
            analysis.pair_distributions([frame], r_max, bins)
    with pytest.raises(ArgumentError, match="most_pairs"):
        analysis.pair_distributions([frame], 2.0, 5, most_pairs=0)
    with pytest.raises(NotApplicableError, match="too small"):
        analysis.pair_distributions([frame], 3.0, 5)
    with pytest.raises(NotApplicableError, match="periodic"):
        analysis.pair_distributions([Placed(points, [6.0] * 3, boundary="ppw")], 2.0, 5)
    with pytest.raises(NotApplicableError, match="no frames"):
        analysis.pair_distributions([], 2.0, 5)
    # Half an edge of displacement makes the box narrower.
    with pytest.raises(NotApplicableError, match="too small"):
        analysis.pair_distributions([Placed(points, [6.0] * 3, displacement=(1, 0, 3.0))], 2.9, 5)


def test_arguments_of_what_freud_computes_are_checked():
    frame = Placed([[1, 1, 1], [2, 2, 2]], [6.0] * 3)
    for what, why in (
        (lambda: analysis.radial_distribution([frame], -1.0, 5), "r_max = -1"),
        (lambda: analysis.radial_distribution([frame], 2.0, 0), "bins = 0"),
        (lambda: analysis.radial_distribution([frame], 2.0, 5, 2.0), "r_min = 2"),
        (lambda: analysis.structure_factor([frame], np.inf, 5), "k_max = inf"),
        (lambda: analysis.structure_factor([frame], 5.0, "5"), "bins = '5'"),
        (lambda: analysis.cluster_sizes(frame, 0.0), "reach = 0"),
    ):
        with pytest.raises(ArgumentError, match=why):
            what()


# --- structure factors -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("d", "sheared", "most"), [(2, False, 500), (2, True, 40), (3, False, 60), (3, True, 500)])
def test_structure_factor_of_random_points_is_one(d, sheared, most):
    rng = np.random.default_rng(5 + d)
    size = np.array([15.0, 12.0, 13.0][:d])
    frames = [
        Placed(rng.random((400, d)) * size, size, displacement=(1, 0, rng.uniform(-6, 6)) if sheared else None)
        for _ in range(8)
    ]
    found = analysis.static_structure(frames, 6.0, 12, most_waves=most)
    assert found.waves.max() <= most and np.all(found.waves > 0) and np.all(np.diff(found.k) > 0)
    known = found.waves * 8 >= 60
    z = ((found.value - 1) / found.error)[known]
    assert len(z) > 8
    assert len(z) - 2.8 * np.sqrt(2 * len(z)) < np.sum(z**2) < len(z) + 5 * np.sqrt(2 * len(z)), z
    # |Σ exp(ik·r)|²/N is distributed exponentially: its spread is its mean.
    assert np.allclose(found.error * np.sqrt(8 * found.waves), 1, atol=0.35, rtol=0) or not known.all()


@pytest.mark.parametrize(("d", "displacement"), [(2, None), (3, None), (2, (0, 1, 2.0)), (3, (2, 0, -3.0))])
def test_structure_factor_of_a_crystal_is_that_of_its_peaks(d, displacement):
    """A square or cubic lattice of spacing 1: S = N at wave vectors 2π(h, k, l), 0 at all others of the box.

    A displacement of the box by whole spacings is the same crystal.
    """
    frame = Placed(lattice(6, 1.0, d), [6.0] * d, displacement=displacement)
    found = analysis.static_structure([frame], 14.0, 28, most_waves=100_000)
    peaks = np.array([h for h in itertools.product(range(-3, 4), repeat=d) if any(h)])
    length = 2 * np.pi * np.linalg.norm(peaks, axis=1)
    edges = np.linspace(0, 14, 29)
    counts = np.histogram(length[length <= 14], edges)[0] / 2
    at = np.searchsorted(edges, found.k) - 1
    # Phases are in single precision.
    assert np.allclose(found.value * found.waves, 6**d * counts[at], rtol=1e-5, atol=1e-6 * 6**d)
    assert counts[at].sum() == counts.sum() > 0
    if d == 2:
        k, value = analysis.structure_factor([frame], 14.0, 28)
        first = np.argmin(np.abs(k - 2 * np.pi))
        assert np.argmax(value) == first and np.all(value[:first] < 1e-20)


@pytest.mark.parametrize(("d", "displacement"), [(2, None), (3, None), (2, (1, 0, 2.2)), (3, (0, 1, -3.1))])
def test_structure_factor_is_the_sum_over_all_waves_of_the_box(d, displacement):
    rng = np.random.default_rng(2)
    size = np.array([8.0, 7.0, 6.0][:d])
    frame = Placed(rng.random((70, d)) * size, size, displacement=displacement)
    found = analysis.static_structure([frame], 4.0, 6, most_waves=10_000)
    index = np.array([m for m in itertools.product(range(-9, 10), repeat=d) if any(m)])
    waves = 2 * np.pi * index @ np.linalg.inv(frame.box.edges[:d, :d]).T
    values = np.abs(np.exp(1j * frame.position[:, :d] @ waves.T).sum(axis=0)) ** 2 / 70
    length = np.linalg.norm(waves, axis=1)
    shells = [k for k in range(6) if np.any((length > k * 4 / 6) & (length <= (k + 1) * 4 / 6))]
    assert len(shells) == len(found.k)
    for row, k in enumerate(shells):
        inside = (length > k * 4 / 6) & (length <= (k + 1) * 4 / 6)
        assert found.waves[row] == inside.sum() / 2
        assert found.value[row] == pytest.approx(values[inside].mean(), rel=1e-5)
        assert found.k[row] == pytest.approx(length[inside].mean(), rel=1e-12)


def test_structure_factor_of_disks_agrees_with_that_of_all_waves():
    rng = np.random.default_rng(8)
    frame = Placed(rng.random((200, 2)) * 12, [12.0, 12.0])
    k, value = analysis.structure_factor([frame], 5.0, 10)
    found = analysis.static_structure([frame], 5.0, 500, most_waves=1000)
    width = k[1] - k[0]
    for at, one in zip(k, value):
        inside = np.abs(found.k - at) < width / 2
        assert np.average(found.value[inside], weights=found.waves[inside]) == pytest.approx(one, rel=0.02, abs=1e-3)


def test_waves_that_are_drawn_have_equal_probabilities(monkeypatch):
    monkeypatch.setattr(scattering, "MOST_LISTED", 0)
    box = haff.Box([9.0, 8.0, 7.0], ["periodic"] * 3, 3, (1, 0, 3.0))
    every = scattering.lattice(box, 4.0)
    length = np.linalg.norm(scattering.vectors(box, every), axis=1)
    shell = {tuple(n) for n in every[length > 3.2]}
    counts: dict[tuple, int] = dict.fromkeys(shell, 0)
    edges = np.array([3.2, 4.0])
    for seed in range(600):
        drawn = scattering._drawn(box, *edges, 20, np.random.default_rng(seed))
        assert len({tuple(n) for n in drawn}) == 20
        for n in drawn:
            # Of n and −n one.
            counts[tuple(n) if tuple(n) in shell else tuple(-n)] += 1
    expected = 600 * 20 / len(shell)
    square = sum((count - expected) ** 2 for count in counts.values()) / expected
    assert square < len(shell) + 5 * np.sqrt(2 * len(shell))


def test_structure_factors_that_do_not_apply_are_refused():
    frame = Placed(np.random.default_rng(0).random((50, 3)) * 6, [6.0] * 3)
    for given_, why in (((0, 5), "k_max"), ((3.0, -1), "bins"), ((3.0, 2, 0), "most_waves")):
        with pytest.raises(ArgumentError, match=why):
            analysis.static_structure([frame], *given_[:2], **({"most_waves": given_[2]} if len(given_) > 2 else {}))
    with pytest.raises(NotApplicableError, match="longest wave"):
        analysis.static_structure([frame], 0.9, 5)
    with pytest.raises(NotApplicableError, match="periodic"):
        analysis.static_structure([Placed(frame.position, [6.0] * 3, boundary="pop")], 3.0, 5)
    with pytest.raises(NotApplicableError, match="no frames"):
        analysis.static_structure([], 3.0, 5)


# --- clusters --------------------------------------------------------------------------------------------


def test_clusters_are_linked_across_periodic_faces_and_not_across_walls():
    # A chain through the face x = 0, a pair through the corner, and one alone.
    chain = [[9.4, 5, 5], [0.3, 5, 5], [1.3, 5, 5]]
    pair, alone = [[0.2, 0.2, 9.8], [9.8, 9.8, 9.2]], [[5, 5, 2]]
    points = [alone[0], chain[0], pair[0], chain[2], pair[1], chain[1]]
    found = analysis.clusters(Placed(points, [10.0] * 3), 1.05)
    assert list(found.sizes) == [3, 2, 1] and found.largest == 3
    assert list(found.label) == [2, 0, 1, 0, 1, 0]
    walls = analysis.clusters(Placed(points, [10.0] * 3, boundary="www"), 1.05)
    assert list(walls.sizes) == [2, 1, 1, 1, 1] and walls.label[3] == walls.label[5] == 0


def test_distance_of_links_is_in_units_of_the_contact_distance():
    frame = Placed([[1, 1, 1], [2.6, 1, 1], [7, 7, 7], [7.6, 7, 7]], [10.0] * 3, radius=[0.5, 1.0, 0.2, 0.2])
    # Gaps: 1.6/1.5 = 1.067 and 0.6/0.4 = 1.5 contact distances.
    assert list(analysis.clusters(frame, 1.06).sizes) == [1, 1, 1, 1]
    assert list(analysis.clusters(frame, 1.07).label) == [0, 0, 1, 2]
    assert list(analysis.clusters(frame, 1.51).sizes) == [2, 2]


@pytest.mark.long
@pytest.mark.parametrize(("flow", "gradient"), [(0, 1), (1, 0), (2, 0), (1, 2)])
def test_clusters_of_a_sheared_box_are_those_of_all_images(flow, gradient):
    rng = np.random.default_rng(20 + 3 * flow + gradient)
    crossing = 0
    for _ in range(10):
        size = np.array([9.0, 8.0, 10.0])
        displacement = gradient, flow, rng.uniform(-0.5, 0.5) * size[flow]
        radius = rng.uniform(0.3, 0.6, 120)
        frame = Placed(rng.random((120, 3)) * size, size, displacement=displacement, radius=radius)
        linked = nearest(frame) <= 1.2 * (radius[:, None] + radius)
        groups = np.arange(120)
        for _ in range(120):
            groups = np.min(np.where(linked | np.eye(120, dtype=bool), groups, 120), axis=1)
        found = analysis.clusters(frame, 1.2)
        assert list(found.sizes) == sorted(np.unique(groups, return_counts=True)[1])[::-1]
        assert len(set(zip(found.label, groups))) == len(found.sizes) == len(set(groups))
        straight = analysis.clusters(Placed(frame.position, size, radius=radius), 1.2)
        crossing += list(straight.sizes) != list(found.sizes)
    assert crossing > 5, "without the displacement clusters would be others"


def test_clusters_of_equal_spheres_are_those_of_freud():
    rng = np.random.default_rng(1)
    for d in (2, 3):
        frame = Placed(rng.random((600, d)) * 14, [14.0] * d)
        assert list(analysis.clusters(frame, 0.8).sizes) == list(analysis.cluster_sizes(frame, 0.8))


@pytest.mark.parametrize("distance", [0, -1.0, np.inf, np.nan, None, "1.1", True])
def test_distance_of_links_that_is_no_distance_is_refused(distance):
    with pytest.raises(ArgumentError, match="distance = "):
        analysis.clusters(Placed([[1, 1, 1], [3, 3, 3]], [10.0] * 3), distance)


def test_box_that_is_too_small_for_links_is_refused():
    with pytest.raises(NotApplicableError, match="too small"):
        analysis.clusters(Placed([[1, 1, 1], [2, 2, 2]], [3.0] * 3), 1.6)
