/* The chain of four L6470 (ST, DocID 16737): registers, commands, flags. */
#ifndef DRIVERS_H
#define DRIVERS_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

enum { /* registers */
    REG_ABS_POS = 0x01, REG_MARK = 0x03, REG_ACC = 0x05, REG_DEC = 0x06, REG_MAX_SPEED = 0x07, REG_KVAL_HOLD = 0x09,
    REG_KVAL_RUN = 0x0A, REG_KVAL_ACC = 0x0B, REG_KVAL_DEC = 0x0C, REG_OCD_TH = 0x13, REG_STALL_TH = 0x14,
    REG_STEP_MODE = 0x16, REG_CONFIG = 0x18, REG_STATUS = 0x19
};

enum { /* commands; add FORWARD to move forward; GO_UNTIL copies the position to MARK, RELEASE zeroes it */
    OP_NOP = 0x00, OP_SET = 0x00, OP_GET = 0x20, OP_MOVE = 0x40, OP_RUN = 0x50, OP_GOTO = 0x60, OP_GO_UNTIL = 0x8A,
    OP_RELEASE = 0x92, OP_SOFT_STOP = 0xB0, OP_HARD_STOP = 0xB8, OP_GET_STATUS = 0xD0, OP_RESET_POS = 0xD8,
    FORWARD = 0x01
};

#define DRIVER_MARK_FAR (DRIVER_MARK + 1UL) /* of alpha, see circle.h */

enum { /* flags of STATUS */
    FLAG_SW_CLOSED = 1 << 2, FLAG_SW_EVENT = 1 << 3, FLAG_FORWARD = 1 << 4, FLAG_MOTION = 3 << 5,
    FLAG_NOT_PERFORMED = 1 << 7, FLAG_WRONG = 1 << 8, FLAG_UVLO_NOT = 1 << 9, FLAG_WARM_NOT = 1 << 10,
    FLAG_HOT_NOT = 1 << 11, FLAG_OCD_NOT = 1 << 12, FLAG_LOSS_A_NOT = 1 << 13, FLAG_LOSS_B_NOT = 1 << 14,
    FLAGS_SUPPLY = FLAG_UVLO_NOT | FLAG_OCD_NOT, FLAGS_LOSS = FLAG_LOSS_A_NOT | FLAG_LOSS_B_NOT,
    FLAGS_HEALTHY = FLAGS_SUPPLY | FLAG_HOT_NOT | FLAGS_LOSS, /* if one is missing, the position is unknown */
    MOTION_BRAKES = 2 << 5, MOTION_CONSTANT = 3 << 5 /* values of FLAG_MOTION; 0: standing */
};

struct driver_command {
    uint8_t op; /* OP_NOP does nothing */
    uint32_t argument;
};

/* Send each driver its command in one frame, followed by the bytes of the arguments. */
void drivers_send(const struct driver_command commands[MOTORS], uint8_t bytes);

/* Read or write a register of each driver. */
void drivers_get(uint8_t reg, uint8_t bytes, uint32_t values[MOTORS]);
void drivers_set(uint8_t reg, uint8_t bytes, const uint32_t values[MOTORS]);
void drivers_set_all(uint8_t reg, uint8_t bytes, uint32_t value);

/* Read STATUS of each driver; clear resets flags whose cause is gone. */
void drivers_status(uint16_t status[MOTORS], bool clear);

/* Read ABS_POS of each driver in microsteps, signed. */
void drivers_position(int32_t position[MOTORS]);

/* Write all registers that differ from their reset values; the motors must stand. */
void drivers_configure(void);

/* Set the maximum speeds for homing, or for everything else. */
void drivers_set_top_speeds(bool homing);

/* Whether all drivers are configured and hold the mark of a valid position. */
bool drivers_position_valid(void);

/* Whether all drivers have the speeds and ramps of the limits that hold; not while homing. */
bool drivers_limited(void);

#endif
