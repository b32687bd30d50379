#include "motion/motion.h"

#include <stdlib.h>

#include "drivers/units.h"

#define LAG_MS 4 /* from a measurement to the driver's answer to it, at the most */
#define AGAIN_MS 50 /* after which an order is given again, as it may have got lost */

static int8_t sign(int32_t value)
{
    return (int8_t)((value > 0) - (value < 0));
}

/* What is left of a velocity (micro/s) so that the axis can still brake before the edge. */
static int32_t clipped(enum axis axis, int32_t want)
{
    int32_t at = rig_position(axis), size = labs(want);
    int32_t room = want > 0 ? axes[axis].high - at : at - axes[axis].low;
    int32_t fastest = units_braking_speed(axis, room - size * LAG_MS / 1000);
    return sign(want) * (size < fastest ? size : fastest);
}

/* Tell the drivers of an axis a speed; both motors of y get it in one frame. */
static void tell(struct order *orders, enum axis axis, int32_t speed)
{
    uint8_t op = speed == 0 ? OP_SOFT_STOP : speed > 0 ? OP_RUN | FORWARD : OP_RUN;
    for (uint8_t m = 0; m < MOTORS; m++)
        if (units_axis(m) == axis)
            orders[m] = (struct order){op, (uint32_t)labs(speed)};
    rig.told[axis] = speed;
}

static void drive(uint32_t now)
{
    struct order orders[MOTORS] = {{OP_NOP, 0}, {OP_NOP, 0}, {OP_NOP, 0}, {OP_NOP, 0}};
    bool again = now - rig.sent >= AGAIN_MS, news = again;
    for (uint8_t a = 0; a < AXES; a++) {
        int32_t speed = units_speed(a, clipped(a, rig.want[a]));
        if (again || speed != rig.told[a]) {
            tell(orders, a, speed);
            news = true;
        }
    }
    if (again)
        rig.sent = now;
    if (news)
        drivers_send(orders, 3);
}

static uint8_t refused(void)
{
    if (rig.mode == MODE_HOMING)
        return ERROR_HOMING;
    if (rig.trouble != 0)
        return ERROR_TROUBLE;
    if (rig.resumed)
        return ERROR_RESTARTED;
    return rig.calibrated ? 0 : ERROR_UNCALIBRATED;
}

uint8_t motion_run(const int32_t *velocity, uint32_t now)
{
    uint8_t error = refused();
    if (error != 0)
        return error;
    for (uint8_t a = 0; a < AXES; a++)
        if (labs(velocity[a]) > axes[a].fastest)
            return ERROR_BOUNDS;
    if (rig.mode != MODE_RUN && rig.mode != MODE_REST)
        rig_stop(0);
    for (uint8_t a = 0; a < AXES; a++)
        rig.want[a] = velocity[a];
    rig.mode = MODE_RUN;
    rig.heard = now;
    drive(now);
    return 0;
}

uint8_t motion_goto(const int32_t *position)
{
    bool slept = rig.trouble == STATUS_WATCHDOG;
    uint8_t error = slept ? 0 : refused();
    for (uint8_t a = 0; a < AXES && error == 0; a++)
        error = units_inside(a, position[a]) ? 0 : ERROR_BOUNDS;
    if (error != 0)
        return error;
    if (slept)
        rig_acknowledge();
    if (!rig.calibrated)
        return ERROR_UNCALIBRATED;
    rig_stop(0);
    for (uint8_t a = 0; a < AXES; a++)
        rig.goal[a] = units_steps(a, position[a]);
    rig.mode = MODE_GOTO_SOON;
    return 0;
}

static void set_off(void)
{
    struct order orders[MOTORS];
    for (uint8_t m = 0; m < MOTORS; m++) {
        enum axis axis = units_axis(m);
        orders[m] = (struct order){OP_GOTO, (uint32_t)rig.goal[axis] & 0x3FFFFFUL};
    }
    drivers_send(orders, 3);
    rig.mode = MODE_GOTO;
}

static void arrive(void)
{
    rig.mode = MODE_REST;
    for (uint8_t m = 0; m < MOTORS; m++)
        if (rig.position[m] != rig.goal[units_axis(m)])
            rig_trouble(STATUS_FAULT, 0);
}

static void supervise_run(uint32_t now)
{
    bool standing = rig.told[AXIS_X] == 0 && rig.told[AXIS_Y] == 0 && rig.told[AXIS_YAW] == 0;
    if (now - rig.heard < WATCHDOG_MS)
        drive(now);
    else if (standing)
        rig.mode = MODE_REST;
    else
        rig_trouble(STATUS_WATCHDOG, 0);
}

void motion_tick(uint32_t now)
{
    if (rig.mode == MODE_RUN)
        supervise_run(now);
    else if (rig.mode == MODE_GOTO_SOON && !rig_moves())
        set_off();
    else if (rig.mode == MODE_GOTO && !rig_moves())
        arrive();
}
