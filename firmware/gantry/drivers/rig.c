#include "drivers/rig.h"

#include "drivers/circle.h"
#include "drivers/units.h"
#include "port.h"

struct rig rig;

#define BROKEN_HIGH 0xFFFF /* what an open line reads */
#define BROKEN_LOW 0x0000

void rig_poll(void)
{
    int32_t alpha = rig.position[MOTOR_ALPHA];
    drivers_status(rig.status, false);
    drivers_position(rig.position);
    if (circle_motor(MOTOR_ALPHA))
        rig.position[MOTOR_ALPHA] = circle_follow(alpha, rig.position[MOTOR_ALPHA]);
}

bool rig_moving(void)
{
    for (uint8_t m = 0; m < MOTORS; m++)
        if ((rig.status[m] & FLAG_MOTION) != 0)
            return true;
    return false;
}

int32_t rig_position(enum axis axis)
{
    int32_t steps = rig.position[units_motor(axis)];
    return units_micro(axis, circle_axis(axis) ? circle_heading(steps) : steps);
}

void rig_stop(uint8_t hard)
{
    struct driver_command commands[MOTORS];
    for (uint8_t m = 0; m < MOTORS; m++) {
        bool at_once = (hard & (1 << units_axis(m))) != 0;
        commands[m] = (struct driver_command){at_once ? OP_HARD_STOP : OP_SOFT_STOP, 0};
    }
    drivers_send(commands, 0);
    for (uint8_t a = 0; a < AXES; a++)
        rig.commanded[a] = rig.target[a] = 0;
    rig.mode = MODE_REST;
}

void rig_void_position(void)
{
    rig.calibrated = false;
    drivers_set_all(REG_MARK, 3, 0);
}

void rig_fail(uint8_t status, uint8_t hard)
{
    if (rig.trouble == 0 || rig.trouble == STATUS_WATCHDOG)
        rig.trouble = status;
    rig_stop(hard);
}

static void release_drivers(void)
{
    port_reset_drivers();
    drivers_configure();
    rig.held = false;
    rig.missed_polls = 0;
}

bool rig_acknowledge(void)
{
    uint16_t flags[MOTORS];
    bool healthy = true;
    if (rig.held)
        release_drivers();
    drivers_status(flags, true);
    for (uint8_t m = 0; m < MOTORS; m++) {
        healthy = healthy && (flags[m] & FLAGS_HEALTHY) == FLAGS_HEALTHY;
        if ((flags[m] & FLAG_SW_CLOSED) == 0)
            rig.switch_handled[m] = false;
    }
    if (!healthy || (rig.calibrated && !drivers_position_valid()))
        rig_void_position();
    rig_poll();
    rig.trouble = 0;
    return healthy;
}

bool rig_driver_absent(enum motor motor)
{
    return rig.status[motor] == BROKEN_HIGH || rig.status[motor] == BROKEN_LOW;
}

bool rig_any_driver_absent(void)
{
    for (uint8_t m = 0; m < MOTORS; m++)
        if (rig_driver_absent(m))
            return true;
    return false;
}

void rig_hold(void)
{
    port_hold_drivers();
    rig.held = true;
    rig_fail(STATUS_FAULT, (1 << AXES) - 1);
    rig_void_position();
}
