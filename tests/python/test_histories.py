"""Quantities against time, and what functions of frames are given: one, several, or a run."""

import numpy as np
import pytest

import haff
from haff import analysis
from haff.analysis import scattering


def test_history_has_a_row_for_each_frame(files):
    with haff.open(files["cooling"]) as run:
        table = analysis.history(run, analysis.temperature)
        assert list(table["time"]) == list(run.frames.time)
        assert list(table["value"]) == [analysis.temperature(frame) for frame in run.frames]
        few = analysis.history(run.frames[::2], lambda frame: {"fastest": abs(frame.velocity).max(), "name": "x"})
        assert list(few) == ["time", "fastest"] and len(few) == len(run.frames[::2])
        found = analysis.history(run.frames[:2], analysis.clusters, distance=1.3)
        assert list(found["largest"]) == [analysis.clusters(frame, 1.3).largest for frame in run.frames[:2]]
        with pytest.raises(haff.ArgumentError, match="must be a number, or a dict"):
            analysis.history(run, lambda frame: "x")
        with pytest.raises(haff.ArgumentError, match="must be a function of a frame"):
            analysis.history(run, 3)
        with pytest.raises(haff.NotApplicableError, match="no frames"):
            analysis.history(run.frames[:0], analysis.temperature)


def test_cluster_history_counts_the_clusters_of_each_frame(files):
    with haff.open(files["disks"]) as run:
        table = analysis.cluster_history(run, 1.2)
        sizes = [analysis.clusters(frame, 1.2).sizes for frame in run.frames]
        assert list(table["largest"]) == [int(size.max()) for size in sizes]
        assert list(table["clusters"]) == [len(size) for size in sizes]
        assert np.allclose(table["mean"], [np.sum(size**2) / np.sum(size) for size in sizes], rtol=1e-14)


def test_structure_history_has_the_peak_and_the_length_of_each_frame(files):
    with haff.open(files["disks"]) as run:
        table = analysis.structure_history(run.frames[:3], 3.0, 12)
        for (_, row), frame in zip(table.iterrows(), run.frames[:3]):
            found = analysis.static_structure(frame, 3.0, 12)
            at = found.value.argmax()
            assert [row["peak"], row["peak_k"]] == pytest.approx([found.value[at], found.k[at]], rel=1e-12)
            assert row["peak_error"] == pytest.approx(found.error[at], rel=1e-9)


def test_the_length_of_waves_does_not_depend_on_the_shells(files):
    with haff.open(files["disks"]) as run:
        frame = run.frames[-1]
        lengths = [lengths_of(frame, bins, 10_000) for bins in (5, 10, 20, 40, 80)]
        # By all waves: ∫ k S dk / ∫ S dk in two dimensions, where a wave of each pair k, −k counts as 1/k.
        index = scattering.lattice(frame.box, 3.0)
        k = np.linalg.norm(scattering.vectors(frame.box, index), axis=1)
        value = scattering.intensities(frame.box, frame.position, index)
        expected = 2 * np.pi * np.sum(value / k) / np.sum(value)
        assert lengths == pytest.approx([expected] * 5, rel=1e-6)
        # With samples of shells it is an estimate.
        assert lengths_of(frame, 5, 60) == pytest.approx(expected, rel=0.1)


def lengths_of(frame, bins, most_waves):
    return analysis.structure_history([frame], 3.0, bins, most_waves=most_waves)["length"][0]


MEANS = {
    "static_structure": (3.0, 10),
    "radial_distribution": (2.0, 10),
    "pair_distributions": (2.0, 10),
    "density_field": (4,),
    "velocity_histogram": (11,),
}
"""Functions of frames, with their other arguments."""


def arrays(found):
    return [part for part in found if isinstance(part, np.ndarray)]


@pytest.mark.parametrize("name", MEANS)
def test_means_over_frames_take_a_frame_frames_or_a_run(name, files):
    function, arguments = getattr(analysis, name), MEANS[name]
    with haff.open(files["cooling"]) as run:
        for given, same in ((run, list(run.frames)), (run.frames[-1], run.frames[-1:])):
            one, other = arrays(function(given, *arguments)), arrays(function(same, *arguments))
            assert one and len(one) == len(other)
            assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(one, other))
        with pytest.raises(haff.ArgumentError, match="must be a frame, frames such as"):
            function("frames", *arguments)


def test_functions_of_one_frame_name_the_history(files):
    with haff.open(files["cooling"]) as run, pytest.raises(haff.ArgumentError, match=r"haff\.analysis\.history"):
        analysis.clusters(run)


@pytest.mark.parametrize("kind", ["structure_factor", "structure", "velocity", "clusters"])
def test_figures_of_frames_obey_the_frame(kind, files):
    from matplotlib.text import Text

    from haff import figures

    with haff.open(files["disks"]) as run:
        shown = " ".join(text.get_text() for text in figures.draw(run, kind, index=1).findobj(Text))
        assert f"t = {run.frames[1].time:.4g}" in shown


def test_a_frame_for_a_figure_without_frames_is_refused(files, tmp_path, capsys):
    from haff.command.main import main

    assert main(["plot", str(files["disks"]), "--kind", "temperature", "--frame", "1", "-o", str(tmp_path)]) == 2
    assert "--frame: goes with the figures" in capsys.readouterr().err
