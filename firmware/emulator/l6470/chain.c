#include "l6470/chain.h"

#define PULLED_UP 0xFF /* what the controller reads from an open line */

void chain_select(struct chain *chain, bool selected)
{
    if (chain->cut == CUT_SELECT || chain->cut == CUT_CLOCK)
        selected = chain->selected = false;
    for (int i = 0; i < CHIPS; i++) {
        if (selected && !chain->selected)
            chain->shift[i] = l6470_transmit(&chain->chips[i]);
        else if (!selected && chain->selected)
            l6470_receive(&chain->chips[i], chain->shift[i]);
    }
    chain->selected = selected;
}

uint8_t chain_shift(struct chain *chain, uint8_t byte)
{
    if (chain->cut == CUT_SELECT)
        return PULLED_UP;
    if (!chain->selected)
        return 0;
    if (chain->cut == CUT_DATA)
        byte = 0;
    uint8_t out = chain->shift[CHIPS - 1];
    for (int i = CHIPS - 1; i > 0; i--)
        chain->shift[i] = chain->shift[i - 1];
    chain->shift[0] = byte;
    return out;
}
