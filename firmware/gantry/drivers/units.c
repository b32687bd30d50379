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
