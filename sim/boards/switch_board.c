// SPDX-License-Identifier: Apache-2.0
// An ATmega328P that runs the firmware of the success switch in simavr; a shared library for sim/switch_board.py.

#include <avr_ioport.h>
#include <avr_uart.h>
#include <sim_avr.h>
#include <sim_hex.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FREQUENCY = 16000000, NO_PIN = 4, NC_PIN = 7 };
enum { CHARACTER = 10 * 52 * 8 };  // cycles: ten bits, UBRR0 = 51 at double speed
enum { LARGEST = 4096, PIN_REGISTER = 0x29 };

struct chip {
    avr_t *avr;
    uint8_t pins;  // what the outside puts on port D
    int resets;    // including the one at power-up
    int count;
    uint8_t bytes[LARGEST];
    uint64_t cycles[LARGEST];
};

static void quiet(avr_t *avr, const int level, const char *format, va_list list)
{
    (void)avr;
    if (level <= LOG_ERROR)
        vfprintf(stderr, format, list);
}

static void never_wait(avr_t *avr, avr_cycle_count_t cycles)
{
    (void)avr, (void)cycles;
}

static void sent(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    struct chip *chip = parameter;
    (void)irq;
    if (chip->count < LARGEST) {
        chip->bytes[chip->count] = (uint8_t)value;
        chip->cycles[chip->count++] = chip->avr->cycle + CHARACTER;
    }
}

// simavr clears the pins with the registers; the outside does not change because the chip starts anew.
static void started(avr_t *avr)
{
    struct chip *chip = avr->custom.data;
    avr->data[PIN_REGISTER] = chip->pins;
    chip->resets++;
}

void chip_free(struct chip *chip)
{
    if (chip->avr != NULL)
        avr_terminate(chip->avr);
    free(chip);
}

// Return a chip with the program of an Intel HEX file, just powered up; NULL when that is not possible.
struct chip *chip_new(const char *path)
{
    struct chip *chip = calloc(1, sizeof *chip);
    avr_global_logger_set(quiet);
    chip->avr = avr_make_mcu_by_name("atmega328p");
    if (chip->avr == NULL) {
        free(chip);
        return NULL;
    }
    avr_init(chip->avr);
    chip->avr->frequency = FREQUENCY;
    chip->avr->sleep = never_wait;
    chip->avr->custom.data = chip;
    chip->avr->reset = started;
    uint32_t size = 0, base = 0;
    uint8_t *program = read_ihex_file(path, &size, &base);
    if (program == NULL || base + size > chip->avr->flashend + 1u) {
        free(program);
        chip_free(chip);
        return NULL;
    }
    memcpy(chip->avr->flash + base, program, size);
    free(program);
    chip->avr->codeend = chip->avr->flashend;
    uint32_t flags = 0;  // neither echo to the terminal nor sleep while the status is polled
    avr_ioctl(chip->avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(avr_io_getirq(chip->avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), sent, chip);
    return chip;
}

// Run until `cycle` with these levels at the pins; `bytes` and `cycles` then show what left the UART meanwhile, each
// byte with the cycle at which its last bit ends. Return their number, or -1 when the chip crashed.
int chip_run(struct chip *chip, uint64_t cycle, int no, int nc)
{
    chip->count = 0;
    chip->pins = (no != 0) << NO_PIN | (nc != 0) << NC_PIN;
    // The outside wins over the chip's own pull-ups, also when the program sets them later.
    avr_ioport_external_t outside = {.name = 'D', .mask = 1 << NO_PIN | 1 << NC_PIN, .value = chip->pins};
    avr_ioctl(chip->avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('D'), &outside);
    avr_raise_irq(avr_io_getirq(chip->avr, AVR_IOCTL_IOPORT_GETIRQ('D'), NO_PIN), no != 0);
    avr_raise_irq(avr_io_getirq(chip->avr, AVR_IOCTL_IOPORT_GETIRQ('D'), NC_PIN), nc != 0);
    while (chip->avr->cycle < cycle)
        if (avr_run(chip->avr) == cpu_Crashed)
            return -1;
    return chip->count;
}

const uint8_t *chip_bytes(const struct chip *chip)
{
    return chip->bytes;
}

const uint64_t *chip_cycles(const struct chip *chip)
{
    return chip->cycles;
}

int chip_resets(const struct chip *chip)
{
    return chip->resets;
}

// Pull the reset pin.
void chip_reset(struct chip *chip)
{
    avr_reset(chip->avr);
}

// Overwrite a byte of memory or a register, as an error inside the chip would.
void chip_spoil_data(struct chip *chip, uint16_t address, uint8_t value)
{
    if (address <= chip->avr->ramend)
        chip->avr->data[address] = value;
}

// Flip the lowest bit of a byte of the program.
void chip_spoil_program(struct chip *chip, uint16_t address)
{
    if (address <= chip->avr->flashend)
        chip->avr->flash[address] ^= 1;
}
