/* The serial line, with the receiver of the real chip. */
#include <string.h>

#include "board/board_internal.h"

#define DATA_OVERRUN 0x08 /* of UCSR0A */
#define FIFO 3          /* bytes of the real receiver: two, and the one in the shift register */
#define BYTE_BITS 10

/* Reading a byte clears the overrun flag, as on the chip. */
static uint8_t uart_read(avr_t *avr, avr_io_addr_t address, void *parameter)
{
    (void)parameter;
    board.lost = false;
    return board.read_byte(avr, address, board.byte_reader);
}

static uint8_t uart_status(avr_t *avr, avr_io_addr_t address, void *parameter)
{
    uint8_t status = board.read_status ? board.read_status(avr, address, board.status_reader) : avr->data[address];
    (void)parameter;
    return board.lost ? status | DATA_OVERRUN : status;
}

static void uart_sent(avr_irq_t *irq, uint32_t value, void *parameter)
{
    (void)irq, (void)parameter;
    if (board.line_end != 0 && board.avr->cycle >= board.line_end)
        board_record_worst(&board.worst.answer, board.avr->cycle - board.line_end);
    board.line_end = 0;
    if (board.sent_count < sizeof board.sent)
        board.sent[board.sent_count++] = (uint8_t)value;
}

avr_cycle_count_t board_byte_cycles(void)
{
    uint8_t low = board.avr->data[0xC4], high = board.avr->data[0xC5] & 15;
    unsigned samples = avr_regbit_get(board.avr, board.uart->u2x) ? 8 : 16;
    return (avr_cycle_count_t)(high << 8 | low) * samples * BYTE_BITS + samples * BYTE_BITS;
}

/* Bytes in the receiver of simavr, a ring of 64. */
static unsigned waiting_bytes(void)
{
    const uart_fifo_t *fifo = &board.uart->input;
    return (unsigned)(fifo->write - fifo->read) & 63;
}

bool board_ready(void)
{
    return board.avr->cycle >= board.busy_until || !board_runs();
}

void board_receive(uint8_t byte)
{
    if (!board_runs() || !avr_regbit_get(board.avr, board.uart->rxen))
        return;
    board.busy_until = board.avr->cycle + board_byte_cycles();
    if (waiting_bytes() >= FIFO || board.loses_next) {
        board.overruns++;
        board.loses_next = false;
        board.lost = true;
        return;
    }
    if (byte == '\n')
        board.line_end = board.busy_until;
    avr_raise_irq(avr_io_getirq(board.avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT), byte);
}

size_t board_transmitted(uint8_t *bytes, size_t size)
{
    size_t count = board.sent_count < size ? board.sent_count : size;
    memcpy(bytes, board.sent, count);
    memmove(board.sent, board.sent + count, board.sent_count - count);
    board.sent_count -= count;
    return count;
}

void board_lose_next(void)
{
    board.loses_next = true;
}

unsigned long board_overruns(void)
{
    return board.overruns;
}

void board_wire_uart(void)
{
    uint32_t flags = 0;
    avr_io_addr_t data = board.uart->r_udr - DATA_TO_IO, status = board.uart->r_ucsra - DATA_TO_IO;
    avr_ioctl(board.avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    board.read_byte = board.avr->io[data].r.c;
    board.byte_reader = board.avr->io[data].r.param;
    board.avr->io[data].r.c = uart_read;
    board.read_status = board.avr->io[status].r.c;
    board.status_reader = board.avr->io[status].r.param;
    board.avr->io[status].r.c = uart_status;
    avr_irq_register_notify(avr_io_getirq(board.avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), uart_sent, NULL);
}
