"""`haff plot` and the figures: their contents, figures that do not apply, and errors."""

import itertools
import os
import re
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text
from PIL import Image, ImageSequence

import haff
from haff import figures
from haff.command.main import _KINDS, main
from haff.figures import movie, render, trajectories

GAS = {"temperature", "energy", "velocity", "structure", "means", "snapshot", "losses"}
DRAWN = {
    "cooling": GAS,
    "disks": GAS,
    "elastic": GAS - {"losses", "temperature"},
    "quiet": GAS - {"losses"},
    "ball": {"energy", "losses", "snapshot", "trajectories", "closed_form"},
    "rough": GAS,
    "rough_disks": GAS,
    "impacts": {"energy", "snapshot", "trajectories", "paths", "closed_form"},
    "sliding": {"energy", "snapshot", "trajectories"},
}


@pytest.mark.long
@pytest.mark.parametrize("name", DRAWN)
def test_default_draws_all_applicable_figures_silently(files, name, tmp_path, capsys):
    assert main(["plot", str(files[name]), "-o", str(tmp_path)]) == 0
    out, err = capsys.readouterr()
    assert {p.stem.removeprefix(f"{name}-") for p in tmp_path.iterdir()} == DRAWN[name], err
    assert out.count("\n") == len(DRAWN[name])
    assert err == ""
    for path in tmp_path.iterdir():
        pixels = np.asarray(Image.open(path).convert("L"))
        assert pixels.std() > 5, f"{path.name} is empty"


@pytest.mark.long
@pytest.mark.parametrize("extension", ["pdf", "svg"])
def test_vector_formats_are_written(files, tmp_path, extension):
    assert main(["plot", str(files["cooling"]), "--kind", "temperature", "--kind", "losses", "-o", str(tmp_path),
                 "--format", extension]) == 0  # fmt: skip
    start = {"pdf": b"%PDF", "svg": b"<?xml"}[extension]
    assert [p.read_bytes()[: len(start)] for p in sorted(tmp_path.iterdir())] == [start, start]


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "kind"),
    [
        *(("cooling", kind) for kind in sorted(GAS)),
        ("rough", "temperature"),
        ("rough", "losses"),
        ("sliding", "energy"),
    ],
)
def test_no_text_is_cut_off_or_covers_other_text(files, name, kind, monkeypatch):
    require_texts_apart(files[name], kind, monkeypatch)


def require_texts_apart(path, kind, monkeypatch):
    """All texts of a figure are on its page, and none covers another."""
    drawn = []  # texts drawn on the canvas: tick labels beyond the limits exist, but are not drawn
    plain = Text.draw
    with haff.open(path) as run:
        figure = figures.draw(run, kind)
        monkeypatch.setattr(Text, "draw", lambda text, renderer: (drawn.append(text), plain(text, renderer))[1])
        FigureCanvasAgg(figure).draw()
    page = figure.bbox
    texts = [(t.get_text(), t.get_window_extent()) for t in drawn if t.get_visible() and t.get_text().strip()]
    assert len(texts) > 3
    for text, box in texts:
        assert page.x0 - 1 <= box.x0 and box.x1 <= page.x1 + 1, f"{text!r} leaves the page"
        assert page.y0 - 1 <= box.y0 and box.y1 <= page.y1 + 1, f"{text!r} leaves the page"
    for k, (text, box) in enumerate(texts):
        for other, other_box in texts[k + 1 :]:
            # Shrunk: extents include the line spacing, which may touch.
            wide = min(box.x1, other_box.x1) - max(box.x0, other_box.x0)
            high = min(box.y1, other_box.y1) - max(box.y0, other_box.y0)
            assert wide < 2 or high < 3, f"{text!r} overlaps {other!r}"


def test_temperature_figure_shows_data_law_and_ratio(files):
    with haff.open(files["cooling"]) as run:
        figure = figures.draw(run, "temperature")
        top, below = figure.axes[:2]
        assert top.get_xscale() == top.get_yscale() == "log"
        ratio = below.lines[-1].get_ydata()
        assert np.allclose(ratio, 1, atol=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("smooth", [False, True])
def test_temperature_figure_shows_that_of_rotation(files, smooth, tmp_path):
    """Of rough contacts without a law; of smooth ones, whose spins do not change, beside Haff's."""
    path = tmp_path / "gas.h5"
    path.write_bytes(files["cooling" if smooth else "rough"].read_bytes())
    if smooth:
        with h5py.File(path, "r+") as file:
            samples = len(file["observables/temperature/value"])
            file["observables/rotational_temperature/value"] = np.full(samples, 0.5)
            for name in ("step", "time"):
                file[f"observables/rotational_temperature/{name}"] = file[f"observables/temperature/{name}"]
    with haff.open(path) as run:
        figure = figures.draw(run, "temperature")
        top, table = figure.axes[0], run.observables
        (line,) = [line for line in top.lines if "rotation" in line.get_label()]
        expected = table["rotational_temperature"].to_numpy()
        assert np.array_equal(line.get_ydata(), expected[1:] if smooth else expected)
        assert len(figure.axes) == (2 if smooth else 1)
        if smooth:
            assert np.allclose(figure.axes[1].lines[-1].get_ydata(), 1, atol=1e-9), "the ratio is that of translation"
        else:
            assert "β = 0.5" in " ".join(text.get_text() for text in figure.texts)


@pytest.mark.long
def test_losses_in_units_of_the_temperature_are_those_by_the_normal_impulse(files):
    for name in ("cooling", "rough"):
        with haff.open(files[name]) as run:
            scaled = figures.draw(run, "losses").axes[1]
            points = scaled.containers[0][0].get_xydata()
            first = points[points[:, 0] < 1]
            assert np.allclose(first[:, 1], np.exp(-first[:, 0]), rtol=0.1), name
            assert ("normal part" in scaled.get_xlabel()) == (name == "rough")


@pytest.mark.parametrize("name", ["ball", "rough", "impacts", "sliding"])
def test_ledger_stack_equals_the_initial_energy(files, name):
    with haff.open(files[name]) as run:
        figure = figures.draw(run, "energy")
        start = run.observables.iloc[0]
        top = figure.axes[0]
        total = start["kinetic_energy"] + start["potential_energy"] + start.get("rotational_energy", 0.0)
        upper = max(path.vertices[:, 1].max() for c in top.collections for path in c.get_paths())
        assert upper == pytest.approx(total, rel=1e-9)
        # The line of the supply.
        assert np.allclose(top.lines[0].get_ydata(), total, rtol=1e-9)


def test_paths_between_frames_are_exact_parabolas(files):
    with haff.open(files["ball"]) as run:
        (path,) = trajectories.flights(run)
        # Reconstructed impacts touch the floor: height of the centre = radius.
        assert np.allclose(path.at[:, 2], 0.5, atol=1e-9)
        first = path.time < run.events["time"][0]
        assert np.allclose(path.position[first, 2], 2.5 - 9.81 * path.time[first] ** 2 / 2, atol=1e-12)


def test_path_of_a_sliding_ball_stays_on_the_floor(files):
    with haff.open(files["sliding"]) as run:
        (path,) = trajectories.flights(run)
        until, v, pull = run.events["time"][1], 7.0, 0.3 * 9.81
        slid = np.minimum(path.time, until)
        x = 1.0 + v * slid - pull * slid**2 / 2 + (v - pull * slid) * (path.time - slid)
        assert np.allclose(path.position, np.stack([x, np.full_like(x, 5.0), np.full_like(x, 0.5)], axis=1), atol=1e-12)
        assert np.allclose(path.at[:, 0], [1.0, 1.0 + v * until - pull * until**2 / 2])


def test_paths_take_up_the_impulses_of_rough_contacts(files):
    with haff.open(files["impacts"]) as run:
        events, paths = run.events, trajectories.flights(run)
        for path, body in zip(paths, (0, 1)):
            sign = np.where(events["i"][path.hits] == body, -1.0, 1.0)[:, None]
            centre = events["position"][path.hits] + sign * run.radius[body] * events["normal"][path.hits]
            assert len(path.hits) == (2, 3)[body] and np.allclose(path.at, centre, atol=1e-12)
            assert np.allclose(path.position[-1], run.frames[-1].position[body], atol=1e-12)


def test_renderer_draws_the_near_sphere_over_the_far_one():
    camera = render.Camera(np.eye(3))
    color = np.array([[1.0, 0, 0], [0, 0, 1.0]])
    for order in (1, -1):
        picture = render.spheres(
            np.array([[0, 0, 0.0], [0.3, 0, 1.5]])[::order], np.array([0.5, 0.3])[::order], color[::order],
            camera, (-1, 1, -1, 1), 100,
        )  # fmt: skip
        red, blue = picture.rgba[50, 35, :3], picture.rgba[50, 65, :3]
        assert red[0] > red[2] and blue[2] > blue[0]
        assert picture.rgba[2, 2, 3] == 0


def test_rendered_sphere_has_its_diameter():
    picture = render.spheres(
        np.zeros((1, 3)), np.array([0.5]), np.ones((1, 3)), render.Camera.looking(), (-1, 1, -1, 1), 200
    )
    assert picture.rgba[..., 3].sum() == pytest.approx(np.pi * 50**2, rel=5e-3)


def test_help_lists_all_figures():
    assert {k: v.about for k, v in figures.KINDS.items()} == _KINDS


def test_wrong_arguments_exit_with_2(files, tmp_path, capsys):
    for arguments in (["plot"], ["plot", str(files["ball"]), "--kind", "pie"], ["plot", "x.h5", "--format", "gif"]):
        with pytest.raises(SystemExit) as stop:
            main(arguments)
        assert stop.value.code == 2
    assert "must be one of temperature" in capsys.readouterr().err
    # Requested figures that do not apply are named.
    assert main(["plot", str(files["ball"]), "--kind", "structure", "--kind", "energy", "-o", str(tmp_path)]) == 2
    assert "skipped structure: g(r) needs a periodic box" in capsys.readouterr().err
    assert main(["plot", str(files["ball"]), "--kind", "snapshot", "--frame", "99", "-o", str(tmp_path)]) == 2
    assert "frame 99 of 25" in capsys.readouterr().err


def test_unreadable_and_unwritable_files_exit_with_4_and_one_line(files, tmp_path, capsys):
    broken = tmp_path / "broken.h5"
    broken.write_bytes(files["ball"].read_bytes()[:3000])
    blocked = tmp_path / "blocked"
    blocked.write_text("a file where a directory should be")
    for arguments in (
        ["plot", str(tmp_path / "none.h5")],
        ["plot", str(broken)],
        ["plot", str(files["ball"]), "-o", str(blocked / "in")],
    ):
        assert main(arguments) == 4, arguments
        err = capsys.readouterr().err
        assert err.startswith("haff: error: ") and err.count("\n") == 1 and "Traceback" not in err


@pytest.mark.long
def test_module_runs_as_a_program(files, tmp_path):
    result = subprocess.run(
        [sys.executable, "-m", "haff", "plot", str(files["ball"]), "--kind", "trajectories", "-o", str(tmp_path)],
        capture_output=True, text=True, env={**os.environ, "MPLBACKEND": "Agg"}, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip() == str(tmp_path / "ball-trajectories.png")


@pytest.mark.long
@pytest.mark.parametrize(("name", "extension"), [("ball", "gif"), ("disks", "mp4"), ("cooling", "mp4")])
def test_movie_has_a_picture_for_each_frame_and_shows_motion(files, name, extension, tmp_path, capsys):
    if extension == "mp4":
        pytest.importorskip("imageio_ffmpeg", reason="no imageio-ffmpeg: pip install 'haff[movie]'")
    target = tmp_path / f"movie.{extension}"
    arguments = ["plot", str(files[name]), "--movie", str(target), "--frames", "0:6:2", "--fps", "10"]
    assert main(arguments) == 0
    assert capsys.readouterr().out.strip() == str(target) and [p.name for p in tmp_path.iterdir()] == [target.name]
    pictures = _pictures(target)
    assert len(pictures) == 3
    for before, after in itertools.pairwise(pictures):
        assert before.std() > 5 and np.abs(after - before).max() > 60
    assert main(arguments) == 2
    assert "exists; --overwrite" in capsys.readouterr().err


def _pictures(path):
    if path.suffix == ".gif":
        with Image.open(path) as movie:
            assert movie.info["duration"] == 100
            return [np.asarray(p.convert("L")).astype(int) for p in ImageSequence.Iterator(movie)]
    import imageio_ffmpeg

    read = imageio_ffmpeg.read_frames(str(path))
    information = next(read)
    assert information["fps"] == pytest.approx(10)
    width, height = information["size"]
    return [np.frombuffer(p, np.uint8).reshape(height, width, 3).mean(axis=2).astype(int) for p in read]


@pytest.fixture
def damaged(files, tmp_path):
    """A file whose third frame cannot be read."""
    path = tmp_path / "damaged.h5"
    path.write_bytes(files["ball"].read_bytes())
    with h5py.File(path, "a") as file:
        group = file["particles/all/position"]
        value = group["value"][:]
        del group["value"]
        dataset = group.create_dataset("value", data=value, chunks=(1, *value.shape[1:]), compression="gzip")
        chunk = dataset.id.get_chunk_info(2)
    with open(path, "r+b") as file:
        file.seek(chunk.byte_offset)
        file.write(bytes(chunk.size))
    return path


@pytest.mark.parametrize("extension", ["mp4", "gif"])
def test_unreadable_frame_is_an_error_of_the_input_file(damaged, extension, tmp_path, capsys):
    if extension == "mp4":
        pytest.importorskip("imageio_ffmpeg", reason="no imageio-ffmpeg: pip install 'haff[movie]'")
    target = tmp_path / f"movie.{extension}"
    assert main(["plot", str(damaged), "--movie", str(target), "--frames", "1:4"]) == 4
    message = capsys.readouterr().err
    dataset = f"{damaged}: particles/all/position/value"
    assert message.startswith(f"haff: error: {dataset}: cannot read: ") and message.count("\n") == 1, message
    assert list(tmp_path.iterdir()) == [damaged]


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="descriptors of open files cannot be found")
def test_read_error_is_not_reported_as_a_write_error(files, tmp_path):
    path = tmp_path / "ball.h5"
    path.write_bytes(files["ball"].read_bytes())
    with haff.open(path) as file:
        assert file.frames[0].position is not None
        for descriptor in Path("/proc/self/fd").iterdir():
            if descriptor.exists() and descriptor.samefile(path):
                # Reading a directory fails: HDF5 reports an errno of the system, as for a broken disk.
                folder = os.open(tmp_path, os.O_RDONLY)
                os.dup2(folder, int(descriptor.name))
                os.close(folder)
        reason = f"^{re.escape(str(path))}: particles/all/[a-z/]+: cannot read: Is a directory$"
        with pytest.raises(haff.FileError, match=reason):
            movie.save(file, tmp_path / "movie.gif")


def test_failing_encoder_is_an_error_of_the_movie(files, tmp_path, monkeypatch, capsys):
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="no imageio-ffmpeg: pip install 'haff[movie]'")
    monkeypatch.setattr(ffmpeg._io, "get_ffmpeg_exe", lambda: "false")
    target = tmp_path / "movie.mp4"
    assert main(["plot", str(files["ball"]), "--movie", str(target), "--frames", ":3"]) == 4
    message = capsys.readouterr().err
    assert re.fullmatch(
        rf"haff: error: {re.escape(str(target))}: ffmpeg has failed: pictures drawn [123], in the file 0\n", message
    ), message
    assert not list(tmp_path.iterdir())


def test_all_pictures_of_a_movie_show_the_same_region(files):
    from haff.figures import snapshot
    from haff.files.extent import extent

    with haff.open(files["ball"]) as run:
        room = extent(run.frames)
        limits = {snapshot.draw(run, k, room=room, pixels=50).axes[0].get_xlim() for k in (0, 5, 20)}
        assert len(limits) == 1


def test_invalid_movie_options_are_refused(files, tmp_path, capsys):
    for arguments, message in (
        (["--movie", str(tmp_path / "a.avi")], "must end in .mp4 or .gif"),
        (["--movie", str(tmp_path / "a.gif"), "--kind", "snapshot"], "leave out --kind"),
        (["--frames", "::2"], "go with --movie"),
        (["--movie", str(tmp_path / "a.gif"), "--fps", "0"], r"must be in (0, 120]"),
        (["--movie", str(tmp_path / "a.gif"), "--frames", "99:"], "none of the 25 frames"),
    ):
        assert main(["plot", str(files["ball"]), *arguments]) == 2
        assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
