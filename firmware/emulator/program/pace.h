/* Time: real, as fast as possible, or in steps on command. */
#ifndef PACE_H
#define PACE_H

/* Seconds of a monotonic clock. */
double pace_clock(void);

/* Let time pass until the program ends. */
void pace_run(void);

#endif
