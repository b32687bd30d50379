#include "l6470.h"

#include <math.h>
#include <string.h>

#define MICRO 128.0
#define SPEED_UNIT (MICRO / 67.108864)   /* microsteps/s of a unit of SPEED */
#define RAMP_UNIT (MICRO * 14.5519152)   /* microsteps/s2 of a unit of ACC: 2^-40 step/tick2 */
#define TOP_UNIT (MICRO / 0.065536)      /* microsteps/s of a unit of MAX_SPEED */
#define LOW_UNIT (MICRO * 0.238418579)   /* microsteps/s of a unit of MIN_SPEED */
#define TURN (4 * MICRO)                 /* microsteps of an electrical turn */
#define RELEASE_LEAST (MICRO * 5)
#define STOPS_SOFT (1 << 4) /* SW_MODE in CONFIG */

enum { ABS_POS = 1, EL_POS, MARK, SPEED, ACC, DEC, MAX_SPEED, MIN_SPEED, STEP_MODE = 0x16, CONFIG = 0x18, STATUS };
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

static uint8_t bytes_of(uint8_t reg)
{
    return (uint8_t)((rows[reg].bits + 7) / 8);
}

static void forget(struct l6470 *chip)
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

void l6470_power(struct l6470 *chip, bool powered)
{
    if (powered != chip->powered)
        forget(chip);
    chip->powered = powered;
}

void l6470_wake(struct l6470 *chip, bool awake)
{
    if (chip->awake && !awake)
        forget(chip);
    chip->awake = awake;
}

int32_t l6470_position(const struct l6470 *chip)
{
    if (chip->frozen)
        return chip->frozen_at;
    int64_t steps = (int64_t)floor(chip->field) - (int64_t)chip->zero;
    return (int32_t)((steps + 0x200000) & 0x3FFFFF) - 0x200000;
}

static bool reached(const struct l6470 *chip)
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
    const uint16_t low_when_raised = L6470_UNDERVOLTAGE | L6470_WARMING | L6470_SHUTDOWN | L6470_OVERCURRENT | L6470_LOSS;
    uint16_t status = (uint16_t)(chip->latched ^ low_when_raised);
    status |= (uint16_t)(chip->bridges_off | reached(chip) << 1 | chip->switch_closed << 2 | chip->forward << 4);
    return (uint16_t)(status | motion_bits(chip) << 5);
}

static void stand(struct l6470 *chip)
{
    chip->motion = L6470_STANDS;
    chip->speed = chip->wanted = 0;
    chip->field = floor(chip->field + 1e-6);
    if (chip->off_after_stop)
        chip->bridges_off = true;
    chip->off_after_stop = false;
}

static void brake(struct l6470 *chip, bool then_off)
{
    chip->motion = L6470_STOPS;
    chip->wanted = 0;
    chip->off_after_stop = then_off;
    if (chip->speed == 0)
        stand(chip);
}

static void shut(struct l6470 *chip)
{
    chip->off_after_stop = true;
    stand(chip);
}

static void note_position(struct l6470 *chip)
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
        note_position(chip);
        stand(chip);
    }
    if (closes && chip->motion == L6470_UNTIL)
        note_position(chip);
    if (closes && chip->motion == L6470_UNTIL && (chip->registers[CONFIG] & STOPS_SOFT))
        brake(chip, false);
    else if (closes && chip->motion != L6470_STANDS && !(chip->registers[CONFIG] & STOPS_SOFT))
        stand(chip);
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
        shut(chip);
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
    shut(chip);
}

void l6470_freeze(struct l6470 *chip, bool frozen)
{
    chip->frozen_at = l6470_position(chip);
    chip->frozen = frozen;
}

void l6470_forget(struct l6470 *chip)
{
    forget(chip);
    chip->latched = 0;
}

/* Bytes */

static uint32_t value_of(struct l6470 *chip, uint8_t reg)
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

static void answer(struct l6470 *chip, uint32_t value, uint8_t bytes)
{
    chip->answer = value;
    chip->answer_left = bytes;
}

static void clear_flags(struct l6470 *chip)
{
    chip->latched = 0;
    l6470_heat(chip, chip->heat);
}

static void set(struct l6470 *chip, uint8_t reg, uint32_t value)
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

/* Whether the bridges can drive a motor; a motion ends their high impedance. */
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

static void go(struct l6470 *chip, double way)
{
    if (!reached(chip)) {
        chip->latched |= L6470_NOT_PERFORMED;
        return;
    }
    if (way == 0 || !ready(chip))
        return;
    chip->motion = L6470_GOES;
    chip->goal = floor(chip->field) + way;
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
    int64_t way = ((int64_t)position - l6470_position(chip)) & 0x3FFFFF;
    go(chip, way < 0x200000 ? (double)way : (double)way - 0x400000);
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
        set(chip, reg, value);
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

/* Commands without an argument; false for those that are none. */
static bool perform_bare(struct l6470 *chip, uint8_t op)
{
    if ((op & 0xF6) == 0x92) {
        chip->copy_to_mark = op & 8;
        release(chip, op & 1);
    } else if (op == 0xA0 || op == 0xB0) {
        if (op == 0xB0 && chip->motion == L6470_STANDS)
            chip->bridges_off = (chip->latched & (L6470_SHUTDOWN | L6470_OVERCURRENT)) != 0;
        else
            brake(chip, op == 0xA0);
    } else if (op == 0xA8 || op == 0xB8) {
        chip->off_after_stop = op == 0xA8 || (chip->latched & (L6470_SHUTDOWN | L6470_OVERCURRENT)) != 0;
        chip->bridges_off = false;
        stand(chip);
    } else if (op == 0xC0)
        forget(chip);
    else if (op == 0xD0) {
        answer(chip, l6470_status(chip), 2);
        clear_flags(chip);
    } else if (op == 0xD8)
        chip->zero = floor(chip->field);
    else
        return false;
    return true;
}

static uint8_t argument_bytes(uint8_t op)
{
    if (op < 0x20)
        return op == 0 ? 0 : bytes_of(op);
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
    if (op > 0x20 && op < 0x40 && rows[op & 0x1F].bits > 0)
        answer(chip, value_of(chip, op & 0x1F), bytes_of(op & 0x1F));
    else if (chip->deaf && op != 0xD0)
        return;
    else if (!perform_bare(chip, op))
        chip->latched |= L6470_WRONG;
}

void l6470_take(struct l6470 *chip, uint8_t byte)
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

uint8_t l6470_next(const struct l6470 *chip)
{
    if (!chip->powered || !chip->awake || chip->answer_left == 0)
        return 0;
    return (uint8_t)(chip->answer >> (8 * (chip->answer_left - 1)));
}

/* Motion */

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
    double way = chip->goal - chip->field, braking = sqrt(2 * chip->registers[DEC] * RAMP_UNIT * fabs(way));
    double speed = fmin(braking, chip->wanted);
    approach(chip, way > 0 ? speed : -speed, dt);
    if (fabs(chip->speed) * dt < fabs(way)) {
        chip->field += chip->speed * dt;
        return;
    }
    chip->field = chip->goal;
    stand(chip);
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
            stand(chip);
    }
    if (chip->speed != 0)
        chip->forward = chip->speed > 0;
}
