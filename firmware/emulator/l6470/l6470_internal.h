/* Shared by the parts of the driver's model. */
#ifndef L6470_INTERNAL_H
#define L6470_INTERNAL_H

#include "l6470/l6470.h"

#define MICRO 128.0
#define SPEED_UNIT (MICRO / 67.108864)   /* microsteps/s of a unit of SPEED */
#define RAMP_UNIT (MICRO * 14.5519152)   /* microsteps/s2 of a unit of ACC: 2^-40 step/tick2 */
#define TOP_UNIT (MICRO / 0.065536)      /* microsteps/s of a unit of MAX_SPEED */
#define STOPS_SOFT (1 << 4) /* SW_MODE in CONFIG */

enum { ABS_POS = 1, EL_POS, MARK, SPEED, ACC, DEC, MAX_SPEED, MIN_SPEED, STEP_MODE = 0x16, CONFIG = 0x18, STATUS };

/* Registers: the size in bytes, the value, writing if the chip accepts it now, and the reset values. */
uint8_t l6470_bytes(uint8_t reg);
uint32_t l6470_value(struct l6470 *chip, uint8_t reg);
void l6470_set(struct l6470 *chip, uint8_t reg, uint32_t value);
void l6470_reset(struct l6470 *chip);

/* Whether the commanded speed is reached; reset the flags whose cause is gone. */
bool l6470_reached(const struct l6470 *chip);
void l6470_clear(struct l6470 *chip);

/* Stop at once, along the ramp, or at once and without current. */
void l6470_stand(struct l6470 *chip);
void l6470_brake(struct l6470 *chip, bool then_off);
void l6470_shut(struct l6470 *chip);

#endif
