/* Telemetry: one JSON object a line, on standard output and to a socket. */
#ifndef TELEMETRY_H
#define TELEMETRY_H

#include "protocol.h"

/* Send each line to a Unix datagram socket as well; lines that no one receives are dropped. 0, or -1 with errno. */
int telemetry_publish(const char *path);

/* A line made by a format; it is JSON without its braces. */
void telemetry_send(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* Something that happened to a motor. */
void telemetry_event(double time, const char *event, enum motor motor, double value);

extern const char *const telemetry_motors[MOTORS];

#endif
