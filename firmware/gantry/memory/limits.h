/* The limits of range, speed and acceleration that hold: those of the rig's memory, never beyond the built-in ones. */
#ifndef LIMITS_H
#define LIMITS_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

struct axis_limits {
    int32_t low, high;      /* micro */
    int32_t fastest;        /* micro/s, of a RUN that is taken */
    int32_t quickest;       /* micro/s, the speed that MAX_SPEED stands for */
    uint16_t edge;          /* as in axis_constants, with the drivers' ramps */
    uint16_t top_register;  /* MAX_SPEED */
    uint16_t ramp_register; /* ACC and DEC */
};

extern struct axis_limits limits[AXES];
extern const int32_t limits_narrowest[LIMITS], limits_widest[LIMITS]; /* micro */

/* Whether each of these is within what the firmware is built for. */
bool limits_possible(const int32_t set[LIMITS]);

/* Let limits hold from now on. */
void limits_apply(const int32_t set[LIMITS]);

/* Whether a position is within the limits and not behind home; a circle's yaw is nowhere behind it. */
bool limits_inside(enum axis axis, int32_t micro);

/* The speed (micro/s, a multiple of 100) from which an axis stops within room (micro), 0 without room. */
int32_t limits_braking_speed(enum axis axis, int32_t room);

#endif
