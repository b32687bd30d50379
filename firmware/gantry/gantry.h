/* The gantry's firmware without its hardware: bytes in, lines out, drivers told. */
#ifndef GANTRY_H
#define GANTRY_H

#include <stdint.h>

/* Once after each start. */
void gantry_begin(void);

/* A byte from the host; 0 stands for bytes that were lost. */
void gantry_take(uint8_t byte);

/* As often as there is time: every TICK_MS it looks after the drivers. */
void gantry_tick(void);

#endif
