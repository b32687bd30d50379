#include "supervision/supervision.h"

#include <stdlib.h>

#include "drivers/circle.h"
#include "drivers/rig.h"
#include "drivers/switches.h"
#include "drivers/units.h"

#define MOST_MISSED_POLLS 2 /* after so many in turn a driver counts as disconnected, with those behind it */

/* The axes whose drivers are disconnected, without power, short-circuited, or rejected a command. */
static uint8_t broken_axes(void)
{
    uint8_t broken = 0;
    for (uint8_t m = 0; m < MOTORS; m++) {
        uint16_t s = rig.status[m];
        if (rig_driver_absent(m) || (s & FLAGS_SUPPLY) != FLAGS_SUPPLY || (s & (FLAG_WRONG | FLAG_NOT_PERFORMED)) != 0)
            broken |= (uint8_t)(1 << units_axis(m));
    }
    return broken;
}

/* The axes with any of these flags active (low). */
static uint8_t axes_without(uint16_t flags)
{
    uint8_t found = 0;
    for (uint8_t m = 0; m < MOTORS; m++)
        if ((rig.status[m] & flags) != flags)
            found |= (uint8_t)(1 << units_axis(m));
    return found;
}

static bool check_drivers(void)
{
    uint8_t broken = broken_axes(), overheated = axes_without(FLAG_HOT_NOT);
    bool stalled = axes_without(FLAGS_LOSS) != 0;
    if (broken != 0) {
        rig_fail(STATUS_FAULT, broken);
    } else if (overheated != 0) {
        rig_fail(STATUS_HOT, overheated);
    } else if (stalled) {
        rig_fail(STATUS_STALL, 0);
    } else {
        if (axes_without(FLAG_WARM_NOT) != 0)
            rig_fail(STATUS_HOT, 0);
        return axes_without(FLAG_WARM_NOT) == 0;
    }
    rig_void_position();
    return false;
}

/* A driver stops by itself at its switch, the pair's other one does not. No correct motion reaches a switch, so the
 * position was wrong, or the switch is stuck and guards neither end: only CALIBRATE moves the rig afterwards. The
 * direction is the driver's, as an axis that brakes before it reverses still moves the old way. */
static void check_switch(enum motor motor)
{
    enum axis axis = units_axis(motor);
    bool idle = !rig.calibrated && !rig_moving();
    if (idle || rig.switch_handled[motor] || (rig.status[motor] & (FLAG_SW_CLOSED | FLAG_SW_EVENT)) == 0)
        return;
    rig.switch_handled[motor] = true;
    rig.blocked[axis] = (rig.status[motor] & FLAG_FORWARD) != 0 ? 1 : -1;
    rig_fail(STATUS_LIMIT, (uint8_t)(1 << axis));
    rig_void_position();
}

static void check_square(void)
{
    int32_t skew = rig.position[MOTOR_Y1] - rig.position[MOTOR_Y2];
    if (rig.calibrated && labs(skew) > axes[AXIS_Y].square) {
        rig_fail(STATUS_FAULT, 1 << AXIS_Y);
        rig_void_position();
    }
}

/* A driver that does not answer does not receive either, and continues its last command. */
static void check_bus(void)
{
    if (rig.held)
        return;
    rig.missed_polls = rig_any_driver_absent() ? rig.missed_polls + 1 : 0;
    if (rig.missed_polls >= MOST_MISSED_POLLS)
        rig_hold();
}

void supervision_tick(void)
{
    check_bus();
    bool homing = rig.mode == MODE_HOMING;
    if (!homing && broken_axes() == 0)
        for (uint8_t m = 0; m < MOTORS; m++)
            if (!circle_motor(m)) /* its index stops nothing, see turns.c */
                check_switch(m);
    if (check_drivers() && !homing)
        check_square();
}
