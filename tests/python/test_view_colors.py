"""Colors in the pages of `haff view`: their range, and the local packing fraction."""

import json

import numpy as np
import pytest

import haff
import synthetic
from haff.command.main import _COLORINGS, main
from haff.viewer.coloring import COLORINGS
from pages import in_node, page_of, seek

# --- the range -----------------------------------------------------------------------------------


def test_options_set_the_first_coloring_and_its_range(files, tmp_path):
    page = page_of(files["cooling"], tmp_path)
    assert page.header["coloring"] == {"name": None, "range": None}
    page = page_of(files["cooling"], tmp_path, "--color-range", "0.5", "2")
    assert page.header["coloring"] == {"name": "speed", "range": [0.5, 2.0]}
    page = page_of(files["cooling"], tmp_path, "--color", "recent-loss", "--color-range", "1e-4", "1e-1")
    assert page.header["coloring"] == {"name": "recent", "range": [1e-4, 0.1]}
    made = haff.view(files["cooling"], tmp_path / "b.html", color="density", color_range=(0, 0.6))
    assert '"coloring":{"name":"density","range":[0.0,0.6]}' in made.read_text()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--color", "heat"], "color 'heat': must be one of speed, species, loss, recent-loss, density"),
        (["--color-range", "2", "1"], "color range 2 1: must be two finite numbers, the first below the second"),
        (["--color-range", "1", "1"], "the first below the second"),
        (["--color-range", "nan", "1"], "must be two finite numbers"),
        (["--color-range", "0", "inf"], "must be two finite numbers"),
        (["--color", "species", "--color-range", "0", "1"], "goes with a quantity, not with species"),
        (["--color", "recent-loss", "--color-range", "0", "1"], "is logarithmic, so both must be positive"),
    ],
)
def test_colors_and_ranges_that_are_none_are_refused(files, tmp_path, capsys, options, message):
    assert main(["view", str(files["cooling"]), "-o", str(tmp_path / "a.html"), *options]) == 2
    err = capsys.readouterr().err
    assert message in err and err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_losses_as_colors_need_an_event_log(files, tmp_path, capsys):
    arguments = ["view", str(files["quiet"]), "-o", str(tmp_path / "a.html"), "--color", "loss"]
    assert main(arguments) == 2
    assert "color loss: the file has no event log with losses of energy" in capsys.readouterr().err


def test_the_command_knows_all_colorings():
    assert tuple(COLORINGS) == _COLORINGS


@pytest.mark.parametrize("given", [("a", 1), (1,), 3, (1, 2, 3)])
def test_color_range_of_python_must_be_two_numbers(files, tmp_path, given):
    with pytest.raises(haff.ArgumentError, match="must be two numbers, min and max"):
        haff.view(files["cooling"], tmp_path / "a.html", color_range=given)


def two_speeds(path):
    """Two spheres side by side with speeds 1 and 3 at the first frame, 0.1 and 0.3 at the second."""
    position = np.array([[[2.5, 5.0, 5.0], [7.5, 5.0, 5.0]]] * 2)
    velocity = np.zeros((2, 2, 3))
    velocity[:, :, 1] = [[1.0, 3.0], [0.1, 0.3]]
    return synthetic.write(
        path,
        scene='schema = 1\n[domain]\nboundary = ["periodic", "periodic", "periodic"]\n[[species]]\nname = "a"\n',
        size=np.full(3, 10.0), boundary=["periodic"] * 3, mass=[1, 1], radius=[1.5, 1.5], species=[0, 0],
        frames={"time": np.array([0.0, 1.0]), "step": np.arange(2), "position": position, "velocity": velocity,
                "image": np.zeros((2, 2, 3), np.int32)},
    )  # fmt: skip


def hues(page, time):
    """Colors of the two spheres at their centers, by their largest component."""
    picture = seek(page, time)
    seen = [page.evaluate(f"haffView.player.locate({k})") for k in (0, 1)]
    colors = [picture[round(at["y"]) - 3 : round(at["y"]) + 4, round(at["x"])].mean(axis=0) for at in seen]
    return [color / color.max() for color in colors]


def same(one, other):
    # The shading scales a color and adds a highlight, which is a few percent of it.
    return np.abs(one - other).max() < 0.08


@pytest.mark.long
def test_a_fixed_range_keeps_colors_while_speeds_fall(show, tmp_path):
    path = two_speeds(tmp_path / "two.h5")
    page = show(path, "--color", "speed")
    early, late = hues(page, 0), hues(page, 1)
    assert same(early[1], late[1]), "the range follows the frames: the fastest has the brightest color"
    # Frozen at the range of the first frame, by its key.
    seek(page, 0)
    page.keyboard.press("x")
    assert page.locator("#fixed").is_checked()
    frozen = hues(page, 1)
    assert same(hues(page, 0)[1], early[1]) and not same(frozen[1], late[1])
    page.keyboard.press("x")
    assert same(hues(page, 1)[1], late[1])


@pytest.mark.long
def test_the_ends_of_the_range_can_be_entered(show, tmp_path):
    page = show(two_speeds(tmp_path / "two.h5"), "--color", "speed", "--color-range", "0", "1")
    assert page.locator("#lowest").input_value() == "0" and page.locator("#highest").input_value() == "1"
    brightest = hues(page, 0)
    assert same(*brightest), "1 and 3 are both at the upper end"
    page.locator("#highest").fill("3")
    page.keyboard.press("Enter")
    assert page.locator("#fixed").is_checked() and not same(*hues(page, 0))
    assert page.evaluate("haffView.player.colors.range(1, 0)") == [0, 3]
    # What is no range is refused, and the one before stays.
    for low, high, message in (("5", "3", "below the upper"), ("", "3", "must be numbers")):
        page.locator("#lowest").fill(low)
        page.locator("#highest").fill(high)
        page.keyboard.press("Enter")
        assert message in page.locator("#range-error").text_content()
        assert page.locator("#lowest").get_attribute("aria-invalid") == "true"
        assert page.evaluate("haffView.player.colors.range(1, 0)") == [0, 3]
    page.locator("#lowest").fill("1")
    page.keyboard.press("Enter")
    assert page.locator("#range-error").text_content() == ""
    assert page.evaluate("haffView.player.colors.range(1, 0)") == [1, 3]
    for name in ("#lowest", "#highest"):
        assert "end of the colors" in page.locator(name).get_attribute("aria-label")


@pytest.mark.long
def test_the_logarithmic_range_of_losses_is_in_their_unit(show, files):
    page = show(files["cooling"], "--color", "recent-loss")
    largest, decades = (page.evaluate(f"header.losses.{name}") for name in ("largest", "decades"))
    assert page.evaluate("haffView.player.colors.limits(0, 0)") == pytest.approx([0, 255])
    entered = [largest[1] / 10**3, largest[1] / 10]
    page.evaluate("r => { haffView.player.colors.fixed.recent = r; }", entered)
    # 255ths of four decades below the largest.
    assert page.evaluate("haffView.player.colors.limits(0, 0)") == pytest.approx(
        [255 * (1 - 3 / decades), 255 * (1 - 1 / decades)]
    )


# --- the local packing fraction ------------------------------------------------------------------

EDGE = 8.0


def density(folder, position, radius, **changes):
    """`localDensity` in Node."""
    given = {
        "dimension": 3, "low": [0, 0, 0], "size": [EDGE] * 3, "periodic": [True] * 3, "walls": [False] * 3,
        "shear": None, "reach": 1.5, "position": np.ravel(position).tolist(), "radius": np.asarray(radius).tolist(),
        **changes,
    }  # fmt: skip
    program = f"console.log(JSON.stringify([...localDensity({json.dumps(given)})]));"
    return np.array(in_node(folder, ["density.js"], program))


def points_of(dimension, count=20_000):
    """Points spread at random in a ball of radius 1."""
    rng = np.random.default_rng(1)
    points = rng.uniform(-1, 1, (count, 3)) * (np.arange(3) < dimension)
    return points[np.linalg.norm(points, axis=1) <= 1]


def counted(position, radius, reach, images, dimension):
    """The local packing fraction by counting points of each ball that are in particles; `images` moves one place."""
    found = []
    unit = points_of(dimension)
    for i, center in enumerate(position):
        places = center + unit * (radius[i] + reach)
        filled = np.zeros(len(places), bool)
        for r, other in zip(radius, position):
            for image in images(other):
                if np.linalg.norm(image - center) < r + radius[i] + reach:
                    filled |= np.linalg.norm(places - image, axis=1) < r
        found.append(filled.mean())
    return np.array(found)


def around(edges, slide=0.0, layers=(1, 1, 1)):
    """Images of a place in a box with these edges; those across y are displaced along x."""
    steps = np.stack(np.meshgrid(*[np.arange(-n, n + 1) for n in layers], indexing="ij"), -1).reshape(-1, 3)
    shifts = steps * np.asarray(edges) + steps[:, 1:2] * [slide, 0.0, 0.0]
    return lambda place: place + shifts


def packed(count, dimension, radii, seed):
    """Places of particles that do not overlap across the faces, drawn one by one."""
    rng = np.random.default_rng(seed)
    places = []
    while len(places) < count:
        place = rng.uniform(0, EDGE, 3) * (np.arange(3) < dimension)
        off = np.array(places).reshape(-1, 3) - place
        off -= EDGE * np.round(off / EDGE)
        if np.all(np.linalg.norm(off, axis=1) > np.array(radii[: len(places)]) + radii[len(places)]):
            places.append(place)
    return np.array(places)


@pytest.mark.long
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("slide", [0.0, 2.7])
def test_density_is_the_share_of_the_ball_that_particles_fill(tmp_path, dimension, slide):
    radius = np.where(np.arange(30) % 3 == 0, 0.8, 0.4)
    position = packed(30, dimension, radius, 7)
    shear = {"flow": 0, "gradient": 1, "slide": slide} if slide else None
    found = density(tmp_path, position, radius, dimension=dimension, shear=shear,
                    periodic=[True, True, dimension == 3])  # fmt: skip
    layers = (2 if slide else 1, 1, 1 if dimension == 3 else 0)
    if slide:  # particles of different rows may overlap there; the sum of shares counts both
        expected = np.array([
            sum(shares(position[i], radius[i] + 1.5, image, radius[j], dimension)
                for j in range(30) for image in around([EDGE] * 3, slide, layers)(position[j]))
            for i in range(30)
        ])  # fmt: skip
        assert found == pytest.approx(np.minimum(expected, 1), abs=0.012)
    else:
        # Errors of counting 10,000 points or more are 0.005; the largest of 30 is some three of them.
        expected = counted(position, radius, 1.5, around([EDGE] * 3, 0.0, layers), dimension)
        assert found == pytest.approx(expected, abs=0.015)
    assert np.ptp(found) > 0.1


def shares(center, R, image, r, dimension):
    """The share of a ball of radius R that another one fills, by points in the smaller one."""
    small, large = ((center, R), (image, r)) if R < r else ((image, r), (center, R))
    if np.linalg.norm(image - center) >= R + r:
        return 0.0
    places = small[0] + small[1] * points_of(dimension)
    return (np.linalg.norm(places - large[0], axis=1) < large[1]).mean() * (small[1] / R) ** dimension


@pytest.mark.parametrize("edges", [[8.0, 3.0, 1.9], [1.7, 9.0, 8.0]])
def test_density_in_thin_periodic_boxes_counts_all_images(tmp_path, edges):
    position = np.array([[0.9, 1.5, 0.9]])
    found = density(tmp_path, position, [0.5], size=edges)
    layers = [int(np.ceil(2.5 / edge)) for edge in edges]
    expected = counted(position, [0.5], 1.5, around(edges, 0.0, layers), 3)
    assert found == pytest.approx(expected, abs=0.015)


@pytest.mark.parametrize("dimension", [2, 3])
def test_balls_end_at_walls(tmp_path, dimension):
    position = np.array([[0.5, 0.5, 0.5], [4.0, 4.0, 4.0], [0.5, 4.0, 4.0]]) * (np.arange(3) < dimension)
    walls = [True, True, dimension == 3]
    found = density(tmp_path, position, [0.5] * 3, dimension=dimension, periodic=[False] * 3, walls=walls)
    # No other particle is in these balls of radius 2; what is beyond walls is no part of them.
    unit = points_of(dimension, 1_000_000)
    share = [np.all(place + 2 * unit >= 0, axis=1).mean() for place in position]
    # The page takes 1000 points, spread evenly.
    assert 0.25**dimension / found == pytest.approx(share, rel=0.02)
    assert share[0] < 0.8 * share[2] < 0.6 * share[1]


def test_density_of_a_gas_has_the_packing_fraction_as_its_mean(tmp_path):
    rng = np.random.default_rng(2)
    position = synthetic.jittered_lattice(rng, 512, EDGE * 1.5, 3, 1.0)
    found = density(tmp_path, position, np.full(512, 0.5), size=[EDGE * 1.5] * 3)
    assert found.mean() == pytest.approx(512 * np.pi / 6 / (EDGE * 1.5) ** 3, rel=0.05)


@pytest.mark.long
@pytest.mark.parametrize("exact", [True, False])
def test_page_colors_a_dense_cluster_brighter_than_a_lone_particle(show, tmp_path, monkeypatch, exact):
    """Seven spheres in contact, and one on its own; also from places stored as 65536ths."""
    from haff.viewer import content

    monkeypatch.setattr(content, "EXACT", 10**9 if exact else 0)
    cross = np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)]) * 1.01 + [3.0, 3.0, 3.0]
    position = np.concatenate([cross, [[8.0, 3.0, 8.0]]])[None]
    path = synthetic.write(
        tmp_path / "eight.h5",
        scene='schema = 1\n[domain]\nboundary = ["periodic", "periodic", "periodic"]\n[[species]]\nname = "a"\n',
        size=np.full(3, 10.0), boundary=["periodic"] * 3, mass=np.ones(8), radius=np.full(8, 0.5),
        species=np.zeros(8, int),
        frames={"time": np.zeros(1), "step": np.zeros(1, int), "position": position,
                "velocity": np.zeros((1, 8, 3)), "image": np.zeros((1, 8, 3), np.int32)},
    )  # fmt: skip
    page = show(path, "--color", "density")
    page.wait_for_function("haffView.player.frames.found[0].density")
    found = page.evaluate("[...haffView.player.frames.found[0].density]")
    # Balls of two diameters: all seven are within that of the one in the middle.
    assert found[0] == pytest.approx(7 / 64, rel=1e-3) and found[7] == pytest.approx(1 / 64, rel=1e-3)
    picture = seek(page, 0)
    seen = [page.evaluate(f"haffView.player.locate({k})") for k in (7, 4)]
    alone, clustered = (picture[round(at["y"]), round(at["x"])] for at in seen)
    # From violet to yellow.
    assert clustered[1] > alone[1] + 40
    assert page.locator("#caption").text_content() == "local packing fraction"
    assert float(page.locator("#highest").input_value()) == pytest.approx(max(found), rel=1e-2)


@pytest.mark.long
def test_density_of_frames_is_found_in_a_worker_while_the_page_plays(show, files):
    page = show(files["cooling"])
    page.locator("#coloring").select_option("density")
    page.evaluate("haffView.player.setPlaying(true)")
    page.wait_for_function("haffView.player.at > 1.1")
    assert page.evaluate("haffView.player.densities.worker instanceof Worker")
    values = page.evaluate("[...haffView.player.frames.found[1].density]")
    with haff.open(files["cooling"]) as run:
        fraction = len(run) * np.pi / 6 / np.prod(run.box.size)
    assert np.mean(values) == pytest.approx(fraction, rel=0.2)
