#include "plant/plant_report.h"

#include "telemetry.h"

void plant_report_pose(const struct plant *plant)
{
    struct pose p = plant_pose(plant);
    telemetry_send(
        "\"t\": %.4f, \"x\": %.7f, \"y\": %.7f, \"yaw\": %.7f, \"vx\": %.5f, \"vy\": %.5f, \"vyaw\": %.5f, "
        "\"skew\": %.7f, \"moves\": %s, \"crashes\": %lu",
        plant->time, p.place[AXIS_X], p.place[AXIS_Y], p.place[AXIS_YAW], p.speed[AXIS_X], p.speed[AXIS_Y],
        p.speed[AXIS_YAW], p.skew, plant_moves(plant) ? "true" : "false", plant->crashes);
}

static double largest(double a, double b)
{
    return a > b ? a : b;
}

void plant_report_extremes(const struct plant *plant)
{
    const struct extremes *x = &plant->extremes[MOTOR_X], *a = &plant->extremes[MOTOR_ALPHA];
    const struct extremes *y = &plant->extremes[MOTOR_Y1], *w = &plant->extremes[MOTOR_Y2];
    telemetry_send("\"speed\": [%.5f, %.5f, %.5f], \"ramp\": [%.5f, %.5f, %.5f], \"way\": [%.7f, %.7f, %.7f]", x->speed,
        largest(y->speed, w->speed), a->speed, x->ramp, largest(y->ramp, w->ramp), a->ramp, x->way,
        largest(y->way, w->way), a->way);
}
