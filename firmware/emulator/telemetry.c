#include "telemetry.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

static int listener = -1;
static struct sockaddr_un address;
const char *const telemetry_motors[MOTORS] = MOTOR_NAMES;

int telemetry_publish(const char *path)
{
    if (strlen(path) >= sizeof address.sun_path)
        return -1;
    address.sun_family = AF_UNIX;
    strcpy(address.sun_path, path);
    listener = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    return listener < 0 ? -1 : 0;
}

void telemetry_send(const char *format, ...)
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

void telemetry_event(double time, const char *event, enum motor motor, double value)
{
    telemetry_send(
        "\"event\": \"%s\", \"t\": %.4f, \"motor\": \"%s\", \"value\": %.4g", event, time,
        telemetry_motors[motor], value);
}
