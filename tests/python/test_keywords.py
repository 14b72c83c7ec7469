"""Errors of scenes in the words of Python: keywords with a short value, and the keyword that was meant."""

from __future__ import annotations

import numpy as np
import pytest

import haff
from haff.scenes.keywords import Given

GAS = {
    "schema": 1,
    "domain": {"packing_fraction": 0.1},
    "species": [{"name": "grain", "count": 50, "radius": 0.5, "mass": 1.0}],
    "run": {"until": 0.5},
}


def error(scene=GAS, /, of=haff.Simulation, **overrides) -> str:
    with pytest.raises(haff.SceneError) as caught:
        of(scene, **overrides)
    return str(caught.value)


@pytest.mark.parametrize("of", [haff.Simulation, haff.run, haff.validate])
def test_arrays_in_errors_are_shown_by_type_and_shape(of):
    text = error(of=of, title=np.zeros((1000, 3)))
    assert text == "title=ndarray of float64, shape (1000, 3): must be a string, not an array"
    text = error(of=of, contact__restitution=np.linspace(0.5, 1.5, 1000))
    assert (
        text.startswith("contact.restitution=ndarray of float64, shape (1000,): must be a number") and len(text) < 200
    )
    # Short values as before, as TOML.
    assert error(of=of, domain__gravity=np.array([0.0, 0.5])).startswith("domain.gravity=[0.0, 0.5]: ")
    assert error(of=of, engine__simd="none").startswith('engine.simd="none": ')


def test_error_of_an_array_of_tables_is_short_for_each_entry():
    with pytest.raises(haff.SceneError) as caught:
        haff.Simulation(GAS, particle=np.random.default_rng(1).random((1000, 3)))
    lines = str(caught.value).splitlines()
    # 21,713 characters in 21 lines before.
    assert len(lines) == len(caught.value.problems) and max(map(len, lines)) < 200
    assert lines[0].startswith("particle=ndarray of float64, shape (1000, 3): particle.0")
    assert caught.value.problems[0].key.startswith("particle.0")


def test_scene_of_another_type_is_refused():
    for of in (haff.Simulation, haff.validate):
        with pytest.raises(
            haff.ArgumentError, match=r"^scene = ndarray of float64, shape \(1000,\): must be a dict, or the path"
        ):
            of(np.zeros(1000))


@pytest.mark.parametrize(
    ("name", "value", "meant"),
    [
        ("threds", 2, "threads=2"),
        ("contact_restitution", 0.9, "contact__restitution=0.9"),
        ("domain_packing_fraction", 0.1, "domain__packing_fraction=0.1"),
        ("species_count", 9, "species__0__count=9"),
    ],
)
def test_misspelled_keywords_are_recognized(name, value, meant):
    for of in (haff.run, haff.Simulation):
        assert f"{name}={value}: unknown key; did you mean {meant}? (allowed: schema" in error(of=of, **{name: value})


def test_misspelled_arguments_and_keys_become_keywords():
    assert "did you mean contact__restitution=0.9? (allowed: restitution" in error(contact__restitutoin=0.9)
    assert "did you mean species__0__count=9?" in error(species__0__cuont=9)
    assert "did you mean overwrite=True?" in error(of=haff.run, overwite=True)
    assert "did you mean file='gas.h5'?" in error(of=haff.run, output="gas.h5")
    assert "did you mean events=True?" in error(event=True)
    assert '"contact": {"restitution": 0.9}?' in error(GAS | {"contact": {"restitutoin": 0.9}})
    assert '"species": [{"count": 9}]?' in error(GAS | {"species": [{"name": "a", "cuont": 9, "radius": 1, "mass": 1}]})


def test_errors_of_scene_files_are_those_of_the_command(tmp_path):
    path = haff.save_scene(GAS | {"contact": {"restitutoin": 0.9}}, tmp_path / "gas.toml")
    assert error(path).startswith(f"{path}:") and "did you mean `" in error(path)


def told(key: str, meant: tuple[str, ...], value: object, *, keyword: bool) -> str:
    """What becomes of the error of an unknown key that may stand for these."""
    text = f"{key}: unknown key"
    problem = haff.SceneProblem(
        text, "scene", None, key, str(value), "unknown key", "unknown_key", "a, b", meant, key if keyword else None
    )
    scene: dict = {}
    node = scene
    *tables, last = key.split(".")
    for table in tables:
        node = node.setdefault(table, {})
    node[last] = value
    values = {key: value} if keyword else {}
    given = Given(scene, values, {key: str(value)}, (), haff.schema)
    return given.retold(haff.SceneError([problem])).problems[0].message


@pytest.mark.parametrize(
    ("key", "meant", "keyword", "entry"),
    [
        ("until", ("run.until",), "run__until=3", '"run": {"until": 3}'),
        ("run.title", ("title",), "title=3", '"title": 3'),
        ("count", ("species.0.count",), "species__0__count=3", '"species": [{"count": 3}]'),
        ("amplitude", ("wall.0.motion.amplitude",), "wall__0__motion__amplitude=3",
         '"wall": [{"motion": {"amplitude": 3}}]'),
        ("mass", ("species.0.mass", "particle.0.mass"),
         "species__0__mass=3 or particle__0__mass=3", '"species": [{"mass": 3}] or "particle": [{"mass": 3}]'),
    ],
)  # fmt: skip
def test_keys_that_were_meant_become_what_to_write(key, meant, keyword, entry):
    for form, written in ((True, keyword), (False, entry)):
        assert told(key, meant, 3, keyword=form) == f"unknown key; did you mean {written}? (allowed: a, b)"


def test_hints_show_long_values_in_part():
    text = told("until", ("run.until",), list(range(1000)), keyword=True)
    assert "run__until=[0, 1, 2" in text and len(text) < 250


def test_errors_have_a_class_and_what_is_allowed(tmp_path):
    cases = {
        "contact__restitution": (1.2, "value", "in [0, 1]"),
        "run__until": ("late", "type", "a number"),
        "run__untl": (1, "unknown_key", None),
        "domain__size": ([9, 9, 9], "conflict", None),
    }
    for of in (haff.Simulation, haff.run, haff.validate):
        for name, (value, code, allowed) in cases.items():
            with pytest.raises(haff.SceneError) as caught:
                of(GAS, **{name: value})
            problem = next(problem for problem in caught.value.problems if problem.code == code)
            assert problem.set == name.replace("__", ".") or code == "conflict"
            assert allowed is None or problem.allowed == allowed
            assert code != "unknown_key" or (problem.meant == ("run.until",) and "until" in problem.allowed)
    scene = haff.save_scene(GAS | {"run": {}}, tmp_path / "gas.toml")
    for of in (haff.run, haff.validate):
        with pytest.raises(haff.SceneError) as caught:
            of(scene)
        assert [problem.code for problem in caught.value.problems] == ["missing"]


def test_errors_of_the_command_keep_their_class(tmp_path):
    """Those of sweeps and of runs that go on come from another process."""
    with pytest.raises(haff.SceneError) as caught:
        haff.sweep(GAS, {"contact.restitution": [1.2]}, output=tmp_path / "study")
    problem = caught.value.problems[0]
    assert (problem.code, problem.set, problem.allowed) == ("value", "contact.restitution", "in [0, 1]")
    haff.run(GAS, file=tmp_path / "gas.h5")
    with pytest.raises(haff.SceneError) as caught:
        haff.resume(tmp_path / "gas.h5", file=tmp_path / "more.h5", contact__restitution=-1)
    problem = caught.value.problems[0]
    assert (problem.code, problem.key, problem.value) == ("value", "contact.restitution", "-1")


@pytest.mark.parametrize(
    ("name", "value", "meant"),
    [("until", 3.0, "run__until=3.0"), ("restitution", 0.5, "contact__restitution=0.5"),
     ("e", 0.9, "contact__restitution=0.9"), ("contact__e", 0.9, "contact__restitution=0.9"),
     ("count", 9, "species__0__count=9")],
)  # fmt: skip
def test_keys_of_other_sections_and_names_of_the_field_are_recognized(name, value, meant):
    for of in (haff.run, haff.Simulation):
        assert f"did you mean {meant}" in error(of=of, **{name: value})
    assert '"run": {"until": 3.0}?' in error(GAS | {"until": 3.0})
