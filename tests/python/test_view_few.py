"""Pages of few bodies: exact counts, every collision lit, marks that turn, colors of figures; narrow windows."""

import numpy as np
import pytest
from matplotlib.colors import to_hex

from haff.viewer import turns
from haff.viewer.keyframes import along_flights
from pages import page_of


def test_marks_turn_by_the_spin(command):
    with command.run("bouncing_superball").open() as run:
        keys = along_flights(run, run.frames)
        found = turns.find(keys, len(run))
    angle = 2 * np.arctan2(found[:, 0, 1], found[:, 0, 3])
    assert np.abs(found[:, 0, [0, 2]]).max() == 0
    # Spin about y: none up to the first bounce at 0.5, then 40/7 for one unit of time, and none for one.
    time = keys.time
    on = np.clip(time - 0.5, 0, 1) + np.clip(time - 2.5, 0, 1) + np.clip(time - 4.5, 0, 1)
    off = (angle - 40 / 7 * on + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(off).max() < 1e-5


def test_rotations_about_several_axes_follow_one_another():
    quarter = np.array([[np.pi / 2, 0.0, 0.0], [0.0, np.pi / 2, 0.0], [0.0, 0.0, 0.0]])

    class Keys:
        time = np.array([0.0, 1.0, 2.0])
        spin = staticmethod(lambda k: quarter[k : k + 1])

    x, y, z, w = turns.find(Keys, 1)[-1, 0, :4]
    # About x, then about the fixed y: (0, 1, 0) goes to (0, 0, 1), and that to (1, 0, 0).
    v, at = np.array([x, y, z]), np.array([0.0, 1.0, 0.0])
    assert at + 2 * w * np.cross(v, at) + 2 * np.cross(v, np.cross(v, at)) == pytest.approx([1, 0, 0], abs=1e-6)
    assert turns.find(Keys, turns.FEW + 1) is None


def test_pages_without_spin_have_no_marks(command, tmp_path):
    page = page_of(command.run("breakshot").path, tmp_path)
    assert page.header["turns"] is None


def test_energies_have_the_colors_of_the_figure(command, tmp_path):
    done = command.run("breakshot")
    page = page_of(done.path, tmp_path)
    ledger = next(panel for panel in page.header["curves"]["panels"] if panel["title"] == "Energy ledger")
    colors = {series["label"]: series["color"] for series in ledger["series"]}
    with done.open() as run:
        layers = run.plot("energy").axes[0].collections
        drawn = {layer.get_label(): to_hex(layer.get_facecolor()[0]) for layer in layers}
    assert colors["kinetic"].lower() == drawn["kinetic"]
    assert colors["dissipated"].lower() == drawn["dissipated, sphere–sphere"]


@pytest.mark.long
def test_counts_are_those_of_the_shown_time(command, show):
    done = command.run("breakshot")
    with done.open() as run:
        log = run.events.to_pandas(columns=["time", "kind"])
    times = np.sort(log["time"][log["kind"].isin(["collision", "wall"])])
    page = show(done.path)
    read = """t => { haffView.player.seek(t); haffView.player.draw();
      const heads = [...document.querySelectorAll('#curves h2')];
      return heads.find(h => h.textContent.startsWith('Collisions')).querySelector('span').textContent }"""
    for k in (0, 1, 5, len(times) - 2):
        between = 0.5 * (times[k] + times[k + 1])
        if times[k + 1] - times[k] > 1e-6:
            assert int(page.evaluate(read, between)) == k + 1
    assert int(page.evaluate(read, float(times[0]))) >= 1


@pytest.mark.long
def test_every_collision_of_few_bodies_is_lit(command, show):
    page = show(command.run("breakshot").path)
    # After the break, so fast that all of it is lit at once: more than the few of a larger system.
    page.evaluate("() => { const p = haffView.player; p.seek(0.5); p.setSpeed(5); p.draw(); }")
    assert page.evaluate("haffView.player.particles.light(haffView.player.events, 0, 0.5, 8)") > 1
    assert page.evaluate("getComputedStyle(document.getElementById('flash-share')).visibility") == "hidden"


def test_the_page_speaks_of_threads_only_in_its_help(command, show):
    page = show(command.run("breakshot").path)
    assert "thread" not in page.inner_text("header")
    assert "threads: " in page.text_content("#keys")


@pytest.mark.long
def test_marks_are_drawn_where_the_ball_is(command, show):
    page = show(command.run("bouncing_superball").path)
    far = """t => { const p = haffView.player; p.seek(t); p.draw();
      const at = p.marks.lines.geometry.getAttribute("position").array;
      const { position, radius } = p.locate(0);
      const off = [];
      for (let k = 0; k < at.length; k += 3) {
        off.push(Math.abs(Math.hypot(...[0, 1, 2].map(c => at[k + c] - position[c])) / radius - 1.004));
      }
      return Math.max(...off) }"""
    for time in (0.0, 0.9, 3.3):
        assert page.evaluate(far, time) < 1e-4


@pytest.mark.long
@pytest.mark.parametrize(("width", "height"), [(390, 844), (844, 390)])
def test_narrow_windows_have_one_row_of_controls(command, show, width, height):
    page = show(command.run("breakshot").path, width=width, height=height)
    size = "e => { const box = document.querySelector(e).getBoundingClientRect(); return [box.width, box.height] }"
    stage = page.evaluate(size, "#stage")
    assert page.evaluate(size, "footer")[1] < 70
    assert page.is_visible("#play") and page.is_visible("#scrub") and not page.is_visible("#speed")
    page.click("#more")
    assert page.is_visible("#speed") and page.is_visible("#opacity") and page.is_visible("#help")
    page.click("#more")
    assert page.evaluate(size, "#stage") == stage and stage[1] > 0.4 * height


@pytest.mark.long
def test_wide_windows_have_all_controls(command, show):
    page = show(command.run("breakshot").path, width=1280, height=800)
    assert not page.is_visible("#more") and page.is_visible("#speed") and page.is_visible("#help")


@pytest.mark.long
def test_fingers_have_large_controls(command, browser, tmp_path):
    page_of(command.run("breakshot").path, tmp_path)
    context = browser.new_context(viewport={"width": 390, "height": 844}, offline=True, has_touch=True, is_mobile=True)
    page = context.new_page()
    page.goto((tmp_path / "page.html").as_uri())
    page.evaluate("haffView.ready")
    page.click("#more")
    for name in ("#play", "#help", "#flash", "#box"):
        box = page.locator(name).bounding_box()
        least = 24 if name in ("#flash", "#box") else 44
        assert box["width"] >= least and box["height"] >= least, name
    context.close()
