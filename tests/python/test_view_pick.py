"""The particle under a click in the pages of `haff view`, and its numbers."""

import json

import h5py
import numpy as np
import pytest

import haff
import synthetic
from pages import in_node, page_of

EDGE = 10.0
SCENE = 'schema = 1\n[domain]\nboundary = ["periodic", "periodic", "periodic"]\n'
SCENE += '[[species]]\nname = "grain"\n[[species]]\nname = "post"\n'


def gas(path, position, velocity=None, *, radius=0.5, species=None, mass=None, d=3, times=(0.0,)):
    """A periodic box of edge 10 with particles that fly freely, by default at rest."""
    position, times = np.asarray(position, float), np.asarray(times)
    velocity = np.zeros_like(position) if velocity is None else np.asarray(velocity, float)
    count = len(position)
    flown = position + velocity * times[:, None, None]
    image = np.floor(flown / EDGE).astype(np.int32) * (np.arange(3) < d)
    return synthetic.write(
        path,
        scene=SCENE if d == 3 else SCENE.replace("[domain]", "dimension = 2\n[domain]"),
        size=np.full(3, EDGE), boundary=["periodic"] * d + ["none"] * (3 - d),
        mass=np.ones(count) if mass is None else mass, radius=np.full(count, radius),
        species=np.zeros(count, int) if species is None else species,
        frames={"time": times, "step": np.arange(len(times)), "position": flown - image * EDGE,
                "velocity": np.tile(velocity, (len(times), 1, 1)), "image": image},
    )  # fmt: skip


def picked(page, rays, folder, *, at=(0, 0.0), visible=(True, True)):
    """What `pick` finds for rays (origin, direction) in a page."""
    arrays = [a for chunk in page.header["frames"]["chunks"] for a in page.arrays(chunk)]
    names = ("position", "velocity", "crossed")
    found = [{name: a.tolist() for name, a in zip(names, arrays[k : k + 3])} for k in range(0, len(arrays), 5)]
    radius, species, held = (a.tolist() for a in page.arrays(page.header["bodies"])[:3])
    program = f"""
        const list = header.frames, found = {json.dumps(found)};
        const frames = {{ list, found, time: list.time, count: list.time.length,
                         velocityUnit: (k) => (list.unit ? list.velocity_unit[k] : 1) }};
        const bodies = {json.dumps({"radius": radius, "species": species, "held": held})};
        const rays = {json.dumps([[np.asarray(v).tolist() for v in ray] for ray in rays])};
        console.log(JSON.stringify(rays.map(([origin, direction]) => pick(frames, bodies, {at[0]}, {at[1]},
          {{ origin, direction, forward: direction, near: 0.01, pixel: () => 1e-9 }},
          {json.dumps(list(visible))}))));"""
    return in_node(folder, ["flight.js", "picking.js"], program, page.header)


def first_hit(centers, owners, radius, origin, direction):
    """The owner of the sphere that a ray hits first, by the quadratic equation; ``None`` without one."""
    off = centers - origin
    b = off @ direction
    discriminant = b**2 - (off**2).sum(axis=1) + radius**2
    distance = np.where(discriminant >= 0, b - np.sqrt(np.abs(discriminant)), np.inf)
    distance[distance <= 0] = np.inf
    return None if np.isinf(distance).all() else int(owners[np.argmin(distance)])


def drawn(position, slide=0.0, radius=0.5):
    """Centers and owners of all images that reach into the box; those across y are displaced along x."""
    centers, owners = [], []
    for up in (-1, 0, 1):
        moved = position + np.array([up * slide, up * EDGE, 0.0])
        moved[:, 0] %= EDGE if slide else np.inf
        for x in (-1, 0, 1):
            for z in (-1, 0, 1):
                centers.append(moved + np.array([x * EDGE, 0.0, z * EDGE]))
                owners.append(np.arange(len(position)))
    centers, owners = np.concatenate(centers), np.concatenate(owners)
    near = np.all((centers > -radius) & (centers < EDGE + radius), axis=1)
    return centers[near], owners[near]


def random_rays(count, seed):
    """Rays from points around the box to points in it."""
    rng = np.random.default_rng(seed)
    origin = EDGE / 2 + rng.normal(size=(count, 3)) * 3 * EDGE
    towards = rng.uniform(-0.5, EDGE + 0.5, (count, 3)) - origin
    return list(zip(origin, towards / np.linalg.norm(towards, axis=1, keepdims=True)))


def test_the_first_sphere_on_a_ray_is_picked_also_if_it_is_an_image(tmp_path):
    position = (synthetic.jittered_lattice(np.random.default_rng(3), 60, EDGE, 3, 1.0) + 1.3) % EDGE
    page = page_of(gas(tmp_path / "gas.h5", position), tmp_path)
    rays = random_rays(400, 4)
    centers, owners = drawn(position)
    expected = [first_hit(centers, owners, 0.5, *ray) for ray in rays]
    assert picked(page, rays, tmp_path) == expected
    assert len(centers) > 60 and 100 < sum(e is not None for e in expected) < 400
    # Without images of periodic faces the answers are others.
    assert expected != [first_hit(position, np.arange(60), 0.5, *ray) for ray in rays]


@pytest.mark.long
def test_images_of_a_sheared_box_are_picked_where_they_slide(tmp_path):
    rng = np.random.default_rng(5)
    position = synthetic.jittered_lattice(rng, 60, EDGE, 3, 1.0)
    velocity = np.zeros((60, 3))
    velocity[:, 0] = 0.6 * position[:, 1]
    shear = {"rate": 0.6, "edge": EDGE, "offset": 2.0}
    path = synthetic.sheared_flights(tmp_path / "gas.h5", position, velocity, [0.0, 0.4, 0.8], **shear)
    page = page_of(path, tmp_path)
    rays = random_rays(300, 6)
    for k, x in ((0, 0.0), (1, 0.0), (1, 0.5)):
        time = 0.4 * (k + x)
        flown = position + velocity * time
        flown[:, 0] %= EDGE
        expected = [first_hit(*drawn(flown, 2.0 + 6.0 * time), 0.5, *ray) for ray in rays]
        found = picked(page, rays, tmp_path, at=(k, x))
        # Single precision: a ray that just touches a sphere may miss it.
        assert sum(a != b for a, b in zip(found, expected)) <= 1


def test_of_spheres_behind_each_other_the_front_one_that_is_not_hidden_is_picked(tmp_path):
    position = [[5.0, 2.0, 5.0], [5.0, 4.0, 5.0], [5.0, 6.0, 5.0]]
    page = page_of(gas(tmp_path / "row.h5", position, species=[0, 1, 0]), tmp_path)
    rays = [([5, -20, 5], [0, 1, 0]), ([5, 20, 5], [0, -1, 0]), ([5, 3, 5], [0, 1, 0]), ([5, -20, 7], [0, 1, 0])]
    assert picked(page, rays, tmp_path) == [0, 2, 1, None]
    assert picked(page, rays, tmp_path, visible=(False, True)) == [1, 1, 1, None]
    assert picked(page, rays, tmp_path, visible=(False, False)) == [None] * 4


@pytest.mark.long
def test_one_of_a_hundred_thousand_particles_is_picked(tmp_path):
    per = 47
    lattice = np.stack(np.meshgrid(*[np.arange(per)] * 3, indexing="ij"), -1).reshape(-1, 3)[:100_000]
    position = (lattice + 0.5) * EDGE / per
    page = page_of(gas(tmp_path / "many.h5", position, radius=0.08), tmp_path)
    rays = [([*position[index][:2], 30.0], [0, 0, -1]) for index in (46, 30_000)]
    # Seen from above, the top one of each column.
    column = [np.flatnonzero((position[:, :2] == position[i, :2]).all(axis=1)) for i in (46, 30_000)]
    assert picked(page, rays, tmp_path) == [int(c[np.argmax(position[c, 2])]) for c in column]


# --- in a browser --------------------------------------------------------------------------------


def facts(page):
    """The numbers of the panel, by name."""
    page.evaluate("haffView.player.draw()")
    rows = page.locator("#facts div")
    return dict(
        row.split("|")
        for row in rows.evaluate_all("rs => rs.map(r => [...r.children].map(c => c.textContent).join('|'))")
    )


def click(page, index):
    at = page.evaluate(f"(haffView.player.draw(), haffView.player.locate({index}))")
    page.mouse.click(at["x"], at["y"])


def numbers(text):
    return [float(value) for value in text.split(",")]


@pytest.mark.long
@pytest.mark.parametrize("name", ["rough", "rough_disks"])
def test_a_click_shows_the_numbers_of_the_file(show, files, name):
    page = show(files[name])
    with haff.open(files[name]) as run:
        mass, radius, d, frame = run.mass, run.radius, run.dimension, run.frames[3]
        place, velocity, spin = frame.position[:, :d], frame.velocity[:, :d], frame.angular_velocity
    page.evaluate("haffView.player.goto(3)")
    # One that no other covers: the first one seen from the camera.
    index = next(
        i
        for i in range(len(mass))
        if page.evaluate(f"(() => {{ const p = haffView.player, {{x, y}} = p.locate({i}); return p.pickAt(x, y); }})()")
        == i
    )
    click(page, index)
    assert page.locator("#particle").is_visible() and page.locator("#chosen").input_value() == str(index)
    found = facts(page)
    assert found["species"] == "grain"
    assert float(found["mass"]) == mass[index] and float(found["radius"]) == radius[index]
    # Single precision, shown with six digits.
    assert numbers(found["position"]) == pytest.approx(place[index], rel=1e-5, abs=1e-6)
    assert numbers(found["velocity"]) == pytest.approx(velocity[index], rel=1e-5, abs=1e-6)
    assert float(found["speed"]) == pytest.approx(np.linalg.norm(velocity[index]), rel=1e-5)
    page.wait_for_function("(haffView.player.draw(), !facts.textContent.includes('…'))")
    assert numbers(facts(page)["spin"]) == pytest.approx(spin[index, 2:] if d == 2 else spin[index], rel=1e-5, abs=1e-6)
    # They follow the particle in time.
    page.keyboard.press("ArrowRight")
    with haff.open(files[name]) as run:
        later = run.frames[4].position[index, :d]
    assert numbers(facts(page)["position"]) == pytest.approx(later, rel=1e-5, abs=1e-6)
    page.keyboard.press("Escape")
    assert not page.locator("#particle").is_visible() and page.locator(".ring").count() == 0


@pytest.mark.long
@pytest.mark.parametrize("d", [2, 3])
def test_clicked_particle_is_marked_at_all_its_images_and_followed(show, tmp_path, d):
    depth = 5.0 if d == 3 else 0.0
    position = [[9.8, 5.0, depth], [5.0, 5.0, depth]]
    page = show(gas(tmp_path / "two.h5", position, [[1.0, 0, 0], [0, 0, 0]], d=d, times=(0.0, 2.0)))
    # At its image across the face.
    at = page.evaluate(f"haffView.player.pixel([-0.2, 5, {depth}])")
    page.mouse.click(at["x"], at["y"])
    assert page.locator("#chosen").input_value() == "0"

    def rings():
        page.evaluate("haffView.player.draw()")
        boxes = page.evaluate("[...document.querySelectorAll('.ring')].map((r) => r.getBoundingClientRect().toJSON())")
        return sorted((box["x"] + box["width"] / 2, box["y"] + box["height"] / 2) for box in boxes)

    def pixels(*places):
        seen = [page.evaluate("p => haffView.player.pixel(p)", [x, 5.0, depth]) for x in places]
        return sorted((p["x"], p["y"]) for p in seen)

    # A pixel: browsers round boxes.
    assert np.allclose(rings(), pixels(-0.2, 9.8), atol=1)
    page.evaluate("haffView.player.seek(1.0)")
    assert np.allclose(rings(), pixels(0.8), atol=1)
    assert numbers(facts(page)["position"])[0] == pytest.approx(0.8, rel=1e-5)
    # A click beside all of them, and a drag, which is no click.
    middle = page.evaluate(f"haffView.player.pixel([5, 5, {depth}])")
    page.mouse.move(middle["x"], middle["y"])
    page.mouse.down()
    page.mouse.move(middle["x"] + 40, middle["y"])
    page.mouse.up()
    assert page.locator("#chosen").input_value() == "0"
    page.evaluate("haffView.player.view.look()")
    corner = page.evaluate(f"haffView.player.pixel([2.5, 2.5, {depth}])")
    page.mouse.click(corner["x"], corner["y"])
    assert not page.locator("#particle").is_visible()


@pytest.mark.long
def test_fixed_particles_are_picked_and_hidden_ones_are_not(show, tmp_path):
    """From the front (along y), the post of another species hides a grain."""
    path = gas(tmp_path / "posts.h5", [[5.0, 2.0, 5.0], [5.0, 6.0, 5.0]], species=[1, 0], mass=[np.inf, 2e60])
    page = show(path)
    page.evaluate(
        """() => { const { view } = haffView.player; view.camera.position.set(5, -20, 5);
                   view.orbit.target.set(5, 5, 5); view.orbit.update(); }"""
    )
    click(page, 0)
    found = facts(page)
    assert page.locator("#chosen").input_value() == "0"
    assert found["species"] == "post" and found["mass"] == "fixed or driven"
    assert numbers(found["velocity"]) == [0, 0, 0]
    page.locator("#opaque").select_option("1")
    page.evaluate("opacity.value = 0; opacity.dispatchEvent(new Event('input'))")
    click(page, 0)
    assert page.locator("#chosen").input_value() == "1" and facts(page)["species"] == "grain"
    assert facts(page)["mass"] == "2e60", "masses are those of the file, in double precision"


@pytest.mark.long
def test_speed_in_a_sheared_box_is_the_one_relative_to_the_flow(show, tmp_path):
    position = np.array([[2.0, 9.0, 5.0], [6.0, 3.0, 5.0]])
    velocity = np.array([[0.6 * 9.0 + 1.0, 2.0, 0.0], [0.6 * 3.0, 0.0, 0.0]])
    path = synthetic.sheared_flights(
        tmp_path / "two.h5", position, velocity, [0.0, 1.0], rate=0.6, edge=EDGE, offset=0.0
    )
    page = show(path)
    page.evaluate("haffView.player.inspector.choose(0)")
    assert float(facts(page)["speed relative to the flow"]) == pytest.approx(np.sqrt(5), rel=1e-5)
    # Across the gradient face the velocity in the lab is that of the image in the box.
    page.evaluate("haffView.player.seek(0.9)")
    found = facts(page)
    assert numbers(found["position"])[1] == pytest.approx(0.8, rel=1e-4)
    assert numbers(found["velocity"]) == pytest.approx([0.4, 2.0, 0.0], abs=1e-4)


@pytest.mark.long
def test_particles_are_chosen_by_number_without_a_pointer(show, tmp_path):
    page = show(gas(tmp_path / "two.h5", [[2.0, 5.0, 5.0], [7.0, 5.0, 5.0]]))
    page.keyboard.press("i")
    assert page.evaluate("document.activeElement.id") == "chosen"
    page.keyboard.type("1")
    page.keyboard.press("Enter")
    assert numbers(facts(page)["position"]) == pytest.approx([7, 5, 5])
    # Letters typed there are no commands; escape leaves.
    page.keyboard.press("Escape")
    assert not page.locator("#particle").is_visible()
    for name in ("#chosen", "#close", "#inspect"):
        assert page.locator(name).get_attribute("aria-label")


def test_spins_between_events_of_exact_paths_are_those_of_a_frame_or_unknown(files, tmp_path):
    """Few rough bodies have a frame of the page at each event."""
    page = page_of(files["impacts"], tmp_path)
    assert page.header["flight"] == "line"
    time = np.array(page.header["frames"]["time"])
    spin = np.stack([a.reshape(-1, 3) for chunk in page.header["frames"]["chunks"] for a in page.arrays(chunk["spin"])])
    with haff.open(files["impacts"]) as run:
        for frame in run.frames:
            row = np.flatnonzero(np.isclose(time, frame.time, rtol=1e-12, atol=0))[-1]
            assert np.allclose(spin[row], frame.angular_velocity, rtol=1e-6, atol=1e-12)
        recorded = run.frames.array("angular_velocity").astype(np.float32)
        known = ~np.isnan(spin).any(axis=2)
        for k, body in zip(*np.nonzero(known)):
            assert (recorded[:, body] == spin[k, body]).all(axis=1).any()


def test_pages_of_smooth_scenes_have_no_spins(files, tmp_path):
    page = page_of(files["cooling"], tmp_path)
    assert all("spin" not in chunk for chunk in page.header["frames"]["chunks"])
    with h5py.File(files["cooling"]) as file:
        assert "inertia" not in file["particles/all"]


@pytest.mark.long
def test_a_click_before_its_frame_is_unpacked_picks_nothing(show, files):
    page = show(files["cooling"])
    page.evaluate(
        "(async () => { const p = haffView.player; await p.frames.loadAll(); p.goto(5); delete p.frames.found[5]; })()"
    )
    assert page.evaluate("haffView.player.pickAt(300, 200)") is None


def test_inertia_without_angular_velocities_makes_a_page_without_spins(tmp_path):
    path = synthetic.cooling_gas(tmp_path / "gas.h5", n=60, frames=3, collisions=50, beta=0.5)
    with h5py.File(path, "r+") as file:
        del file["particles/all/angular_velocity"]
    page = page_of(path, tmp_path)
    assert all("spin" not in chunk for chunk in page.header["frames"]["chunks"])
