"""Names of a study's dimensions that need no quotes."""

from __future__ import annotations

import pytest

import haff
from haff.command.study import _dataset, _names

GAS = {
    "schema": 1,
    "domain": {"packing_fraction": 0.1},
    "species": [{"name": "grain", "count": 50, "radius": 0.5, "mass": 1.0}],
    "run": {"until": 0.5},
}
VALUES = {"contact.restitution": [0.8, 0.9], "species.grain.count": [50, 60]}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    haff.sweep(GAS, VALUES, seeds=2, output=folder)
    return folder


def test_dimensions_have_names_that_need_no_quotes(folder):
    study = haff.sweep(GAS, VALUES, seeds=2, output=folder, series=["temperature"])
    assert study["collisions"].dims == ("restitution", "count", "seed")
    assert study["temperature_series"].dims == ("restitution", "count", "seed", "time")
    assert all(str(name).isidentifier() for name in (*study.dims, *study.coords))
    keys = {name: study[name].attrs.get("key") for name in study.dims}
    assert keys.pop("observable") is None and keys == {
        "restitution": "contact.restitution",
        "count": "species.grain.count",
        "seed": None,
        "time": None,
    }
    by_keys = haff.sweep(GAS, VALUES, seeds=2, output=folder, dims="keys")
    assert by_keys.status.sizes == {"contact.restitution": 2, "species.grain.count": 2, "seed": 2}
    one = by_keys.sel({"contact.restitution": 0.9, "species.grain.count": 60, "seed": 1})
    same = study.sel(restitution=0.9, count=60, seed=1)
    assert one["particles"] == same["particles"] == 60
    assert one["state_hash"].item() == same["state_hash"].item()
    assert study["collisions"].mean("restitution").dims == ("count", "seed")
    with pytest.raises(haff.ArgumentError, match="dims = 'both': must be one of keys, names"):
        haff.sweep(GAS, VALUES, output=folder, dims="both")


@pytest.mark.parametrize(
    ("keys", "names"),
    [
        (["contact.restitution", "run.until"], ["restitution", "until"]),
        (["species.grain.count", "species.ball.count"], ["grain_count", "ball_count"]),
        (["contact.restitution", "wall.0.restitution"], ["contact_restitution", "wall_0_restitution"]),
        (["contact.restitution", "contact.wall_restitution"], ["restitution", "wall_restitution"]),
        # Not a name of a variable, of an argument of sel, or of Python.
        (["run.collisions", "a.method", "b.lambda"], ["run_collisions", "a_method", "b_lambda"]),
        (["domain.size.0", "species.big-one.mass"], ["size_0", "mass"]),
        (["seed", "title", "x.title"], ["seed", "title", "x_title"]),
        (["a.b", "a_b", "c.b"], ["key_a_b", "a_b", "c_b"]),
    ],
)
def test_names_are_the_shortest_that_are_free(keys, names):
    taken = ["collisions", "method", "seed"]
    found = _names(keys, taken)
    # A name cannot begin with a digit.
    assert list(found.values()) == ["wall_0_restitution" if name == "0_restitution" else name for name in names]
    assert len(set(found.values())) == len(keys) and all(name.isidentifier() for name in found.values())


def test_rows_have_the_order_of_the_grid_whatever_their_numbers(tmp_path):
    """A study that has grown has runs whose numbers are not in the order of the grid."""
    rows = [{"index": number, "status": "complete", "collisions": 100 + number, "seed": 1} for number in (4, 0, 5, 1)]
    study = _dataset(rows, {"contact.restitution": [0.8, 0.9]}, 2, tmp_path, ())
    assert study["collisions"].to_numpy().tolist() == [[104, 100], [105, 101]]
    assert study["index"].to_numpy().tolist() == [[4, 0], [5, 1]]
