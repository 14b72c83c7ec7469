"""Walls that are no planes in pages and figures: where they are drawn, how they move, and what readers make of them."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection

import haff
from haff.analysis import experiment
from haff.command.main import main
from haff.errors import FileError, NotApplicableError
from haff.figures import shapes, solids
from haff.files.extent import Extent
from haff.files.scene import SHAPES, parsed, shape_of, shaped_walls
from pages import in_node, page_of, seek
from shapes_scenes import ALL, MOVES, NAMES, PLANE, SIZE, SPACE, arrays_of, is_wall, off, place, scene_of, unit


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The file of a wall with a motion; each is made once."""
    folder, done = tmp_path_factory.mktemp("shapes"), {}

    def of(name, d, moves="still"):
        key = (name, d, moves)
        if key not in done:
            done[key] = folder / f"{len(done)}.h5"
            wall = (SPACE if d == 3 else PLANE)[name]
            haff.run(scene_of({**wall, **MOVES[moves]}, d), file=done[key], threads=1)
        return done[key]

    return of


# --- readers -------------------------------------------------------------------------------------------


def test_all_walls_of_their_own_shape_are_found_in_the_order_of_their_rows():
    walls = [
        {"name": "x-", "sticks": True},
        {"name": "a", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}},
        {"name": "b", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1], "extent": [1, 1]}},
        *({"name": key, **SPACE[name]} for name, key in (("tube", "c"), ("ball", "d"), ("funnel", "e"))),
        {"name": "f", "mesh": {"file": "a.stl"}},
        {"name": "g", "surface": "torus"},
    ]
    assert [wall["name"] for wall in shaped_walls({"wall": walls})] == list("abcdefg")
    kinds = [shape_of(wall) for wall in walls]
    assert kinds == [None, "plane", "rectangle", "cylinder", "sphere", "cone", "mesh", "surface"]


@pytest.mark.parametrize(("name", "d"), ALL, ids=NAMES)
def test_readers_take_no_shape_for_a_half_space(name, d, made):
    with haff.open(made(name, d)) as run:
        assert run.wall_names == ["it"] and experiment.count_walls(run) == 1
        with pytest.raises(NotApplicableError, match="no plane without end"):
            experiment.plane(run, 0)
        assert experiment.driven(run, 0) == "" and experiment.wall_restitution(run, "grain", 0) == 1.0


def test_walls_that_turn_or_are_passed_have_no_theory_of_a_floor(tmp_path):
    ball = {"name": "ball", "position": [0, 0, 1], "velocity": [0, 0, 0], "radius": 0.1, "mass": 1.0}
    floor = {"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    base = {
        "schema": 1,
        "domain": {"boundary": ["open"] * 3, "gravity": [0, 0, -1.0]},
        "particle": [ball],
        "run": {"until": 4.0},
        "output": {"frames": 0.5, "events": True},
    }
    below = {"name": "below", "plane": {"point": [0, 0, -3], "normal": [0, 0, 1]}}
    haff.run({**base, "wall": [{**floor, "rotation": {"rate": 1.0}}]}, file=tmp_path / "turns.h5")
    haff.run({**base, "wall": [{**floor, "passes": ["ball"]}, below]}, file=tmp_path / "passed.h5")
    with haff.open(tmp_path / "turns.h5") as run, pytest.raises(NotApplicableError, match="rotates"):
        experiment.heights(run)
    with haff.open(tmp_path / "passed.h5") as run:
        assert len(experiment.heights(run)) == 1, "the floor that it hits is no other"
        with pytest.raises(NotApplicableError, match="pass through the wall 'floor'"):
            experiment.plane(run, 0)


@pytest.mark.parametrize(
    ("wall", "message"),
    [
        ('cylinder = { point = [0, 0, 0], axis = [0, 0, 0], radius = 1.0 }', "wall[0].cylinder.axis"),
        ('cone = { apex = [0, 0, 0], axis = [0, 0, 1], angle = 1.6 }', "below π/2"),
        ('sphere = { center = [0, 0], radius = -1.0 }', "wall[0].sphere.radius = -1.0"),
        ('mesh = { file = "a.stl", rotation = [[0, 0, 0], 1.0] }', "wall[0].mesh.rotation[0]"),
        ('mesh = { file = "a.stl", rotation = [1.0, 1.0] }', "wall[0].mesh.rotation[0] = 1.0"),
        ('plane = { point = [0, 0, 0], normal = [0, 0, 1], extent = [1, 1], along = [0, 0, 0] }', "plane.along"),
    ],
)  # fmt: skip
def test_shapes_of_damaged_scenes_are_refused(wall, message):
    with pytest.raises(Exception, match=r"must be") as caught:
        parsed(f"schema = 1\n[[wall]]\nname = 'a'\n{wall}\n")
    assert message in str(caught.value)


# --- pages ---------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize(("name", "d"), ALL, ids=NAMES)
@pytest.mark.parametrize("moves", MOVES)
def test_pages_have_each_shape_where_it_is(name, d, moves, made, tmp_path):
    path = made(name, d, moves)
    page = page_of(path, tmp_path)
    (entry,) = page.header["shapes"]
    with haff.open(path) as run:
        (wall,) = run.scene["wall"]
        time, position, radius = run.frames.time, run.frames.array("position"), run.radius
    assert page.header["notes"] == [] and page.header["walls"] == []
    assert entry["name"] == "it" and entry["kind"] == shape_of(wall) and not entry["passes"]
    vertices, triangles, edges, wires, marks, strips, _ = arrays_of(page, entry, d)
    assert not len(marks)
    # The way from there that the page computes.
    program = f"""
        const at = {json.dumps(time.tolist())};
        console.log(JSON.stringify(at.map((t) => moved({json.dumps(entry)}, t))));
    """
    shifts = np.array(in_node(tmp_path, ["surroundings.js"], program, page.header))
    # Single precision of numbers up to 20.
    close = 2e-6
    for t, shift, at in zip(time, shifts, position):
        here = place(wall, t)
        flat = np.pad(strips.reshape(-1, 2), ((0, 0), (0, 1)))
        for points in (vertices, edges.reshape(-1, 3), wires.reshape(-1, 3), flat):
            assert off(wall, points + shift, here).max(initial=0.0) < close
        # The grains touch the same surface, and are not in it.
        assert (off(wall, at, here) - radius).min() > -1e-9
    if d == 2:
        assert len(strips) and not len(edges) and (len(triangles) > 0) == (entry["side"] == "outside")
        middles = np.pad(strips.mean(axis=1), ((0, 0), (0, 1))) + shifts[0]
        assert off(wall, middles, place(wall, time[0])).max() < 4.0 * (1 - math.cos(math.pi / solids.SEGMENTS)) + close
    else:
        assert len(triangles) and not len(strips)
        a, b, c = vertices[triangles.T]
        assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 0
        middles = (a + b + c) / 3 + shifts[0]
        largest = np.ptp(vertices, axis=0).max() / 2
        assert off(wall, middles, place(wall, time[0])).max() < largest * (1 - math.cos(2 * math.pi / solids.SEGMENTS))


AREAS = {
    "drum": (2 * np.pi * 3.4 * 7.0 + 2 * np.pi * 3.4**2, np.pi * 3.4**2 * 7.0),
    "ball": (4 * np.pi * 1.5**2, 4 / 3 * np.pi * 1.5**3),
    "open tube": (2 * np.pi * 1.5 * 3.0, None),
    "funnel": (np.pi * math.tan(0.5) / math.cos(0.5) * (9 - 1), None),
    "spike": (
        np.pi * 16 * math.tan(0.3) * (1 / math.cos(0.3) + math.tan(0.3)),
        np.pi * (4 * math.tan(0.3)) ** 2 * 4 / 3,
    ),
    "plate": (6.0, None),
    "turned plate": (6.0, None),
}


@pytest.mark.parametrize("name", AREAS)
def test_triangles_are_all_of_a_surface_and_seen_from_outside(name):
    room = Extent(np.zeros(3), np.full(3, SIZE), np.zeros(3, bool))
    form = shapes.build(SPACE[name], 3, room, np.zeros(3), None).form
    a, b, c = form.vertices[form.faces.T]
    area, volume = AREAS[name]
    # Chords of circles: π²/6 /96² of the area and π²/3·2/96² of the volume, and twice that on a sphere.
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(area, rel=2e-3)
    if volume is not None:
        assert np.einsum("fi,fi", a, np.cross(b, c)) / 6 == pytest.approx(volume, rel=2e-3)


@pytest.mark.long
@pytest.mark.parametrize("name", ["drum", "globe", "plate"])
def test_the_extent_of_the_view_has_finite_walls_in_it_as_they_move(name, made, tmp_path):
    for moves in ("still", "steady", "sine"):
        page = page_of(made(name, 3, moves), tmp_path)
        vertices = arrays_of(page, page.header["shapes"][0], 3)[0]
        low, high = np.array(page.header["shown"])
        with haff.open(made(name, 3, moves)) as run:
            wall, time = run.scene["wall"][0], run.frames.time
        way = [place(wall, t) - place(wall, time[0]) for t in np.linspace(time[0], time[-1], 20)]
        if moves == "sine":
            way = [shift + place(wall, time[0]) for shift in way]
        for shift in way:
            assert np.all(vertices + shift > low - 1e-5) and np.all(vertices + shift < high + 1e-5)
        space = in_node(tmp_path, ["surroundings.js"], "console.log(JSON.stringify(room()));", page.header)
        assert np.all(np.array(space["low"]) <= low) and np.all(np.array(space["high"]) >= high)


def test_walls_without_end_are_cut_at_the_box_and_large_obstacles_do_not_shrink_the_view():
    box = Extent(np.zeros(3), np.array([8.0, 6.0, 4.0]), np.ones(3, bool))
    wall = {"cylinder": {"point": [4, 3, 2], "axis": [1, 0.3, 0], "radius": 1.5, "side": "outside"}}
    form = shapes.build(wall, 3, box, np.zeros(3), None).form
    assert off(wall, form.vertices).max() < 1e-12
    # All lines along it reach from face to face.
    assert np.all(form.vertices > -1e-6) and np.all(form.vertices < box.size + 1e-6)
    assert (
        np.isclose(form.vertices[:, 0], 0, atol=1e-6).sum() == np.isclose(form.vertices[:, 0], 8, atol=1e-6).sum() > 40
    )

    earth = {"name": "earth", "sphere": {"center": [0, 0, -1e4], "radius": 1e4, "side": "outside"}}
    file = SimpleNamespace(dimension=3, path=Path("a.h5"), scene={"wall": [earth]}, compression=None)
    found = shapes.find(file, Extent(np.zeros(3), np.ones(3), np.zeros(3, bool)), 0.0)
    assert len(found.shapes) == 1 and found.room.size.max() <= 1 + 2 * shapes.FARTHEST


@pytest.mark.long
@pytest.mark.parametrize("d", [2, 3])
def test_marks_turn_with_their_wall(show, tmp_path, d):
    rate = -0.7
    wall = {**(SPACE["ball"] if d == 3 else PLANE["disk"]), "rotation": {"rate": rate}}
    if d == 3:
        wall["rotation"]["axis"] = [0, 1, 1]
    haff.run(scene_of(wall, d, ["wall"] * d), file=tmp_path / "a.h5")
    page = show(tmp_path / "a.h5")
    places = []
    for time in (0.0, 1.0):
        seek(page, time)
        found = page.evaluate(
            """() => { const [part] = haffView.player.surroundings.turning[0]; part.updateMatrixWorld();
                const at = part.geometry.getAttribute("position"), found = [];
                for (let k = 0; k < at.count; k++)
                  found.push(new THREE.Vector3().fromBufferAttribute(at, k).applyMatrix4(part.matrixWorld).toArray());
                return found; }"""
        )
        places.append(np.array(found) - [4, 4, 4 * (d == 3)])
    before, after = places
    axis = unit([0, 1, 1] if d == 3 else [0, 0, 1])
    c, s = math.cos(rate), math.sin(rate)
    expected = c * before + s * np.cross(axis, before) + (1 - c) * (before @ axis)[:, None] * axis
    assert len(before) >= 12 and np.allclose(after, expected, atol=1e-5) and not np.allclose(before, after, atol=0.1)
    if d == 3:
        assert np.allclose(np.linalg.norm(before, axis=1), 1.5, atol=1e-5)


@pytest.mark.long
def test_faces_of_the_box_and_planes_that_turn_have_marks(show, tmp_path):
    plane = {"name": "lid", "plane": {"point": [4, 4, 7], "normal": [0, 0, -1]}, "rotation": {"rate": 1.0}}
    scene = scene_of(SPACE["ball"], 3, ["wall"] * 3)
    scene["wall"] += [plane, {"name": "x+", "rotation": {"rate": 0.5, "point": [8, 3, 4]}}]
    haff.run(scene, file=tmp_path / "a.h5")
    page = show(tmp_path / "a.h5")
    seek(page, 0.5)
    found = page.evaluate(
        """haffView.player.surroundings.turning.map(([part, point, axis, rate]) => {
            const at = [...part.geometry.getAttribute("position").array];
            return [at.map((x, k) => x + point[k % 3]), axis.toArray(), rate]; })"""
    )
    by_rate = {rate: (np.array(at).reshape(-1, 3), axis) for at, axis, rate in found}
    lid, face = by_rate[1.0], by_rate[0.5]
    assert np.allclose(lid[0][:, 2], 7) and lid[1] == [0, 0, -1]
    assert np.allclose(np.linalg.norm(lid[0][:192] - [4, 4, 7], axis=1), 4, atol=1e-5)
    # The largest circle about the point in the face.
    assert np.allclose(face[0][:, 0], 8) and face[1] == [-1, 0, 0]
    assert np.allclose(np.linalg.norm(face[0][:192] - [8, 3, 4], axis=1), 3, atol=1e-5)


@pytest.mark.long
def test_containers_are_open_towards_the_viewer_and_obstacles_are_whole(show, tmp_path):
    """One small grain beside the middle of the view, which shows what is drawn of the sphere there."""
    seen = {}
    for side in ("inside", "outside", "both"):
        scene = scene_of({"sphere": {"center": [4, 4, 4], "radius": 3.0, "side": side}}, 3, ["open"] * 3)
        del scene["species"]
        away = 2.0 if side == "inside" else 3.5
        grain = {"name": "g", "position": [4, 4, 4 + away], "velocity": [0, 0, 0.1], "radius": 0.2, "mass": 1.0}
        scene |= {"particle": [grain], "run": {"until": 1.0}}
        haff.run(scene, file=tmp_path / f"{side}.h5")
        page = show(tmp_path / f"{side}.h5")
        picture = seek(page, 0.5)
        at = page.evaluate("haffView.player.pixel([4, 4, 4])")
        x, y = round(at["x"]), round(at["y"])
        corner, middle = picture[3, 3], picture[y - 2 : y + 3, x - 2 : x + 3].mean(axis=(0, 1))
        sides = page.evaluate(
            """haffView.player.surroundings.parts.filter((part) => part.isMesh)
                 .map(({ material }) => [material.side, material.depthWrite])"""
        )
        assert sides == [[{"inside": 1, "outside": 0, "both": 2}[side], False]]
        seen[side] = np.abs(middle - corner).sum()
    assert 20 < seen["inside"] < 0.75 * seen["outside"], seen
    assert seen["inside"] < seen["both"] < seen["outside"], seen


@pytest.mark.long
def test_lines_of_the_plane_are_drawn_beside_the_grains(show, tmp_path):
    wall = {**PLANE["circle"], "passes": []}
    haff.run(scene_of(wall, 2), file=tmp_path / "a.h5")
    page = show(tmp_path / "a.h5")
    picture = seek(page, 0.5)
    low, high = page.evaluate("[haffView.player.surroundings.space.low, haffView.player.surroundings.space.high]")
    thick = 0.006 * max(high[k] - low[k] for k in (0, 1))
    color = np.array([0xB9, 0xA7, 0x7F])
    for angle in np.linspace(0, 2 * np.pi, 12, endpoint=False):
        rim = 4 + thick / 2
        at = page.evaluate("p => haffView.player.pixel(p)", [4 + rim * math.cos(angle), 4 + rim * math.sin(angle), 0])
        x, y = int(at["x"]), int(at["y"])
        near = picture[y - 1 : y + 2, x - 1 : x + 2].reshape(-1, 3)
        assert np.abs(near - color).sum(axis=1).min() < 40, angle


# --- walls that are passed -------------------------------------------------------------------------------


@pytest.mark.long
def test_walls_that_are_passed_are_fainter_in_pages_and_dashed_in_figures(show, tmp_path):
    walls = {"kept": [], "passed": ["grain"]}
    opacities, styles = {}, {}
    for name, passes in walls.items():
        scene = scene_of({**SPACE["shell"], "passes": passes}, 3, ["wall"] * 3)
        plane = {"point": [1, 0, 0], "normal": [1, 0, 0], "two-sided": True}
        scene["wall"].append({"name": "p", "plane": plane, "passes": passes})
        haff.run(scene, file=tmp_path / f"{name}.h5")
        page = show(tmp_path / f"{name}.h5")
        found = page.evaluate(
            """haffView.player.surroundings.parts.slice(1).filter((p) => p.isMesh)
                 .map((p) => p.material.uniforms ? p.material.uniforms.opacity.value : p.material.opacity)"""
        )
        opacities[name] = sorted(found)
        figure = haff.plot(tmp_path / f"{name}.h5", "snapshot")
        lines = [c for c in figure.axes[0].collections if isinstance(c, LineCollection) and is_wall(c)]
        styles[name] = {c.get_linestyle()[0][1] is not None for c in lines if len(c.get_segments())}
    assert [a / b for a, b in zip(opacities["passed"][-2:], opacities["kept"][-2:])] != [1.0, 1.0]
    assert sum(opacities["passed"]) < sum(opacities["kept"]) - 0.2
    assert styles == {"kept": {False}, "passed": {True}}


# --- figures -----------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize(("name", "d"), ALL, ids=NAMES)
@pytest.mark.parametrize("moves", ["still", "sine"])
def test_snapshots_show_the_shapes(name, d, moves, made, tmp_path):
    path = made(name, d, moves)
    assert main(["plot", str(path), "--kind", "snapshot", "-o", str(tmp_path)]) == 0
    figure = haff.plot(path, "snapshot")
    lines = [c for c in figure.axes[0].collections if isinstance(c, LineCollection) and is_wall(c)]
    segments = [segment for c in lines for segment in c.get_segments()]
    assert segments
    with haff.open(path) as run:
        (wall,) = run.scene["wall"]
        here = place(wall, run.frames.time[-1])
    if d == 2:
        for points in segments:
            assert off(wall, np.pad(points, ((0, 0), (0, 1))), here).max() < 1e-9
        filled = [c for c in figure.axes[0].collections if isinstance(c, PolyCollection)]
        side = next(iter(wall[k] for k in SHAPES if k in wall)).get("side")
        assert bool(filled) == (side == "outside")
    axes = figure.axes[0]
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    if name in ("drum", "globe", "circle", "disk", "line", "plate"):
        points = np.concatenate(segments)
        assert np.all(points > [left, bottom]) and np.all(points < [right, top]), "all of it is in the picture"


def test_lines_behind_particles_are_hidden_by_them():
    from haff.figures import walls
    from haff.figures.render import Camera, spheres

    camera = Camera(np.eye(3))
    picture = spheres(np.zeros((1, 3)), np.ones(1), np.ones((1, 3)), camera, (-2, 2, -2, 2), 400)
    assert picture.depth.shape == picture.rgba.shape[:2]
    # At the height 0.5 the sphere is nearer than x² + z² = 1, |x| < 0.866.
    line = np.array([[-2.0, 0, 0.5], [2.0, 0, 0.5]])
    parts = walls.in_front(walls.fine(line, 0.01), picture)
    assert len(parts) == 2
    ends = np.sort([part[[0, -1], 0] for part in parts], axis=None)
    assert np.allclose(ends, [-1, -math.sqrt(0.75), math.sqrt(0.75), 1], atol=0.03)
    up = np.array([0, 0, 1.0])
    assert walls.in_front(line + up, picture) and not walls.in_front(line - 2 * up, picture)


@pytest.mark.long
@pytest.mark.parametrize("d", [2, 3])
def test_paths_are_drawn_in_their_container(d, tmp_path):
    ball = {"name": "a", "position": [0.3, 0.4] if d == 2 else [0.3, 0, 0.4], "velocity": [1, 0, 0][:d]}
    wall = (
        {"cylinder": {"point": [0, 0], "radius": 1.0}} if d == 2 else {"sphere": {"center": [0, 0, 0], "radius": 1.0}}
    )
    scene = scene_of(wall, d)
    del scene["species"], scene["initial"]
    scene["particle"] = [{**ball, "radius": 0.1, "mass": 1.0}]
    scene["domain"]["gravity"] = [0, -1.0] if d == 2 else [0, 0, -1.0]
    haff.run(scene, file=tmp_path / "a.h5")
    axes = haff.plot(tmp_path / "a.h5", "paths").axes[0]
    (lines,) = (c for c in axes.collections if isinstance(c, LineCollection) and is_wall(c))
    points = np.concatenate(lines.get_segments())
    assert np.abs(np.linalg.norm(points, axis=1) - 1).max() < 1e-2 and len(points) > 90
    assert np.ptp(axes.get_xlim()) > 2 and np.ptp(axes.get_ylim()) > 2
    # Other figures of few bodies are drawn, or say why not.
    assert main(["plot", str(tmp_path / "a.h5"), "-o", str(tmp_path / "all")]) == 0


def test_planes_are_lines_of_snapshots(tmp_path):
    partition = {"point": [4, 4], "normal": [1, 0], "hole": {"center": [4, 3], "radius": 1.0}}
    scene = scene_of({"plane": partition}, 2, ["wall"] * 2)
    haff.run(scene, file=tmp_path / "a.h5")
    axes = haff.plot(tmp_path / "a.h5", "snapshot").axes[0]
    segments = [s for c in axes.collections if isinstance(c, LineCollection) and is_wall(c) for s in c.get_segments()]
    found = sorted([sorted(part[:, 1].tolist()) for part in segments])
    assert np.allclose(found, [[0, 2], [4, 8]], atol=1e-6) and np.allclose(np.concatenate(segments)[:, 0], 4)


@pytest.mark.long
def test_movies_show_moving_walls_in_one_region(made, tmp_path):
    assert main(["plot", str(made("globe", 3, "steady")), "--movie", str(tmp_path / "a.gif")]) == 0
    from PIL import Image

    with Image.open(tmp_path / "a.gif") as movie:
        assert movie.n_frames == 5


def test_files_of_other_walls_are_errors_of_one_line(made, tmp_path):
    """A scene in a file is text; what cannot be drawn is an error of the file."""
    import h5py

    path = tmp_path / "a.h5"
    path.write_bytes(made("ball", 3).read_bytes())
    with h5py.File(path, "r+") as file:
        text = file["parameters/scene"][()].decode().replace("radius = 1.5", "radius = -1.5")
        del file["parameters/scene"]
        file["parameters/scene"] = text
    with pytest.raises(FileError, match=r"wall\[0\]\.sphere\.radius"), haff.open(path) as run:
        haff.view(run, tmp_path / "a.html")
