/* Telemetry: one JSON object a line, on standard output. */
#ifndef TELEMETRY_H
#define TELEMETRY_H

#include "protocol.h"

/* A line made by a format; it is JSON without its braces. */
void telemetry_send(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* Something that happened to a motor. */
void telemetry_event(double time, const char *event, enum motor motor, double value);

extern const char *const telemetry_motors[MOTORS];

#endif
