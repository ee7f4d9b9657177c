/* A PLC on libmodbus: runs insert_peg COUNT times and counts the answers, then asks for what no cell may give.
 *
 *     libmodbus_client tcp HOST PORT COUNT
 *     libmodbus_client rtu PORT UNIT COUNT
 *
 * Addresses and numbers are those of `cell map --format h`. */

#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <modbus.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "cell_map.h"

enum { MOST_CYCLES = 1000000, PAUSE = 1000000 }; /* ns */

static modbus_t *line;
static uint16_t command[CELL_COMMAND_SIZE], report[CELL_REPORT_SIZE];

static void fail(const char *what) {
    printf("%s: %s\n", what, modbus_strerror(errno));
    exit(1);
}

static void cycle(void) {
    const struct timespec pause = {0, PAUSE};

    command[CELL_COMMAND_LIFE] = command[CELL_COMMAND_LIFE_TAIL] = command[CELL_COMMAND_LIFE] % 0xFFFF + 1;
    if (modbus_write_registers(line, 0, CELL_COMMAND_SIZE, command) != CELL_COMMAND_SIZE) fail("FC16");
    do {
        if (modbus_read_input_registers(line, 0, CELL_REPORT_SIZE, report) != CELL_REPORT_SIZE) fail("FC4");
    } while (report[CELL_REPORT_LIFE] != report[CELL_REPORT_LIFE_TAIL]);
    nanosleep(&pause, NULL);
}

static int run(void) {
    uint8_t inputs[CELL_DISCRETES_SIZE];
    int is_done;

    command[CELL_COMMAND_SEQUENCE]++;
    command[CELL_COMMAND_CODE] = CELL_CODE_INSERT_PEG;
    for (int n = 0; n < MOST_CYCLES; n++) {
        cycle();
        if (report[CELL_REPORT_SEQUENCE] == command[CELL_COMMAND_SEQUENCE] && report[CELL_REPORT_RESULT] != 0) break;
        if (report[CELL_REPORT_ANSWERED] == command[CELL_COMMAND_SEQUENCE] && report[CELL_REPORT_REFUSAL] != 0) return 0;
    }
    if (modbus_read_input_bits(line, 0, CELL_DISCRETES_SIZE, inputs) != CELL_DISCRETES_SIZE) fail("FC2");
    is_done = report[CELL_REPORT_SEQUENCE] == command[CELL_COMMAND_SEQUENCE] && report[CELL_REPORT_RESULT] == CELL_RESULT_SUCCESS;
    is_done = is_done && inputs[CELL_DISCRETE_DONE] && !inputs[CELL_DISCRETE_BUSY] && !inputs[CELL_DISCRETE_ERROR] && !inputs[CELL_DISCRETE_COMMAND_ABORTED];
    command[CELL_COMMAND_ACKNOWLEDGE] = command[CELL_COMMAND_SEQUENCE];
    for (int n = 0; n < MOST_CYCLES && report[CELL_REPORT_RESULT] != 0; n++) cycle();
    return is_done && report[CELL_REPORT_RESULT] == 0;
}

static void expect(const char *what, int returned, int error) {
    if (returned != -1 || errno != error) {
        printf("%s: %d, %s instead of %s\n", what, returned, modbus_strerror(errno), modbus_strerror(error));
        exit(1);
    }
}

static void other_functions(void) {
    uint16_t words[CELL_REPORT_SIZE], exchanged[2], recipe = 7;
    uint8_t coils[3], name[64];
    int size;

    if (modbus_read_registers(line, CELL_MIRROR, CELL_REPORT_SIZE, words) != CELL_REPORT_SIZE) fail("FC3");
    if (words[CELL_REPORT_VERSION] != report[CELL_REPORT_VERSION]) fail("FC3: another version");
    if (modbus_write_register(line, CELL_COMMAND_RECIPE, recipe) != 1) fail("FC6");
    if (modbus_write_and_read_registers(line, CELL_COMMAND_RECIPE, 1, &recipe, CELL_COMMAND_SEQUENCE, 2, exchanged) != 2) fail("FC23");
    if (exchanged[0] != command[CELL_COMMAND_SEQUENCE] || exchanged[1] != command[CELL_COMMAND_CODE]) fail("FC23: other values");
    if (modbus_read_bits(line, 0, 3, coils) != 3) fail("FC1");
    if (modbus_write_bit(line, 2, 0) != 1) fail("FC5");
    coils[0] = coils[1] = coils[2] = 0;
    if (modbus_write_bits(line, 0, 3, coils) != 3) fail("FC15");
    expect("FC3 beyond the block", modbus_read_registers(line, CELL_COMMAND_SIZE, 1, words), EMBXILADD);
    expect("FC6 into the report", modbus_write_register(line, CELL_MIRROR, 1), EMBXILADD);
    size = modbus_report_slave_id(line, sizeof name, name);
    if (size < 2) fail("FC17");
    if (memcmp(name, "tactile-insertion-cell", size - 1) != 0 || name[size - 1] != 0xFF) fail("FC17: another name");
    if (modbus_mask_write_register(line, CELL_COMMAND_RECIPE, 0x00F2, 0x0025) != 1) fail("FC22");
    if (modbus_read_registers(line, CELL_COMMAND_RECIPE, 1, words) != 1) fail("FC3");
    if (words[0] != ((recipe & 0x00F2) | (0x0025 & ~0x00F2))) fail("FC22: another value");
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
    if (modbus_read_input_registers(line, 0, CELL_REPORT_SIZE, report) != CELL_REPORT_SIZE) fail("FC4");
    command[CELL_COMMAND_SEQUENCE] = report[CELL_REPORT_SEQUENCE];
    command[CELL_COMMAND_VERSION] = report[CELL_REPORT_VERSION];
    cycle();
    commands = atoi(words[4]);
    for (int n = 0; n < commands; n++) done += run();
    other_functions();
    printf("triggered %d done %d\n", commands, done);
    modbus_close(line);
    modbus_free(line);
    return 0;
}
