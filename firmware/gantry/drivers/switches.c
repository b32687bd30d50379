#include "drivers/switches.h"

#include "drivers/rig.h"
#include "drivers/units.h"

#define ALL ((1 << MOTORS) - 1)

bool switches_closed(enum motor motor)
{
    return (rig.status[motor] & FLAG_SW_CLOSED) != 0;
}

static uint8_t closed(void)
{
    uint8_t found = 0;
    for (uint8_t m = 0; m < MOTORS; m++)
        found |= (uint8_t)(switches_closed(m) << m);
    return found;
}

bool switches_axis_closed(enum axis axis)
{
    for (uint8_t m = 0; m < MOTORS; m++)
        if (units_axis(m) == axis && switches_closed(m))
            return true;
    return false;
}

bool switches_any_closed(void)
{
    return closed() != 0;
}

bool switches_all_closed(void)
{
    return closed() == ALL;
}

bool switches_quiet(uint8_t polls)
{
    uint8_t now = closed();
    rig.quiet_polls = rig_moving() || now != rig.closed ? 0 : rig.quiet_polls + 1;
    rig.closed = now;
    return rig.quiet_polls >= polls;
}
