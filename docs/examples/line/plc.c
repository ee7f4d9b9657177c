/* The soft PLC around the compiled line: every 10 ms it writes Command, reads Report, and runs the program once.
 *
 *     plc HOST PORT [PEGS [SECONDS]]
 *
 * The connection is opened again whenever it is lost. It ends when the order is done, and prints what came of it. */

#define _POSIX_C_SOURCE 200809L
#include <modbus.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "iec_std_lib.h"
#include "accessor.h"
#include "POUS.h"

enum { COMMAND_WORDS = sizeof(((LINE *)0)->COMMAND.value.table) / sizeof(WORD) };
enum { REPORT_WORDS = sizeof(((LINE *)0)->REPORT.value.table) / sizeof(WORD) };
enum { CYCLE = 10 * 1000 * 1000 }; /* ns */

TIME __CURRENT_TIME;
extern LINE CPU__MAIN;
void config_init__(void);
void config_run__(unsigned long tick);

static modbus_t *connect_to(const char *host, int port) {
    modbus_t *line = modbus_new_tcp(host, port);
    if (line != NULL && modbus_connect(line) == 0) return line;
    modbus_free(line);
    return NULL;
}

static int exchange(modbus_t *line) {
    WORD *command = CPU__MAIN.COMMAND.value.table, *report = CPU__MAIN.REPORT.value.table;
    return modbus_write_registers(line, 0, COMMAND_WORDS, command) == COMMAND_WORDS &&
           modbus_read_input_registers(line, 0, REPORT_WORDS, report) == REPORT_WORDS;
}

int main(int count, char **words) {
    modbus_t *line = NULL;
    struct timespec pause = {0, CYCLE};
    unsigned long ticks, tick;

    if (count < 3) return 2;
    ticks = (count > 4 ? atol(words[4]) : 3600) * 100;
    config_init__();
    if (count > 3) CPU__MAIN.WANTED.value = (UINT)atoi(words[3]);
    for (tick = 0; tick < ticks && !CPU__MAIN.ISOVER.value; tick++) {
        clock_gettime(CLOCK_MONOTONIC, (struct timespec *)&__CURRENT_TIME);
        config_run__(tick);
        if (line == NULL) line = connect_to(words[1], atoi(words[2]));
        if (line != NULL && !exchange(line)) {
            modbus_close(line);
            modbus_free(line);
            line = NULL;
        }
        nanosleep(&pause, NULL);
    }
    printf("fed %u good %u bad %u recovered %u\n", CPU__MAIN.FED.value, CPU__MAIN.GOOD.value, CPU__MAIN.BAD.value,
           CPU__MAIN.RECOVERED.value);
    if (CPU__MAIN.NEEDSPERSON.value) printf("a peg is left in the cell: take it away, then send CLEARED\n");
    return CPU__MAIN.ISOVER.value && CPU__MAIN.GOOD.value == CPU__MAIN.WANTED.value ? 0 : 1;
}
