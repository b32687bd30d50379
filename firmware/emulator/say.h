/* What is told to whoever started the program: one JSON object a line, on standard output and to a socket. */
#ifndef SAY_H
#define SAY_H

#include "plant.h"

/* Send each line to a Unix datagram socket as well; lines that nobody takes are dropped. 0, or -1 with errno. */
int say_to(const char *path);

extern const char *const say_motors[MOTORS];

void say_event(double time, const char *event, enum motor motor, double value);
void say_pose(const struct plant *plant);
void say_extremes(const struct plant *plant);

/* A line made by a format; it is JSON without its braces. */
void say(const char *format, ...) __attribute__((format(printf, 1, 2)));

#endif
