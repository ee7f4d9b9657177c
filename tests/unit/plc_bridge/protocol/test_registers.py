"""The register map stays where PLC programs expect it, in every exported form."""

import csv
import io
import json

import pytest

from plc_bridge.exports.map_formats import as_bytes, as_csv, as_json, as_markdown
from plc_bridge.protocol.images import (
    COMMAND,
    DIAGNOSTICS,
    REPORT,
    CommandImage,
    command_image,
    command_words,
)
from plc_bridge.protocol.messages import Diagnostics, PartEvidence, Refusal, Report, Result
from plc_bridge.protocol.registers import MIRROR, STAGES, Parameter, table

PLACES = {register.name: register for register in table()}


def test_registers_have_a_name_and_a_place_of_their_own():
    assert len(PLACES) == len(table())
    taken = [(r.table, a) for r in table() for a in range(r.address, r.address + r.words)]
    assert len(taken) == len(set(taken))


def test_each_block_fits_one_request_and_ends_below_the_mirror():
    assert max(r.address + r.words for r in table() if r.table == "input") <= MIRROR
    assert COMMAND.words <= min(MIRROR, 123)
    assert max(REPORT.words, DIAGNOSTICS.words) <= 125


@pytest.mark.parametrize(
    ("name", "table", "address", "index", "subindex"),
    [
        ("command_life", "holding", 0, 0x2000, 1),
        ("command_sequence", "holding", 1, 0x2000, 2),
        ("command_code", "holding", 2, 0x2000, 3),
        ("command_recipe", "holding", 3, 0x2000, 4),
        ("command_serial", "holding", 8, 0x2000, 9),
        ("command_parameter_1", "holding", 24, 0x2000, 10),
        ("command_life_tail", "holding", 40, 0, 0),
        ("report_life", "input", 0, 0x2001, 1),
        ("report_sequence", "input", 2, 0x2001, 3),
        ("report_answered", "input", 3, 0x2001, 4),
        ("report_result", "input", 5, 0x2001, 6),
        ("report_run", "input", 12, 0x2001, 13),
        ("report_holder", "input", 15, 0x2001, 15),
        ("report_life_tail", "input", 72, 0, 0),
        ("report_part_evidence", "input", 73, 0x2001, 39),
        ("report_part_width", "input", 74, 0x2001, 40),
        ("packml_state", "input", 201, 0x2005, 2),
        ("diagnostics_refusals", "input", 106, 0x2002, 4),
        ("execute", "coil", 0, 0x2003, 1),
        ("stop", "coil", 1, 0x2003, 2),
        ("busy", "discrete", 0, 0x2004, 1),
    ],
)
def test_registers_and_objects_stay_where_plc_programs_expect_them(name, table, address, index, subindex):
    place = PLACES[name]
    assert (place.table, place.address, place.index, place.subindex) == (table, address, index, subindex)


def test_a_plc_of_map_2_0_finds_its_block_unchanged():
    image = Report(life=7, part=4, part_depth=0.012, life_tail=7, part_evidence=0x55, part_width=0.008)
    words = REPORT.words_of(image)
    assert (words[0], words[72], words[73:]) == (7, 7, [0x55, 80])


def test_the_evidence_of_the_peg_is_named_bit_by_bit():
    bits = [f"{1 << n} {PartEvidence(1 << n).name}" for n in range(10)]
    assert ", ".join(bits) in PLACES["report_part_evidence"].meaning


def test_blocks_survive_their_words():
    image = CommandImage(5, 65535, 101, 7, 65534, 1, 256, "PEG-0042", ((0, -70000), (7, 12)), 5)
    assert command_image(command_words(image)) == image
    times = {f"report_stage_time_{number}": 0.5 for number in range(1, STAGES + 1)}
    numbers = {r.name: n * r.scale for n, r in enumerate(REPORT.registers) if r.type != "string"}
    words = REPORT.pack({**numbers, **times, "report_holder": "10.0.0.5:4711"})
    assert REPORT.words_of(REPORT.read(words)) == words
    counts = Diagnostics(*range(65_530, 65_543))
    assert DIAGNOSTICS.read(DIAGNOSTICS.words_of(counts)) == counts


def test_wide_values_are_big_endian():
    words = REPORT.words_of(Report(run=0x00012345, holder="AB"))
    assert words[PLACES["report_run"].address : PLACES["report_run"].address + 2] == [0x0001, 0x2345]
    assert words[PLACES["report_holder"].address] == 0x4142


def test_values_beyond_a_register_are_cut():
    words = REPORT.words_of(Report(progress=70_000, total_time=1e9, holder="x" * 40))
    image = REPORT.read(words)
    assert (image.progress, image.holder) == (65535, "x" * 32)
    assert image.total_time == pytest.approx(0xFFFFFFFF * 0.001)


def test_mask_beyond_the_parameters_is_kept_for_refusal():
    words = command_words(CommandImage())
    words[PLACES["command_parameter_mask"].address] = 0x8000
    assert command_image(words).parameters == ((8, 0),)


def test_json_has_exactly_the_promised_keys():
    keys = {"name", "table", "address", "words", "type", "scale", "unit", "access", "meaning"}
    keys |= {"low", "high", "index", "subindex", "pdo"}
    assert all(set(entry) == keys for entry in json.loads(as_json(table())))


def test_csv_has_one_row_for_each_register():
    rows = list(csv.DictReader(io.StringIO(as_csv(table()))))
    assert [row["name"] for row in rows] == [register.name for register in table()]


def test_markdown_names_programs_and_words():
    text = as_markdown(table({100: "insert_peg"}))
    assert "100 insert_peg" in text
    assert all(word.name in text for word in (*Result, *Refusal))


def test_parameters_bring_their_unit_scale_and_limits():
    speed = Parameter("search.speed", "m/s", 1e-4, 0.001, 0.1, "how fast")
    entry = next(r for r in table({}, [speed]) if r.name == "command_parameter_1")
    assert (entry.unit, entry.scale, entry.meaning) == ("m/s", 1e-4, "search.speed: how fast; 0.001 to 0.1 m/s")


def test_bytes_for_a_gateway_lie_as_the_words_do():
    rows = [line.split(",") for line in as_bytes(table()).splitlines()[1:]]
    for direction, block in (("to the cell", COMMAND), ("from the cell", REPORT)):
        own = [row for row in rows if row[0] == direction]
        assert [row[6] for row in own] == [r.name for r in block.registers]
        assert [int(row[1]) for row in own] == [2 * (r.address - block.start) for r in block.registers]
        assert int(own[-1][1]) + int(own[-1][2]) == 2 * block.words
