/* The serial protocol and the rig in numbers; services/gantry/rig_table.py has the same, and the tests compare them.
 * micro is 1e-6 m, or 1e-6 rad for the yaw; step is a microstep of the drivers. */
#ifndef PROTOCOL_H
#define PROTOCOL_H

#include <stdint.h>

#define BAUD 115200UL
#define LINE_LONGEST 64 /* without the line's end; the longest valid line, SETLIMITS, has 61 */
#define WATCHDOG_MS 500
#define HOMING_PHASE_MS 30000UL /* the longest way to a switch takes 19 s */
#define TICK_MS 2 /* between two looks at the drivers */
#define MICROSTEPS 128
#define STEP_MODE_REGISTER 7

enum command { COMMAND_GOTO, COMMAND_RUN, COMMAND_STOP, COMMAND_CALIBRATE, COMMAND_POSITION, COMMAND_STATUS, COMMAND_LIMITS, COMMAND_SETLIMITS, COMMAND_FORGET, COMMAND_GOTOLEFT, COMMAND_GOTORIGHT };

enum status { STATUS_IDLE = 0, STATUS_MOVING = 1, STATUS_HOMING = 2, STATUS_LIMIT = 3, STATUS_STALL = 4, STATUS_HOT = 5, STATUS_NOT_CALIBRATED = 6, STATUS_WATCHDOG = 7, STATUS_FAULT = 8 };
enum error { ERROR_UNKNOWN = 1, ERROR_COUNT = 2, ERROR_NUMBER = 3, ERROR_BOUNDS = 4, ERROR_DAMAGED = 5, ERROR_UNCALIBRATED = 6, ERROR_HOMING = 7, ERROR_TROUBLE = 8, ERROR_RESTARTED = 9, ERROR_BUSY = 10 };
enum source { SOURCE_BUILT = 0, SOURCE_KEPT = 1, SOURCE_DAMAGED = 2, SOURCE_WRITING = 3 };

enum limit { LIMIT_X, LIMIT_Y, LIMIT_YAW, LIMIT_SPEED, LIMIT_YAW_RATE, LIMIT_ACCELERATION, LIMIT_YAW_ACCELERATION, LIMITS };

enum motor { MOTOR_X, MOTOR_Y1, MOTOR_Y2, MOTOR_ALPHA, MOTORS };
enum axis { AXIS_X, AXIS_Y, AXIS_YAW, AXES };
#define MOTOR_NAMES {"x", "y1", "y2", "alpha"}
#define MOTOR_AXES {AXIS_X, AXIS_Y, AXIS_Y, AXIS_YAW}
#define DRIVER_CONFIG_FIRST 0x2E8B /* internal 16 MHz clock, given on to the next; a closing switch stops hard */
#define DRIVER_CONFIG_OTHERS 0x2E8D /* clock of the driver before, given on */
#define DRIVER_KVAL_HOLD 0x20
#define DRIVER_KVAL_RUN 0x3C /* 2.8 V of 12 V */
#define DRIVER_KVAL_RAMP 0x3C
#define DRIVER_OCD_TH 0x8 /* 3.4 A */
#define DRIVER_STALL_TH 0x40 /* 2 A */
#define DRIVER_MARK 0xD0D0 /* in MARK while the position is valid, and gone when a driver was without power */

struct axis_constants {
    int64_t steps_q32; /* microsteps per micro, times 2^32 */
    int64_t micro_q32; /* micro per microstep, times 2^32 */
    int64_t speed_q32; /* units of SPEED per micro/s, times 2^32 */
    int32_t offset; /* microsteps at 0 */
    int32_t low; /* micro */
    int32_t high; /* micro */
    int32_t fastest; /* micro/s */
    uint16_t edge; /* twice the braking before an edge, micro/s2 / 10^4 */
    uint16_t top_register; /* MAX_SPEED */
    uint16_t ramp_register; /* ACC and DEC */
    int32_t homing_speed; /* units of SPEED */
    uint16_t homing_top_register; /* MAX_SPEED while homing */
    int32_t back_off; /* microsteps */
    int32_t skew; /* microsteps */
    int32_t square; /* microsteps */
};

enum kind { KIND_DYNAMIC, KIND_CIRCLE, KINDS };

/* By Table 4.2, the workspace, and what tests/firmware/test_protocol.py names. */
#define AXIS_ROWS_DYNAMIC { \
    {1825189302LL, 10106756627LL, 956924849LL, 382464L, -900000L, 950000L, 1000000L, 90L, 217L, 114L, 22280L, 22L, 1275L, 4250L, 425L}, \
    {1825189302LL, 10106756627LL, 956924849LL, 297472L, -700000L, 700000L, 1000000L, 90L, 217L, 114L, 22280L, 22L, 1275L, 4250L, 425L}, \
    {17324278LL, 1064791485521LL, 9082911LL, 10624L, -2633860L, 2967059L, 1000000L, 160L, 2L, 2L, 740L, 1L, 282L, 282L, 282L} \
}

#define AXIS_ROWS_CIRCLE { \
    {1825189302LL, 10106756627LL, 956924849LL, 382464L, -900000L, 950000L, 1000000L, 90L, 217L, 114L, 22280L, 22L, 1275L, 4250L, 425L}, \
    {1825189302LL, 10106756627LL, 956924849LL, 297472L, -700000L, 700000L, 1000000L, 90L, 217L, 114L, 22280L, 22L, 1275L, 4250L, 425L}, \
    {17499271LL, 1054143570666LL, 9174658LL, 12800L, -6283185L, 6283185L, 1000000L, 160L, 2L, 2L, 748L, 1L, 1138L, 284L, 284L} \
}

#define TURN 25600L /* microsteps of a circle's turn */
#define INDEX_WIDTH 711L /* microsteps below step 0 in which its index is closed */
#define INDEX_TOLERANCE 213L /* microsteps by which it may be elsewhere */
#define DRIVER_CONFIG_INDEX 0x2E9D /* of a circle's alpha: as the others, and its switch stops nothing */

#ifdef CIRCLE
#define RIG_KIND KIND_CIRCLE
#define AXIS_ROWS AXIS_ROWS_CIRCLE
#define LIMITS_NARROWEST {100000L, 100000L, 6283185L, 100000L, 500000L, 100000L, 500000L} /* micro */
#define LIMITS_WIDEST {1850000L, 1400000L, 6283185L, 1000000L, 1000000L, 500000L, 1000000L} /* micro */
#define COMMANDS 11
#define COMMAND_ROWS {{"GOTO", 3}, {"RUN", 3}, {"STOP", 0}, {"CALIBRATE", 0}, {"POSITION", 0}, {"STATUS", 0}, {"LIMITS", 0}, {"SETLIMITS", 7}, {"FORGET", 0}, {"GOTOLEFT", 3}, {"GOTORIGHT", 3}}
#else
#define RIG_KIND KIND_DYNAMIC
#define AXIS_ROWS AXIS_ROWS_DYNAMIC
#define LIMITS_NARROWEST {100000L, 100000L, 174533L, 100000L, 500000L, 100000L, 500000L} /* micro */
#define LIMITS_WIDEST {1850000L, 1400000L, 2967059L, 1000000L, 1000000L, 500000L, 1000000L} /* micro */
#define COMMANDS 9
#define COMMAND_ROWS {{"GOTO", 3}, {"RUN", 3}, {"STOP", 0}, {"CALIBRATE", 0}, {"POSITION", 0}, {"STATUS", 0}, {"LIMITS", 0}, {"SETLIMITS", 7}, {"FORGET", 0}}
#endif

#endif
