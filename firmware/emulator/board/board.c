#include "board/board.h"

#include <simavr/avr_watchdog.h>
#include <simavr/sim_elf.h>
#include <stdio.h>
#include <string.h>

#include "board/board_internal.h"

#define AVR_MACHINE 83 /* EM_AVR */

struct board board;

static void log_nothing(avr_t *avr, const int level, const char *format, va_list arguments)
{
    (void)avr, (void)level, (void)format, (void)arguments;
}

void board_record_worst(double *worst, avr_cycle_count_t cycles)
{
    if ((double)cycles / BOARD_HZ > *worst)
        *worst = (double)cycles / BOARD_HZ;
}

bool board_runs(void)
{
    return board.powered && !board.held && board.plant->time >= board.starts;
}

static avr_cycle_count_t wake(avr_t *avr, avr_cycle_count_t when, void *parameter)
{
    (void)avr, (void)when, (void)parameter;
    return 0;
}

static void run_processor(void)
{
    const avr_cycle_count_t slice = (avr_cycle_count_t)(BOARD_HZ * PLANT_DT);
    if (board.debt >= slice) { /* it slept throughout */
        board.debt -= slice;
        return;
    }
    avr_cycle_count_t wanted = slice - board.debt, begin = board.avr->cycle;
    board.was_reset = false;
    if (board.avr->data[0xC4] != 0)
        board.uart->cycles_per_byte = board_byte_cycles();
    avr_cycle_timer_register(board.avr, wanted, wake, NULL);
    while (board.avr->cycle - begin < wanted && !board.was_reset && !board_crashed()) {
        avr_run(board.avr);
    }
    board.debt = board.was_reset ? 0 : board.avr->cycle - begin - wanted;
}

void board_step(void)
{
    if (board_runs() && !board_crashed())
        run_processor();
    board_update_standby();
    plant_step(board.plant);
}

struct board_times board_times(void)
{
    struct board_times times = board.worst;
    memset(&board.worst, 0, sizeof board.worst);
    return times;
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

/* Skip the time in which the processor sleeps. */
static void sleep_through(avr_t *avr, avr_cycle_count_t cycles)
{
    (void)avr;
    board.slept += cycles;
}

/* The loop resets the watchdog in each iteration. */
static int watchdog_reset(avr_io_t *io, uint32_t what, void *parameter)
{
    (void)io, (void)parameter;
    if (what == AVR_IOCTL_WATCHDOG_RESET) {
        if (board.looped != 0)
            board_record_worst(&board.worst.loop, board.avr->cycle - board.looped - board.slept);
        board.looped = board.avr->cycle;
        board.slept = 0;
    }
    return -1;
}

static void wire(void)
{
    avr_t *avr = board.avr;
    board.uart = module("uart");
    board.spi = module("spi");
    avr->sleep = sleep_through;
    avr->run_cycle_limit = 1000;
    board.listener = (avr_io_t){.kind = "listener", .ioctl = watchdog_reset};
    avr_register_io(avr, &board.listener);
    board_wire_resets();
    board_wire_uart();
    board_wire_spi();
}

/* simavr does not check this. */
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

bool board_start(struct plant *plant, const char *elf)
{
    elf_firmware_t firmware = {.frequency = (uint32_t)BOARD_HZ};
    avr_global_logger_set(log_nothing);
    board.plant = plant;
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
