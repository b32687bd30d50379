/* CALIBRATE: find the switch of each axis; it opens at step 0. */
#ifndef HOMING_H
#define HOMING_H

#include <stdbool.h>
#include <stdint.h>

/* Start; all motors brake first, and the position is void until homing ends. */
void homing_start(void);

/* Whether homing waits for the motors to stand. */
bool homing_settling(void);

/* Control homing; call once a tick. now is in ms. */
void homing_tick(uint32_t now);

/* Restore the position that the drivers kept during a reset of the controller, or reset and configure them. */
void homing_restore(void);

#endif
