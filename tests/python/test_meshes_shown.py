"""Walls that are meshes: their files, and what pages and figures show of them."""

from __future__ import annotations

import math

import h5py
import numpy as np
import pytest
from matplotlib.collections import LineCollection

import haff
from haff.common.compiled import compiled
from haff.figures import meshes, shapes, solids
from haff.files import mesh as files_of_meshes
from haff.files.extent import Extent
from pages import page_of
from shapes_scenes import (
    MOVES,
    SIZE,
    SPACE,
    arrays_of,
    binary_stl,
    box_triangles,
    is_wall,
    obj,
    off,
    place,
    scene_of,
    text_stl,
)

FORMS = {"text.stl": text_stl, "binary.STL": binary_stl, "box.obj": obj}


@pytest.mark.parametrize("name", FORMS)
def test_meshes_are_read_from_all_forms_of_files(name, tmp_path):
    (tmp_path / name).write_bytes(FORMS[name](box_triangles()))
    # Beside the current directory, that of the file of the run.
    assert np.array_equal(files_of_meshes.read(name, tmp_path), box_triangles())


def test_faces_of_many_corners_are_divided(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0 1.0\nv 0 1 0\nvn 0 0 1\nf 1/1/1 2/2/1 3/3/1 4/4/1\n")
    found = files_of_meshes.read("a.obj", tmp_path)
    assert found[:, :, :2].tolist() == [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]]


@pytest.mark.parametrize(
    ("name", "data", "why"),
    [
        ("a.stl", b"", "is not an STL file"),
        ("a.stl", b"solid\nfacet\nvertex 1 2\n", "is not an STL file"),
        ("a.stl", b"vertex 1 2 x\n" * 3, "is not an STL file"),
        ("a.obj", b"", "no triangles of finite size"),
        ("a.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "no triangles of finite size"),
        ("a.obj", b"v 0 0 0\nf 1 2 3\n", "is not an OBJ file"),
        ("a.obj", b"v 0 0 0\nf x\n", "is not an OBJ file"),
        ("a.ply", b"ply", r"must end in \.stl or \.obj"),
        ("missing.stl", None, "missing.stl is not there"),
        ("a\0.stl", None, "stl"),
    ],
)
def test_files_that_are_no_meshes_are_refused(name, data, why, tmp_path):
    if data is not None:
        (tmp_path / name).write_bytes(data)
    with pytest.raises(files_of_meshes.MeshFault, match=why):
        files_of_meshes.read(name, tmp_path)


def test_a_mesh_that_has_changed_is_not_shown(tmp_path):
    data = binary_stl(box_triangles())
    (tmp_path / "a.stl").write_bytes(data)
    known = compiled().mesh(tmp_path / "a.stl")[1]
    assert len(files_of_meshes.read("a.stl", tmp_path, known)) == 12
    with pytest.raises(files_of_meshes.MeshFault, match="has changed since the run"):
        files_of_meshes.read("a.stl", tmp_path, known[::-1])


def beside(folder):
    """Reads meshes of a folder."""
    return lambda given: files_of_meshes.read(given["file"], folder)


def mesh_run(folder, monkeypatch, **keys):
    monkeypatch.chdir(folder)
    (folder / "box.stl").write_bytes(binary_stl((box_triangles() - 3.0) * 1000))
    mesh = {"file": "box.stl", "scale": 0.001, "point": [3, 3, 3], "side": "outside"}
    haff.run(scene_of({"mesh": mesh, **keys}, 3, ["wall"] * 3), file=folder / "mesh.h5", threads=1)
    return folder / "mesh.h5"


@pytest.mark.parametrize("moves", MOVES)
def test_pages_and_figures_have_meshes(moves, tmp_path, monkeypatch):
    path = mesh_run(tmp_path, monkeypatch, **MOVES[moves])
    page = page_of(path, tmp_path)
    (entry,) = page.header["shapes"]
    vertices, triangles, edges, *_ = arrays_of(page, entry, 3)
    with haff.open(path) as run:
        (wall,) = run.scene["wall"]
        time, position, radius = run.frames.time, run.frames.array("position"), run.radius
    assert vertices.shape == (8, 3) and triangles.shape == (12, 3), "corners in common are one vertex"
    assert edges.shape == (12, 2, 3), "not the diagonals of the faces"
    assert entry["arrays"]["arrays"][1][0] == "Uint16Array"
    mean = place({**wall, "motion": {**wall["motion"], "amplitude": 0}} if "motion" in wall else wall, time[0])
    assert off(wall, vertices, mean).max() < 2e-6
    for t, at in zip(time, position):
        assert (off(wall, at, place(wall, t)) - radius).min() > -1e-9
    figure = haff.plot(path, "snapshot")
    lines = [c for c in figure.axes[0].collections if isinstance(c, LineCollection) and is_wall(c)]
    assert any(len(c.get_segments()) == 12 for c in lines)


def test_meshes_are_turned_and_scaled_as_the_command_does():
    turn = {"file": "box.stl", "scale": 2.0, "point": [1, 2, 3], "rotation": [[0, 0, 2], np.pi / 2]}

    found = meshes.mesh(turn, "both", np.array([0.5, 0, 0]), lambda _: box_triangles())
    x, y, z = np.unique(box_triangles().reshape(-1, 3), axis=0).T
    expected = np.stack([-2 * y + 1.5, 2 * x + 2, 2 * z + 3], axis=1)
    assert np.allclose(np.sort(found.vertices, axis=0), np.sort(expected, axis=0), atol=1e-12)


def test_faces_that_are_turned_over_are_turned_back(tmp_path):
    rng = np.random.default_rng(5)
    for whole in (1, -1):
        triangles = box_triangles()[:, ::whole]
        over = rng.random(12) < 0.4
        triangles[over] = triangles[over][:, ::-1]
        (tmp_path / "a.stl").write_bytes(binary_stl(triangles))
        form = meshes.mesh({"file": "a.stl"}, "inside", np.zeros(3), beside(tmp_path))
        a, b, c = form.vertices[form.faces.T]
        assert np.einsum("fi,fi", a, np.cross(b, c)) / 6 == pytest.approx(18.0)
        files_of_meshes._read.cache_clear()


def test_of_many_faces_the_box_around_them_is_drawn(tmp_path, monkeypatch):
    (tmp_path / "a.stl").write_bytes(binary_stl(box_triangles()))
    monkeypatch.setattr(meshes, "MOST_FACES", 11)
    form = meshes.mesh({"file": "a.stl"}, "inside", np.zeros(3), beside(tmp_path))
    assert form.vertices.shape == (8, 3) and len(form.faces) == 0
    assert sorted(float(np.linalg.norm(b - a)) for a, b in form.edges) == [2.0] * 4 + [3.0] * 8


def test_sections_show_the_form_of_smooth_meshes(tmp_path):
    room = Extent(np.zeros(3), np.full(3, SIZE), np.zeros(3, bool))
    globe = shapes.build(SPACE["globe"], 3, room, np.zeros(3), None).form
    (tmp_path / "a.stl").write_bytes(binary_stl(globe.vertices[globe.faces]))
    form = meshes.mesh({"file": "a.stl"}, "inside", np.zeros(3), beside(tmp_path))
    wires = np.array(form.wires)
    assert len(form.edges) == 0 and len(wires) >= 3 * solids.SEGMENTS
    assert off(SPACE["globe"], wires).max() < 4 * (1 - math.cos(np.pi / solids.SEGMENTS) ** 2)
    assert np.all(np.min(np.ptp(wires, axis=1), axis=1) < 1e-6), "each is in a plane across an axis"


def test_a_run_has_the_triangles_of_its_walls(tmp_path, monkeypatch, capsys):
    """It is drawn and goes on with those it began with, wherever its file is: their own file is gone or has changed."""
    path = mesh_run(tmp_path, monkeypatch)
    with haff.open(path) as run:
        (name, triangles), scene = *run.meshes.items(), run.scene
    assert name == scene["wall"][0]["mesh"]["hash"] and np.array_equal(triangles, 1000 * (box_triangles() - 3))
    before = page_of(path, tmp_path).header["shapes"]
    for change in (lambda file: file.write_bytes(binary_stl(2 * box_triangles())), lambda file: file.unlink()):
        change(tmp_path / "box.stl")
        page = page_of(path, tmp_path)
        assert page.header["notes"] == [] and page.header["shapes"] == before != []
        further = haff.resume(path, file=tmp_path / "further.h5", run__until=3.0, overwrite=True)
        assert further.report["simulated_time"] == 3.0
        with haff.open(tmp_path / "further.h5") as run:
            assert np.array_equal(run.meshes[name], triangles)
    with pytest.raises(haff.HaffError, match=r"file.*other\.stl.*cannot be read"):
        haff.resume(path, file=tmp_path / "x.h5", run__until=3.0, wall__it__mesh__file="other.stl")
    assert capsys.readouterr().err == ""


def test_a_missing_mesh_is_a_note_and_the_page_is_made(tmp_path, monkeypatch, capsys):
    path = mesh_run(tmp_path, monkeypatch)
    (tmp_path / "box.stl").unlink()
    with h5py.File(path, "r+") as file:  # as of a mesh too large to be kept
        del file["parameters/meshes"]
    page = page_of(path, tmp_path)
    note = f"the wall 'it' is not drawn: {tmp_path / 'box.stl'} is not there"
    assert capsys.readouterr().err == f"haff: {note}\n"
    assert page.header["shapes"] == [] and page.header["notes"] == [note]
    figure = haff.plot(path, "snapshot")
    assert "is not there" in " ".join(text.get_text() for text in figure.axes[0].texts).replace("\n", " ")
