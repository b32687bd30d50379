/* Supervision: what the drivers say, and what follows from it. */
#ifndef SUPERVISION_H
#define SUPERVISION_H

/* One look. */
void supervision_tick(void);

#endif
