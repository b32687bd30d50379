/* The limit switches as of the last poll. Both ends of an axis share an input. */
#ifndef SWITCHES_H
#define SWITCHES_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

/* Whether the switch of a motor, any switch of an axis, any switch, or all switches are closed. */
bool switches_closed(enum motor motor);
bool switches_axis_closed(enum axis axis);
bool switches_any_closed(void);
bool switches_all_closed(void);

/* Call once a poll: whether all motors have stood and no switch has changed for so many polls. */
bool switches_quiet(uint8_t polls);

#endif
