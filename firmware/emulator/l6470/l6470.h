/* A model of one L6470 stepper driver (ST, DocID 16737 Rev 3): registers, commands, ramps, flags. No hardware, no clock:
 * bytes and time come in. Positions are microsteps, speeds microsteps/s. */
#ifndef L6470_H
#define L6470_H

#include <stdbool.h>
#include <stdint.h>

enum l6470_motion { L6470_STANDS, L6470_RUNS, L6470_GOES, L6470_STOPS, L6470_UNTIL, L6470_RELEASES };
enum l6470_heat { L6470_COOL, L6470_WARM, L6470_TOO_HOT };

struct l6470 {
    uint32_t registers[32];
    enum l6470_motion motion;
    double field; /* where the field stands, in microsteps of 1/128 */
    double zero;  /* where ABS_POS is 0 */
    double speed, wanted, goal;
    bool powered, awake; /* motor supply, and reset high */
    bool bridges_off, off_after_stop, forward, copy_to_mark;
    bool switch_closed;
    bool deaf;   /* it answers, and does nothing of what it is told */
    bool frozen; /* the counter stands still */
    int32_t frozen_at;
    enum l6470_heat heat;
    uint16_t latched; /* flags of STATUS that are raised, all active high here */
    uint8_t op, left, answer_left;
    uint32_t argument, answer;
};

enum { /* bits of `latched`, where STATUS has them */
    L6470_SWITCH_EVENT = 1 << 3, L6470_NOT_PERFORMED = 1 << 7, L6470_WRONG = 1 << 8, L6470_UNDERVOLTAGE = 1 << 9,
    L6470_WARMING = 1 << 10, L6470_SHUTDOWN = 1 << 11, L6470_OVERCURRENT = 1 << 12, L6470_LOSS = 3 << 13
};

/* Motor supply, and the reset input; without either everything is forgotten. */
void l6470_power(struct l6470 *chip, bool powered);
void l6470_wake(struct l6470 *chip, bool awake);

/* What chip select's rising edge brings in; the byte that will be shifted out in the next frame. */
void l6470_take(struct l6470 *chip, uint8_t byte);
uint8_t l6470_next(const struct l6470 *chip);

void l6470_switch(struct l6470 *chip, bool closed);
void l6470_heat(struct l6470 *chip, enum l6470_heat heat);

/* A motor that slipped, and a short circuit. */
void l6470_loss(struct l6470 *chip);
void l6470_short(struct l6470 *chip);

/* A counter that stands still from now on, or goes on. */
void l6470_freeze(struct l6470 *chip, bool frozen);

/* A driver that starts anew without a word. */
void l6470_forget(struct l6470 *chip);

/* Time passes, s. */
void l6470_advance(struct l6470 *chip, double dt);

int32_t l6470_position(const struct l6470 *chip);
uint16_t l6470_status(const struct l6470 *chip);

#endif
