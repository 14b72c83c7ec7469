"""The ray caster of snapshots against plain references, and its cost."""

import time

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from haff.figures import render, snapshot


def balls(rng, count: int, width: int, height: int, smallest: float, largest: float) -> render._Balls:
    """Random spheres, many of which overlap and some of which leave the picture."""
    low, high = -largest, np.array([width, height, 200]) + largest
    place = rng.uniform(low, high, (count, 3)).astype(np.float32)
    r = rng.uniform(smallest, largest, count).astype(np.float32)
    return render._Balls(*place.T, r, rng.uniform(0, 1, (count, 3)).astype(np.float32))


@pytest.mark.parametrize(
    ("count", "smallest", "largest"), [(400, 2.0, 9.0), (60, 5.0, 20.0), (12, 30.0, 70.0), (300, 0.3, 3.0)]
)
def test_nearest_sphere_of_every_pixel_is_that_of_a_plain_loop(count, smallest, largest):
    width, height = 150, 110
    spheres = balls(np.random.default_rng(count), count, width, height, smallest, largest)
    depth, owner = render._nearest(spheres, width, height)
    column, row = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    expected = np.full((height, width), -np.inf)
    for x, y, z, r in zip(*(values.astype(float) for values in spheres[:4])):
        square = r**2 - (column - x) ** 2 - (row - y) ** 2
        expected = np.maximum(expected, np.where(square > 0, z + np.sqrt(np.maximum(square, 0)), -np.inf))
    seen = np.isfinite(expected)
    # At the rim single precision decides otherwise, by about 1e-4 pixels: of these pixels there are few.
    assert np.mean(seen != (owner >= 0)) < 1e-3
    both = seen & (owner >= 0)
    # Near a rim the height is the root of a small number: single precision of r² = 5000 gives 5e-4 below the root.
    assert np.abs(depth[both] - expected[both]).max() < 0.05
    assert np.median(np.abs(depth[both] - expected[both])) < 1e-4
    own = [values[owner[both]].astype(float) for values in spheres[:4]]
    surface = own[2] + np.sqrt(np.maximum(own[3] ** 2 - (column[both] - own[0]) ** 2 - (row[both] - own[1]) ** 2, 0))
    assert np.abs(surface - expected[both]).max() < 0.05


@pytest.mark.parametrize("reach", [2.0, 5.0, 11.0, 60.0, 300.0])
def test_surroundings_are_those_of_a_blur_at_full_resolution(reach):
    width, height = 420, 300
    rng = np.random.default_rng(3)
    depth, _ = render._nearest(balls(rng, 150, width, height, 12.0, 30.0), width, height)
    filled = np.where(np.isfinite(depth), depth, depth[np.isfinite(depth)].min()).astype(float)
    expected = (gaussian_filter(filled, reach / 2, mode="nearest") - filled) / (2 * reach)
    around = render._Surroundings.of(depth, reach)
    bands = [slice(low, min(low + 64, height)) for low in range(0, height, 64)]
    found = np.concatenate([around.below(np.float32(filled[band]), band) for band in bands])
    # Shades differ by half of it: 0.02 of 1 is not to be seen.
    assert np.abs(found - expected).mean() < 0.02 * max(1.0, np.abs(expected).max())
    assert np.corrcoef(found.ravel(), expected.ravel())[0, 1] > 0.99


@pytest.mark.long
def test_a_sphere_as_large_as_the_picture_is_drawn_in_time():
    """The blur over a sphere as large as the picture took some hundred times as long as that over a small one."""

    def draw(radius: float) -> tuple[render.Picture, float]:
        start = time.process_time()
        picture = render.spheres(
            np.zeros((1, 3)), np.array([radius]), np.ones((1, 3)), render.Camera.looking(), (-0.7, 0.7, -0.7, 0.7),
            snapshot.PIXELS,
        )  # fmt: skip
        return picture, time.process_time() - start

    small = min(draw(0.02)[1] for _ in range(3))
    picture, large = draw(0.5)
    assert large < 20 * small, f"{large:.2f} s of a processor, {small:.2f} s for a small sphere"
    assert picture.rgba[..., 3].mean() == pytest.approx(np.pi * 0.25 / 1.4**2, rel=2e-3)


def test_seam_of_spheres_that_overlap_is_where_their_surfaces_meet():
    """Such as fixed bodies: the one with the farther centre is seen where its surface is nearer."""
    picture = render.spheres(
        np.array([[0.0, 0, 0], [0.4, 0, 0.1]]), np.array([0.5, 0.5]), np.array([[1.0, 0, 0], [0, 0, 1.0]]),
        render.Camera(np.eye(3)), (-1, 1.4, -1.2, 1.2), 24,
    )  # fmt: skip
    row = picture.rgba[12]
    red, blue = row[..., 0] > row[..., 2], row[..., 2] > row[..., 0]
    # Both surfaces have points equally far from both centres, 0.4 x + 0.1 z = 0.085: z² + x² = 1/4 gives x = 0.09. The
    # left rim of the nearer one is at -0.1.
    seam = -1 + 2.4 / 24 * np.flatnonzero(blue)[0]
    assert red.sum() > 5 and 0.05 <= seam <= 0.15
