#include "avr/uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <string.h>
#include <util/atomic.h>

#include "port.h"
#include "protocol.h"

#define SIZE 128 /* of each buffer; a power of two */
#define NEXT(i) (((i) + 1) & (SIZE - 1))
#define ERRORS ((1 << FE0) | (1 << DOR0) | (1 << UPE0))

static volatile uint8_t in[SIZE], in_head, in_tail, out[SIZE], out_head, out_tail;
static volatile bool lost;

static bool put(uint8_t byte)
{
    uint8_t next = NEXT(in_head);
    if (next == in_tail)
        return false;
    in[in_head] = byte;
    in_head = next;
    return true;
}

/* A 0 precedes a byte that has an error or follows lost bytes. */
ISR(USART_RX_vect)
{
    bool damaged = (UCSR0A & ERRORS) != 0;
    uint8_t byte = UDR0;
    if (damaged || lost)
        lost = !put(0);
    if (!lost)
        lost = !put(byte);
}

ISR(USART_UDRE_vect)
{
    if (out_head == out_tail) {
        UCSR0B &= (uint8_t)~(1 << UDRIE0);
        return;
    }
    UDR0 = out[out_tail];
    out_tail = NEXT(out_tail);
}

void uart_start(void)
{
    UCSR0A = 1 << U2X0;
    UBRR0H = 0;
    UBRR0L = (uint8_t)((F_CPU + 4 * BAUD) / (8 * BAUD) - 1);
    UCSR0C = (1 << UCSZ01) | (1 << UCSZ00);
    UCSR0B = (1 << RXEN0) | (1 << TXEN0) | (1 << RXCIE0);
}

bool uart_has_byte(void)
{
    return in_head != in_tail;
}

bool uart_read(uint8_t *byte)
{
    if (!uart_has_byte())
        return false;
    *byte = in[in_tail];
    in_tail = NEXT(in_tail);
    return true;
}

static void queue(char c)
{
    out[out_head] = (uint8_t)c;
    out_head = NEXT(out_head);
}

void port_send_line(const char *line)
{
    uint8_t room = (uint8_t)(out_tail - out_head - 1) & (SIZE - 1);
    if (strlen(line) + 1 > room)
        return;
    while (*line != '\0')
        queue(*line++);
    queue('\n');
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { UCSR0B |= 1 << UDRIE0; }
}
