#include "say.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

static int listener = -1;
static struct sockaddr_un address;
const char *const say_motors[MOTORS] = MOTOR_NAMES;

int say_to(const char *path)
{
    if (strlen(path) >= sizeof address.sun_path)
        return -1;
    address.sun_family = AF_UNIX;
    strcpy(address.sun_path, path);
    listener = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    return listener < 0 ? -1 : 0;
}

void say(const char *format, ...)
{
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    text[0] = '{';
    int length = vsnprintf(text + 1, sizeof text - 3, format, arguments) + 1;
    va_end(arguments);
    if (length > (int)sizeof text - 3)
        length = (int)sizeof text - 3;
    strcpy(text + length, "}\n");
    fputs(text, stdout);
    fflush(stdout);
    if (listener >= 0)
        sendto(listener, text, (size_t)length + 2, MSG_NOSIGNAL, (struct sockaddr *)&address, sizeof address);
}

void say_event(double time, const char *event, enum motor motor, double value)
{
    say("\"event\": \"%s\", \"t\": %.4f, \"motor\": \"%s\", \"value\": %.4g", event, time, say_motors[motor], value);
}

void say_pose(const struct plant *plant)
{
    struct pose p = plant_pose(plant);
    say("\"t\": %.4f, \"x\": %.7f, \"y\": %.7f, \"yaw\": %.7f, \"vx\": %.5f, \"vy\": %.5f, \"vyaw\": %.5f, "
        "\"skew\": %.7f, \"moves\": %s, \"crashes\": %lu",
        plant->time, p.place[AXIS_X], p.place[AXIS_Y], p.place[AXIS_YAW], p.speed[AXIS_X], p.speed[AXIS_Y],
        p.speed[AXIS_YAW], p.skew, plant_moves(plant) ? "true" : "false", plant->crashes);
}

static double largest(double a, double b)
{
    return a > b ? a : b;
}

void say_extremes(const struct plant *plant)
{
    const struct extremes *x = &plant->extremes[MOTOR_X], *y = &plant->extremes[MOTOR_Y1], *w = &plant->extremes[MOTOR_Y2];
    const struct extremes *a = &plant->extremes[MOTOR_ALPHA];
    say("\"speed\": [%.5f, %.5f, %.5f], \"ramp\": [%.5f, %.5f, %.5f], \"way\": [%.7f, %.7f, %.7f]", x->speed,
        largest(y->speed, w->speed), a->speed, x->ramp, largest(y->ramp, w->ramp), a->ramp, x->way,
        largest(y->way, w->way), a->way);
}
