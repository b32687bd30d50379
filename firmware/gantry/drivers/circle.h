/* A yaw that turns without end, on a rig of the kind circle: headings are microsteps of its turn, 0 at its index. On
 * another kind of rig nothing of this is in the binary. */
#ifndef CIRCLE_H
#define CIRCLE_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

enum way { WAY_SHORTEST, WAY_LEFT, WAY_RIGHT }; /* left is counter-clockwise, forward for the driver */

struct circle {
    enum way way; /* of the GOTO */
    bool forward; /* how homing looks for the index */
    bool far;     /* the counter may wrap around soon, so that only this firmware knows the heading */
};

extern struct circle circle;

static inline bool circle_axis(enum axis axis)
{
    return RIG_KIND == KIND_CIRCLE && axis == AXIS_YAW;
}

static inline bool circle_motor(enum motor motor)
{
    return RIG_KIND == KIND_CIRCLE && motor == MOTOR_ALPHA;
}

/* The heading of a position, 0 to TURN - 1. */
int32_t circle_heading(int32_t position);

/* The distance to a position's heading, less than a turn; half a turn goes left unless the way says otherwise. */
int32_t circle_distance(int32_t from, int32_t to, enum way way);

/* The position, without end, of a counter of 22 bits that was at another one before. */
int32_t circle_follow(int32_t before, int32_t counter);

#endif
