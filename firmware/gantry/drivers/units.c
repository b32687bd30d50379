#include "drivers/units.h"

const struct axis_constants axes[AXES] = AXIS_ROWS;
static const uint8_t motor_axes[MOTORS] = MOTOR_AXES;

enum motor units_motor(enum axis axis)
{
    uint8_t motor = 0;
    while (motor_axes[motor] != axis)
        motor++;
    return (enum motor)motor;
}

enum axis units_axis(enum motor motor)
{
    return (enum axis)motor_axes[motor];
}

static int32_t scaled(int32_t value, int64_t q32)
{
    int64_t product = value * q32;
    return (int32_t)((product + (product < 0 ? -(1LL << 31) : 1LL << 31)) / (1LL << 32));
}

int32_t units_steps(enum axis axis, int32_t micro)
{
    return scaled(micro, axes[axis].steps_q32) + axes[axis].offset;
}

int32_t units_micro(enum axis axis, int32_t steps)
{
    return scaled(steps - axes[axis].offset, axes[axis].micro_q32);
}

int32_t units_speed(enum axis axis, int32_t micro_s)
{
    return scaled(micro_s, axes[axis].speed_q32);
}

bool units_inside(enum axis axis, int32_t micro)
{
    return micro >= axes[axis].low && micro <= axes[axis].high && units_steps(axis, micro) >= 0;
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

int32_t units_braking_speed(enum axis axis, int32_t room)
{
    if (room <= 0)
        return 0;
    uint32_t longest = UINT32_MAX / axes[axis].edge;
    uint32_t clear = (uint32_t)room < longest ? (uint32_t)room : longest;
    return 100L * root(axes[axis].edge * clear);
}
