#include "l6470/l6470.h"

#include <math.h>

#include "l6470/l6470_internal.h"

void l6470_power(struct l6470 *chip, bool powered)
{
    if (powered != chip->powered)
        l6470_reset(chip);
    chip->powered = powered;
}

void l6470_wake(struct l6470 *chip, bool awake)
{
    if (chip->awake && !awake)
        l6470_reset(chip);
    chip->awake = awake;
}

int32_t l6470_position(const struct l6470 *chip)
{
    if (chip->frozen)
        return chip->frozen_at;
    int64_t steps = (int64_t)floor(chip->field) - (int64_t)chip->zero;
    return (int32_t)((steps + 0x200000) & 0x3FFFFF) - 0x200000;
}

bool l6470_reached(const struct l6470 *chip)
{
    return chip->motion == L6470_STANDS || (chip->motion == L6470_RUNS && chip->speed == chip->wanted);
}

static uint16_t motion_bits(const struct l6470 *chip)
{
    if (chip->motion == L6470_STANDS)
        return 0;
    if (chip->motion == L6470_STOPS || chip->speed * chip->wanted < 0 || fabs(chip->speed) > fabs(chip->wanted))
        return 2;
    return fabs(chip->speed) < fabs(chip->wanted) ? 1 : 3;
}

uint16_t l6470_status(const struct l6470 *chip)
{
    const uint16_t low_when_raised =
        L6470_UNDERVOLTAGE | L6470_WARMING | L6470_SHUTDOWN | L6470_OVERCURRENT | L6470_LOSS;
    uint16_t status = (uint16_t)(chip->latched ^ low_when_raised);
    status |= (uint16_t)(chip->bridges_off | l6470_reached(chip) << 1 | chip->switch_closed << 2 | chip->forward << 4);
    return (uint16_t)(status | motion_bits(chip) << 5);
}

void l6470_heat(struct l6470 *chip, enum l6470_heat heat)
{
    chip->heat = heat;
    if (!chip->powered)
        return;
    if (heat != L6470_COOL)
        chip->latched |= L6470_WARMING;
    if (heat == L6470_TOO_HOT) {
        chip->latched |= L6470_SHUTDOWN;
        l6470_shut(chip);
    }
}

void l6470_loss(struct l6470 *chip)
{
    if (chip->powered && chip->awake)
        chip->latched |= L6470_LOSS;
}

void l6470_short(struct l6470 *chip)
{
    chip->latched |= L6470_OVERCURRENT;
    l6470_shut(chip);
}

void l6470_freeze(struct l6470 *chip, bool frozen)
{
    chip->frozen_at = l6470_position(chip);
    chip->frozen = frozen;
}

void l6470_forget(struct l6470 *chip)
{
    l6470_reset(chip);
    chip->latched = 0;
}

void l6470_clear(struct l6470 *chip)
{
    chip->latched = 0;
    l6470_heat(chip, chip->heat);
}
