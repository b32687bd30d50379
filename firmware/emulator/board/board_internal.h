/* Shared by the parts of the board. */
#ifndef BOARD_INTERNAL_H
#define BOARD_INTERNAL_H

#include <simavr/avr_ioport.h>
#include <simavr/avr_spi.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_io.h>

#include "board/board.h"

#define DATA_TO_IO 32 /* simavr's tables of registers begin behind the 32 of the core */

struct board {
    struct plant *plant;
    avr_t *avr;
    avr_uart_t *uart;
    avr_spi_t *spi;
    void (*reset)(avr_t *avr);
    bool powered, held, was_reset, requested;
    double starts, standby_until;
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
};

extern struct board board;

/* Hook into simavr's peripherals. */
void board_wire_resets(void);
void board_wire_uart(void);
void board_wire_spi(void);

/* Whether the controller has power, is not held in reset, and has started. */
bool board_runs(void);

/* Let the drivers' reset follow the controller's pin. */
void board_update_standby(void);

/* Cycles of a byte on the serial line; update the longest of some times. */
avr_cycle_count_t board_byte_cycles(void);
void board_record_worst(double *worst, avr_cycle_count_t cycles);

#endif
