/* A model of one L6470 stepper driver (ST, DocID 16737 Rev 3): registers, commands, ramps, flags. Bytes and time are
 * its inputs. Positions are microsteps, speeds microsteps/s. */
#ifndef L6470_H
#define L6470_H

#include <stdbool.h>
#include <stdint.h>

enum l6470_motion { L6470_STANDS, L6470_RUNS, L6470_GOES, L6470_STOPS, L6470_UNTIL, L6470_RELEASES };
enum l6470_heat { L6470_COOL, L6470_WARM, L6470_TOO_HOT };

struct l6470 {
    uint32_t registers[32];
    enum l6470_motion motion;
    double field; /* position of the field, in microsteps of 1/128 */
    double zero;  /* where ABS_POS is 0 */
    double speed, wanted, goal;
    bool powered, awake; /* motor supply, and reset high */
    bool bridges_off, off_after_stop, forward, copy_to_mark;
    bool switch_closed;
    bool deaf;   /* it answers, and ignores commands */
    bool frozen; /* the counter does not count */
    int32_t frozen_at;
    enum l6470_heat heat;
    uint16_t latched; /* flags of STATUS that are raised, active high */
    uint8_t op, left, answer_left;
    uint32_t argument, answer;
};

enum { /* bits of `latched`, where STATUS has them */
    L6470_SWITCH_EVENT = 1 << 3, L6470_NOT_PERFORMED = 1 << 7, L6470_WRONG = 1 << 8, L6470_UNDERVOLTAGE = 1 << 9,
    L6470_WARMING = 1 << 10, L6470_SHUTDOWN = 1 << 11, L6470_OVERCURRENT = 1 << 12, L6470_LOSS = 3 << 13
};

/* Switch the motor supply and the reset input; without either the chip resets. */
void l6470_power(struct l6470 *chip, bool powered);
void l6470_wake(struct l6470 *chip, bool awake);

/* Receive a byte at chip select's rising edge; the byte to shift out in the next frame. */
void l6470_receive(struct l6470 *chip, uint8_t byte);
uint8_t l6470_transmit(const struct l6470 *chip);

void l6470_switch(struct l6470 *chip, bool closed);
void l6470_heat(struct l6470 *chip, enum l6470_heat heat);

/* The motor slipped; the motor is short-circuited. */
void l6470_loss(struct l6470 *chip);
void l6470_short(struct l6470 *chip);

/* Stop or continue counting. */
void l6470_freeze(struct l6470 *chip, bool frozen);

/* Reset without raising a flag. */
void l6470_forget(struct l6470 *chip);

/* Let time pass, s. */
void l6470_advance(struct l6470 *chip, double dt);

int32_t l6470_position(const struct l6470 *chip);
uint16_t l6470_status(const struct l6470 *chip);

#endif
