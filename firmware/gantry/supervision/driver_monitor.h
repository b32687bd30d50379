/* Whether the drivers do what they were told, as far as their answers show. */
#ifndef DRIVER_MONITOR_H
#define DRIVER_MONITOR_H

#include <stdint.h>

/* One look, after the motion's step; now is in ms. */
void driver_monitor_tick(uint32_t now);

#endif
