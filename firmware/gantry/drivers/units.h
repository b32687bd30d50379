/* Conversions of Table 4.2, in integers, so that host and ATmega compute the same. */
#ifndef UNITS_H
#define UNITS_H

#include <stdint.h>

#include "protocol.h"

extern const struct axis_constants axes[AXES];

/* The first motor of an axis, and the axis of a motor. */
enum motor units_motor(enum axis axis);
enum axis units_axis(enum motor motor);

/* Convert micro to microsteps from home, y = c x + offset, and back. */
int32_t units_steps(enum axis axis, int32_t micro);
int32_t units_micro(enum axis axis, int32_t steps);

/* Convert micro/s to units of the drivers' SPEED, w = c v, signed. */
int32_t units_speed(enum axis axis, int32_t micro_s);

#endif
