#include <math.h>

#include "l6470/l6470_internal.h"

void l6470_stand(struct l6470 *chip)
{
    chip->motion = L6470_STANDS;
    chip->speed = chip->wanted = 0;
    chip->field = floor(chip->field + 1e-6);
    if (chip->off_after_stop)
        chip->bridges_off = true;
    chip->off_after_stop = false;
}

void l6470_brake(struct l6470 *chip, bool then_off)
{
    chip->motion = L6470_STOPS;
    chip->wanted = 0;
    chip->off_after_stop = then_off;
    if (chip->speed == 0)
        l6470_stand(chip);
}

void l6470_shut(struct l6470 *chip)
{
    chip->off_after_stop = true;
    l6470_stand(chip);
}

static void record_position(struct l6470 *chip)
{
    if (chip->copy_to_mark)
        chip->registers[MARK] = (uint32_t)l6470_position(chip) & 0x3FFFFF;
    else
        chip->zero = floor(chip->field + 1e-6);
}

void l6470_switch(struct l6470 *chip, bool closed)
{
    bool closes = closed && !chip->switch_closed, opens = !closed && chip->switch_closed;
    chip->switch_closed = closed;
    if (!chip->powered || !chip->awake)
        return;
    if (closes)
        chip->latched |= L6470_SWITCH_EVENT;
    if (opens && chip->motion == L6470_RELEASES) {
        record_position(chip);
        l6470_stand(chip);
    }
    if (closes && chip->motion == L6470_UNTIL)
        record_position(chip);
    if (closes && chip->motion == L6470_UNTIL && (chip->registers[CONFIG] & STOPS_SOFT))
        l6470_brake(chip, false);
    else if (closes && chip->motion != L6470_STANDS && !(chip->registers[CONFIG] & STOPS_SOFT))
        l6470_stand(chip);
}

static void approach(struct l6470 *chip, double wanted, double dt)
{
    bool slower = fabs(wanted) < fabs(chip->speed) || wanted * chip->speed < 0;
    double ramp = chip->registers[slower ? DEC : ACC] * RAMP_UNIT * dt;
    if (wanted * chip->speed < 0)
        wanted = 0;
    if (fabs(wanted - chip->speed) <= ramp)
        chip->speed = wanted;
    else
        chip->speed += wanted > chip->speed ? ramp : -ramp;
}

static void advance_to_goal(struct l6470 *chip, double dt)
{
    double distance = chip->goal - chip->field, braking = sqrt(2 * chip->registers[DEC] * RAMP_UNIT * fabs(distance));
    double speed = fmin(braking, chip->wanted);
    approach(chip, distance > 0 ? speed : -speed, dt);
    if (fabs(chip->speed) * dt < fabs(distance)) {
        chip->field += chip->speed * dt;
        return;
    }
    chip->field = chip->goal;
    l6470_stand(chip);
}

void l6470_advance(struct l6470 *chip, double dt)
{
    if (chip->motion == L6470_STANDS)
        return;
    if (chip->motion == L6470_GOES) {
        advance_to_goal(chip, dt);
    } else {
        double before = chip->speed;
        approach(chip, chip->wanted, dt);
        chip->field += (before + chip->speed) / 2 * dt;
        if (chip->motion == L6470_STOPS && chip->speed == 0)
            l6470_stand(chip);
    }
    if (chip->speed != 0)
        chip->forward = chip->speed > 0;
}
