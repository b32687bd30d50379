#include "drivers/drivers.h"

#include "drivers/circle.h"
#include "drivers/units.h"
#include "memory/limits.h"
#include "port.h"

static uint32_t mark_of(uint8_t motor)
{
    return circle_motor(motor) && circle.far ? DRIVER_MARK_FAR : DRIVER_MARK;
}

static uint32_t config_of(uint8_t motor)
{
    if (circle_motor(motor))
        return DRIVER_CONFIG_INDEX;
    return motor == 0 ? DRIVER_CONFIG_FIRST : DRIVER_CONFIG_OTHERS;
}

static void exchange_arguments(uint32_t values[MOTORS], uint8_t bytes)
{
    uint8_t frame[MOTORS];
    while (bytes-- > 0) {
        for (uint8_t m = 0; m < MOTORS; m++)
            frame[m] = (uint8_t)(values[m] >> (8 * bytes));
        port_exchange(frame);
        for (uint8_t m = 0; m < MOTORS; m++) {
            values[m] &= ~((uint32_t)0xFF << (8 * bytes));
            values[m] |= (uint32_t)frame[m] << (8 * bytes);
        }
    }
}

void drivers_send(const struct driver_command commands[MOTORS], uint8_t bytes)
{
    uint8_t frame[MOTORS];
    uint32_t values[MOTORS];
    for (uint8_t m = 0; m < MOTORS; m++) {
        frame[m] = commands[m].op;
        values[m] = commands[m].op == OP_NOP ? 0 : commands[m].argument;
    }
    port_exchange(frame);
    exchange_arguments(values, bytes);
}

static void query(uint8_t op, uint8_t bytes, uint32_t values[MOTORS])
{
    uint8_t frame[MOTORS];
    for (uint8_t m = 0; m < MOTORS; m++) {
        frame[m] = op;
        values[m] = 0;
    }
    port_exchange(frame);
    exchange_arguments(values, bytes);
}

void drivers_get(uint8_t reg, uint8_t bytes, uint32_t values[MOTORS])
{
    query(OP_GET | reg, bytes, values);
}

void drivers_set(uint8_t reg, uint8_t bytes, const uint32_t values[MOTORS])
{
    struct driver_command commands[MOTORS];
    for (uint8_t m = 0; m < MOTORS; m++)
        commands[m] = (struct driver_command){OP_SET | reg, values[m]};
    drivers_send(commands, bytes);
}

void drivers_set_all(uint8_t reg, uint8_t bytes, uint32_t value)
{
    const uint32_t values[MOTORS] = {value, value, value, value};
    drivers_set(reg, bytes, values);
}

void drivers_status(uint16_t status[MOTORS], bool clear)
{
    uint32_t values[MOTORS];
    query(clear ? OP_GET_STATUS : OP_GET | REG_STATUS, 2, values);
    for (uint8_t m = 0; m < MOTORS; m++)
        status[m] = (uint16_t)values[m];
}

void drivers_position(int32_t position[MOTORS])
{
    uint32_t values[MOTORS];
    drivers_get(REG_ABS_POS, 3, values);
    for (uint8_t m = 0; m < MOTORS; m++) {
        int32_t low = (int32_t)(values[m] & 0x3FFFFFUL);
        position[m] = low < 0x200000L ? low : low - 0x400000L;
    }
}

static void configure_ramps(void)
{
    uint32_t ramps[MOTORS];
    for (uint8_t m = 0; m < MOTORS; m++)
        ramps[m] = limits[units_axis(m)].ramp_register;
    drivers_set(REG_ACC, 2, ramps);
    drivers_set(REG_DEC, 2, ramps);
}

void drivers_set_top_speeds(bool homing)
{
    uint32_t tops[MOTORS];
    for (uint8_t m = 0; m < MOTORS; m++)
        tops[m] = homing ? axes[units_axis(m)].homing_top_register : limits[units_axis(m)].top_register;
    drivers_set(REG_MAX_SPEED, 2, tops);
}

void drivers_configure(void)
{
    uint32_t configs[MOTORS];
    for (uint8_t m = 0; m < MOTORS; m++)
        configs[m] = config_of(m);
    drivers_set(REG_CONFIG, 2, configs);
    drivers_set_all(REG_STEP_MODE, 1, STEP_MODE_REGISTER);
    drivers_set_all(REG_KVAL_HOLD, 1, DRIVER_KVAL_HOLD);
    drivers_set_all(REG_KVAL_RUN, 1, DRIVER_KVAL_RUN);
    drivers_set_all(REG_KVAL_ACC, 1, DRIVER_KVAL_RAMP);
    drivers_set_all(REG_KVAL_DEC, 1, DRIVER_KVAL_RAMP);
    drivers_set_all(REG_OCD_TH, 1, DRIVER_OCD_TH);
    drivers_set_all(REG_STALL_TH, 1, DRIVER_STALL_TH);
    configure_ramps();
    drivers_set_top_speeds(false);
}

bool drivers_position_valid(void)
{
    uint32_t configs[MOTORS], marks[MOTORS];
    drivers_get(REG_CONFIG, 2, configs);
    drivers_get(REG_MARK, 3, marks);
    for (uint8_t m = 0; m < MOTORS; m++)
        if (configs[m] != config_of(m) || marks[m] != mark_of(m))
            return false;
    return true;
}

bool drivers_limited(void)
{
    uint32_t tops[MOTORS], ramps[MOTORS];
    drivers_get(REG_MAX_SPEED, 2, tops);
    drivers_get(REG_ACC, 2, ramps);
    for (uint8_t m = 0; m < MOTORS; m++) {
        const struct axis_limits *held = &limits[units_axis(m)];
        if (tops[m] != held->top_register || ramps[m] != held->ramp_register)
            return false;
    }
    return true;
}
