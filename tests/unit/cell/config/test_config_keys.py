"""Every key of the config can be explained, is in force from somewhere, and is refused with what is allowed."""

import json
import re
import tomllib
from pathlib import Path

import pytest

from cell.commands.cli import main
from cell.config.files import DEFAULT, SHIPPED
from cell.config.keys import find, in_force, keys, planned, section_summary, toml
from cell.config.load import load
from cell.config.text import as_toml, commented, file_schema
from drivers.errors import ConfigError
from tests.unit.cell.config.test_config import cell_file, layer

WRONG = '"\\u0007nothing that is allowed"'
"""A text that no key takes for a number, a choice or a section."""


def _texts():
    return [key.name for key in keys() if key.allowed in ("a text", "a file") or key.name.endswith("model")]


def test_every_key_says_what_it_means_and_in_which_unit():
    for key in keys():
        assert key.meaning.endswith((".", '."')), key
        assert len(key.summary.split()) >= 2 or key.kind, key
        assert len(key.summary) <= 130, key
        assert key.unit or "a number" not in key.allowed, key
        assert key.allowed, key
        assert key.sources, key


def test_the_shipped_cell_is_commented_with_what_its_keys_mean():
    text = DEFAULT.read_text(encoding="utf-8")
    assert text == commented(text), "cell config comment config/sim.toml writes the comments anew"


@pytest.mark.parametrize(
    ("name", "source"),
    [
        ("search.gains.translation", "chosen within the margin that `cell check` prints"),
        ("search.gains.rotation", "chosen within the margin that `cell check` prints"),
        ("grasp.opening", "chosen, not measured"),
        ("search.height", "chosen, not measured"),
        ("search.tilt", "[gibbons], Sec. IV"),
    ],
)
def test_keys_without_a_source_have_that_of_their_section(name, source):
    (key,) = find(name)
    assert key.sources == (source,)


def test_every_source_can_be_looked_up():
    """A source is a reference, a decision, a command of this program, or says plainly that there is none to look up."""
    known = re.findall(r"^- (\[\w+\])", Path("docs/references.md").read_text(encoding="utf-8"), re.MULTILINE)
    decisions = {path.name[:4] for path in Path("docs/decisions").glob("[0-9]*.md")}
    for key in keys():
        for source in key.sources:
            assert all(each in known for each in re.findall(r"\[[a-z_]+\]", source)), (key.name, source)
            assert set(re.findall(r"decision (\d{4})", source)) <= decisions, (key.name, source)
            assert all(Path(page).is_file() for page in re.findall(r"docs/tried/\w+\.md", source)), (key.name, source)
            assert re.search(
                r"\[|decision \d|docs/tried/\w+\.md|`cell \w+|data sheet|config/|RFC|Modbus|EN |CiA|IEC"
                r"|^(assumed$|chosen, not measured$|derived (from|for) |set for each (cell|part|trial|command)$)",
                source,
            ), (key.name, source)


def test_a_key_has_its_setters_and_a_section_its_keys():
    (key,) = find("search.speed")
    assert "a recipe" in key.setters
    assert "a command, as parameter 1" in key.setters
    assert key.reader == "skills.search.params"
    assert {setter for rate in find("skin.rate") for setter in rate.setters} == {"a cell's file", "a preset", "--set"}
    assert len(find("search")) > 20


def test_a_key_is_found_in_each_kind_of_its_section():
    kinds = ("sim", "can", "serial", "host")
    assert [key.kind for key in find("skin.rate")] == [f'skin.kind = "{kind}"' for kind in kinds]


def test_a_value_in_force_says_where_it_came_from(tmp_path):
    file = cell_file(tmp_path)
    recipe = layer(tmp_path, "recipes", 7, "[peg]\ndiameter = 0.0079\n")
    loaded = load(file, "careful", sets=["grasp.force=12.0"])
    origins = {each.key.name: each.origin for each in in_force(loaded, 7)}
    assert origins["limits.force"] == str(file)
    assert origins["scan_rate"] == str(DEFAULT)
    assert origins["search.rest"] == str(SHIPPED / "presets" / "careful.toml")
    assert origins["peg.diameter"] == str(recipe)
    assert origins["grasp.force"] == "--set"
    assert origins["journal.folder"] == "default"


@pytest.mark.parametrize(
    "sets", [[], ["skin={kind='can', channel='emulated'}", "switch={kind='serial', port='emulated'}"]]
)
def test_the_config_that_is_shown_is_the_config(sets, tmp_path):
    loaded = load(sets=sets)
    file = tmp_path / "whole.toml"
    file.write_text(as_toml(in_force(loaded)))
    assert load(file).cell == loaded.cell


@pytest.mark.parametrize(
    ("value", "text"),
    [(True, "true"), (0.1, "0.1"), ((1, 2), "[1, 2]"), ('a "b"', '"a \\"b\\""'), ({"a": None, "b": 1}, "{ b = 1 }")],
)
def test_a_value_is_written_as_toml(value, text):
    assert toml(value) == text


def test_writing_comments_twice_changes_nothing():
    bare = '# About it.\n[search]\nspeed = 0.1 # old\nfast_axis = "y"\n\n[peg]\nlength = 0.05\n'
    once = commented(bare)
    assert "# About it.\n" in once
    assert f"speed = 0.1  # {find('search.speed')[0].summary}\n" in once
    assert commented(once) == once
    assert tomllib.loads(once) == tomllib.loads(bare)


def test_comments_are_of_the_section_and_kind_that_the_file_has():
    line = "gains = { translation = 1.0, rotation = 2.0, damping_ratio = 1.0 }"
    assert commented(f"[search]\n{line}\n") == f"[search]\n{line}  # {section_summary('search.gains')}\n"
    can = commented('[skin]\nkind = "can"\nchannel = "can#0"\nrate = 20.0\n')
    assert f"rate = 20.0  # {find('skin.rate')[1].summary}\n" in can
    assert 'channel = "can#0"  # ' in can  # a sign within a text is no comment


def test_an_editor_finds_a_description_of_every_key_in_draft_7():
    schema = file_schema()
    text = json.dumps(schema)
    assert schema["$schema"] == "http://json-schema.org/draft-07/schema#"
    assert "$defs" not in text
    assert "prefixItems" not in text
    assert set(re.findall(r'"#/definitions/(\w+)"', text)) <= schema["definitions"].keys()
    sections = [schema, *schema["definitions"].values()]
    found = [item for section in sections for item in section.get("properties", {}).items()]
    assert len(found) > 300
    assert [name for name, each in found if not each.get("description") and "$ref" not in json.dumps(each)] == []


def test_every_key_is_refused_with_what_is_allowed():
    refused = 0
    for name in dict.fromkeys(key.name for key in keys() if not key.kind and key.name not in _texts()):
        with pytest.raises(ConfigError) as caught:
            load(sets=[f"{name}={WRONG}"])
        told = str(caught.value)
        assert re.search(r": \S.* (allowed|needed)", told), told
        assert told.startswith("--set: "), told
        refused += 1
    assert refused > 200


def test_an_unknown_key_is_refused_with_those_of_its_section():
    sections = {key.name.rpartition(".")[0] for key in keys() if not key.kind and "." in key.name}
    for section in sections:
        with pytest.raises(ConfigError, match=rf"^--set: {section}\.nonsense: unknown key; \w.* allowed"):
            load(sets=[f"{section}.nonsense=1"])


@pytest.mark.parametrize(
    ("wrong", "meant"),
    [("search.sped=0.1", "search.speed"), ("scan_rat=100.0", "scan_rate"), ("search.diameter=0.1", "peg.diameter")],
)
def test_a_mistyped_key_is_answered_with_what_was_meant(wrong, meant):
    with pytest.raises(ConfigError, match=rf"did you mean {meant}\b"):
        load(sets=[wrong])


@pytest.mark.parametrize(
    ("sets", "blamed"),
    [
        (["hole.diameter=0.007"], "--set: hole.diameter: peg.diameter = 0.008: thicker"),
        (["peg.diameter=0.0082"], "--set: peg.diameter = 0.0082: thicker"),
        (["preset=tight"], "{preset}: hole.diameter: peg.diameter = 0.008: thicker"),
        (["preset=tight", "peg.diameter=0.0075"], "--set: peg.diameter = 0.0075: thicker"),
    ],
)
def test_the_upper_layer_of_two_conflicting_keys_is_blamed(sets, blamed, tmp_path):
    (tmp_path / "cell.toml").write_text(DEFAULT.read_text())
    preset = layer(tmp_path, "presets", "tight", "[hole]\ndiameter = 0.007\n")
    with pytest.raises(ConfigError) as caught:
        load(tmp_path / "cell.toml", sets=sets)
    assert str(caught.value).startswith(blamed.format(preset=preset))


@pytest.mark.parametrize(("section", "key"), [("hole.latch", "hole.latch.force"), ("sim.fixture", "sim.fixture.mean")])
def test_a_section_that_this_cell_does_not_have_is_explained_whole(section, key, capsys):
    assert main(["config", "explain", section]) == 0
    told = capsys.readouterr().out
    assert key in told
    assert "not in this cell" in told


def test_every_planned_figure_has_unit_origin_and_reasons():
    found = {each.name: each for each in planned(load(sets=["speed_scale=10"]))}
    speed, drawn, stall = (found[name] for name in ("insert.turn_rate", "grasp.drawing_speed", "adjust.stall_timeout"))
    assert (speed.value, speed.unit, speed.is_capped) == (2.5, "rad/s", True)
    assert (drawn.value, drawn.unit, drawn.origin) == (0.5, "m/s", "fixed")
    assert (stall.value, stall.reasons) == (0.2, ("attempt", "speed_scale"))
    assert all(each.unit or not isinstance(each.value, float) for each in found.values())
    assert not any(name.startswith(("corner.", "paper.")) for name in found)  # sections of other parts
