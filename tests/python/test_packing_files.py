"""Files of growth runs: boxes of frames, exports, `haff.Packing`, its figure, and `haff.pack`."""

from __future__ import annotations

import gc
import json
import os
import stat
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

import haff
import misuses
import synthetic
from haff import analysis, figures
from haff.errors import ArgumentError, FileError, MissingDataError, NotApplicableError
from test_figures import require_texts_apart
from test_packing import fcc, hexagonal


@pytest.fixture(scope="module")
def paths(tmp_path_factory):
    """Synthetic runs of growth by name."""
    folder = tmp_path_factory.mktemp("grown")
    position, box = fcc(3)
    # The last sphere is loose in its cage, and a species of its own.
    radius = np.where(np.arange(len(position)) == 107, 0.48, 0.5)
    disks, plane = hexagonal(6)
    pressures = (20.0, *np.geomspace(100.0, 1e8, 40))
    walled = np.array([[0.5, 0.5], [1.5, 0.5], [0.5, 1.5], [1.5, 1.5]]) + 1e-9
    return {
        "spheres": synthetic.grown(
            folder / "spheres.h5", position % box.size, radius, box.size, species=radius < 0.5, pressures=pressures
        ),
        "disks": synthetic.grown(
            folder / "disks.h5", disks % plane.size[:2], 0.5, plane.size, pressures=pressures, d=2
        ),
        "walls": synthetic.grown(folder / "walls.h5", walled, 0.5, [2 + 2e-9, 2 + 2e-9, 1], boundary="ww", d=2),
        "fluid": synthetic.grown(folder / "fluid.h5", position % box.size, 0.2, box.size, pressures=(4.0, 5.0)),
    }


# --- boxes of frames -----------------------------------------------------------------------------------


@pytest.mark.long
def test_each_frame_has_its_own_box(paths):
    with haff.open(paths["spheres"]) as run:
        assert run.compression is not None and run.shear is None
        volumes = np.array([frame.box.volume for frame in run.frames])
        np.testing.assert_allclose(volumes, run.samples["box_volume"], rtol=1e-12)
        assert np.all(np.diff(volumes) < 0) and run.box.volume == volumes[0]
        np.testing.assert_array_equal([box.size for box in run.frames.boxes()], [f.box.size for f in run.frames])
        assert [box.volume for box in run.frames[::-2].boxes()] == volumes[::-2].tolist()
        last = run.frames[-1]
        assert np.all(last.position < last.box.size) and run.frames.array("position").shape == (42, 108, 3)
        np.testing.assert_array_equal(last.unwrapped, last.position)
        cell, _ = last.to_freud()
        assert cell.Lx == pytest.approx(last.box.size[0])
        # Distributions are in the box of the frame: the density at the end is that of the crystal.
        g = analysis.pair_distributions([last], 1.2, 12)
        assert g.total[9:11].sum() > 5
        assert "packing fraction 0.247 to 0.74," in figures.draw(run, "snapshot").texts[1].get_text()


def test_positions_and_edges_of_a_shrinking_box_are_checked(paths, tmp_path):
    for place, value, message in [
        ("particles/all/position/value", 5.0, r"position/value\[41, 3, 0\] = 5\.0: must be in the box"),
        ("particles/all/box/edges/value", -1.0, r"box/edges/value\[41, 0\] = -1\.0: must be in \["),
    ]:
        path = tmp_path / "damaged.h5"
        path.write_bytes(paths["spheres"].read_bytes())
        with h5py.File(path, "r+") as file:
            # In the box of the first frame, and beyond that of the last.
            file[place][(41, 3, 0) if "position" in place else (41, 0)] = value
        with haff.open(path) as run:
            assert run.frames[40].position.shape == (108, 3)
            with pytest.raises(FileError, match=message):
                _ = run.frames[-1].position


def test_exports_have_the_box_of_each_frame(paths, tmp_path):
    with haff.open(paths["spheres"]) as run:
        boxes = np.array([box.size for box in run.frames.boxes()])
        text = run.export(tmp_path / "all.extxyz").read_text()
        lattices = [line.split('"')[1].split() for line in text.splitlines() if line.startswith("Lattice")]
        np.testing.assert_array_equal(np.array(lattices, float)[:, [0, 4, 8]], boxes)
        with h5py.File(run.export(tmp_path / "all.vtkhdf")) as vtk:
            np.testing.assert_array_equal(vtk["VTKHDF/FieldData/box_size"], boxes)
            places = vtk["VTKHDF/Steps/FieldDataOffsets/box_size"][:]
            assert places.tolist() == [*range(42)]
            assert vtk["VTKHDF/Steps/FieldDataOffsets/periodic"][:].tolist() == [0] * 42
        gsd = pytest.importorskip("gsd.hoomd", reason="no gsd: pip install 'haff[export]'")
        with gsd.open(str(run.export(tmp_path / "all.gsd"))) as trajectory:
            np.testing.assert_allclose([one.configuration.box[:3] for one in trajectory], boxes, rtol=1e-6)
            for one, frame in zip(trajectory, run.frames):
                where = one.particles.position + frame.box.size / 2
                np.testing.assert_allclose(where, frame.position, atol=1e-5)


def test_state_for_scenes_has_the_box_of_its_frame(paths):
    from haff.scenes import recorded_state

    with haff.open(paths["spheres"]) as run:
        np.testing.assert_array_equal(recorded_state(paths["spheres"])["size"], run.frames[-1].box.size)
        np.testing.assert_array_equal(recorded_state(paths["spheres"], 0)["size"], run.frames[0].box.size)


def test_figures_and_pages_do_not_mix_the_densities_of_a_growing_run(paths, tmp_path):
    with haff.open(paths["spheres"]) as run:
        assert [frame.index for frame in analysis.drawn_frames(run, 5)] == [41]
        assert "t = 41" in figures.draw(run, "structure").texts[-1].get_text()
        with pytest.raises(NotApplicableError, match=r"the edges of the box change with time$"):
            analysis.cooling_law(run)
        notes: list[str] = []
        haff.view(run, tmp_path / "page.html", notes=notes)
        assert any("longest edges" in note for note in notes)
        notes.clear()
        haff.view(run, tmp_path / "last.html", frames=-1, notes=notes)
        edge = float(run.frames[-1].box.size[0])
        assert not notes and f'"size":[{edge!r}' in (tmp_path / "last.html").read_text()


# --- the object ----------------------------------------------------------------------------------------


def test_packing_has_the_last_frame_and_its_contacts(paths):
    with haff.open_packing(paths["spheres"]) as packing:
        assert len(packing) == 108 and packing.dimension == 3
        assert packing.positions.shape == (108, 3) and packing.radii.shape == (108,)
        assert packing.packing_fraction == pytest.approx(np.sum(4 / 3 * np.pi * packing.radii**3) / packing.box.volume)
        assert packing.packing_fraction == pytest.approx(packing.file.samples["packing_fraction"][-1], rel=1e-12)
        # The mean over the last interval, in which p rises by 10^(6/39).
        ratio = 10 ** (6 / 39)
        assert packing.reduced_pressure == pytest.approx(1e8 * np.log(ratio) / (ratio - 1), rel=1e-6)
        assert np.flatnonzero(packing.rattlers).tolist() == [107]
        assert len(packing.contacts) == 6 * 108 - 12 and packing.contact_number == pytest.approx(12 - 12 / 107)
        assert (packing.status, packing.collisions, packing.seed) == ("jammed", 4000, 7)
        assert packing.network.tolerance == pytest.approx(0.5e-5, rel=0.2)
        wide = packing.contact_network(0.03)
        assert not wide.rattlers.any() and wide.contact_number == 12
        order = packing.bond_order()
        assert order.whole == pytest.approx(0.5745, abs=1e-4)
        assert packing.g_r().partial.shape == (2, 2, 500)
        assert packing.g_r(2.0, 10).r[-1] == pytest.approx(1.9)
        assert "108 spheres, packing fraction 0.73969" in repr(packing)
        shown = packing._repr_html_()
        assert "<td" in shown and "jammed" in shown and "11.89" in shown
        with pytest.raises(AttributeError, match="a packing is what its file has"):
            packing.radii = 1.0
    assert "closed" in repr(packing) and "closed" in packing._repr_html_()


def test_fraction_of_jamming_is_that_of_the_run(paths):
    with haff.open_packing(paths["disks"]) as packing:
        fit = packing.jamming_fraction()
        jam = packing.packing_fraction / (1 - 2 / 1e8)
        # The mean pressure of an interval is about that at its middle, where 1 − φ/φ_J changes by 40 % in it.
        assert fit.value == pytest.approx(jam, rel=1e-9) and fit.coefficient == pytest.approx(2.0, rel=0.02)
    with haff.open_packing(paths["walls"]) as packing:
        assert packing.contact_number == 4 and packing.network.backbone_contacts == 12
        with pytest.raises(NotApplicableError, match="periodic box"):
            packing.g_r()


def test_file_without_pressure_has_contacts_by_a_tolerance_only(files, paths):
    with haff.open_packing(files["ball"]) as packing:
        assert packing.status == "unfinished" and "reduced pressure" in packing._repr_html_()
        with pytest.raises(MissingDataError, match=r"no samples of pressure$"):
            _ = packing.contacts
        with pytest.raises(MissingDataError, match=r"no samples of pressure$"):
            packing.jamming_fraction()
        assert packing.contact_network(0.1).rattlers.all()
    with haff.open(paths["fluid"]) as run, pytest.raises(NotApplicableError, match="pressure of frame 0 is not known"):
        analysis.reduced_pressure(run.frames[0])


def test_packing_is_saved_and_exported(paths, tmp_path):
    with haff.open_packing(paths["disks"]) as packing:
        kept = packing.save(tmp_path / "kept.h5")
        assert kept.read_bytes() == paths["disks"].read_bytes()
        with pytest.raises(ArgumentError, match="overwrite=True replaces it"):
            packing.save(kept)
        assert packing.save(kept, overwrite=True) == kept
        with pytest.raises(ArgumentError, match="is the file that is read"):
            packing.save(paths["disks"], overwrite=True)
        assert packing.export(tmp_path / "one.extxyz").read_text().count("Lattice") == 1
        assert packing.export(tmp_path / "all.extxyz", frames=None).read_text().count("Lattice") == 42
        assert len(packing.export(tmp_path / "one.csv").read_text().splitlines()) == 73
        assert len(packing.export(tmp_path / "rows.csv", table="observables").read_text().splitlines()) == 43


def test_scene_from_a_packing_is_valid_and_runs(paths):
    with haff.open_packing(paths["spheres"]) as packing:
        scene = packing.scene(run__until=0.5, contact__restitution=0.9, **{"species__grain 1__radius": 0.48})
        assert scene["domain"]["size"] == packing.box.size.tolist() and scene["run"] == {"until": 0.5}
        assert [kind["radius"] for kind in scene["species"]] == [0.5, 0.48]
        with pytest.raises(ArgumentError, match=r"species__9__mass = 1\.0: the scene has no such place"):
            packing.scene(species__9__mass=1.0)
        grown = packing.scene(growth__rate=1e-3, growth__until_reduced_pressure=1e6)
        assert "run" not in grown and grown["growth"] == {"rate": 1e-3, "until_reduced_pressure": 1e6}
        live = haff.Simulation(scene, threads=1)
        np.testing.assert_array_equal(live.positions, packing.positions)
        np.testing.assert_array_equal(live.radii, packing.radii)
        assert live.packing_fraction == pytest.approx(packing.packing_fraction)
    with haff.open_packing(paths["disks"]) as packing:
        flat = haff.Simulation(packing.scene(run__until=0.5), threads=1)
        assert flat.box.dimension == 2 and len(flat) == 72


# --- the figure ----------------------------------------------------------------------------------------


def test_figure_has_contacts_as_lines_and_rattlers_in_another_color(paths, tmp_path):
    with haff.open_packing(paths["disks"]) as packing:
        figure = packing.plot(tmp_path / "disks.png")
        assert (tmp_path / "disks.png").stat().st_size > 10_000
        disks, lines = figure.axes[0].collections
        # 72 · 3 contacts, each from both of its disks.
        assert len(lines.get_segments()) == 2 * 216
        segment = np.array(lines.get_segments())
        np.testing.assert_allclose(np.linalg.norm(segment[:, 1] - segment[:, 0], axis=1), 1.0, rtol=1e-6)
        assert len(np.unique(disks.get_facecolors(), axis=0)) == 1
        assert "Z = 6.000 (isostatic 3.972),  0 rattlers" in figure.texts[1].get_text()
        assert not packing.plot(tolerance=1e-13).axes[0].collections[1].get_segments()
    with haff.open_packing(paths["spheres"]) as packing:
        figure = packing.plot()
        assert len(np.unique(figure.axes[0].collections[0].get_facecolors(), axis=0)) <= 2
        assert "layer" in figure.texts[0].get_text() and "1 rattler" in figure.texts[1].get_text()
    with haff.open_packing(paths["walls"]) as packing:
        segments = packing.plot().axes[0].collections[1].get_segments()
        assert len(segments) == 2 * 4 + 8


def test_figure_needs_a_dense_state_and_a_closed_box(paths, files):
    for path, message in [
        (paths["fluid"], "contacts need a packing: the reduced pressure is 4.4.*, below 10"),
        (files["ball"], "needs a box with periodic faces or walls"),
        (files["cooling"], "contacts need a packing: the reduced pressure is 1.*, below 10"),
    ]:
        with haff.open(path) as run, pytest.raises(NotApplicableError, match=message):
            run.plot("contacts")


@pytest.mark.parametrize("name", ["spheres", "disks", "walls"])
def test_no_text_of_the_figure_is_cut_off(paths, name, monkeypatch):
    require_texts_apart(paths[name], "contacts", monkeypatch)


# --- haff.pack -----------------------------------------------------------------------------------------

FAKE = """#!{python}
import json, pathlib, shutil, sys
words = sys.argv[1:]
output = pathlib.Path(next(word for word in words if word.startswith("--output=")).partition("=")[2])
pathlib.Path({log!r}).write_text(json.dumps(words))
if "--seed=13" in words:
    print(json.dumps({{"error": "jammed at packing fraction 0.63", "problems": []}}))
    sys.exit(3)
shutil.copyfile({file!r}, output)
print(json.dumps({{"file": str(output), "warnings": ["slow"] if "--seed=5" in words else []}}))
"""


@pytest.fixture
def fake(paths, tmp_path, monkeypatch):
    """A stand-in for the command, which writes a synthetic packing; returns a function with the words it was given."""
    script, log = tmp_path / "fake", tmp_path / "words.json"
    script.write_text(FAKE.format(python=sys.executable, log=str(log), file=str(paths["spheres"])))
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("HAFF", str(script))
    return lambda: json.loads(log.read_text())


def test_pack_hands_its_arguments_to_the_command(fake, tmp_path):
    packing = haff.pack(108, 0.6, seed=1)
    assert packing.status == "jammed" and len(packing) == 108
    *words, output = fake()
    expected = "pack 108 --json --dimension=3 --packing-fraction=0.6 --container=periodic --seed=1 --quiet"
    assert words == expected.split() and output == f"--output={packing.path}"
    haff.pack(
        7, sizes=[0.5, 0.7], dimension=2, container="box", rate=1e-3, threads=1, path=tmp_path / "x.h5", overwrite=True
    )
    assert fake() == [
        *"pack 7 --json --dimension=2 --jammed --container=box --seed=0".split(),
        "--sizes={ list = [0.5, 0.7] }",
        *"--reduced-pressure=1000000000.0 --rate=0.001 --threads=1 --quiet --overwrite".split(),
        f"--output={tmp_path / 'x.h5'}",
    ]
    haff.pack(7, 0.95, sizes={"lognormal": (0.5, 0.1)})
    assert "--sizes={ lognormal = [0.5, 0.1] }" in fake() and "--packing-fraction=0.95" in fake()
    haff.pack(7, sizes=np.float64(0.25), reduced_pressure=1e5)
    assert "--sizes=0.25" in fake() and "--reduced-pressure=100000.0" in fake()


def test_temporary_file_of_a_packing_lives_as_long_as_it_is_used(fake):
    packing = haff.pack(108)
    path, frames = packing.path, packing.file.frames
    del packing
    gc.collect()
    assert path.exists() and frames[-1].position.shape == (108, 3)
    del frames
    gc.collect()
    assert not path.parent.exists()


def test_failures_and_warnings_of_the_command_are_those_of_python(fake):
    with pytest.raises(haff.SimulationError, match=r"jammed at packing fraction 0\.63"):
        haff.pack(108, 0.7, seed=13)
    with pytest.warns(RuntimeWarning, match="slow"):
        haff.pack(108, 0.7, seed=5)


NO_FRACTION = {
    **misuses.without(misuses.NO_REAL, "text"),
    **misuses.BEYOND,
    "zero": 0.0,
    "negative": -0.5,
    "one": 1.0,
    "denser than fcc": 0.7405,
    "word": "jam",
}
NO_SIZES = {
    **misuses.without(misuses.NO_NUMBERS, "none", "dict"),
    **misuses.BEYOND,
    "zero": 0.0,
    "negative": [0.5, -0.5],
    "none of them": [],
    "nested": [[0.5]],
    "nan": [0.5, np.nan],
}
NOT_FOR_PACK = {
    "n": {**misuses.NO_COUNT, "zero": 0, "one": 1, "many": 10**9},
    "packing_fraction": NO_FRACTION,
    "sizes": NO_SIZES,
    "dimension": misuses.NO_DIMENSION,
    "container": {**misuses.NO_NAME, "walls": "walls"},
    "aspect": misuses.without(misuses.NO_POSITIVE, "none"),
    "rate": misuses.without(misuses.NO_POSITIVE, "none"),
    "reduced_pressure": {**misuses.NO_POSITIVE, "one": 1.0, "beyond rounding": 1e13},
    "seed": misuses.NO_COUNT,
    "path": misuses.without(misuses.NO_PATH, "none"),
    "overwrite": misuses.NO_FLAG,
    "threads": misuses.without({**misuses.NO_COUNT, "zero": 0}, "none"),
    "progress": misuses.NO_FLAG,
}


@pytest.mark.parametrize("parameter", NOT_FOR_PACK)
def test_wrong_arguments_of_pack_are_refused_before_the_command_runs(parameter, monkeypatch):
    monkeypatch.setenv("HAFF", os.devnull)
    for name, value in NOT_FOR_PACK[parameter].items():
        with pytest.raises(ArgumentError, match=rf"^{parameter} = ") as caught:
            haff.pack(**({"n": 10, "packing_fraction": 0.5} | {parameter: value}))
        assert len(str(caught.value)) < 300 and str(caught.value).isprintable(), name


def test_long_lists_of_sizes_are_refused(monkeypatch):
    monkeypatch.setenv("HAFF", os.devnull)
    with pytest.raises(ArgumentError, match=r"sizes = .*: too long, .* characters; give a distribution or a table"):
        haff.pack(100_000, sizes=np.linspace(0.5, 0.7, 100_000))


# --- packings by the command ---------------------------------------------------------------------------


@pytest.mark.physics
@pytest.mark.parametrize(("dimension", "sizes", "fraction"), [(3, None, 0.55), (2, [0.5, 0.7], 0.8)])
def test_growth_ends_on_the_packing_fraction(dimension, sizes, fraction):
    with haff.pack(200, fraction, sizes=sizes, dimension=dimension, seed=1) as packing:
        assert packing.packing_fraction == pytest.approx(fraction, rel=1e-12)
        assert packing.status == "packing_fraction" and packing.collisions > 1000
        frame = packing.frame
        assert analysis.max_overlap(frame).depth < 1e-10
        radii = packing.file.radius
        assert set(np.unique(radii)) == ({0.5} if sizes is None else {0.5, 0.7})


@pytest.mark.long
@pytest.mark.physics
def test_jammed_disks_of_two_sizes_are_isostatic():
    # Of fast growth contacts are missing.
    with haff.pack(200, "jammed", sizes=[0.5, 0.7], dimension=2, rate=2e-3, seed=2) as packing:
        network = packing.network
        assert packing.reduced_pressure > 5e8 and packing.status == "jammed"
        assert packing.packing_fraction == pytest.approx(0.846, abs=0.01)
        assert abs(network.backbone_contacts - network.isostatic_contacts) <= 0.01 * network.isostatic_contacts
        fit = packing.jamming_fraction()
        assert fit.value == pytest.approx(packing.packing_fraction / (1 - 2 / packing.reduced_pressure), abs=1e-9)
        # Growth does not heat rattlers, so that the backbone has all of the energy.
        assert fit.coefficient == pytest.approx(2, rel=0.03)
        energy = np.sum(packing.frame.thermal_velocity**2, axis=1)
        assert np.median(energy[packing.rattlers]) < 1e-3 * energy.mean()


@pytest.mark.long
@pytest.mark.physics
def test_fast_growth_to_a_dense_fluid_and_slow_growth_from_there_jam_without_order(tmp_path):
    with haff.pack(200, 0.62, rate=0.015, seed=1) as start:
        slow = {"growth__rate": 3e-3, "growth__temperature": 1.0, "growth__until_reduced_pressure": 1e9}
        haff.run(start.scene(**slow), file=tmp_path / "jammed.h5", threads=1)
    with haff.open_packing(tmp_path / "jammed.h5") as packing:
        network = packing.network
        assert packing.status == "jammed" and packing.packing_fraction == pytest.approx(0.643, abs=0.006)
        assert network.backbone_contacts == pytest.approx(network.isostatic_contacts, rel=0.02)
        assert packing.rattlers.sum() < 12 and packing.bond_order().whole < 0.2


@pytest.mark.physics
def test_growth_to_a_lower_pressure_has_not_jammed():
    with haff.pack(100, "jammed", sizes=[0.5, 0.7], dimension=2, rate=0.03, reduced_pressure=100.0, seed=2) as packing:
        assert packing.status == "reduced_pressure" and 30 < packing.reduced_pressure < 200


@pytest.mark.physics
def test_packing_between_walls_touches_them():
    with haff.pack(100, "jammed", container="box", seed=3) as packing:
        assert packing.box.boundary == ("wall",) * 3 and len(packing.network.contacts.wall_rows) > 20
        assert analysis.max_overlap(packing.frame).depth < 1e-10


@pytest.mark.long
@pytest.mark.physics
@pytest.mark.parametrize(
    ("container", "options", "turns"),
    [
        ("cylinder", {"aspect": 1.5}, 1),
        ("tube", {"aspect": 3.0}, 2),
        ("sphere", {}, 3),
        ("cylinder", {"dimension": 2}, 1),
    ],
)
def test_a_packing_in_a_container_touches_it_and_starts_scenes(container, options, turns, tmp_path):
    sizes = [0.5, 0.6]
    with haff.pack(200, "jammed", container=container, sizes=sizes, rate=0.01, seed=2, **options) as packing:
        found, room = packing.network, packing.box.container
        # The volume of the container, from its shape.
        shape = room.wall[room.kind]
        r, length = shape["radius"], 2 * shape["radius"] * options.get("aspect", 2.0)
        disks = packing.dimension == 2
        volume = np.pi * r**2 * (1.0 if disks else 4 / 3 * r if container == "sphere" else length)
        filled = np.sum(np.pi * packing.radii**2 if disks else 4 / 3 * np.pi * packing.radii**3)
        assert packing.packing_fraction == pytest.approx(filled / volume, rel=1e-12)
        assert packing.file.observables["packing_fraction"].iloc[-1] == pytest.approx(filled / volume, rel=1e-12)
        assert packing.status == "jammed" and packing.packing_fraction > (0.75 if disks else 0.5)
        # Nothing is outside, the container is touched, and the walls of the box around it are not.
        nearest = np.min([part(packing.positions)[0] for part in room.parts()], axis=0) - packing.radii
        assert -1e-12 < nearest.min() < 1e-7
        assert len(found.contacts.wall_rows) > 15 and set(found.contacts.wall_sides[:, 0]) == {3}
        foot = packing.positions[found.contacts.wall_rows] + found.contacts.wall_vector
        assert np.min([np.abs(part(foot)[0]) for part in room.parts()], axis=0).max() < 1e-12
        assert found.periodic == turns
        assert found.backbone_contacts == pytest.approx(found.isostatic_contacts, rel=0.05)
        packing.plot(tmp_path / "contacts.png")
        start = packing.scene(run__until=0.05)
        with haff.run(start, file=tmp_path / "run.h5").file as run:
            last = run.frames[-1]
            outside = np.min([part(last.position)[0] for part in room.parts()], axis=0) - last.radius
            assert outside.min() > -1e-12 and run.samples["wall_collisions"][-1] > 1000


@pytest.mark.physics
def test_packings_are_determined_by_their_seed(tmp_path):
    first, second, other = (
        haff.pack(60, 0.55, seed=seed, path=tmp_path / f"{k}.h5", threads=threads)
        for k, (seed, threads) in enumerate([(4, 1), (4, 2), (5, 1)])
    )
    np.testing.assert_array_equal(first.positions, second.positions)
    assert not np.array_equal(first.positions, other.positions)
    with pytest.raises(FileError, match="overwrite=True"):
        haff.pack(60, 0.55, path=Path(tmp_path / "0.h5"))
