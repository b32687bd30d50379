#include <math.h>

#include "l6470/l6470_internal.h"

#define LOW_UNIT (MICRO * 0.238418579)   /* microsteps/s of a unit of MIN_SPEED */
#define RELEASE_LEAST (MICRO * 5)

static void answer(struct l6470 *chip, uint32_t value, uint8_t bytes)
{
    chip->answer = value;
    chip->answer_left = bytes;
}

/* Whether the bridges can drive a motor; if so, end their high impedance. */
static bool ready(struct l6470 *chip)
{
    if ((chip->latched & (L6470_SHUTDOWN | L6470_OVERCURRENT)) != 0) {
        chip->latched |= L6470_NOT_PERFORMED;
        return false;
    }
    chip->bridges_off = chip->off_after_stop = false;
    return true;
}

static double top_speed(const struct l6470 *chip)
{
    return chip->registers[MAX_SPEED] * TOP_UNIT;
}

static void run(struct l6470 *chip, enum l6470_motion motion, bool forward, double speed)
{
    if (!ready(chip))
        return;
    speed = fmin(speed, top_speed(chip));
    chip->motion = motion;
    chip->wanted = forward ? speed : -speed;
}

static void go(struct l6470 *chip, double distance)
{
    if (!l6470_reached(chip)) {
        chip->latched |= L6470_NOT_PERFORMED;
        return;
    }
    if (distance == 0 || !ready(chip))
        return;
    chip->motion = L6470_GOES;
    chip->goal = floor(chip->field) + distance;
    chip->wanted = top_speed(chip);
}

static void move(struct l6470 *chip, bool forward, uint32_t steps)
{
    if (chip->motion == L6470_STANDS)
        go(chip, forward ? steps : -(double)steps);
    else
        chip->latched |= L6470_NOT_PERFORMED;
}

static void go_to(struct l6470 *chip, uint32_t position)
{
    int64_t distance = ((int64_t)position - l6470_position(chip)) & 0x3FFFFF;
    go(chip, distance < 0x200000 ? (double)distance : (double)distance - 0x400000);
}

static void release(struct l6470 *chip, bool forward)
{
    if (chip->motion != L6470_STANDS || !ready(chip))
        return;
    chip->motion = L6470_RELEASES;
    chip->wanted = fmax((chip->registers[MIN_SPEED] & 0xFFF) * LOW_UNIT, RELEASE_LEAST) * (forward ? 1 : -1);
    chip->speed = chip->wanted;
}

static void perform(struct l6470 *chip)
{
    uint8_t op = chip->op, reg = op & 0x1F;
    if (chip->deaf)
        return;
    bool forward = op & 1;
    uint32_t value = chip->argument;
    if (op < 0x20)
        l6470_set(chip, reg, value);
    else if ((op & 0xFE) == 0x40)
        move(chip, forward, value & 0x3FFFFF);
    else if ((op & 0xFE) == 0x50)
        run(chip, L6470_RUNS, forward, (value & 0xFFFFF) * SPEED_UNIT);
    else if (op == 0x60)
        go_to(chip, value & 0x3FFFFF);
    else if ((op & 0xF6) == 0x82) {
        chip->copy_to_mark = op & 8;
        run(chip, L6470_UNTIL, forward, (value & 0xFFFFF) * SPEED_UNIT);
    }
}

/* Perform a command without an argument; false when it is unknown. */
static bool perform_bare(struct l6470 *chip, uint8_t op)
{
    if ((op & 0xF6) == 0x92) {
        chip->copy_to_mark = op & 8;
        release(chip, op & 1);
    } else if (op == 0xA0 || op == 0xB0) {
        if (op == 0xB0 && chip->motion == L6470_STANDS)
            chip->bridges_off = (chip->latched & (L6470_SHUTDOWN | L6470_OVERCURRENT)) != 0;
        else
            l6470_brake(chip, op == 0xA0);
    } else if (op == 0xA8 || op == 0xB8) {
        chip->off_after_stop = op == 0xA8 || (chip->latched & (L6470_SHUTDOWN | L6470_OVERCURRENT)) != 0;
        chip->bridges_off = false;
        l6470_stand(chip);
    } else if (op == 0xC0)
        l6470_reset(chip);
    else if (op == 0xD0) {
        answer(chip, l6470_status(chip), 2);
        l6470_clear(chip);
    } else if (op == 0xD8)
        chip->zero = floor(chip->field);
    else
        return false;
    return true;
}

static uint8_t argument_bytes(uint8_t op)
{
    if (op < 0x20)
        return op == 0 ? 0 : l6470_bytes(op);
    bool moves = (op & 0xFE) == 0x40 || (op & 0xFE) == 0x50 || op == 0x60 || (op & 0xF6) == 0x82;
    return moves ? 3 : 0;
}

static void begin(struct l6470 *chip, uint8_t op)
{
    chip->op = op;
    chip->argument = 0;
    chip->left = argument_bytes(op);
    if (op == 0 || chip->left > 0)
        return;
    if (op > 0x20 && op < 0x40 && l6470_bytes(op & 0x1F) > 0)
        answer(chip, l6470_value(chip, op & 0x1F), l6470_bytes(op & 0x1F));
    else if (chip->deaf && op != 0xD0)
        return;
    else if (!perform_bare(chip, op))
        chip->latched |= L6470_WRONG;
}

void l6470_receive(struct l6470 *chip, uint8_t byte)
{
    if (!chip->powered || !chip->awake)
        return;
    if (chip->answer_left > 0)
        chip->answer_left--;
    if (chip->left == 0) {
        if (chip->answer_left == 0 || byte != 0)
            begin(chip, byte);
        return;
    }
    chip->argument = chip->argument << 8 | byte;
    if (--chip->left == 0)
        perform(chip);
}

uint8_t l6470_transmit(const struct l6470 *chip)
{
    if (!chip->powered || !chip->awake || chip->answer_left == 0)
        return 0;
    return (uint8_t)(chip->answer >> (8 * (chip->answer_left - 1)));
}
