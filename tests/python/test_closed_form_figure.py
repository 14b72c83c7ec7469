"""The figure `closed_form`: every worked system of the chapter is drawn with its law, which agrees with the run."""

import numpy as np
import pytest

from haff import figures
from haff.figures import trajectories
from haff.figures.worked import worked

pytestmark = pytest.mark.physics

# The quantity drawn for each scene, and overrides of the scene.
SCENES = [
    ("bouncing_ball", {}, "Height of the ball"),
    ("bouncing_ball", {"wall__0__restitution": 1.0, "domain__gravity": [0.0, 0.0, -1.6]}, "Height of the ball"),
    ("direct_impact", {"contact__restitution": 0.1}, "Velocities in the impact"),
    ("oblique_pair", {"particle__0__mass": 3.0}, "Velocities in the impact"),
    ("oblique_wall", {}, "Velocities in the impact"),
    ("hammer_and_nail", {}, "Velocities in the impact"),
    ("forging", {}, "Velocities in the impact"),
    ("pendulums", {"contact__restitution": 0.3}, "Angles of the pendulums"),
    ("pendulums", {"contact__restitution": 1.0, "pendulum__0__angle": -0.9}, "Angles of the pendulums"),
    ("pendulums_unequal", {"particle__1__mass": 0.7}, "Angles of the pendulums"),
    ("newtons_cradle", {"pendulum__1__angle": -0.6}, "Angles of the pendulums"),
    ("spring_impact", {"spring__0__stiffness": 200.0}, "Compression of the spring"),
    ("stick_to_rod", {"rod__0__angle": 0.7}, "Angle of the rod"),
    ("elastic_rod_end", {"contact__restitution": 0.5}, "Angle of the rod"),
]


@pytest.mark.long
@pytest.mark.parametrize(("scene", "settings", "title"), SCENES)
def test_closed_form_agrees_with_the_recorded_motion(command, scene, settings, title):
    with command.run(f"textbook/{scene}", **settings).open() as run:
        found = worked(run)
        assert found.title == title
        assert found.law is not None, found.why
        law = found.law(found.time)
        assert law.shape == found.seen.shape == (len(found.names), len(run.frames))
        defined = np.isfinite(law)
        assert defined.mean() > 0.3, "the law holds for too short a time to be seen"
        difference = np.abs(law - found.seen)[defined].max() / np.abs(found.seen).max()
        assert difference < 1e-10, f"off by {difference:.1e}"
        figure = figures.draw(run, "closed_form")
        assert len(figure.axes) == 2
        assert "largest difference" in "".join(text.get_text() for text in figure.texts)


def test_pendulum_paths_between_distant_frames_are_hermite_arcs(command):
    with command.run("textbook/pendulums", output__frames=0.1, run__until=0.5).open() as run:
        path = trajectories.flights(run)[0]
        length = np.linalg.norm(path.position - [0, 0, 1], axis=1)
        # Error of a Hermite arc: h⁴/384 of the fourth derivative, about (3/s)⁴; of a parabola: (h · 3/s)²/2 = 5 %.
        assert np.abs(length - 1).max() < 5 * 0.3**4 / 384 * 2


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        ({"particle__0__velocity": [0.0, 0.0, 0.0], "pendulum__1__length": 0.9}, "the pendulums are not alike"),
        ({"contact__restitution": {"model": "viscoelastic", "coefficient": 0.1}}, "restitution is not one number"),
        ({"pendulum__1__angle": 0.2}, "the pendulums are not released at one angle"),
        ({"pendulum__0__angle": 0.6}, "the bobs meet before they hang"),
    ],
)
def test_motion_without_closed_form_is_drawn_with_the_reason(command, settings, why):
    with command.run("textbook/pendulums", **settings).open() as run:
        figure = figures.draw(run, "closed_form")
        assert len(figure.axes) == 1
        assert f"no closed form drawn: {why}" in "".join(text.get_text() for text in figure.texts)
