/* The ATmega328P of an Arduino UNO R3: pins, clock, watchdog, and the loop. Pins are listed in firmware/README.md. */
#include <avr/eeprom.h>
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>
#include <util/atomic.h>
#include <util/delay.h>

#include "avr/uart.h"
#include "gantry.h"
#include "port.h"
#include "protocol.h"

#define SELECT PB2       /* D10, low during a frame */
#define DATA_OUT PB3     /* D11 */
#define DATA_IN PB4      /* D12, pulled up: an open line reads 1 */
#define DATA_CLOCK PB5   /* D13 */
#define DRIVERS_ALIVE PD4 /* D4, low resets the drivers */
#define TICKS_A_MS (F_CPU / 64 / 1000)

static volatile uint32_t milliseconds;

ISR(TIMER0_COMPA_vect)
{
    milliseconds++;
}

uint32_t port_now(void)
{
    uint32_t now;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { now = milliseconds; }
    return now;
}

/* The first byte sent reaches the last driver. */
void port_exchange(uint8_t *bytes)
{
    PORTB &= (uint8_t)~(1 << SELECT);
    for (uint8_t m = MOTORS; m-- > 0;) {
        SPDR = bytes[m];
        while (!(SPSR & (1 << SPIF))) {
        }
        bytes[m] = SPDR;
    }
    PORTB |= 1 << SELECT;
    _delay_us(1); /* the drivers need 800 ns */
}

void port_hold_drivers(void)
{
    PORTD &= (uint8_t)~(1 << DRIVERS_ALIVE);
}

void port_reset_drivers(void)
{
    port_hold_drivers();
    _delay_ms(1);
    PORTD |= 1 << DRIVERS_ALIVE;
    _delay_ms(2);
}

uint8_t port_memory_read(uint8_t address)
{
    return eeprom_read_byte((const uint8_t *)(uintptr_t)address);
}

void port_memory_write(uint8_t address, uint8_t byte)
{
    eeprom_write_byte((uint8_t *)(uintptr_t)address, byte);
}

bool port_memory_busy(void)
{
    return !eeprom_is_ready();
}

/* The pull-up comes before the output, so that a short reset does not reach the drivers. */
static void start_pins(void)
{
    PORTD |= 1 << DRIVERS_ALIVE;
    DDRD |= 1 << DRIVERS_ALIVE;
    PORTB |= (1 << SELECT) | (1 << DATA_IN);
    DDRB |= (1 << SELECT) | (1 << DATA_OUT) | (1 << DATA_CLOCK);
    SPCR = (1 << SPE) | (1 << MSTR) | (1 << CPOL) | (1 << CPHA); /* 4 MHz, mode 3 */
}

static void start_clock(void)
{
    TCCR0A = 1 << WGM01;
    TCCR0B = (1 << CS01) | (1 << CS00);
    OCR0A = TICKS_A_MS - 1;
    TIMSK0 = 1 << OCIE0A;
}

/* Sleep until the next interrupt, a millisecond at most. */
static void doze(void)
{
    cli();
    if (!uart_has_byte()) {
        sleep_enable();
        sei();
        sleep_cpu();
        sleep_disable();
    }
    sei();
}

int main(void)
{
    MCUSR = 0;
    wdt_enable(WDTO_120MS);
    start_pins();
    start_clock();
    uart_start();
    sei();
    gantry_start();
    for (;;) {
        wdt_reset();
        uint8_t byte;
        if (uart_read(&byte))
            gantry_receive(byte);
        gantry_tick();
        doze();
    }
}
