/* RUN and GOTO within the limits, and CALIBRATE: find the switch of each axis; it opens at step 0. */
#ifndef MOTION_H
#define MOTION_H

#include <stdbool.h>
#include <stdint.h>

#include "drivers/rig.h"

/* Start or continue moving with velocities (micro/s). Returns 0 or an error. */
uint8_t motion_run(const int32_t *velocity, uint32_t now);

/* Move to a position (micro). Returns 0 or an error. */
uint8_t motion_goto(const int32_t *position);

/* Control the motion; call once a tick. now is in ms. */
void motion_tick(uint32_t now);

/* Start homing; all motors brake first, and the position is void until it ends. */
void homing_start(void);

/* Whether homing waits for the motors to stand. */
bool homing_settling(void);

/* Control homing; call once a tick. now is in ms. */
void homing_tick(uint32_t now);

/* Restore the position that the drivers kept during a reset of the controller, or reset and configure them. */
void homing_restore(void);

#endif
