#include "memory/limits.h"

#include "drivers/circle.h"
#include "drivers/units.h"

struct axis_limits limits[AXES];
const int32_t limits_narrowest[LIMITS] = LIMITS_NARROWEST, limits_widest[LIMITS] = LIMITS_WIDEST;

bool limits_possible(const int32_t set[LIMITS])
{
    for (uint8_t i = 0; i < LIMITS; i++)
        if (set[i] < limits_narrowest[i] || set[i] > limits_widest[i])
            return false;
    return true;
}

/* A register that stands for the built-in limit, for one below; rounded down. */
static uint16_t lowered(uint16_t built, int32_t limit, int32_t widest)
{
    return (uint16_t)((uint32_t)built * (uint32_t)limit / (uint32_t)widest);
}

static void apply_range(enum axis axis, int32_t range)
{
    struct axis_limits *to = &limits[axis];
    to->low = axes[axis].low;
    to->high = axes[axis].high;
    if (axis != AXIS_YAW) {
        to->high = to->low + range;
    } else if (!circle_axis(axis)) {
        to->low = to->low > -range ? to->low : -range;
        to->high = range;
    }
}

void limits_apply(const int32_t set[LIMITS])
{
    for (uint8_t a = 0; a < AXES; a++) {
        bool turns = a == AXIS_YAW;
        uint8_t speed = turns ? LIMIT_YAW_RATE : LIMIT_SPEED, ramp = turns ? LIMIT_YAW_ACCELERATION : LIMIT_ACCELERATION;
        const struct axis_constants *built = &axes[a];
        struct axis_limits *to = &limits[a];
        apply_range(a, set[a]);
        to->fastest = set[speed];
        to->top_register = lowered(built->top_register, set[speed], limits_widest[speed]);
        to->quickest = (int32_t)((uint32_t)built->fastest * to->top_register / built->top_register);
        to->ramp_register = lowered(built->ramp_register, set[ramp], limits_widest[ramp]);
        to->edge = (uint16_t)((uint32_t)built->edge * to->ramp_register / built->ramp_register);
    }
}

bool limits_inside(enum axis axis, int32_t micro)
{
    bool endless = circle_axis(axis);
    return micro >= limits[axis].low && micro <= limits[axis].high && (endless || units_steps(axis, micro) >= 0);
}

static uint16_t root(uint32_t square)
{
    uint16_t result = 0;
    for (uint16_t bit = 0x8000; bit != 0; bit >>= 1) {
        uint16_t guess = result | bit;
        if ((uint32_t)guess * guess <= square)
            result = guess;
    }
    return result;
}

int32_t limits_braking_speed(enum axis axis, int32_t room)
{
    if (room <= 0)
        return 0;
    uint32_t longest = UINT32_MAX / limits[axis].edge;
    uint32_t clear = (uint32_t)room < longest ? (uint32_t)room : longest;
    return 100L * root(limits[axis].edge * clear);
}
