#include "supervision/driver_monitor.h"

#include <stdlib.h>

#include "motion/homing.h"
#include "drivers/rig.h"
#include "drivers/units.h"

#define PATIENCE_MS 120 /* in which an order that got lost has been given twice again */
#define WAY_MS 100
#define SPEEDS_A_MS 524 /* units of SPEED that are a microstep a millisecond: 67.1 units are a step/s of 128 */
#define SLACK 16        /* microsteps */

/* Whether a motor stands, moves, or goes steadily the other way than it was told. One that brakes may still obey. */
static bool contradicts(enum motor motor)
{
    int32_t told = rig.told[units_axis(motor)];
    uint16_t motion = rig.status[motor] & FLAG_MOTION;
    bool forward = (rig.status[motor] & FLAG_FORWARD) != 0;
    if (motion == 0)
        return told != 0;
    return told == 0 ? motion != MOTION_BRAKES : motion == MOTION_CONSTANT && forward != (told > 0);
}

/* The ways are compared only from when a motor has reached the speed that it was told. */
static void begin_way(enum motor motor, uint32_t now)
{
    rig.way[motor] = (struct way){now, rig.position[motor], rig.told[units_axis(motor)]};
}

/* Whether a counter goes another way than a motor was told. */
static bool strays(enum motor motor, uint32_t now)
{
    const struct way *way = &rig.way[motor];
    bool steady = (rig.status[motor] & FLAG_MOTION) == MOTION_CONSTANT && way->told == rig.told[units_axis(motor)];
    uint32_t time = now - way->since;
    if (steady && time < WAY_MS)
        return false;
    int32_t expected = way->told * (int32_t)time / SPEEDS_A_MS, moved = rig.position[motor] - way->begin;
    begin_way(motor, now);
    return steady && labs(moved - expected) > labs(expected) / 4 + SLACK;
}

static void distrust(void)
{
    rig_trouble(STATUS_FAULT, 0);
    rig_forget();
}

/* The first time they are told to brake; if that does not help either, they lose their current. */
static void check_orders(uint32_t now)
{
    bool contradicted = false;
    for (uint8_t m = 0; m < MOTORS; m++)
        contradicted = contradicted || contradicts(m);
    if (!contradicted) {
        rig.obeyed = now;
        rig.doubted = false;
    } else if (now - rig.obeyed >= PATIENCE_MS) {
        rig.obeyed = now;
        rig.doubted ? rig_hold() : distrust();
        rig.doubted = true;
    }
}

void driver_monitor_tick(uint32_t now)
{
    bool brakes = rig.mode == MODE_REST || rig.mode == MODE_GOTO_SOON || homing_brakes();
    bool judged = (rig.mode == MODE_RUN || brakes) && !rig.held && !rig_mute();
    for (uint8_t m = 0; m < MOTORS; m++)
        if (!judged)
            begin_way(m, now);
        else if (strays(m, now) && rig.mode == MODE_RUN)
            distrust();
    if (judged)
        check_orders(now);
    else
        rig.obeyed = now;
}
