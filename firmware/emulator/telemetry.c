#include "telemetry.h"

#include <stdarg.h>
#include <stdio.h>

const char *const telemetry_motors[MOTORS] = MOTOR_NAMES;

void telemetry_send(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    putchar('{');
    vprintf(format, arguments);
    puts("}");
    fflush(stdout);
    va_end(arguments);
}

void telemetry_event(double time, const char *event, enum motor motor, double value)
{
    telemetry_send(
        "\"event\": \"%s\", \"t\": %.4f, \"motor\": \"%s\", \"value\": %.4g", event, time,
        telemetry_motors[motor], value);
}
