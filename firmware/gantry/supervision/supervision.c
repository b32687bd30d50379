#include "supervision/supervision.h"

#include <stdlib.h>

#include "drivers/rig.h"
#include "drivers/switches.h"
#include "drivers/units.h"

#define MUTE_LOOKS 2 /* a driver that does not answer so often in turn is away, and with it those behind it */

/* The axes whose drivers are away, without power, short-circuited, or were given nonsense. */
static uint8_t broken_axes(void)
{
    uint8_t broken = 0;
    for (uint8_t m = 0; m < MOTORS; m++) {
        uint16_t s = rig.status[m];
        if (rig_absent(m) || (s & FLAGS_RIGHT) != FLAGS_RIGHT || (s & (FLAG_WRONG | FLAG_NOT_PERFORMED)) != 0)
            broken |= (uint8_t)(1 << units_axis(m));
    }
    return broken;
}

/* The axes that lack any of these flags, which are low when active. */
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
    uint8_t broken = broken_axes(), shut = axes_without(FLAG_HOT_NOT);
    bool lost = axes_without(FLAGS_LOSS) != 0;
    if (broken != 0) {
        rig_trouble(STATUS_FAULT, broken);
    } else if (shut != 0) {
        rig_trouble(STATUS_HOT, shut);
    } else if (lost) {
        rig_trouble(STATUS_STALL, 0);
    } else {
        if (axes_without(FLAG_WARM_NOT) != 0)
            rig_trouble(STATUS_HOT, 0);
        return axes_without(FLAG_WARM_NOT) == 0;
    }
    rig_forget();
    return false;
}

/* The drivers stop on the edge by themselves, the pair's other one does not. No right motion reaches a switch, so the
 * position was wrong, or the switch is stuck and guards neither end: only CALIBRATE moves the rig after it. The
 * direction is the driver's, as an axis that brakes before it turns still goes the old way. */
static void check_switch(enum motor motor)
{
    enum axis axis = units_axis(motor);
    bool idle = !rig.calibrated && !rig_moves();
    if (idle || rig.touched[motor] || (rig.status[motor] & (FLAG_SW_CLOSED | FLAG_SW_EVENT)) == 0)
        return;
    rig.touched[motor] = true;
    rig.blocked[axis] = (rig.status[motor] & FLAG_FORWARD) != 0 ? 1 : -1;
    rig_trouble(STATUS_LIMIT, (uint8_t)(1 << axis));
    rig_forget();
}

static void check_square(void)
{
    int32_t skew = rig.position[MOTOR_Y1] - rig.position[MOTOR_Y2];
    if (rig.calibrated && labs(skew) > axes[AXIS_Y].square) {
        rig_trouble(STATUS_FAULT, 1 << AXIS_Y);
        rig_forget();
    }
}

/* A driver that does not answer does not hear either, and goes on with what it was told last. */
static void check_bus(void)
{
    if (rig.held)
        return;
    rig.mute = rig_mute() ? rig.mute + 1 : 0;
    if (rig.mute >= MUTE_LOOKS)
        rig_hold();
}

void supervision_tick(void)
{
    check_bus();
    bool homing = rig.mode == MODE_HOMING;
    if (!homing && broken_axes() == 0)
        for (uint8_t m = 0; m < MOTORS; m++)
            check_switch(m);
    if (check_drivers() && !homing)
        check_square();
}
