/* A yaw that turns without end: its index has to be where its counter says, and its counter must not wrap around. */
#ifndef TURNS_H
#define TURNS_H

/* Check the index and keep the counter; call once a tick after a poll. */
void turns_tick(void);

#endif
