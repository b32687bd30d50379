/* CALIBRATE: find each axis' switch, and call the place where it opens step 0. */
#ifndef HOMING_H
#define HOMING_H

#include <stdbool.h>
#include <stdint.h>

/* Begin; whatever moves brakes first, and the position is void until the end. */
void homing_begin(void);

/* Whether it still waits for what moved before to stand. */
bool homing_brakes(void);

/* One step; now is in ms. */
void homing_tick(uint32_t now);

/* Take up a position that the drivers kept over a reset of the controller, or set them up anew. */
void homing_wake(void);

#endif
