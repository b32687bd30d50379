/* Whether the drivers do what they were told, as far as their answers show. */
#ifndef DOUBT_H
#define DOUBT_H

#include <stdint.h>

/* One look, after the motion's step; now is in ms. */
void doubt_tick(uint32_t now);

#endif
