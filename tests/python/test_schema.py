"""The JSON schema of scenes, by a validator of its own."""

import math
import sys
from pathlib import Path

import jsonschema
import pytest

import haff

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


def as_json(value):
    """TOML as JSON: infinite numbers, which JSON lacks, as the largest finite one."""
    match value:
        case float():
            return min(max(value, -1.7976931348623157e308), 1.7976931348623157e308) if not math.isnan(value) else value
        case list():
            return [as_json(item) for item in value]
        case dict():
            return {key: as_json(item) for key, item in value.items()}
    return value


@pytest.fixture(scope="module")
def validator():
    schema = haff.schema()
    validator = jsonschema.validators.validator_for(schema)
    validator.check_schema(schema)
    return validator(schema)


def test_schema_accepts_every_scene(validator):
    scenes = [*CONFIGS.glob("*.toml"), *CONFIGS.glob("textbook/*.toml")]
    assert len(scenes) > 20
    for path in scenes:
        errors = [error.message for error in validator.iter_errors(as_json(tomllib.loads(path.read_text())))]
        assert not errors, f"{path.name}: {errors}"


@pytest.mark.parametrize(
    "name",
    [
        "unknown_key",
        "restitution_above_one",
        "radius_negative",
        "count_fraction",
        "wrong_type",
        "boundary_unknown",
        "dimension",
        "drive_noise_negative_strength",
        "frames_true",
        "seed_negative",
        "schema_version",
        "time_negative",
    ],
)
def test_schema_refuses_unknown_keys_and_values_out_of_range(validator, name):
    scene = as_json(tomllib.loads((CONFIGS / "invalid" / f"{name}.toml").read_text()))
    assert not validator.is_valid(scene), name
