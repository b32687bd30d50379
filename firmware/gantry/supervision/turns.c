#include "supervision/supervision.h"

#include <stdlib.h>

#include "drivers/circle.h"
#include "drivers/rig.h"
#include "drivers/switches.h"

#define FAR 0x100000L /* microsteps, 40 turns; the counter wraps around at twice as many */

/* The index is closed in INDEX_WIDTH below heading 0, and nowhere else. It is not looked at close to its edges, so that
 * neither hysteresis nor bounces count. A motor that slipped, a coupling that did, and a switch that is stuck or cut off
 * are alike: the position is void, and CALIBRATE distinguishes them. */
static void check_index(void)
{
    int32_t heading = circle_heading(rig.position[MOTOR_ALPHA] + INDEX_WIDTH / 2 + TURN / 2);
    int32_t off = (int32_t)labs(heading - TURN / 2) - INDEX_WIDTH / 2; /* outside the index by so much */
    bool closed = switches_closed(MOTOR_ALPHA);
    if (closed ? off <= INDEX_TOLERANCE : off >= -INDEX_TOLERANCE)
        return;
    rig_fail(STATUS_STALL, 0);
    rig_void_position();
}

static void set_alpha(uint8_t reg, uint32_t value)
{
    struct driver_command commands[MOTORS] = {{OP_NOP, 0}, {OP_NOP, 0}, {OP_NOP, 0}, {OP_SET | reg, value}};
    drivers_send(commands, 3);
}

/* At rest the counter is set back into its turn. When it may wrap around before, its driver's mark says so: a controller
 * that restarts then would take up a wrong heading. */
static void keep_counter(void)
{
    int32_t at = rig.position[MOTOR_ALPHA];
    bool rests = rig.mode == MODE_REST && (rig.status[MOTOR_ALPHA] & FLAG_MOTION) == 0;
    if (rests && at != circle_heading(at)) {
        rig.position[MOTOR_ALPHA] = circle_heading(at);
        set_alpha(REG_ABS_POS, (uint32_t)circle_heading(at));
        set_alpha(REG_MARK, DRIVER_MARK);
        circle.far = false;
    } else if (!circle.far && labs(at) > FAR) {
        circle.far = true;
        set_alpha(REG_MARK, DRIVER_MARK_FAR);
    }
}

void turns_tick(void)
{
    if (!rig.calibrated || rig_any_driver_absent())
        return;
    check_index();
    if (rig.calibrated)
        keep_counter();
}
