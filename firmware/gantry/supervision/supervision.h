/* Supervision: checks what the drivers report, and stops the rig. */
#ifndef SUPERVISION_H
#define SUPERVISION_H

/* Check all drivers; call once a tick after a poll. */
void supervision_tick(void);

#endif
