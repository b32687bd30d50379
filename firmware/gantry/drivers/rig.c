#include "drivers/rig.h"

#include "port.h"
#include "drivers/units.h"

struct rig rig;

#define BROKEN_HIGH 0xFFFF /* what the line says without a driver */
#define BROKEN_LOW 0x0000

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

int32_t rig_position(enum axis axis)
{
    return units_micro(axis, rig.position[units_motor(axis)]);
}

void rig_stop(uint8_t hard)
{
    struct order orders[MOTORS];
    for (uint8_t m = 0; m < MOTORS; m++) {
        bool at_once = (hard & (1 << units_axis(m))) != 0;
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
        sound = sound && (flags[m] & FLAGS_SOUND) == FLAGS_SOUND;
        if ((flags[m] & FLAG_SW_CLOSED) == 0)
            rig.touched[m] = false;
    }
    if (!sound || (rig.calibrated && !drivers_remember()))
        rig_forget();
    rig_look();
    rig.trouble = 0;
    return sound;
}

bool rig_absent(enum motor motor)
{
    return rig.status[motor] == BROKEN_HIGH || rig.status[motor] == BROKEN_LOW;
}

bool rig_mute(void)
{
    for (uint8_t m = 0; m < MOTORS; m++)
        if (rig_absent(m))
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
