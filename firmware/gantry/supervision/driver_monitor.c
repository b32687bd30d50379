#include "supervision/supervision.h"

#include <stdlib.h>

#include "drivers/rig.h"
#include "drivers/units.h"
#include "motion/motion.h"

#define CONTRADICTION_MS 120      /* long enough to send a lost command twice more */
#define TRAVEL_MS 100
#define SPEED_OF_MICROSTEP_MS 524 /* units of SPEED per microstep/ms: 67.1 units are a step/s of 128 */
#define TOLERANCE 16              /* microsteps */

/* Whether a motor stands, moves or moves in the wrong direction against its command. A braking motor may still obey. */
static bool contradicts(enum motor motor)
{
    int32_t commanded = rig.commanded[units_axis(motor)];
    uint16_t motion = rig.status[motor] & FLAG_MOTION;
    bool forward = (rig.status[motor] & FLAG_FORWARD) != 0;
    if (motion == 0)
        return commanded != 0;
    return commanded == 0 ? motion != MOTION_BRAKES : motion == MOTION_CONSTANT && forward != (commanded > 0);
}

/* The travel is compared only after a motor has reached its commanded speed. */
static void begin_travel(enum motor motor, uint32_t now)
{
    rig.travel[motor] = (struct travel){now, rig.position[motor], rig.commanded[units_axis(motor)]};
}

/* Whether a counter's travel deviates from the commanded speed. */
static bool deviates(enum motor motor, uint32_t now)
{
    const struct travel *travel = &rig.travel[motor];
    bool constant = (rig.status[motor] & FLAG_MOTION) == MOTION_CONSTANT;
    bool steady = constant && travel->commanded == rig.commanded[units_axis(motor)];
    uint32_t time = now - travel->began;
    if (steady && time < TRAVEL_MS)
        return false;
    int32_t expected = travel->commanded * (int32_t)time / SPEED_OF_MICROSTEP_MS;
    int32_t moved = rig.position[motor] - travel->start;
    begin_travel(motor, now);
    return steady && labs(moved - expected) > labs(expected) / 4 + TOLERANCE;
}

static void report_fault(void)
{
    rig_fail(STATUS_FAULT, 0);
    rig_void_position();
}

/* A contradiction first makes all axes brake; if it persists, the motors lose their current. */
static void check_commands(uint32_t now)
{
    bool contradicted = false;
    for (uint8_t m = 0; m < MOTORS; m++)
        contradicted = contradicted || contradicts(m);
    if (!contradicted) {
        rig.consistent = now;
        rig.contradiction_handled = false;
    } else if (now - rig.consistent >= CONTRADICTION_MS) {
        rig.consistent = now;
        rig.contradiction_handled ? rig_hold() : report_fault();
        rig.contradiction_handled = true;
    }
}

void driver_monitor_tick(uint32_t now)
{
    bool brakes = rig.mode == MODE_REST || rig.mode == MODE_GOTO_PENDING || homing_settling();
    bool monitored = (rig.mode == MODE_RUN || brakes) && !rig.held && !rig_any_driver_absent();
    for (uint8_t m = 0; m < MOTORS; m++)
        if (!monitored)
            begin_travel(m, now);
        else if (deviates(m, now) && rig.mode == MODE_RUN)
            report_fault();
    if (monitored)
        check_commands(now);
    else
        rig.consistent = now;
}
