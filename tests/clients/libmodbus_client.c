/* A PLC on libmodbus: runs insert_peg COUNT times and counts the answers, then asks for what no cell may give.
 *
 *     libmodbus_client tcp HOST PORT COUNT
 *     libmodbus_client rtu PORT UNIT COUNT
 *
 * Addresses are those of `cell map`. */

#include <errno.h>
#include <modbus.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LIFE, SEQUENCE, CODE, RECIPE, ACKNOWLEDGE, LEASE, VERSION, LIFE_TAIL = 40, COMMAND_WORDS };
enum { R_LIFE, R_VERSION, R_SEQUENCE, R_ANSWERED, R_REFUSAL, R_RESULT, R_LIFE_TAIL = 72, REPORT_WORDS };
enum { BUSY, DONE, ERROR, ABORTED, INPUTS };
enum { INSERT_PEG = 100, SUCCESS = 1, MIRROR = 1000, MOST_CYCLES = 100000 };

static modbus_t *line;
static uint16_t command[COMMAND_WORDS], report[REPORT_WORDS];

static void fail(const char *what) {
    printf("%s: %s\n", what, modbus_strerror(errno));
    exit(1);
}

static void cycle(void) {
    command[LIFE] = command[LIFE_TAIL] = command[LIFE] % 0xFFFF + 1;
    if (modbus_write_registers(line, 0, COMMAND_WORDS, command) != COMMAND_WORDS) fail("FC16");
    do {
        if (modbus_read_input_registers(line, 0, REPORT_WORDS, report) != REPORT_WORDS) fail("FC4");
    } while (report[R_LIFE] != report[R_LIFE_TAIL]);
}

static int run(void) {
    uint8_t inputs[INPUTS];
    int is_done;

    command[SEQUENCE]++;
    command[CODE] = INSERT_PEG;
    for (int n = 0; n < MOST_CYCLES; n++) {
        cycle();
        if (report[R_SEQUENCE] == command[SEQUENCE] && report[R_RESULT] != 0) break;
        if (report[R_ANSWERED] == command[SEQUENCE] && report[R_REFUSAL] != 0) return 0;
    }
    if (modbus_read_input_bits(line, 0, INPUTS, inputs) != INPUTS) fail("FC2");
    is_done = report[R_SEQUENCE] == command[SEQUENCE] && report[R_RESULT] == SUCCESS;
    is_done = is_done && inputs[DONE] && !inputs[BUSY] && !inputs[ERROR] && !inputs[ABORTED];
    command[ACKNOWLEDGE] = command[SEQUENCE];
    for (int n = 0; n < MOST_CYCLES && report[R_RESULT] != 0; n++) cycle();
    return is_done && report[R_RESULT] == 0;
}

static void expect(const char *what, int returned, int error) {
    if (returned != -1 || errno != error) {
        printf("%s: %d, %s instead of %s\n", what, returned, modbus_strerror(errno), modbus_strerror(error));
        exit(1);
    }
}

static void other_functions(void) {
    uint16_t words[REPORT_WORDS], exchanged[2], recipe = 7;
    uint8_t coils[3];

    if (modbus_read_registers(line, MIRROR, REPORT_WORDS, words) != REPORT_WORDS) fail("FC3");
    if (words[R_VERSION] != report[R_VERSION]) fail("FC3: another version");
    if (modbus_write_register(line, RECIPE, recipe) != 1) fail("FC6");
    if (modbus_write_and_read_registers(line, RECIPE, 1, &recipe, SEQUENCE, 2, exchanged) != 2) fail("FC23");
    if (exchanged[0] != command[SEQUENCE] || exchanged[1] != command[CODE]) fail("FC23: other values");
    if (modbus_read_bits(line, 0, 3, coils) != 3) fail("FC1");
    if (modbus_write_bit(line, 2, 0) != 1) fail("FC5");
    coils[0] = coils[1] = coils[2] = 0;
    if (modbus_write_bits(line, 0, 3, coils) != 3) fail("FC15");
    expect("FC3 beyond the block", modbus_read_registers(line, COMMAND_WORDS, 1, words), EMBXILADD);
    expect("FC6 into the report", modbus_write_register(line, MIRROR, 1), EMBXILADD);
    expect("FC17", modbus_report_slave_id(line, sizeof words, (uint8_t *)words), EMBXILFUN);
}

int main(int count, char **words) {
    int done = 0, commands;

    if (count != 5) return 2;
    if (strcmp(words[1], "tcp") == 0) {
        line = modbus_new_tcp(words[2], atoi(words[3]));
    } else {
        line = modbus_new_rtu(words[2], 115200, 'N', 8, 1);
        if (line != NULL) modbus_set_slave(line, atoi(words[3]));
    }
    if (line == NULL || modbus_connect(line) != 0) fail("connect");
    modbus_set_response_timeout(line, 10, 0);
    if (modbus_read_input_registers(line, 0, REPORT_WORDS, report) != REPORT_WORDS) fail("FC4");
    command[SEQUENCE] = report[R_SEQUENCE];
    command[VERSION] = report[R_VERSION];
    cycle();
    commands = atoi(words[4]);
    for (int n = 0; n < commands; n++) done += run();
    other_functions();
    printf("triggered %d done %d\n", commands, done);
    modbus_close(line);
    modbus_free(line);
    return 0;
}
