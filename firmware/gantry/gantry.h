/* The firmware's core, independent of hardware: it executes the host's commands and supervises the drivers. */
#ifndef GANTRY_H
#define GANTRY_H

#include <stdint.h>

/* Call once after each start. */
void gantry_start(void);

/* Receive a byte from the host; 0 stands for lost bytes. */
void gantry_receive(uint8_t byte);

/* Call as often as possible; polls and controls the drivers every TICK_MS. */
void gantry_tick(void);

#endif
