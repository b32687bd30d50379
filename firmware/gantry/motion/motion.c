#include "motion/motion.h"

#include <stdlib.h>

#include "drivers/circle.h"
#include "drivers/units.h"
#include "memory/limits.h"

#define LAG_MS 4 /* the longest time from a measurement to the driver's reaction */
#define RESEND_MS 50 /* after which a command is sent again, because it may be lost */

static int8_t sign(int32_t value)
{
    return (int8_t)((value > 0) - (value < 0));
}

/* Limit a velocity (micro/s) to what the driver goes, and so that the axis can brake before the edge. */
static int32_t limited(enum axis axis, int32_t velocity)
{
    int32_t at = rig_position(axis), most = limits[axis].quickest, size = labs(velocity);
    size = size < most ? size : most;
    if (circle_axis(axis))
        return sign(velocity) * size;
    int32_t room = velocity > 0 ? limits[axis].high - at : at - limits[axis].low;
    int32_t fastest = limits_braking_speed(axis, room - size * LAG_MS / 1000);
    return sign(velocity) * (size < fastest ? size : fastest);
}

/* Set the commands that give an axis a speed; both motors of y get theirs in one frame. */
static void set_command(struct driver_command *commands, enum axis axis, int32_t speed)
{
    uint8_t op = speed == 0 ? OP_SOFT_STOP : speed > 0 ? OP_RUN | FORWARD : OP_RUN;
    for (uint8_t m = 0; m < MOTORS; m++)
        if (units_axis(m) == axis)
            commands[m] = (struct driver_command){op, (uint32_t)labs(speed)};
    rig.commanded[axis] = speed;
}

static void drive(uint32_t now)
{
    struct driver_command commands[MOTORS] = {{OP_NOP, 0}, {OP_NOP, 0}, {OP_NOP, 0}, {OP_NOP, 0}};
    bool resend = now - rig.sent >= RESEND_MS, changed = resend;
    for (uint8_t a = 0; a < AXES; a++) {
        int32_t speed = units_speed(a, limited(a, rig.target[a]));
        if (resend || speed != rig.commanded[a]) {
            set_command(commands, a, speed);
            changed = true;
        }
    }
    if (resend)
        rig.sent = now;
    if (changed)
        drivers_send(commands, 3);
}

static uint8_t refusal(void)
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
    uint8_t error = refusal();
    if (error != 0)
        return error;
    for (uint8_t a = 0; a < AXES; a++)
        if (labs(velocity[a]) > limits[a].fastest)
            return ERROR_BOUNDS;
    if (rig.mode != MODE_RUN && rig.mode != MODE_REST)
        rig_stop(0);
    for (uint8_t a = 0; a < AXES; a++)
        rig.target[a] = velocity[a];
    rig.mode = MODE_RUN;
    rig.run_received = now;
    drive(now);
    return 0;
}

uint8_t motion_goto(const int32_t *position)
{
    bool timed_out = rig.trouble == STATUS_WATCHDOG;
    uint8_t error = timed_out ? 0 : refusal();
    for (uint8_t a = 0; a < AXES && error == 0; a++)
        error = limits_inside(a, position[a]) ? 0 : ERROR_BOUNDS;
    if (error != 0)
        return error;
    if (timed_out)
        rig_acknowledge();
    if (!rig.calibrated)
        return ERROR_UNCALIBRATED;
    rig_stop(0);
    for (uint8_t a = 0; a < AXES; a++)
        rig.goal[a] = units_steps(a, position[a]);
    rig.mode = MODE_GOTO_PENDING;
    return 0;
}

static void start_goto(void)
{
    struct driver_command commands[MOTORS];
    int32_t alpha = rig.position[MOTOR_ALPHA];
    if (circle_axis(AXIS_YAW))
        rig.goal[AXIS_YAW] = alpha + circle_distance(alpha, rig.goal[AXIS_YAW], circle.way);
    for (uint8_t m = 0; m < MOTORS; m++) {
        enum axis axis = units_axis(m);
        commands[m] = (struct driver_command){OP_GOTO, (uint32_t)rig.goal[axis] & 0x3FFFFFUL};
    }
    drivers_send(commands, 3);
    rig.mode = MODE_GOTO;
}

static void finish_goto(void)
{
    rig.mode = MODE_REST;
    for (uint8_t m = 0; m < MOTORS; m++)
        if (rig.position[m] != rig.goal[units_axis(m)])
            rig_fail(STATUS_FAULT, 0);
}

static void supervise_run(uint32_t now)
{
    bool standing = rig.commanded[AXIS_X] == 0 && rig.commanded[AXIS_Y] == 0 && rig.commanded[AXIS_YAW] == 0;
    if (now - rig.run_received < WATCHDOG_MS)
        drive(now);
    else if (standing)
        rig.mode = MODE_REST;
    else
        rig_fail(STATUS_WATCHDOG, 0);
}

void motion_tick(uint32_t now)
{
    if (rig.mode == MODE_RUN)
        supervise_run(now);
    else if (rig.mode == MODE_GOTO_PENDING && !rig_moving())
        start_goto();
    else if (rig.mode == MODE_GOTO && !rig_moving())
        finish_goto();
}
