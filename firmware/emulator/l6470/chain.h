/* Daisy chain: the drivers form one shift register while chip select is low. */
#ifndef CHAIN_H
#define CHAIN_H

#include "l6470/l6470.h"

#define CHIPS 4

/* Which wire to the drivers is cut: none, chip select (or all), clock, data to the first. */
enum cut { CUT_NOTHING, CUT_SELECT, CUT_CLOCK, CUT_DATA };

struct chain {
    struct l6470 chips[CHIPS]; /* the first is nearest to the controller's output */
    uint8_t shift[CHIPS];
    bool selected;
    enum cut cut;
};

void chain_select(struct chain *chain, bool selected);

/* Shift a byte in at the first driver and one out at the last. */
uint8_t chain_shift(struct chain *chain, uint8_t byte);

#endif
