/* The limit switches, as the drivers saw them at the last look. Both ends of an axis share an input. */
#ifndef SWITCHES_H
#define SWITCHES_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

/* Whether a motor's switch is closed; any of an axis, as y1 and y2 go together; any at all; all. */
bool switches_closed(enum motor motor);
bool switches_axis_closed(enum axis axis);
bool switches_any_closed(void);
bool switches_all_closed(void);

/* Once a look: whether all motors have stood, and no switch has changed, for so many looks. */
bool switches_quiet(uint8_t looks);

#endif
