#include "motion/homing.h"

#include <stdlib.h>

#include "port.h"
#include "drivers/rig.h"
#include "drivers/switches.h"
#include "drivers/units.h"

/* SETTLE: brake. START: the drivers begin anew, at which rotors jump by up to two steps, and hold them. LEAVE: leave a
 * switch that is closed, at whichever end it is. APPROACH: go to the switch at home. RELEASE: go until it opens. */
enum phase { SETTLE, START, LEAVE, APPROACH, RELEASE };

#define QUIET_LOOKS 10 /* in which all stands and no switch bounces, before the next phase begins */
#define START_LOOKS 50 /* in which the rotors come to rest after their jump */
#define WAYS_OUT 7 /* back_offs from behind a switch that was hit: a slip may lead far */

static int32_t travelled(enum motor motor)
{
    uint32_t way = ((uint32_t)rig.position[motor] - (uint32_t)rig.begin[motor]) & 0x3FFFFFUL;
    return way < 0x200000UL ? (int32_t)way : (int32_t)(0x400000UL - way);
}

static void enter(enum phase phase)
{
    rig.phase = (uint8_t)phase;
    rig.quiet = 0;
    rig.since = port_now();
    for (uint8_t m = 0; m < MOTORS; m++)
        rig.begin[m] = rig.position[m];
}

/* How many back_offs an axis goes next to leave its switch, 0 when it has tried all: the way it came from, or to either
 * side when nobody knows. */
static int8_t way_out(enum axis axis)
{
    static const int8_t unknown[] = {1, -2};
    if (rig.blocked[axis] != 0)
        return rig.tries < WAYS_OUT ? (int8_t)-rig.blocked[axis] : 0;
    return rig.tries < sizeof unknown ? unknown[rig.tries] : 0;
}

/* False when a switch stays closed. */
static bool leave(void)
{
    struct order orders[MOTORS];
    for (uint8_t m = 0; m < MOTORS; m++) {
        int8_t times = switches_axis_closed(units_axis(m)) ? way_out(units_axis(m)) : 0;
        if (times == 0 && switches_axis_closed(units_axis(m)))
            return false;
        uint32_t way = (uint32_t)(axes[units_axis(m)].back_off * abs(times));
        uint8_t op = times > 0 ? OP_MOVE + FORWARD : times < 0 ? OP_MOVE : OP_NOP;
        orders[m] = (struct order){op, way};
    }
    rig.tries++;
    drivers_send(orders, 3);
    enter(LEAVE);
    return true;
}

static void approach(void)
{
    struct order orders[MOTORS];
    for (uint8_t m = 0; m < MOTORS; m++)
        orders[m] = (struct order){OP_GO_UNTIL, (uint32_t)axes[units_axis(m)].homing_speed};
    drivers_send(orders, 3);
    enter(APPROACH);
}

/* The counters begin at 0 here as well, so that the way to where the switches open is seen. */
static void release(void)
{
    struct order orders[MOTORS], zero[MOTORS];
    for (uint8_t m = 0; m < MOTORS; m++) {
        zero[m] = (struct order){OP_RESET_POS, 0};
        orders[m] = (struct order){OP_RELEASE + FORWARD, 0};
    }
    drivers_send(zero, 0);
    rig_look();
    drivers_send(orders, 0);
    enter(RELEASE);
}

static void set_up(void)
{
    struct order hold[MOTORS];
    for (uint8_t m = 0; m < MOTORS; m++)
        hold[m] = (struct order){OP_HARD_STOP, 0};
    port_reset_drivers();
    drivers_configure();
    rig_acknowledge();
    drivers_set_top_speeds(true);
    drivers_send(hold, 0);
    enter(START);
}

static void fail(void)
{
    rig_trouble(STATUS_FAULT, (1 << AXES) - 1);
}

/* Farther than the axis is long, or than a switch takes to open: the switch is stuck. Or y1 and y2 part. */
static bool too_far(void)
{
    if (rig.phase != APPROACH && rig.phase != RELEASE)
        return false;
    for (uint8_t m = 0; m < MOTORS; m++) {
        enum axis axis = units_axis(m);
        int32_t length = units_steps(axis, axes[axis].high) + 4 * axes[axis].back_off;
        if (travelled(m) > (rig.phase == APPROACH ? length : 2 * axes[axis].back_off))
            return true;
    }
    int32_t apart = travelled(MOTOR_Y1) - travelled(MOTOR_Y2);
    return rig.phase == APPROACH && labs(apart) > axes[AXIS_Y].skew;
}

static void finish(void)
{
    if (switches_any_closed() || !rig_acknowledge()) {
        fail();
        return;
    }
    drivers_set_top_speeds(false);
    drivers_set_all(REG_MARK, 3, DRIVER_MARK);
    rig.calibrated = true;
    rig.mode = MODE_REST;
    for (uint8_t a = 0; a < AXES; a++)
        rig.blocked[a] = 0;
}

/* All motors stand: go on with the next phase. */
static void next_phase(void)
{
    if (rig.phase == SETTLE)
        set_up();
    else if (rig.phase < APPROACH && !switches_any_closed())
        approach();
    else if (rig.phase < APPROACH)
        leave() ? (void)0 : fail();
    else if (rig.phase == APPROACH)
        switches_all_closed() ? release() : fail();
    else
        finish();
}

void homing_begin(void)
{
    rig_acknowledge();
    rig_stop(0);
    rig_forget();
    rig.mode = MODE_HOMING;
    rig.phase = SETTLE;
    rig.tries = rig.quiet = 0;
    rig.since = port_now();
}

bool homing_brakes(void)
{
    return rig.mode == MODE_HOMING && rig.phase == SETTLE;
}

void homing_tick(uint32_t now)
{
    if (rig.mode != MODE_HOMING)
        return;
    if (too_far() || now - rig.since >= HOMING_PHASE_MS)
        fail();
    else if (switches_quiet(rig.phase == START ? START_LOOKS : QUIET_LOOKS))
        next_phase();
}

void homing_wake(void)
{
    rig_look();
    int32_t skew = rig.position[MOTOR_Y1] - rig.position[MOTOR_Y2];
    rig.calibrated = drivers_remember() && labs(skew) <= axes[AXIS_Y].square;
    if (rig.calibrated) {
        rig.resumed = true;
        rig_stop(0);
        return;
    }
    port_reset_drivers();
    drivers_configure();
    rig_acknowledge();
}
