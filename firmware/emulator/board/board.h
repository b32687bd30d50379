/* The controller's board: an ATmega328P under simavr with its serial line, SPI to the drivers' chain, and the line that
 * keeps the drivers awake. It works around simavr 1.6 where that differs from the chip. */
#ifndef BOARD_H
#define BOARD_H

#include <stddef.h>

#include "plant/plant.h"

#define BOARD_HZ 16000000.0

enum board_reset { RESET_POWER, RESET_OPENED, RESET_WATCHDOG, RESET_ORDERED };

/* Load an ELF file; false when it is none. The controller is off. */
bool board_begin(struct plant *plant, const char *elf, double boot);

/* Power of the controller; and whether its reset is held down. */
void board_power(bool on);
void board_hold(bool held);
void board_reset(enum board_reset reason);

/* Let the firmware hang: from now on it jumps to itself, without interrupts. */
void board_hang(void);

/* Let PLANT_DT pass. */
void board_step(void);

/* Whether a byte for the controller can be taken, which takes 87 us on the wire; and give it. */
bool board_wants(void);
void board_give(uint8_t byte);

/* What the controller sent since the last time, at most size bytes. */
size_t board_sent(uint8_t *bytes, size_t size);

/* The longest time round the firmware's loop, and from a line's last bit to the first bit of its answer, s; since the
 * last time. */
struct board_times {
    double loop, answer;
};
struct board_times board_times(void);

/* The next byte gets lost in the receiver, as if the program had not fetched the ones before. */
void board_lose_next(void);

/* Bytes that the controller's receiver lost, and whether the processor ended. */
unsigned long board_overruns(void);
bool board_crashed(void);

#endif
