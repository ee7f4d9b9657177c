"""The threats that the cell was tested against: what may happen, what guards against it, and the test that proves the guard."""

from typing import NamedTuple


class Threat(NamedTuple):
    """One threat."""

    what: str
    guard: str
    """Module and name of what guards."""
    test: str
    """File and name of the test."""


ROWS = """
a client of OPC UA with a foreign, a revoked or somebody else's certificate
 plc_bridge.opcua.session.Trust
 tests/line/test_opcua.py::test_client_with_a_wrong_certificate_is_refused
a request of OPC UA that passes by the secure channel
 plc_bridge.opcua.session.CellSession
 tests/line/test_opcua.py::test_request_without_a_channel_reads_nothing
a foreign page or a rebound name reads a route
 cell.page.front.Front
 tests/line/test_front.py::test_a_foreign_name_or_page_gets_421_on_every_route
a rebound name in a real browser
 cell.page.guard.refusal
 tests/line/test_front.py::test_a_rebound_name_reads_nothing_in_a_real_browser
a token is read on the way
 cell.page.guard.is_private
 tests/line/test_front.py::test_a_token_is_taken_where_nobody_on_the_way_reads_it
the page crosses the network in clear
 cell.page.server.PageServer.context
 tests/line/test_front.py::test_a_page_for_other_computers_speaks_tls_with_the_keys_of_the_cell
somebody guesses the token
 cell.page.token.is_token
 tests/line/test_page_server.py::test_without_the_token_nothing_moves_and_guessing_ends
a half-written token is used for ever
 cell.page.token.page_token
 tests/unit/cell/page/test_page_parts.py::test_a_token_that_anybody_could_guess_is_made_anew
a full disk leaves an empty token
 drivers.figures_file.replace_text
 tests/unit/cell/page/test_page_parts.py::test_a_full_disk_leaves_no_token_behind
viewers lock the operator out
 cell.page.hub.PageHub.admit
 tests/line/test_page_server.py::test_an_operator_gets_in_however_many_only_look
one address takes every place
 cell.page.hub.PageHub.full
 tests/line/test_page_server.py::test_one_address_has_only_so_many_places_to_look
a request starts a process, or shows paths
 cell.page.front.Guarded.require_token
 tests/line/test_page_server.py::test_only_the_token_has_a_config_shown_or_a_file_made
a message that no parser can read
 cell.page.commands.parse
 tests/line/test_page_server.py::test_what_no_parser_can_read_is_answered_in_one_line_and_logged_in_none
bytes on a wire that no parser can read
 plc_bridge.modbus.pdu.respond
 tests/unit/test_bytes_outside.py::test_random_bytes_on_a_wire_do_no_harm
a file of the config or of a calibration is damaged
 drivers.figures_file.read_figures
 tests/unit/test_bytes_outside.py::test_a_damaged_file_is_read_or_refused_in_one_line
somebody fills the log
 cell.records.patient_log.SparseFilter
 tests/line/test_page_server.py::test_without_the_token_nothing_moves_and_guessing_ends
a row that cannot be written stops the records
 cell.records.index.Index.put
 tests/unit/cell/records/test_journal_content.py::test_a_row_that_cannot_be_written_holds_up_no_other
a damaged byte stops a start
 cell.records.upkeep.made_again
 tests/unit/cell/records/test_journal_content.py::test_a_damaged_folder_starts_or_is_refused_in_one_line
a thread dies unseen
 cell.commands.cli.main
 tests/unit/cell/commands/test_stop.py::test_a_thread_that_ends_by_an_error_ends_the_program
two processes write one journal
 cell.records.writer.JournalWriter.open
 tests/unit/cell/records/test_journal_content.py::test_a_second_process_is_refused_with_the_first_and_its_start
others write the folder of the records
 cell.records.index.require_own
 tests/unit/cell/records/test_journal.py::test_a_folder_that_others_may_write_is_refused_in_one_line
a restart believes where the peg was
 cell.records.kept_file.KeptFile
 tests/unit/cell/peg/test_custody.py::test_a_state_lost_to_a_full_disk_is_unknown_until_written
a lost run has moved the peg
 cell.peg.custody.Custody
 tests/unit/cell/peg/test_custody.py::test_a_file_older_than_a_lost_run_makes_the_place_unknown
a damaged file of the peg is believed
 cell.peg.custody.KeptPart
 tests/unit/cell/peg/test_custody.py::test_a_damaged_file_makes_the_place_unknown
a reading that no sensor can give
 skills.guards.setpoint_gate.GatedArm.read
 tests/unit/skills/guards/test_setpoint_gate.py::test_an_arm_whose_readings_are_no_numbers_is_halted_once
an arm whose readings stand still
 skills.guards.setpoint_gate.GatedArm.read
 tests/unit/skills/guards/test_setpoint_gate.py::test_readings_that_stand_still_are_a_fault_in_time
a client without, or with a foreign certificate
 plc_bridge.modbus.tls.server_context
 tests/line/test_modbus_tls.py::test_client_without_a_valid_certificate_is_refused_and_counted
a revoked certificate
 plc_bridge.modbus.tls.server_context
 tests/line/test_modbus_tls.py::test_a_revoked_certificate_is_refused_and_another_one_served
a key runs out unseen
 cell.run.exposure.key_verdict
 tests/unit/cell/run/test_exposure.py::test_check_reports_open_ports_and_the_age_of_keys
a port is open to everybody unseen
 cell.run.exposure.exposures
 tests/unit/cell/run/test_exposure.py::test_each_open_port_is_named_with_its_risk
a newer dependency behaves in another way
 cell.records.provenance.installed
 tests/unit/docs/test_dependencies.py::test_every_dependency_has_an_upper_bound_and_its_pin_is_within
a value that fits in no register
 plc_bridge.protocol.images.Block.pack
 tests/unit/plc_bridge/protocol/test_registers.py::test_values_beyond_a_register_are_cut
a skin whose frames stand still
 drivers.skin.health.SkinHealth
 tests/unit/drivers/skin/test_health.py::test_no_taxel_of_a_frozen_frame_is_trusted_at_the_limit
hostile Modbus frames
 plc_bridge.modbus.pdu
 tests/line/test_hostile_frames.py
requests to the page, forms, chunks and websocket frames that no parser can read
 cell.page.front.Front
 tests/line/test_hostile_frames.py::test_every_kind_of_answer_was_provoked
a browser leaves during a film
 cell.page.server.FileHandler
 tests/line/test_page_server.py::test_a_browser_that_leaves_during_a_film_is_no_error
"""
"""What may happen, and below it its guard and the test of that."""
LINES = [line.strip() for line in ROWS.strip().splitlines()]
THREATS = tuple(map(Threat, LINES[::3], LINES[1::3], LINES[2::3]))
