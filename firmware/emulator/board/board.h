/* The controller's board: an ATmega328P under simavr with its serial line, SPI to the drivers' chain, and the drivers'
 * standby line. It corrects simavr 1.6 where that differs from the chip. */
#ifndef BOARD_H
#define BOARD_H

#include <stddef.h>

#include "plant/plant.h"

#define BOARD_HZ 16000000.0

enum board_reset { RESET_POWER, RESET_OPENED, RESET_WATCHDOG, RESET_BUTTON };

/* Load an ELF file; false when it is none. The controller is off. */
bool board_start(struct plant *plant, const char *elf);

/* Switch the controller's power; hold it in reset; reset it. */
void board_power(bool on);
void board_hold(bool held);
void board_reset(enum board_reset reason);

/* Make the firmware hang: it jumps to itself, with interrupts disabled. */
void board_hang(void);

/* Let PLANT_DT pass. */
void board_step(void);

/* Whether the receiver is free, as a byte takes 87 us on the wire; receive a byte from the host. */
bool board_ready(void);
void board_receive(uint8_t byte);

/* Fetch what the controller transmitted since the last call, at most size bytes. */
size_t board_transmitted(uint8_t *bytes, size_t size);

/* The longest iteration of the firmware's loop, and from a line's last bit to its answer's first bit, s; since the last
 * call. */
struct board_times {
    double loop, answer;
};
struct board_times board_times(void);

/* Lose the next byte in the receiver, as in an overrun. */
void board_lose_next(void);

/* How many bytes the receiver lost; whether the processor crashed. */
unsigned long board_overruns(void);
bool board_crashed(void);

#endif
