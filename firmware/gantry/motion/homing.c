#include "motion/motion.h"

#include <stdlib.h>

#include "drivers/circle.h"
#include "drivers/rig.h"
#include "drivers/switches.h"
#include "drivers/units.h"
#include "port.h"

/* SETTLE: brake. START: reset the drivers, which makes rotors jump by up to two steps, and hold them. LEAVE: leave a
 * closed switch at either end. APPROACH: go to the switch at home, or to a circle's index from either side. RELEASE: go forward until
 * it opens. */
enum phase { SETTLE, START, LEAVE, APPROACH, RELEASE };

#define QUIET_POLLS 10 /* without motion or a bouncing switch, before the next phase begins */
#define START_POLLS 50 /* in which rotors come to rest after their jump */
#define MOST_ATTEMPTS 7 /* back_offs from behind a switch that was hit; more than one, as a motor may slip */

static int32_t travelled(enum motor motor)
{
    uint32_t travel = ((uint32_t)rig.position[motor] - (uint32_t)rig.phase_start[motor]) & 0x3FFFFFUL;
    return travel < 0x200000UL ? (int32_t)travel : (int32_t)(0x400000UL - travel);
}

static void enter(enum phase phase)
{
    rig.phase = (uint8_t)phase;
    rig.quiet_polls = 0;
    rig.phase_began = port_now();
    for (uint8_t m = 0; m < MOTORS; m++)
        rig.phase_start[m] = rig.position[m];
}

/* How many back_offs an axis moves next to leave its switch, signed: back where it came from, or to either side when
 * that is unknown. 0 when all attempts failed. */
static int8_t escape_direction(enum axis axis)
{
    static const int8_t unknown[] = {1, -2};
    if (rig.blocked[axis] != 0)
        return rig.attempts < MOST_ATTEMPTS ? (int8_t)-rig.blocked[axis] : 0;
    return rig.attempts < sizeof unknown ? unknown[rig.attempts] : 0;
}

/* Move axes off their closed switches; false when a switch stays closed. */
static bool leave_switches(void)
{
    struct driver_command commands[MOTORS];
    for (uint8_t m = 0; m < MOTORS; m++) {
        int8_t times = switches_axis_closed(units_axis(m)) ? escape_direction(units_axis(m)) : 0;
        if (times == 0 && switches_axis_closed(units_axis(m)))
            return false;
        uint32_t distance = (uint32_t)(axes[units_axis(m)].back_off * abs(times));
        uint8_t op = times > 0 ? OP_MOVE + FORWARD : times < 0 ? OP_MOVE : OP_NOP;
        if (circle_motor(m) && times != 0)
            circle.forward = times < 0;
        commands[m] = (struct driver_command){op, distance};
    }
    rig.attempts++;
    drivers_send(commands, 3);
    enter(LEAVE);
    return true;
}

static void approach(void)
{
    struct driver_command commands[MOTORS];
    for (uint8_t m = 0; m < MOTORS; m++) {
        uint8_t op = circle_motor(m) && circle.forward ? OP_GO_UNTIL + FORWARD : OP_GO_UNTIL;
        commands[m] = (struct driver_command){op, (uint32_t)axes[units_axis(m)].homing_speed};
    }
    drivers_send(commands, 3);
    enter(APPROACH);
}

/* The counters restart at 0, so that the travel until the switches open is measured. */
static void release(void)
{
    struct driver_command commands[MOTORS], zero[MOTORS];
    for (uint8_t m = 0; m < MOTORS; m++) {
        zero[m] = (struct driver_command){OP_RESET_POS, 0};
        commands[m] = (struct driver_command){OP_RELEASE + FORWARD, 0};
    }
    drivers_send(zero, 0);
    if (circle_motor(MOTOR_ALPHA))
        rig.position[MOTOR_ALPHA] = 0;
    rig_poll();
    drivers_send(commands, 0);
    enter(RELEASE);
}

static void restart_drivers(void)
{
    struct driver_command hold[MOTORS];
    for (uint8_t m = 0; m < MOTORS; m++)
        hold[m] = (struct driver_command){OP_HARD_STOP, 0};
    port_reset_drivers();
    drivers_configure();
    rig_acknowledge();
    drivers_set_top_speeds(true);
    drivers_send(hold, 0);
    enter(START);
}

static void fail(void)
{
    rig_fail(STATUS_FAULT, (1 << AXES) - 1);
}

/* Whether an axis moved farther than its length or turn, or than a switch needs to open, or y1 and y2 drift apart. */
static bool too_far(void)
{
    if (rig.phase != APPROACH && rig.phase != RELEASE)
        return false;
    for (uint8_t m = 0; m < MOTORS; m++) {
        enum axis axis = units_axis(m);
        int32_t whole = circle_axis(axis) ? TURN : units_steps(axis, axes[axis].high);
        int32_t length = whole + 4 * axes[axis].back_off;
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
    if (circle_axis(AXIS_YAW))
        circle.far = false;
    rig.mode = MODE_REST;
    for (uint8_t a = 0; a < AXES; a++)
        rig.blocked[a] = 0;
}

/* Start the next phase; all motors stand. */
static void next_phase(void)
{
    if (rig.phase == SETTLE)
        restart_drivers();
    else if (rig.phase < APPROACH && !switches_any_closed())
        approach();
    else if (rig.phase < APPROACH)
        leave_switches() ? (void)0 : fail();
    else if (rig.phase == APPROACH)
        switches_all_closed() ? release() : fail();
    else
        finish();
}

void homing_start(void)
{
    rig_acknowledge();
    rig_stop(0);
    if (circle_axis(AXIS_YAW))
        circle.forward = rig.calibrated && circle_heading(rig.position[MOTOR_ALPHA]) > TURN / 2;
    rig_void_position();
    rig.mode = MODE_HOMING;
    rig.phase = SETTLE;
    rig.attempts = rig.quiet_polls = 0;
    rig.phase_began = port_now();
}

bool homing_settling(void)
{
    return rig.mode == MODE_HOMING && rig.phase == SETTLE;
}

void homing_tick(uint32_t now)
{
    if (rig.mode != MODE_HOMING)
        return;
    if (too_far() || now - rig.phase_began >= HOMING_PHASE_MS)
        fail();
    else if (switches_quiet(rig.phase == START ? START_POLLS : QUIET_POLLS))
        next_phase();
}

void homing_restore(void)
{
    rig_poll();
    int32_t skew = rig.position[MOTOR_Y1] - rig.position[MOTOR_Y2];
    rig.calibrated = drivers_position_valid() && drivers_limited() && labs(skew) <= axes[AXIS_Y].square;
    if (rig.calibrated) {
        rig.resumed = true;
        rig_stop(0);
        return;
    }
    port_reset_drivers();
    drivers_configure();
    rig_acknowledge();
}
