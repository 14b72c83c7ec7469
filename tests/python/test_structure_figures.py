"""The figures `structure`, `partials`, `structure_factor`, `clusters`, `density` and `heights`: contents and time."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.text import Text

import haff
import synthetic
from haff import analysis, figures
from haff.command.main import _BY_NAME, main
from haff.errors import NotApplicableError
from haff.figures import structure
from patience import HANGS
from test_figures import require_texts_apart

MIXTURE = {
    "title": "Spheres of two sizes",
    "seed": 1,
    "domain": {"packing_fraction": 0.2},
    "species": [
        {"name": "small", "count": 400, "radius": 0.4, "mass": 1.0},
        {"name": "large", "count": 100, "radius": 0.8, "mass": 8.0},
    ],
    "initial": {"positions": "random", "temperature": 1.0},
    "run": {"until": 10.0},
    "output": {"frames": 1.0},
}
LAYER = {
    "title": "Grains over a floor",
    "seed": 2,
    "domain": {"size": [6, 6, 40], "boundary": ["periodic", "periodic", "wall"], "gravity": [0, 0, -1]},
    "species": [{"name": "grain", "count": 200, "radius": 0.5, "mass": 1.0}],
    "initial": {"positions": "lattice", "temperature": 5.0},
    "run": {"until": 40.0},
    "output": {"frames": 0.5},
}
SHEARED = {
    "title": "Sheared disks",
    "seed": 5,
    "dimension": 2,
    "domain": {"packing_fraction": 0.4, "shear": {"flow": "y", "gradient": "x", "rate": 0.3}},
    "species": [{"name": "grain", "count": 400, "radius": 0.5, "mass": 1.0}],
    "initial": {"positions": "lattice", "temperature": 1.0},
    "contact": {"restitution": 0.8},
    "run": {"until": 10.0},
    "output": {"frames": 0.7},
}


@pytest.fixture(scope="module")
def paths(files, tmp_path_factory):
    folder = tmp_path_factory.mktemp("structure")
    for name, scene in (("mixture", MIXTURE), ("layer", LAYER), ("sheared", SHEARED)):
        haff.run(scene, file=folder / f"{name}.h5")
    return files | {name: folder / f"{name}.h5" for name in ("mixture", "layer", "sheared")}


DRAWN = {
    "cooling": {"structure_factor", "structure_history", "clusters", "density"},
    "disks": {"structure_factor", "structure_history", "clusters", "density"},
    "sheared": {"structure_factor", "structure_history", "clusters", "density"},
    "mixture": {"structure_factor", "structure_history", "clusters", "density", "partials"},
    "layer": {"clusters", "density", "heights"},
    "ball": set(),
}


@pytest.mark.long
@pytest.mark.parametrize("name", DRAWN)
def test_figures_are_drawn_by_name_where_they_apply(paths, name, tmp_path, capsys):
    words = [word for kind in _BY_NAME for word in ("--kind", kind)]
    missing = set(_BY_NAME) - DRAWN[name]
    assert main(["plot", str(paths[name]), "-o", str(tmp_path), *words]) == (2 if missing else 0)
    out, err = capsys.readouterr()
    assert {path.stem.removeprefix(f"{name}-") for path in tmp_path.iterdir()} == DRAWN[name]
    assert out.count("\n") == len(DRAWN[name])
    assert {line.split(":")[0].removeprefix("skipped ") for line in err.splitlines()} == missing
    assert "Traceback" not in err and all(len(line) > 25 for line in err.splitlines()), "each has a reason"


def test_figures_by_name_are_marked():
    assert {name for name, kind in figures.KINDS.items() if not kind.standard} == set(_BY_NAME)


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "kind"),
    [(name, kind) for name in ("cooling", "sheared", "mixture", "layer") for kind in sorted(DRAWN[name])],
)
def test_no_text_is_cut_off_or_covers_other_text(paths, name, kind, monkeypatch):
    require_texts_apart(paths[name], kind, monkeypatch)


@pytest.mark.long
def test_structure_figure_has_the_distribution_by_freud(paths):
    for name in ("cooling", "mixture", "sheared"):
        with haff.open(paths[name]) as run:
            x, g = figures.draw(run, "structure").axes[0].lines[1].get_data()
            frames, sigma, r_max, bins = structure.sampled(run, structure.MOST_PAIRS)
            r, expected = analysis.radial_distribution(frames, r_max, bins)
            assert np.allclose(x * sigma, r, rtol=1e-5)
            # freud divides by N instead of N − 1; a distance at a limit may be in the other bin by single precision.
            near = analysis.pair_distributions(frames, r_max, bins)
            scale = len(run) / (len(run) - 1)
            assert np.all(np.abs(g - scale * expected) <= 5 * np.maximum(np.nan_to_num(near.total_error), 0.02)), name


def test_sample_of_distances_is_stated_and_unbiased(paths, monkeypatch):
    with haff.open(paths["cooling"]) as run:
        frames, _, r_max, bins = structure.sampled(run, structure.MOST_PAIRS)
        every = analysis.pair_distributions(frames[:1], r_max, bins)
        monkeypatch.setattr(structure, "MOST_PAIRS", every.pairs / 4)
        (line,) = [one for one in figures.draw(run, "structure").axes[0].lines if "simulation" in str(one.get_label())]
        assert "1 frame, from " in line.get_label() and "particles to all" in line.get_label()
        assert len(structure.sampled(run, every.pairs / 4).frames) == 1
        few = analysis.pair_distributions(frames[:1], r_max, bins, most_pairs=every.pairs / 4)
        assert few.pairs == pytest.approx(every.pairs / 4, rel=0.1)
        z = ((few.total - every.total) / few.total_error)[np.isfinite(few.total_error) & (few.total_error > 0)]
        # A quarter of the distances, of which some are in both: the difference has less than the error of the sample.
        assert 0.3 < np.sqrt(np.mean(z**2)) < 1.2


def test_partial_figure_has_a_curve_for_each_pair_and_the_contact_values(paths):
    with haff.open(paths["mixture"]) as run:
        axes = figures.draw(run, "partials").axes[0]
        labels = [line.get_label() for line in axes.lines]
        assert {"small – small", "small – large", "large – large", "contact, BMCSL"} <= set(labels)
        marks = [line for line in axes.lines if line.get_marker() == "D" and len(line.get_xdata())]
        contacts = sorted(float(mark.get_xdata()[0]) for mark in marks)
        assert contacts == pytest.approx([0.8 / 1.2, 1.0, 1.6 / 1.2])
        for line in axes.lines[1:]:
            x, g = (np.asarray(values, float) for values in line.get_data())
            if line.get_label() == "small – large":
                # Nothing is nearer than contact, and the fluid is dense at it.
                assert np.all(g[x < 1 - 0.03] == 0) and g[np.searchsorted(x, 1.0)] > 1.2


@pytest.mark.parametrize(
    ("keys", "is_last"),
    [
        ({"run__until": 400.0, "output__frames": 20.0}, True),
        ({"run__until": 60.0, "output__frames": {"log": [1.0, 1.5]}, "contact__restitution": 1.0}, True),
        ({"run__until": 60.0, "output__frames": 5.0, "contact__restitution": 1.0}, False),
    ],
    ids=["cools", "geometric", "steady"],
)
def test_structure_factor_of_a_gas_that_changes_is_that_of_its_last_frame(keys, is_last, tmp_path):
    scene = {
        "seed": 3,
        "domain": {"packing_fraction": 0.1},
        "species": [{"name": "grain", "count": 300, "radius": 0.5, "mass": 1.0}],
        "contact": {"restitution": 0.8},
    }
    with haff.run(scene, file=tmp_path / "gas.h5", **keys) as run:
        figure = figures.draw(run.file, "structure_factor")
        shown = " ".join(text.get_text() for text in figure.findobj(Text))
        last = f"{run.file.frames[-1].time:.4g}"
    assert ("simulation, one frame" in shown) == is_last and ("simulation, 12 frames" in shown) != is_last
    assert f"t = {last}" in shown if is_last else f"… {last}" in shown


def test_cluster_figure_has_the_sizes_of_the_last_frame(paths):
    with haff.open(paths["sheared"]) as run:
        top, below = figures.draw(run, "clusters").axes
        expected = analysis.clusters(run.frames[-1], 1.1)
        sizes, counts = below.lines[0].get_data()
        assert np.sum(sizes * counts) == len(run) and np.sum(counts) == len(expected.sizes)
        n = expected.sizes.astype(float)
        last = [line.get_ydata()[-1] for line in top.lines]
        assert last == pytest.approx([expected.largest, n @ n / n.sum(), n.mean()], rel=1e-14)
        assert top.lines[0].get_xdata()[-1] == run.frames[-1].time


def test_density_figure_shows_the_frame_that_is_chosen(paths):
    with haff.open(paths["sheared"]) as run:
        values = [figures.draw(run, "density", index=k).axes[0].collections[0].get_array() for k in (0, -1)]
        for value in values:
            assert np.mean(value) == pytest.approx(0.4, rel=1e-3), "the mean is the packing fraction"
        assert not np.array_equal(*values)
        with pytest.raises(NotApplicableError, match="frame 99 of"):
            figures.draw(run, "density", index=99)
    with haff.open(paths["mixture"]) as run:
        panels = [axes for axes in figures.draw(run, "density").axes if axes.get_title(loc="left")]
        assert [axes.get_title(loc="left").split()[0] for axes in panels] == ["mean", "slice"]
        assert np.mean(panels[0].collections[0].get_array()) == pytest.approx(0.2, rel=1e-3)


def test_height_figure_of_an_elastic_gas_over_a_floor(paths):
    with haff.open(paths["layer"]) as run:
        density, temperature, velocity = figures.draw(run, "heights").axes
        z, n = density.lines[0].get_data()
        assert np.sum(n) * (z[1] - z[0]) * 36 == pytest.approx(200, rel=1e-9)
        T = temperature.lines[0].get_ydata()
        mean = run.observables["temperature"][len(run.observables) // 2 :].mean()
        # Elastic: one temperature at all heights; later frames are few, of 200 grains.
        assert np.nanmean(T[:20]) == pytest.approx(mean, rel=0.1)
        assert density.get_xlim() == (0, 40) and velocity.get_xlabel().startswith("height $z$")


@pytest.fixture(scope="module")
def large(tmp_path_factory):
    """Six frames of 10⁵ spheres."""
    rng = np.random.default_rng(1)
    n, side = 100_000, 55.88
    place = np.stack([synthetic.jittered_lattice(rng, n, side, 3, 1.0) for _ in range(6)])
    size = [side] * 3
    return synthetic.write(
        tmp_path_factory.mktemp("large") / "large.h5",
        scene=f"[domain]\nsize = {size}\n",
        size=size,
        boundary=["periodic"] * 3,
        mass=np.ones(n),
        radius=np.full(n, 0.5),
        species=np.zeros(n),
        frames={
            "time": np.arange(6.0),
            "step": np.arange(6) * n * 10,
            "position": place,
            "velocity": np.zeros((6, n, 3)),
            "image": np.zeros((6, n, 3), np.int32),
        },
    )


@pytest.mark.long
@pytest.mark.parametrize(("kind", "most"), [("structure", 5), ("structure_factor", 8), ("clusters", 5), ("density", 5)])
def test_figures_of_many_particles_take_little_processor_time(large, tmp_path, kind, most):
    """About 1.2, 2.2, 1.8 and 1 s; g(r) of all pairs of six frames by freud takes 10 s."""
    package = str(Path(haff.__file__).parents[1])
    environment = {**os.environ, "PYTHONPATH": package, "MPLBACKEND": "Agg"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "haff", "plot", str(large), "--kind", kind, "-o", str(tmp_path)]
    subprocess.run(command, check=True, env=environment, capture_output=True, timeout=HANGS)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    assert seconds < most, f"{seconds:.1f} s of processor time"


def test_distances_of_many_particles_are_a_limited_number(large):
    with haff.open(large) as run:
        frames, _, r_max, bins = structure.sampled(run, structure.MOST_PAIRS)
        found = analysis.pair_distributions(frames, r_max, bins, most_pairs=structure.MOST_PAIRS)
        assert len(frames) == 1 and found.pairs == pytest.approx(structure.MOST_PAIRS, rel=0.1)
        assert found.pairs <= 1e7
