"""Containers that shrink with a box: what files say of them, live simulations, figures, and what is none."""

import numpy as np
import pytest

import haff
from haff.files.container import container_of

CONE = {"name": "hopper", "cone": {"apex": [5, 5, 0], "axis": [0, 0, 1], "angle": 0.4, "start": 1.0, "length": 9.0}}


def scene(wall=CONE, **domain):
    return {
        "seed": 1,
        "domain": {"size": [10.0] * 3, "boundary": ["wall"] * 3, "compression": {"rate": 0.05}, **domain},
        "species": [{"name": "grain", "count": 40, "radius": 0.3, "mass": 1.0, "temperature": 1.0}],
        "wall": [wall],
        "run": {"until": 2.0},
        "output": {"frames": 1.0, "observables": 1.0},
    }


@pytest.mark.long
@pytest.mark.physics
def test_volume_and_places_of_a_cone_are_those_of_the_engine(tmp_path):
    with haff.run(scene(), file=tmp_path / "cone.h5").file as run:
        # A frustum: (a² + ab + b²) π h/3.
        a, b = np.tan(0.4) * 1.0, np.tan(0.4) * 9.0
        whole = np.pi / 3 * (a * a + a * b + b * b) * 8.0
        volume = run.samples["box_volume"][:]
        np.testing.assert_allclose(volume, whole * (1 - 0.05 * run.samples["time"][:]) ** 3, rtol=1e-12)
        for frame, expected in zip(run.frames, volume):
            assert frame.box.volume == pytest.approx(expected, rel=1e-12)
            distance = np.min([part(frame.position)[0] for part in frame.box.container.parts()], axis=0)
            assert (distance > 0.3 - 1e-12).all()
        assert len(frame.box.container.parts()) == 3 and "cone inside" in repr(frame.box)
        run.plot("snapshot", tmp_path / "cone.png")
        haff.view(run, tmp_path / "cone.html")
        assert '"shrinks": 0.05' in (tmp_path / "cone.html").read_text().replace(":0.05", ": 0.05")


@pytest.mark.physics
def test_the_box_of_a_live_simulation_has_the_present_container():
    simulation = haff.Simulation(scene())
    simulation.advance(1.0)
    found = simulation.sample()
    assert simulation.box.volume == pytest.approx(found["box_volume"], rel=1e-12)
    assert simulation.box.container.wall["cone"]["length"] == pytest.approx(9.0 * 0.95, rel=1e-12)


@pytest.mark.parametrize(
    ("wall", "domain"),
    [
        (CONE, {"compression": {"rate": 0.0}}),
        (CONE, {"compression": {"rates": [0.0, 0.0, 0.0]}}),
        ({"name": "post", "cylinder": {"point": [5, 5, 0], "axis": [0, 0, 1], "radius": 1.0, "side": "outside"}}, {}),
        ({"name": "floor", "plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}, {}),
        ({"name": "hopper", "cone": {"apex": [5, 5, 0], "axis": [0, 0, 1], "angle": 0.4}}, {}),
    ],
)
def test_what_does_not_shrink_is_no_container(wall, domain):
    assert container_of(scene(), 3) is not None
    assert container_of(scene(wall, **domain), 3) is None


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"container": "tube", "dimension": 2}, "take the cylinder, a circle"),
        ({"container": "sphere", "aspect": 2.0}, "aspect: is for cylinders and tubes"),
        ({"aspect": 2.0}, "aspect: is for cylinders and tubes"),
        ({"container": "cylinder", "dimension": 2, "aspect": 2.0}, "aspect: is for cylinders and tubes"),
        ({"container": "cylinder", "aspect": 1e7}, "must be above 0 and below 1000000"),
    ],
)
@pytest.mark.physics
def test_lengths_that_a_container_does_not_have_are_refused(options, told):
    with pytest.raises(haff.HaffError, match=told):
        haff.pack(20, 0.3, **options)
