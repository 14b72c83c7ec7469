"""Porosity beside the wall of a container: closed forms, sums of volumes, and packings against published layers."""

import numpy as np
import pytest

import haff
from haff import analysis
from haff.errors import ArgumentError, NotApplicableError
from haff.files.container import Container

CYLINDER = {"name": "c", "cylinder": {"point": [3, 3, 0], "axis": [0, 0, 1], "radius": 2.5}}
SPHERE = {"name": "s", "sphere": {"center": [3, 3, 3], "radius": 2.5}}
CIRCLE = {"name": "c", "cylinder": {"point": [3, 3], "radius": 2.5}}


def box(wall, d=3, sides=("wall", "wall", "periodic")):
    return haff.Box([6.0, 6.0, 7.0], sides, d, container=Container(wall, d))


def test_a_sphere_on_the_axis_of_a_cylinder_has_the_chords_of_the_closed_form():
    found = analysis.radial_porosity([[3, 3, 2]], 0.8, box(CYLINDER), bins=50)
    r = 2.5 - found.distance
    chord = 2 * np.sqrt(np.maximum(0.8**2 - r**2, 0.0))
    np.testing.assert_allclose(found.porosity, 1 - chord / 7.0, atol=1e-12)
    assert found.distance[0] == pytest.approx(0.025) and (np.diff(found.distance) > 0).all()


@pytest.mark.long
@pytest.mark.parametrize(("wall", "d", "power"), [(CYLINDER, 3, 1), (SPHERE, 3, 2), (CIRCLE, 2, 1)])
def test_its_integral_is_the_volume_of_the_particles(wall, d, power):
    positions = np.array([[3.9, 3.2, 3.1], [2.0, 2.5, 3.4], [3.0, 4.6, 2.9], [3.0, 1.6, 2.1]])[:, :d]
    radii = np.array([0.5, 0.7, 0.3, 0.4])
    found = analysis.radial_porosity(positions, radii, box(wall, d), bins=20_000)
    r = 2.5 - found.distance
    whole = {"cylinder": 2 * np.pi * 7.0, "sphere": 4 * np.pi}["sphere" if wall is SPHERE else "cylinder"]
    surface = (2 * np.pi if d == 2 else whole) * r**power
    volume = np.sum((1 - found.porosity) * surface) * 2.5 / len(r)
    expected = np.sum(np.pi * radii**2 if d == 2 else 4 / 3 * np.pi * radii**3)
    # Of the chords the quadrature, of the others the steps.
    assert volume == pytest.approx(expected, rel=2e-4 if wall is CYLINDER else 1e-5)


def test_without_a_round_container_there_is_none():
    plain = haff.Box([6.0, 6.0, 6.0], ["wall"] * 3, 3)
    cone = {"name": "c", "cone": {"apex": [3, 3, 0], "axis": [0, 0, 1], "angle": 0.4, "length": 5.0}}
    for one in (plain, box(cone)):
        with pytest.raises(NotApplicableError, match="container"):
            analysis.radial_porosity([[3, 3, 3]], 0.5, one)
    with pytest.raises(ArgumentError, match="bins"):
        analysis.radial_porosity([[3, 3, 3]], 0.5, box(SPHERE), bins=0)
    with pytest.raises(ArgumentError, match="container"):
        haff.Box([6.0, 6.0, 6.0], ["wall"] * 3, 3, container="cylinder")


@pytest.mark.long
@pytest.mark.physics
def test_spheres_in_a_tube_are_in_layers_beside_its_wall():
    with haff.pack(1000, "jammed", container="tube", aspect=2.0, seed=1) as packing:
        found = packing.radial_porosity(400)
        mean = 1 - packing.packing_fraction
    at = lambda low, high: (found.distance > low) & (found.distance < high)  # noqa: E731
    # One at the wall; nearly all of the first layer touches it, so that the minimum is at one radius.
    assert found.porosity[0] > 0.95
    first = np.argmin(np.where(at(0.2, 0.9), found.porosity, 1.0))
    assert found.distance[first] == pytest.approx(0.5, abs=0.06) and found.porosity[first] < 0.30
    # The next maximum is near one diameter, higher than the mean.
    assert found.porosity[at(0.85, 1.1)].max() > mean + 0.1
