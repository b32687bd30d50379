/* Lines of text: put together of bytes, taken apart, and numbers in them. */
#ifndef LINE_H
#define LINE_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

#define NUMBERS 3

enum line_state { LINE_OPEN, LINE_DONE, LINE_DAMAGED };

struct line {
    char text[LINE_LONGEST + 1];
    uint8_t length;
    bool damaged;
};

struct request {
    enum command command;
    int32_t numbers[NUMBERS]; /* micro */
};

/* Take a byte. LINE_DONE: text holds a line without its end. LINE_DAMAGED: the line that ended here is void, as it was
 * too long or had a byte that is not printable; the port gives such a byte where it lost one. */
enum line_state line_take(struct line *line, uint8_t byte);

/* What a line asks for; 0, or an error. Numbers are not compared with bounds yet. */
uint8_t line_parse(const char *text, struct request *request);

/* A number in micro as text with six decimals; returns the place behind it. */
char *line_number(char *out, int32_t micro);

#endif
