// SPDX-License-Identifier: Apache-2.0
// The success switch under the hole: a changeover microswitch on an ATmega328P at 16 MHz that reports over its UART.
//
// Wiring: common to ground, normally open contact to PD4, normally closed contact to PD7; PB5 lights while closed.
// The two contacts contradict each other when a wire breaks or shorts, so that a broken cable never looks like a peg.
// The packet is described in drivers/switch/wire.py, which decodes it.

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/pgmspace.h>
#include <avr/sleep.h>
#include <avr/wdt.h>
#include <stdbool.h>
#include <stdint.h>
#include <util/crc16.h>

#define BAUD_RATE 38400UL
#define DEBOUNCE 5       // ms that a reading must last before it counts
#define DISAGREEMENT 50  // ms that both contacts may be open or closed: the lever's travel takes less
#define HEARTBEAT 25     // ms between packets while nothing changes

enum { START = 0xD1 };
enum { UNKNOWN, OPEN, CLOSED, DISAGREE };
enum { RAM_BROKEN = 1, FLASH_BROKEN = 2, WATCHDOG_RESET = 4, BROWN_OUT_RESET = 8 };
enum { NO = 1 << PD4, NC = 1 << PD7 };
enum { LENGTH = 10 };
enum { HUNG = 0x5AC3 };  // after power-up, memory holds this value only by a chance of 1 in 65536

static volatile bool ticked;
static uint8_t packet[LENGTH];
static volatile uint8_t sent = LENGTH;

static uint8_t reset_cause __attribute__((section(".noinit")));
static uint16_t hung __attribute__((section(".noinit")));

// After a watchdog reset the watchdog runs on with its shortest period: stop it before anything else.
void keep_reset_cause(void) __attribute__((naked, used, section(".init3")));
void keep_reset_cause(void)
{
    reset_cause = MCUSR;
    MCUSR = 0;
    wdt_disable();
}

// The watchdog interrupts first and resets the chip one period later, if interrupts are blocked too. The interrupt starts
// the program again past the boot loader: the boot loader of older Nanos leaves the watchdog running and never gets to the
// program, and Optiboot clears the cause of a reset.
ISR(WDT_vect, ISR_NAKED)
{
    hung = HUNG;
    __asm__ volatile("jmp 0");
}

ISR(TIMER0_COMPA_vect)
{
    ticked = true;
}

ISR(USART_UDRE_vect)
{
    UDR0 = packet[sent++];
    if (sent == LENGTH)
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
}

// Write and read back every byte between the variables and the stack.
static bool ram_is_good(void)
{
    extern uint8_t __heap_start;
    for (volatile uint8_t *byte = &__heap_start; byte < (uint8_t *)SP - 32; byte++)
        for (uint8_t pattern = 0x55; pattern != 0; pattern = pattern == 0x55 ? 0xAA : 0) {
            *byte = pattern;
            if (*byte != pattern)
                return false;
        }
    return true;
}

static uint32_t crc32(uint32_t crc, uint8_t byte)
{
    crc ^= (uint32_t)byte << 24;
    for (uint8_t bit = 0; bit < 8; bit++)
        crc = crc & 0x80000000UL ? crc << 1 ^ 0x04C11DB7UL : crc << 1;
    return crc;
}

// The Makefile appends the POSIX `cksum` of the program to the program.
static bool flash_is_good(void)
{
    uint32_t crc = 0;
    for (uint16_t at = 0; at < PROGRAM_SIZE; at++)
        crc = crc32(crc, pgm_read_byte(at));
    for (uint16_t length = PROGRAM_SIZE; length != 0; length >>= 8)
        crc = crc32(crc, (uint8_t)length);
    return ~crc == pgm_read_dword(PROGRAM_SIZE);
}

static void send(uint8_t contacts, uint8_t health, uint32_t time)
{
    uint16_t crc = 0xFFFF;
    packet[0] = START;
    packet[1] = FIRMWARE;
    packet[2] = contacts;
    packet[3] = health;
    packet[4] = time & 0x7F;
    packet[5] = time >> 7 & 0x7F;
    packet[6] = time >> 14 & 0x7F;
    for (uint8_t i = 0; i < LENGTH - 3; i++)
        crc = _crc_xmodem_update(crc, packet[i]);
    packet[7] = crc & 0x7F;
    packet[8] = crc >> 7 & 0x7F;
    packet[9] = crc >> 14;
    sent = 0;
    UCSR0B |= _BV(UDRIE0);
}

static uint8_t reading(uint8_t pins)
{
    if ((pins & (NO | NC)) == NO)
        return OPEN;
    if ((pins & (NO | NC)) == NC)
        return CLOSED;
    return DISAGREE;
}

int main(void)
{
    uint8_t health = ram_is_good() ? 0 : RAM_BROKEN;
    if (!flash_is_good())
        health |= FLASH_BROKEN;
    const bool is_broken = health != 0;
    if (reset_cause & _BV(WDRF) || hung == HUNG)
        health |= WATCHDOG_RESET;
    hung = 0;
    if (reset_cause & _BV(BORF))
        health |= BROWN_OUT_RESET;

    DDRB = _BV(DDB5);
    DDRD = 0;
    PORTD = NO | NC;  // pull-ups
    TCCR0A = _BV(WGM01);
    TCCR0B = _BV(CS01) | _BV(CS00);
    OCR0A = F_CPU / 64 / 1000 - 1;
    TIMSK0 = _BV(OCIE0A);
    UCSR0A = _BV(U2X0);
    UBRR0 = (F_CPU + BAUD_RATE * 4) / (BAUD_RATE * 8) - 1;
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(TXEN0);
    set_sleep_mode(SLEEP_MODE_IDLE);
    wdt_enable(WDTO_120MS);
    WDTCSR |= _BV(WDIE);
    sei();

    uint32_t time = 0;  // ms since the reset
    uint8_t accepted = UNKNOWN, last = UNKNOWN, lasted = 0, quiet = 0;
    bool is_due = false;
    for (;;) {
        cli();
        while (!ticked) {
            sleep_enable();
            sei();
            sleep_cpu();
            sleep_disable();
            cli();
        }
        ticked = false;
        sei();
        wdt_reset();
        time++;

        const uint8_t pins = PIND, now = reading(pins);
        if (now != last) {
            last = now;
            lasted = 0;
        }
        if (lasted < UINT8_MAX)
            lasted++;
        if (!is_broken && now != accepted && lasted >= (now == DISAGREE ? DISAGREEMENT : DEBOUNCE)) {
            accepted = now;
            is_due = true;
        }
        PORTB = accepted == CLOSED ? _BV(PORTB5) : 0;

        if (quiet < HEARTBEAT)
            quiet++;
        if ((is_due || quiet == HEARTBEAT) && sent == LENGTH) {
            // Low pins are contacts that connect to ground.
            send(accepted | (pins & NO ? 0 : 4) | (pins & NC ? 0 : 8), health, time);
            is_due = false;
            quiet = 0;
        }
    }
}
