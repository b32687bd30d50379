#include "plant/plant.h"

#include <math.h>
#include <string.h>

#include "telemetry.h"

#define MICRO 128.0
#define RESONANCE (2 * M_PI * 60) /* rad/s, of a NEMA 17 with its load */
#define DAMPING (2 * 0.3 * RESONANCE)
#define PULL (RESONANCE * RESONANCE * 2 / M_PI) /* full steps/s2 at one full step of lag, the most there is */
#define BARRIER (PULL * 4 / M_PI) /* (full steps/s)2, half the square of the speed that one pole can catch: 480 */
#define BOUNCING 0.003            /* s that a switch bounces when it closes or opens */
#define BOUNCE 0.0003             /* s between two edges of that */
#define FRICTION 20000.0          /* full steps/s2 of a rotor without a holding field, 6 m/s2 */
#define CAUGHT 0.6                /* of a turn of four steps; at one half a rotor can fall either way */

static const struct axis_constants kinds[KINDS][AXES] = {AXIS_ROWS_DYNAMIC, AXIS_ROWS_CIRCLE};
static const struct axis_constants *constants = kinds[KIND_DYNAMIC];
static const enum axis axis_of[MOTORS] = MOTOR_AXES;

/* In m or degrees: from step 0 to where the switch at home closes, from the highest position to where the other one
 * closes, its hysteresis, and from both to the end of the frame. */
static const struct {
    double closes, beyond, hysteresis, frame;
} ends[AXES] = {{0.001, 0.005, 0.001, 0.02}, {0.001, 0.005, 0.001, 0.02}, {1, 1.5, 1, 8}};

#define INDEX_HYSTERESIS 1.0 /* degrees at each end of a circle's index */

double plant_unit(enum motor motor)
{
    return (double)constants[axis_of[motor]].micro_q32 / 4294967296.0 * MICRO / 1e6;
}

/* m or degrees of an axis as full steps. */
static double steps_of(enum motor motor, double length)
{
    return length * (axis_of[motor] == AXIS_YAW ? M_PI / 180 : 1) / plant_unit(motor);
}

static double length_of(enum motor motor)
{
    const struct axis_constants *c = &constants[axis_of[motor]];
    return c->high * 1e-6 / plant_unit(motor) + c->offset / MICRO;
}

/* The field moves in microsteps. */
static double field_of(const struct plant *plant, enum motor motor)
{
    return floor(plant->chain.chips[motor].field) / MICRO + plant->carriages[motor].origin;
}

static bool bounces(const struct plant *plant, const struct carriage *c)
{
    double left = c->bounces_until - plant->time;
    return left > 0 && (int)(left / BOUNCE) % 2 == 1;
}

/* Whether an axis turns without end. */
static bool endless(enum motor motor)
{
    return constants == kinds[KIND_CIRCLE] && axis_of[motor] == AXIS_YAW;
}

/* The index is closed below 0, and opens behind either end of its arc. */
static bool at_index(const struct carriage *c, enum motor motor)
{
    double turn = TURN / MICRO, width = INDEX_WIDTH / MICRO, slack = steps_of(motor, INDEX_HYSTERESIS);
    double above = c->at - turn * floor(c->at / turn + 0.5);
    return c->closed ? above < 0 && above > -width - slack : above < -slack && above > -width;
}

static bool at_end(const struct carriage *c, enum motor motor)
{
    enum axis axis = axis_of[motor];
    double high = length_of(motor) + steps_of(motor, ends[axis].beyond);
    double back = c->closed ? 1 : 0;
    bool low_end = c->at < steps_of(motor, ends[axis].closes) * (back - 1);
    bool high_end = c->at > high - back * steps_of(motor, ends[axis].hysteresis);
    return low_end || high_end;
}

static void update_switch(struct plant *plant, enum motor motor)
{
    struct carriage *c = &plant->carriages[motor];
    bool closed = endless(motor) ? at_index(c, motor) : at_end(c, motor);
    if (closed != c->closed)
        c->bounces_until = plant->time + BOUNCING + BOUNCE / 2;
    c->closed = closed;
    bool seen = c->stuck == SWITCH_WORKS ? c->closed != bounces(plant, c) : c->stuck == SWITCH_CLOSED;
    if (seen != plant->chain.chips[motor].switch_closed)
        telemetry_event(plant->time, seen ? "closed" : "open", motor, 0);
    l6470_switch(&plant->chain.chips[motor], seen);
}

static void limit_to_frame(struct plant *plant, enum motor motor)
{
    struct carriage *c = &plant->carriages[motor];
    double room = steps_of(motor, ends[axis_of[motor]].frame);
    double at = fmin(fmax(c->at, -room), length_of(motor) + room);
    if (at == c->at) {
        c->crashed = false;
        return;
    }
    if (!c->crashed) {
        plant->crashes++;
        telemetry_event(plant->time, "crash", motor, fabs(c->speed) * plant_unit(motor));
    }
    c->crashed = true;
    c->at = at;
    c->speed = 0;
}

static void detect_slip(struct plant *plant, enum motor motor)
{
    struct carriage *c = &plant->carriages[motor];
    double turns = (field_of(plant, motor) - c->at) / 4;
    long slips = lround(turns);
    bool held = !plant->chain.chips[motor].bridges_off;
    if (held && fabs(turns - (double)c->slips) < CAUGHT)
        return;
    if (held) {
        telemetry_event(plant->time, "slip", motor, (double)(slips - c->slips));
        l6470_loss(&plant->chain.chips[motor]);
    }
    c->slips = slips;
}

static void apply_friction(struct carriage *c)
{
    double loss = FRICTION * PLANT_DT;
    c->speed = fabs(c->speed) < loss ? 0 : c->speed - copysign(loss, c->speed);
}

/* A rotor that is too fast for a pole slips from one to the next: their pull averages out, and only friction brakes it.
 * Pull and damping come from the same current, so their sum is limited. */
static void move_rotor(struct plant *plant, enum motor motor, double field_speed)
{
    struct carriage *c = &plant->carriages[motor];
    double lag = field_of(plant, motor) - c->at, relative = c->speed - field_speed;
    bool slips = relative * relative / 2 + BARRIER / 2 * (1 - cos(M_PI_2 * lag)) > BARRIER;
    bool off = plant->chain.chips[motor].bridges_off;
    double pull = PULL * sin(M_PI_2 * lag) - (slips ? 0 : DAMPING * relative);
    if (!off)
        c->speed += fmin(fmax(pull, -PULL), PULL) * PLANT_DT;
    if (off || slips)
        apply_friction(c);
    c->at += c->speed * PLANT_DT;
}

static void record_extremes(struct plant *plant, enum motor motor, double before, double field)
{
    struct extremes *e = &plant->extremes[motor];
    const struct l6470 *chip = &plant->chain.chips[motor];
    double unit = plant_unit(motor), change = fabs(chip->speed - before) / MICRO * unit / PLANT_DT;
    bool abrupt = chip->motion == L6470_STANDS || chip->motion == L6470_RELEASES;
    e->speed = fmax(e->speed, fabs(chip->speed) / MICRO * unit);
    e->ramp = abrupt ? e->ramp : fmax(e->ramp, change);
    e->way += fabs(chip->field - field) / MICRO * unit;
}

static void step_motor(struct plant *plant, enum motor motor)
{
    struct l6470 *chip = &plant->chain.chips[motor];
    double before = chip->speed, field = chip->field;
    l6470_advance(chip, PLANT_DT);
    record_extremes(plant, motor, before, field);
    if (!plant->carriages[motor].torn) {
        move_rotor(plant, motor, chip->speed / MICRO);
        if (!endless(motor))
            limit_to_frame(plant, motor);
        detect_slip(plant, motor);
    }
    update_switch(plant, motor);
}

void plant_step(struct plant *plant)
{
    for (int m = 0; m < MOTORS; m++)
        step_motor(plant, (enum motor)m);
    plant->time += PLANT_DT;
}

void plant_start(struct plant *plant, enum kind kind, const double *place)
{
    constants = kinds[kind];
    memset(plant, 0, sizeof *plant);
    for (int m = 0; m < MOTORS; m++) {
        struct carriage *c = &plant->carriages[m];
        struct l6470 *chip = &plant->chain.chips[m];
        chip->awake = true;
        l6470_power(chip, true);
        c->at = c->origin = place[axis_of[m]] / plant_unit(m) + constants[axis_of[m]].offset / MICRO;
        update_switch(plant, m);
    }
}

bool plant_moves(const struct plant *plant)
{
    for (int m = 0; m < MOTORS; m++)
        if (plant->chain.chips[m].motion != L6470_STANDS)
            return true;
    return false;
}

struct pose plant_pose(const struct plant *plant)
{
    struct pose pose = {.skew = 0};
    for (int m = 0; m < MOTORS; m++) {
        const struct carriage *c = &plant->carriages[m];
        enum axis axis = axis_of[m];
        double half = axis == AXIS_Y ? 0.5 : 1, unit = plant_unit(m);
        pose.place[axis] += half * (c->at - constants[axis].offset / MICRO) * unit;
        pose.speed[axis] += half * c->speed * unit;
    }
    for (int a = 0; a < AXES; a++) {
        pose.place[a] = pose.place[a] * (1 + plant->longer[a]) + plant->shift[a];
        pose.speed[a] *= 1 + plant->longer[a];
    }
    if (endless(MOTOR_ALPHA))
        pose.place[AXIS_YAW] -= 2 * M_PI * floor(pose.place[AXIS_YAW] / (2 * M_PI) + 0.5);
    pose.skew = (plant->carriages[MOTOR_Y1].at - plant->carriages[MOTOR_Y2].at) * plant_unit(MOTOR_Y1);
    return pose;
}

void plant_push(struct plant *plant, enum motor motor, double steps)
{
    plant->carriages[motor].at += steps;
}

void plant_motor_power(struct plant *plant, bool on)
{
    for (int m = 0; m < MOTORS; m++)
        l6470_power(&plant->chain.chips[m], on);
}
