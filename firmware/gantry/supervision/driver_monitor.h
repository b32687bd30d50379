/* Compares what the drivers report with their commands. */
#ifndef DRIVER_MONITOR_H
#define DRIVER_MONITOR_H

#include <stdint.h>

/* Check all drivers; call once a tick after motion_tick. now is in ms. */
void driver_monitor_tick(uint32_t now);

#endif
