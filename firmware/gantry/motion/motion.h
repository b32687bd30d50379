/* Motion that is asked for: RUN and GOTO, kept within the limits. */
#ifndef MOTION_H
#define MOTION_H

#include <stdint.h>

#include "drivers/rig.h"

/* Begin or go on with velocities (micro/s); 0 or an error. */
uint8_t motion_run(const int32_t *velocity, uint32_t now);

/* Move to a position (micro); 0 or an error. */
uint8_t motion_goto(const int32_t *position);

/* One step of the motion. */
void motion_tick(uint32_t now);

#endif
