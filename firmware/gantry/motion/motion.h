/* RUN and GOTO within the limits. */
#ifndef MOTION_H
#define MOTION_H

#include <stdint.h>

#include "drivers/rig.h"

/* Start or continue moving with velocities (micro/s). Returns 0 or an error. */
uint8_t motion_run(const int32_t *velocity, uint32_t now);

/* Move to a position (micro). Returns 0 or an error. */
uint8_t motion_goto(const int32_t *position);

/* Control the motion; call once a tick. now is in ms. */
void motion_tick(uint32_t now);

#endif
