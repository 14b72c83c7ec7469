"""Partly transparent particles in the pages of `haff view`."""

import numpy as np
import pytest

import synthetic
from pages import seek

BACK = np.array([0x11, 0x15, 0x1A])


def row_of_spheres(path, species, places=((5.0, 3.0, 5.0), (5.0, 7.0, 5.0)), d=3):
    """Spheres behind each other along y, of species in blue and orange."""
    count = len(species)
    scene = "schema = 1\n" + ("dimension = 2\n" if d == 2 else "")
    scene += '[domain]\nboundary = ["wall", "wall", "wall"]\n[[species]]\nname = "blue"\n[[species]]\nname = "orange"\n'
    return synthetic.write(
        path, scene=scene, size=np.full(3, 10.0), boundary=["none"] * 3, mass=np.ones(count),
        radius=np.full(count, 1.5), species=species,
        frames={"time": np.zeros(1), "step": np.zeros(1, int), "position": np.array([places[:count]]),
                "velocity": np.zeros((1, count, 3)), "image": np.zeros((1, count, 3), np.int32)},
    )  # fmt: skip


def color_at_center(page):
    """Mean color around the centers of both spheres, seen along y without the box."""
    page.evaluate(
        """() => { const { view } = haffView.player; box.checked = false; view.camera.position.set(5, -30, 5);
                   view.orbit.target.set(5, 5, 5); view.orbit.update(); }"""
    )
    picture = seek(page, 0)
    at = page.evaluate("haffView.player.pixel([5, 3, 5])")
    x, y = round(at["x"]), round(at["y"])
    return picture[y - 8 : y + 9, x - 8 : x + 9].reshape(-1, 3).mean(axis=0)


def set_opacity(page, value, species=""):
    if species != "":
        page.locator("#opaque").select_option(species)
    page.evaluate("v => { opacity.value = v; opacity.dispatchEvent(new Event('input')); }", value)


@pytest.mark.long
@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
@pytest.mark.parametrize("points", [False, True])
def test_colors_mix_as_their_opacities_say_in_any_order(show, tmp_path, order, points):
    """The front sphere is blue; the one behind it comes before or after it in the file."""
    places = [(5.0, 3.0, 5.0), (5.0, 7.0, 5.0)]
    path = row_of_spheres(tmp_path / "row.h5", list(order), [places[k] for k in order])
    page = show(path)
    if points:
        html = tmp_path / "page.html"
        html.write_text(html.read_text().replace("const POINTS = 20000;", "const POINTS = 1;"))
        page.reload()
        page.evaluate("haffView.ready")
    blue = color_at_center(page)
    set_opacity(page, 0, "0")
    orange = color_at_center(page)
    set_opacity(page, 0, "1")
    assert np.abs(color_at_center(page) - BACK).max() < 1, "at 0 nothing is drawn"
    assert blue[2] > blue[0] + 40 and orange[0] > orange[2] + 40
    set_opacity(page, 0.5, "0")
    set_opacity(page, 1, "1")
    # Of 300 pixels with 4 samples each; without those, of points, 0.03 of a difference of 200.
    error = 12 if points else 6
    assert color_at_center(page) == pytest.approx(0.5 * blue + 0.5 * orange, abs=error)
    set_opacity(page, 0.3, "0")
    set_opacity(page, 0.6, "1")
    mixed = 0.3 * blue + 0.7 * (0.6 * orange + 0.4 * BACK)
    assert color_at_center(page) == pytest.approx(mixed, abs=error)


@pytest.mark.long
def test_opacity_of_all_species_is_set_at_once_and_by_keys(show, tmp_path):
    page = show(row_of_spheres(tmp_path / "row.h5", [0, 1]))
    opaque = color_at_center(page)
    page.keyboard.press("o")
    page.keyboard.press("o")
    assert float(page.locator("#opacity").input_value()) == pytest.approx(0.8)
    assert page.evaluate("haffView.player.colors.opacity.slice(0, 2)") == pytest.approx([0.8, 0.8])
    assert np.abs(color_at_center(page) - opaque).max() > 10
    page.keyboard.press("Shift+O")
    page.keyboard.press("Shift+O")
    page.keyboard.press("Shift+O")
    assert color_at_center(page) == pytest.approx(opaque, abs=1)


@pytest.mark.long
def test_disks_are_mixed_with_the_background(show, tmp_path):
    path = row_of_spheres(tmp_path / "disks.h5", [0, 1], [(3.0, 3.0, 0.0), (7.0, 7.0, 0.0)], d=2)
    page = show(path)

    def colors():
        picture = seek(page, 0)
        seen = [page.evaluate(f"haffView.player.locate({k})") for k in (0, 1)]
        return [picture[round(at["y"]), round(at["x"])] for at in seen]

    full = colors()
    assert not page.locator("#opaque").is_hidden()
    set_opacity(page, 0.25, "1")
    first, second = colors()
    assert np.array_equal(first, full[0]), "of the chosen species only"
    assert second == pytest.approx(0.25 * full[1] + 0.75 * BACK, abs=2)


@pytest.mark.long
def test_the_grain_goes_while_nothing_moves(show, tmp_path):
    page = show(row_of_spheres(tmp_path / "row.h5", [0, 1]))
    set_opacity(page, 0.5)
    color_at_center(page)
    at = page.evaluate("haffView.player.pixel([5, 3, 5])")
    page.wait_for_function("haffView.player.smooth.count === ROUNDS")
    # Red, green and blue of the drawing with its grain, and of the mean, at the same place.
    patch = """([canvas, x, y]) => { const p = haffView.player; p.render();
      const copy = new OffscreenCanvas(9, 9), context = copy.getContext("2d"), box = stage.getBoundingClientRect();
      const scale = stage.width / box.width;
      context.drawImage(document.getElementById(canvas), -(x - box.left) * scale + 4, -(y - box.top) * scale + 4);
      return [...context.getImageData(0, 0, 9, 9).data]; }"""
    grains = []
    for canvas in ("stage", "mean"):
        data = np.array(page.evaluate(patch, [canvas, at["x"], at["y"]])).reshape(81, 4)[:, :3]
        grains.append(data.std(axis=0).max())
    # Of 24 drawings, a fifth.
    assert page.locator("#mean").is_visible() and grains[1] < 0.35 * grains[0] and grains[0] > 20
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Shift+O")
    for _ in range(5):
        page.keyboard.press("Shift+O")
    page.wait_for_function("haffView.player.colors.opacity[0] === 1 && document.getElementById('mean').hidden")
