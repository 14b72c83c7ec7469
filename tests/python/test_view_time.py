"""Time in the pages of `haff view`: linear, logarithmic, or by frames."""

import json

import numpy as np
import pytest

import synthetic
from pages import in_node, page_of


def scaled(folder, times, spacing, program):
    """The JSON of an expression of `line`, a Timeline of these times."""
    line = f"const line = new Timeline({json.dumps(list(times))}, {json.dumps(spacing)});"
    return in_node(folder, ["timeline.js"], f"{line} console.log(JSON.stringify({program}));")


LOGARITHMIC = [0.0, *(0.1 * 10 ** (np.arange(31) / 10))]
"""A start at 0, and three decades from 0.1 to 100."""


def frames_at(path, times):
    """A file of two particles at rest with frames at these times."""
    times = np.asarray(times, float)
    position = np.tile(np.array([[2.0, 5.0, 5.0], [7.0, 5.0, 5.0]]), (len(times), 1, 1))
    return synthetic.write(
        path,
        scene='schema = 1\n[domain]\nboundary = ["periodic", "periodic", "periodic"]\n[[species]]\nname = "a"\n',
        size=np.full(3, 10.0), boundary=["periodic"] * 3, mass=[1, 1], radius=[0.5, 0.5], species=[0, 0],
        frames={"time": times, "step": np.arange(len(times)), "position": position,
                "velocity": np.zeros_like(position), "image": np.zeros(position.shape, np.int32)},
    )  # fmt: skip


def test_equal_decades_take_equal_parts_of_a_logarithmic_slider(tmp_path):
    decades = [0.1, 1.0, 10.0, 100.0]
    shares = scaled(tmp_path, LOGARITHMIC, "log", f"{decades}.map((t) => line.share(line.placeOf(t)))")
    # What is before the first positive time takes one of 31 intervals.
    assert shares == pytest.approx([1 / 31, *(1 / 31 + 30 / 31 * np.arange(1, 4) / 3)], rel=1e-9)
    back = scaled(tmp_path, LOGARITHMIC, "log", f"{shares}.map((s) => line.timeAt(line.position(s)))")
    assert back == pytest.approx(decades, rel=1e-9)
    # Between two frames as well: halfway in the logarithm, not in time.
    between = np.sqrt(LOGARITHMIC[10] * LOGARITHMIC[11])
    found = scaled(tmp_path, LOGARITHMIC, "log", "line.timeAt(line.position((line.share(10) + line.share(11)) / 2))")
    assert found == pytest.approx(between, rel=1e-9)


@pytest.mark.parametrize(
    ("times", "spacing"),
    [(LOGARITHMIC, "log"), (LOGARITHMIC[1:], "log"), (np.linspace(0, 5, 11), "linear"), ([0, 1, 1.5, 9, 20], "frames")],
)
def test_slider_and_position_are_inverse(tmp_path, times, spacing):
    shares = np.linspace(0, 1, 41).tolist()
    for scale in scaled(tmp_path, times, spacing, "line.scales"):
        back = scaled(
            tmp_path, times, spacing, f"(line.scale = '{scale}', {shares}.map((s) => line.share(line.position(s))))"
        )
        assert back == pytest.approx(shares, abs=1e-12)


def test_playback_shows_as_many_decades_in_each_second(tmp_path):
    program = "(() => { const seen = []; let at = line.placeOf(0.1); for (let k = 0; k < 200; k++) {"
    program += " seen.push(line.timeAt(at)); at = line.advance(at, 0.02, 1); } return seen; })()"
    seen = np.array(scaled(tmp_path, LOGARITHMIC, "log", program))
    steps = np.diff(np.log10(seen))
    # Chords between frames: positions are linear in time there, shares logarithmic, and both are exact.
    assert steps == pytest.approx(np.full(199, steps[0]), rel=1e-9)
    rate = scaled(tmp_path, LOGARITHMIC, "log", "line.rate(1)")
    assert rate["unit"] == "decades" and rate["value"] == pytest.approx(steps[0] / 0.02, rel=1e-9)
    # How much time a second shows there, by which collisions stay lit.
    flow = scaled(tmp_path, LOGARITHMIC, "log", "line.flow(line.placeOf(2), 1)")
    assert flow == pytest.approx(2 * np.log(10) * rate["value"], rel=1e-9)


@pytest.mark.parametrize(
    ("times", "spacing"),
    [
        (LOGARITHMIC, "log"),
        # The last frame is at the end of the run, wherever that is.
        ([*LOGARITHMIC, 101.0], "log"),
        (LOGARITHMIC[5:], "log"),
        (np.linspace(0, 3, 13), "linear"),
        ([0.0, 1.0], "linear"),
        ([0.0, 0.1, 5.0, 5.1, 5.2, 80.0, 81.0], "frames"),
        ([3.0], "linear"),
    ],
)
def test_page_has_the_scale_on_which_the_frames_are_even(tmp_path, times, spacing):
    page = page_of(frames_at(tmp_path / "few.h5", times), tmp_path)
    assert page.header["frames"]["spacing"] == spacing


@pytest.mark.long
def test_frames_of_a_cooling_run_play_in_logarithmic_time(show, tmp_path):
    page = show(frames_at(tmp_path / "few.h5", LOGARITHMIC))
    assert page.locator("#scale").input_value() == "log" and "decades/s" in page.locator("#rate").text_content()
    page.evaluate("(s) => { scrub.value = s; scrub.dispatchEvent(new Event('input')); }", 1 / 31 + 30 / 31 / 3)
    assert page.evaluate("haffView.player.time") == pytest.approx(1.0, rel=1e-6)
    # The switch, by its key; the time stays, and the slider moves.
    page.keyboard.press("l")
    page.evaluate("haffView.player.draw()")
    assert page.locator("#scale").input_value() == "linear" and "time/s" in page.locator("#rate").text_content()
    assert page.evaluate("haffView.player.time") == pytest.approx(1.0, rel=1e-6)
    assert float(page.locator("#scrub").input_value()) == pytest.approx(0.01, rel=1e-6)
    page.locator("#scale").select_option("log")
    page.evaluate("haffView.player.draw()")
    assert float(page.locator("#scrub").input_value()) == pytest.approx(1 / 31 + 10 / 31, rel=1e-6)


@pytest.mark.long
def test_evenly_spaced_frames_play_in_linear_time(show, tmp_path):
    page = show(frames_at(tmp_path / "few.h5", np.linspace(0, 8, 9)))
    assert page.locator("#scale").input_value() == "linear"
    page.evaluate("scrub.value = 0.5; scrub.dispatchEvent(new Event('input'))")
    assert page.evaluate("haffView.player.time") == pytest.approx(4.0)
