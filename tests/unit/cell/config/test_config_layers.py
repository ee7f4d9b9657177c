"""Tables are laid over each other key by key, and each key keeps its origin."""

import pytest

from cell.config.layers import SET, lay_layer, nested, parse_set
from drivers.errors import ConfigError


def laid(*layers):
    merged, origins = {}, {}
    for name, tree in layers:
        lay_layer(merged, tree, name, origins)
    return merged, origins


def test_a_later_layer_replaces_single_keys_and_leaves_the_rest():
    merged, origins = laid(
        ("below", {"search": {"speed": 0.1, "pitch": 0.7}, "retries": 2}), ("above", {"search": {"speed": 0.2}})
    )
    assert merged == {"search": {"speed": 0.2, "pitch": 0.7}, "retries": 2}
    assert origins["search", "speed"] == "above"
    assert origins["search", "pitch"] == origins["search",] == origins["retries",] == "below"


def test_a_size_below_takes_the_key_of_a_shape_above():
    merged, origins = laid(
        ("below", {"peg": {"diameter": 0.008}, "hole": {"diameter": 0.0081}}), ("above", {"peg": {"shape": "square"}})
    )
    assert merged["peg"]["sides"] == [0.008, 0.008]
    assert "diameter" not in merged["peg"]
    assert origins["peg", "sides"] == "below"


@pytest.mark.parametrize("text", ["search.speed", "=1", "search..speed=1", "search speed=1"])
def test_a_single_key_has_a_name_and_a_value(text):
    with pytest.raises(ConfigError, match=rf"^{SET} .*KEY=VALUE"):
        parse_set(text)


def test_a_place_becomes_tables_within_each_other():
    assert nested([(("search", "gains", "rotation"), 40.0)]) == {"search": {"gains": {"rotation": 40.0}}}
