/* Supervision: checks what the drivers report, and stops the rig. */
#ifndef SUPERVISION_H
#define SUPERVISION_H

#include <stdint.h>

/* Check all drivers; call once a tick after a poll. */
void supervision_tick(void);

/* Check the index of a yaw that turns without end, and keep its counter from wrapping around; call it after these. */
void turns_tick(void);

/* Compare what the drivers report with their commands; call once a tick after motion_tick. now is in ms. */
void driver_monitor_tick(uint32_t now);

#endif
