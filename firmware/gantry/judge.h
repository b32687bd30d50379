/* Supervision: what the drivers say, and what follows from it. */
#ifndef JUDGE_H
#define JUDGE_H

/* One look. */
void judge_tick(void);

#endif
