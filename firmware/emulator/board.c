#include "board.h"

#include <simavr/avr_ioport.h>
#include <simavr/avr_spi.h>
#include <simavr/avr_uart.h>
#include <simavr/avr_watchdog.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <simavr/sim_interrupts.h>
#include <simavr/sim_io.h>
#include <stdio.h>
#include <string.h>

#include "say.h"

#define DATA_TO_IO 32 /* simavr's tables of registers begin behind the 32 of the core */
#define SELECT_PIN 2    /* of port B */
#define ALIVE_MASK 0x10 /* of port D */
#define MCUSR_DATA 0x54
#define DATA_OVERRUN 0x08 /* of UCSR0A */
#define START_UP 0.065  /* s, the chip's own after any reset */
#define HOLD 0.25       /* s that the drivers' reset stays up by its capacitor when nobody drives it */
#define FIFO 3          /* bytes of the real receiver: two, and the one that comes in */
#define BYTE_BITS 10
#define AVR_MACHINE 83 /* EM_AVR */
#define JUMP_TO_ITSELF 0xCFFF

static struct {
    struct plant *plant;
    avr_t *avr;
    avr_uart_t *uart;
    avr_spi_t *spi;
    void (*reset)(avr_t *avr);
    bool powered, held, was_reset, by_order, restarting;
    double boot, starts, alive_until;
    avr_cycle_count_t debt, busy_until;
    uint8_t spi_byte, sent[4096];
    size_t sent_count;
    uint16_t hung_word;
    avr_flashaddr_t hung_at;
    unsigned long overruns;
    bool loses_next, lost;
    avr_io_read_t read_byte, read_status;
    void *byte_reader, *status_reader;
    avr_io_t listener;
    avr_cycle_count_t looped, slept, line_end;
    struct board_times worst;
} board;

static void log_nothing(avr_t *avr, const int level, const char *format, va_list arguments)
{
    (void)avr, (void)level, (void)format, (void)arguments;
}

/* SPI: a byte takes eight clocks of the rate that is set, not simavr's 100 us. */

static avr_cycle_count_t spi_cycles(void)
{
    static const uint8_t dividers[8] = {4, 2, 16, 8, 64, 32, 128, 64};
    uint8_t control = board.avr->data[board.spi->r_spcr] & 3, doubled = board.avr->data[board.spi->r_spsr] & 1;
    return 8U * dividers[control << 1 | doubled];
}

static avr_cycle_count_t spi_done(avr_t *avr, avr_cycle_count_t when, void *parameter)
{
    (void)when, (void)parameter;
    board.spi->input_data_register = chain_shift(&board.plant->chain, board.spi_byte);
    avr_raise_interrupt(avr, &board.spi->spi);
    return 0;
}

static void spi_write(avr_t *avr, avr_io_addr_t address, uint8_t value, void *parameter)
{
    (void)address, (void)parameter;
    if (!avr_regbit_get(avr, board.spi->spe))
        return;
    avr_clear_interrupt(avr, &board.spi->spi);
    board.spi_byte = value;
    avr_cycle_timer_register(avr, spi_cycles(), spi_done, NULL);
}

static void select_changed(avr_irq_t *irq, uint32_t value, void *parameter)
{
    (void)irq, (void)parameter;
    chain_select(&board.plant->chain, (value & 1) == 0);
}

/* The serial line */

static void note(double *worst, avr_cycle_count_t cycles)
{
    if ((double)cycles / BOARD_HZ > *worst)
        *worst = (double)cycles / BOARD_HZ;
}

/* Reading a byte takes back the flag that others were lost, as on the chip. */
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
        note(&board.worst.answer, board.avr->cycle - board.line_end);
    board.line_end = 0;
    if (board.sent_count < sizeof board.sent)
        board.sent[board.sent_count++] = (uint8_t)value;
}

static avr_cycle_count_t byte_cycles(void)
{
    uint8_t low = board.avr->data[0xC4], high = board.avr->data[0xC5] & 15;
    unsigned samples = avr_regbit_get(board.avr, board.uart->u2x) ? 8 : 16;
    return (avr_cycle_count_t)(high << 8 | low) * samples * BYTE_BITS + samples * BYTE_BITS;
}

static bool runs(void)
{
    return board.powered && !board.held && board.plant->time >= board.starts;
}

/* Bytes in the receiver of simavr, a ring of 64. */
static unsigned waiting_bytes(void)
{
    const uart_fifo_t *fifo = &board.uart->input;
    return (unsigned)(fifo->write - fifo->read) & 63;
}

bool board_wants(void)
{
    return board.avr->cycle >= board.busy_until || !runs();
}

void board_give(uint8_t byte)
{
    if (!runs() || !avr_regbit_get(board.avr, board.uart->rxen))
        return;
    board.busy_until = board.avr->cycle + byte_cycles();
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

size_t board_sent(uint8_t *bytes, size_t size)
{
    size_t count = board.sent_count < size ? board.sent_count : size;
    memcpy(bytes, board.sent, count);
    memmove(board.sent, board.sent + count, board.sent_count - count);
    board.sent_count -= count;
    return count;
}

/* Resets */

static void unhang(void)
{
    if (board.hung_word == 0)
        return;
    memcpy(board.avr->flash + board.hung_at, &board.hung_word, sizeof board.hung_word);
    board.hung_word = 0;
}

/* simavr calls it at the end of each reset, the watchdog's too. */
static void after_reset(avr_t *avr)
{
    if (board.reset != NULL)
        board.reset(avr);
    unhang();
    board.was_reset = true;
    board.sent_count = 0;
    board.busy_until = board.debt = board.looped = board.line_end = 0;
    board.starts = board.plant->time + START_UP;
    chain_select(&board.plant->chain, false);
    if (!board.by_order)
        say("\"event\": \"reset\", \"t\": %.4f, \"reason\": \"watchdog\"", board.plant->time);
}

void board_reset(enum board_reset reason)
{
    static const char *const names[] = {"power", "opened", "watchdog", "ordered"};
    static const uint8_t flags[] = {1, 2, 8, 2}; /* of MCUSR */
    if (!board.powered)
        return;
    board.by_order = true;
    avr_reset(board.avr);
    board.by_order = false;
    board.avr->data[MCUSR_DATA] = flags[reason];
    board.starts = board.plant->time + START_UP + board.boot;
    say("\"event\": \"reset\", \"t\": %.4f, \"reason\": \"%s\"", board.plant->time, names[reason]);
}

void board_power(bool on)
{
    bool begins = on && !board.powered;
    board.powered = on;
    if (begins)
        board_reset(RESET_POWER);
    if (!on)
        board.alive_until = board.plant->time;
}

void board_hold(bool held)
{
    bool ends = board.held && !held;
    board.held = held;
    if (ends)
        board_reset(RESET_ORDERED);
}

void board_hang(void)
{
    const uint16_t jump = JUMP_TO_ITSELF;
    unhang();
    board.hung_at = board.avr->pc;
    memcpy(&board.hung_word, board.avr->flash + board.hung_at, sizeof board.hung_word);
    memcpy(board.avr->flash + board.hung_at, &jump, sizeof jump);
    board.avr->sreg[S_I] = 0;
    board.avr->state = cpu_Running;
}

/* Time */

/* A pin that nobody drives keeps its level for a while; a controller without power pulls it down. */
static void see_alive_line(void)
{
    avr_ioport_state_t port = {.ddr = 0};
    double now = board.plant->time;
    avr_ioctl(board.avr, AVR_IOCTL_IOPORT_GETSTATE('D'), &port);
    bool driven = runs() && (port.ddr & ALIVE_MASK) != 0;
    if (driven)
        board.alive_until = (port.port & ALIVE_MASK) != 0 ? now + HOLD : now;
    bool alive = board.powered && now < board.alive_until;
    for (int i = 0; i < CHIPS; i++)
        l6470_wake(&board.plant->chain.chips[i], alive);
}

static avr_cycle_count_t wake(avr_t *avr, avr_cycle_count_t when, void *parameter)
{
    (void)avr, (void)when, (void)parameter;
    return 0;
}

static void run_processor(void)
{
    const avr_cycle_count_t slice = (avr_cycle_count_t)(BOARD_HZ * PLANT_DT);
    if (board.debt >= slice) { /* it slept through */
        board.debt -= slice;
        return;
    }
    avr_cycle_count_t wanted = slice - board.debt, begin = board.avr->cycle;
    board.was_reset = false;
    if (board.avr->data[0xC4] != 0)
        board.uart->cycles_per_byte = byte_cycles();
    avr_cycle_timer_register(board.avr, wanted, wake, NULL);
    while (board.avr->cycle - begin < wanted && !board.was_reset && !board_crashed()) {
        avr_run(board.avr);
    }
    board.debt = board.was_reset ? 0 : board.avr->cycle - begin - wanted;
}

void board_step(void)
{
    if (runs() && !board_crashed())
        run_processor();
    see_alive_line();
    plant_step(board.plant);
}

void board_lose_next(void)
{
    board.loses_next = true;
}

struct board_times board_times(void)
{
    struct board_times times = board.worst;
    memset(&board.worst, 0, sizeof board.worst);
    return times;
}

unsigned long board_overruns(void)
{
    return board.overruns;
}

bool board_crashed(void)
{
    return board.avr->state == cpu_Crashed || board.avr->state == cpu_Done;
}

static void *module(const char *kind)
{
    for (avr_io_t *io = board.avr->io_port; io != NULL; io = io->next)
        if (strcmp(io->kind, kind) == 0)
            return io;
    return NULL;
}

/* The processor sleeps, and we need not wait. */
static void sleep_through(avr_t *avr, avr_cycle_count_t cycles)
{
    (void)avr;
    board.slept += cycles;
}

/* The loop resets the watchdog each time round. */
static int hear_watchdog(avr_io_t *io, uint32_t what, void *parameter)
{
    (void)io, (void)parameter;
    if (what == AVR_IOCTL_WATCHDOG_RESET) {
        if (board.looped != 0)
            note(&board.worst.loop, board.avr->cycle - board.looped - board.slept);
        board.looped = board.avr->cycle;
        board.slept = 0;
    }
    return -1;
}

static void wire_uart(void)
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
}

static void wire(void)
{
    avr_t *avr = board.avr;
    board.uart = module("uart");
    board.spi = module("spi");
    board.reset = avr->reset;
    avr->reset = after_reset;
    avr->sleep = sleep_through;
    avr->run_cycle_limit = 1000;
    board.listener = (avr_io_t){.kind = "listener", .ioctl = hear_watchdog};
    avr_register_io(avr, &board.listener);
    wire_uart();
    avr->io[board.spi->r_spdr - DATA_TO_IO].w.c = spi_write;
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), uart_sent, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), SELECT_PIN), select_changed, NULL);
}

/* simavr takes anything for a program. */
static bool is_firmware(const char *elf)
{
    unsigned char head[20] = {0};
    FILE *file = fopen(elf, "rb");
    if (file == NULL)
        return false;
    bool whole = fread(head, sizeof head, 1, file) == 1;
    fclose(file);
    return whole && memcmp(head, "\177ELF", 4) == 0 && head[18] == AVR_MACHINE && head[19] == 0;
}

bool board_begin(struct plant *plant, const char *elf, double boot)
{
    elf_firmware_t firmware = {.frequency = (uint32_t)BOARD_HZ};
    avr_global_logger_set(log_nothing);
    board.plant = plant;
    board.boot = boot;
    if (!is_firmware(elf) || elf_read_firmware(elf, &firmware) != 0 || firmware.flash == NULL)
        return false;
    strcpy(firmware.mmcu, "atmega328p");
    firmware.frequency = (uint32_t)BOARD_HZ;
    board.avr = avr_make_mcu_by_name(firmware.mmcu);
    if (board.avr == NULL || avr_init(board.avr) != 0)
        return false;
    avr_load_firmware(board.avr, &firmware);
    wire();
    return true;
}
