/* The serial protocol's lines: assembling, parsing, and formatting numbers. */
#ifndef LINE_H
#define LINE_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

#define NUMBERS LIMITS /* of the longest command */

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

/* Add a byte. LINE_DONE: text holds a line without its end. LINE_DAMAGED: the line that ends here is invalid, as it was
 * too long or had an unprintable byte; the port inserts one where bytes were lost. */
enum line_state line_receive(struct line *line, uint8_t byte);

/* Parse a line into a request. Returns 0 or an error. Does not check bounds. */
uint8_t line_parse(const char *text, struct request *request);

/* Format a number in micro with six decimals. Returns the end of the text. */
char *line_number(char *out, int32_t micro);

#endif
