#include "rig.h"

#include <stdlib.h>

#include "port.h"
#include "units.h"

struct rig rig;

#define BROKEN_HIGH 0xFFFF /* what the line says without a driver */
#define BROKEN_LOW 0x0000
#define MUTE_LOOKS 2 /* a driver that does not answer so often in turn is away, and with it those behind it */
#define RIGHT_FLAGS (FLAG_UVLO_NOT | FLAG_OCD_NOT)
#define LOSS_FLAGS (FLAG_LOSS_A_NOT | FLAG_LOSS_B_NOT)
#define SOUND_FLAGS (RIGHT_FLAGS | FLAG_HOT_NOT | LOSS_FLAGS) /* without one of them a rotor may be anywhere */

enum motor rig_motor(enum axis axis)
{
    return axis == AXIS_X ? MOTOR_X : axis == AXIS_Y ? MOTOR_Y1 : MOTOR_ALPHA;
}

enum axis rig_axis(enum motor motor)
{
    return motor == MOTOR_X ? AXIS_X : motor == MOTOR_ALPHA ? AXIS_YAW : AXIS_Y;
}

void rig_look(void)
{
    drivers_status(rig.status, false);
    drivers_position(rig.position);
}

bool rig_moves(void)
{
    for (uint8_t m = 0; m < MOTORS; m++)
        if ((rig.status[m] & FLAG_MOTION) != 0)
            return true;
    return false;
}

bool rig_pressed(enum motor motor)
{
    return (rig.status[motor] & FLAG_SW_CLOSED) != 0;
}

int32_t rig_position(enum axis axis)
{
    return units_micro(axis, rig.position[rig_motor(axis)]);
}

void rig_stop(uint8_t hard)
{
    struct order orders[MOTORS];
    for (uint8_t m = 0; m < MOTORS; m++) {
        bool at_once = (hard & (1 << rig_axis(m))) != 0;
        orders[m] = (struct order){at_once ? OP_HARD_STOP : OP_SOFT_STOP, 0};
    }
    drivers_send(orders, 0);
    for (uint8_t a = 0; a < AXES; a++)
        rig.told[a] = rig.want[a] = 0;
    rig.mode = MODE_REST;
}

void rig_forget(void)
{
    rig.calibrated = false;
    drivers_set_all(REG_MARK, 3, 0);
}

void rig_trouble(uint8_t status, uint8_t hard)
{
    if (rig.trouble == 0 || rig.trouble == STATUS_WATCHDOG)
        rig.trouble = status;
    rig_stop(hard);
}

static void let_go(void)
{
    port_reset_drivers();
    drivers_configure();
    rig.held = false;
    rig.mute = 0;
}

bool rig_acknowledge(void)
{
    uint16_t flags[MOTORS];
    bool sound = true;
    if (rig.held)
        let_go();
    drivers_status(flags, true);
    for (uint8_t m = 0; m < MOTORS; m++) {
        sound = sound && (flags[m] & SOUND_FLAGS) == SOUND_FLAGS;
        if ((flags[m] & FLAG_SW_CLOSED) == 0)
            rig.touched[m] = false;
    }
    if (!sound || (rig.calibrated && !drivers_remember()))
        rig_forget();
    rig_look();
    rig.trouble = 0;
    return sound;
}

static bool absent(enum motor motor)
{
    return rig.status[motor] == BROKEN_HIGH || rig.status[motor] == BROKEN_LOW;
}

bool rig_mute(void)
{
    for (uint8_t m = 0; m < MOTORS; m++)
        if (absent(m))
            return true;
    return false;
}

void rig_hold(void)
{
    port_hold_drivers();
    rig.held = true;
    rig_trouble(STATUS_FAULT, (1 << AXES) - 1);
    rig_forget();
}

/* The axes whose drivers are away, without power, short-circuited, or were given nonsense. */
static uint8_t broken_axes(void)
{
    uint8_t broken = 0;
    for (uint8_t m = 0; m < MOTORS; m++) {
        uint16_t s = rig.status[m];
        if (absent(m) || (s & RIGHT_FLAGS) != RIGHT_FLAGS || (s & (FLAG_WRONG | FLAG_NOT_PERFORMED)) != 0)
            broken |= (uint8_t)(1 << rig_axis(m));
    }
    return broken;
}

/* The axes that lack any of these flags, which are low when active. */
static uint8_t axes_without(uint16_t flags)
{
    uint8_t found = 0;
    for (uint8_t m = 0; m < MOTORS; m++)
        if ((rig.status[m] & flags) != flags)
            found |= (uint8_t)(1 << rig_axis(m));
    return found;
}

static bool judge_drivers(void)
{
    uint8_t broken = broken_axes(), shut = axes_without(FLAG_HOT_NOT);
    bool lost = axes_without(LOSS_FLAGS) != 0;
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
static void judge_switch(enum motor motor)
{
    enum axis axis = rig_axis(motor);
    bool idle = !rig.calibrated && !rig_moves();
    if (idle || rig.touched[motor] || (rig.status[motor] & (FLAG_SW_CLOSED | FLAG_SW_EVENT)) == 0)
        return;
    rig.touched[motor] = true;
    rig.blocked[axis] = (rig.status[motor] & FLAG_FORWARD) != 0 ? 1 : -1;
    rig_trouble(STATUS_LIMIT, (uint8_t)(1 << axis));
    rig_forget();
}

static void judge_square(void)
{
    int32_t skew = rig.position[MOTOR_Y1] - rig.position[MOTOR_Y2];
    if (rig.calibrated && labs(skew) > axes[AXIS_Y].square) {
        rig_trouble(STATUS_FAULT, 1 << AXIS_Y);
        rig_forget();
    }
}

/* A driver that does not answer does not hear either, and goes on with what it was told last. */
static void judge_bus(void)
{
    if (rig.held)
        return;
    rig.mute = rig_mute() ? rig.mute + 1 : 0;
    if (rig.mute >= MUTE_LOOKS)
        rig_hold();
}

void rig_judge(void)
{
    judge_bus();
    bool homing = rig.mode == MODE_HOMING;
    if (!homing && broken_axes() == 0)
        for (uint8_t m = 0; m < MOTORS; m++)
            judge_switch(m);
    if (judge_drivers() && !homing)
        judge_square();
}
