#include <math.h>

#include "l6470/l6470_internal.h"

#define TURN (4 * MICRO) /* microsteps of an electrical turn */

enum when { NEVER, ALWAYS, STANDING, BRIDGES_OFF };

static const struct {
    uint8_t bits;
    enum when when;
    uint32_t reset;
} rows[32] = {
    [ABS_POS] = {22, STANDING, 0},       [EL_POS] = {9, STANDING, 0},      [MARK] = {22, ALWAYS, 0},
    [SPEED] = {20, NEVER, 0},            [ACC] = {12, STANDING, 0x8A},     [DEC] = {12, STANDING, 0x8A},
    [MAX_SPEED] = {10, ALWAYS, 0x41},    [MIN_SPEED] = {13, STANDING, 0},  [0x09] = {8, ALWAYS, 0x29},
    [0x0A] = {8, ALWAYS, 0x29},          [0x0B] = {8, ALWAYS, 0x29},       [0x0C] = {8, ALWAYS, 0x29},
    [0x0D] = {14, BRIDGES_OFF, 0x408},   [0x0E] = {8, BRIDGES_OFF, 0x19},  [0x0F] = {8, BRIDGES_OFF, 0x29},
    [0x10] = {8, BRIDGES_OFF, 0x29},     [0x11] = {4, ALWAYS, 0},          [0x12] = {5, NEVER, 0},
    [0x13] = {4, ALWAYS, 8},             [0x14] = {7, ALWAYS, 0x40},       [0x15] = {10, ALWAYS, 0x27},
    [STEP_MODE] = {8, BRIDGES_OFF, 7},   [0x17] = {8, STANDING, 0xFF},     [CONFIG] = {16, BRIDGES_OFF, 0x2E88},
    [STATUS] = {16, NEVER, 0},
};

uint8_t l6470_bytes(uint8_t reg)
{
    return (uint8_t)((rows[reg].bits + 7) / 8);
}

void l6470_reset(struct l6470 *chip)
{
    for (int i = 0; i < 32; i++)
        chip->registers[i] = rows[i].reset;
    chip->motion = L6470_STANDS;
    chip->speed = chip->wanted = 0;
    chip->field = chip->zero = TURN * floor(chip->field / TURN + 0.5); /* EL_POS is 0: the rotor will jump there */
    chip->bridges_off = chip->forward = true;
    chip->off_after_stop = false;
    chip->latched = L6470_UNDERVOLTAGE;
    chip->left = chip->answer_left = 0;
}

uint32_t l6470_value(struct l6470 *chip, uint8_t reg)
{
    switch (reg) {
    case ABS_POS:
        return (uint32_t)l6470_position(chip) & 0x3FFFFF;
    case SPEED:
        return (uint32_t)(fabs(chip->speed) / SPEED_UNIT);
    case STATUS:
        return l6470_status(chip);
    default:
        return chip->registers[reg];
    }
}

void l6470_set(struct l6470 *chip, uint8_t reg, uint32_t value)
{
    enum when when = rows[reg].when;
    bool standing = chip->motion == L6470_STANDS;
    if (when == NEVER || (when == STANDING && !standing) || (when == BRIDGES_OFF && !chip->bridges_off)) {
        chip->latched |= L6470_NOT_PERFORMED;
        return;
    }
    value &= (1U << rows[reg].bits) - 1;
    chip->registers[reg] = value;
    if (reg == ABS_POS)
        chip->zero = floor(chip->field) - (value < 0x200000 ? (double)value : (double)value - 0x400000);
}
