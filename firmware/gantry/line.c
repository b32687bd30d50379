#include "line.h"

#include <string.h>

#define FARTHEST 100000000 /* 100 m: beyond all bounds */
#define MOST_DIGITS 9

static const struct {
    char name[10];
    uint8_t arguments;
} rows[COMMANDS] = COMMAND_ROWS;

static bool printable(uint8_t byte)
{
    return byte >= ' ' && byte <= '~';
}

static enum line_state finish(struct line *line)
{
    bool damaged = line->damaged;
    if (line->length > 0 && line->text[line->length - 1] == '\r')
        line->length--;
    line->text[line->length] = '\0';
    damaged = damaged || strchr(line->text, '\r') != NULL;
    line->length = 0;
    line->damaged = false;
    return damaged ? LINE_DAMAGED : LINE_DONE;
}

enum line_state line_receive(struct line *line, uint8_t byte)
{
    if (byte == '\n')
        return finish(line);
    if (line->length == LINE_LONGEST || !(printable(byte) || byte == '\r'))
        line->damaged = true;
    else
        line->text[line->length++] = (char)byte;
    return LINE_OPEN;
}

static bool digit(char c)
{
    return c >= '0' && c <= '9';
}

/* Parse the digits before the point, in micro. Returns NULL when there are none or too many. */
static const char *whole(const char *at, int32_t *micro)
{
    const char *begin = at;
    int32_t value = 0;
    for (; digit(*at); at++) {
        value = value * 10 + (int32_t)(*at - '0') * 1000000;
        value = value < FARTHEST ? value : FARTHEST;
        if (at - begin == MOST_DIGITS)
            return NULL;
    }
    *micro = value;
    return at == begin ? NULL : at;
}

/* Parse the digits behind the point; ignore those behind the sixth. */
static const char *decimals(const char *at, int32_t *micro)
{
    int32_t weight = 100000;
    const char *begin = at;
    for (; digit(*at); at++, weight /= 10)
        *micro += (*at - '0') * weight;
    return at == begin ? NULL : at;
}

static const char *number(const char *at, int32_t *micro)
{
    bool negative = *at == '-';
    if (*at == '-' || *at == '+')
        at++;
    at = whole(at, micro);
    if (at != NULL && *at == '.')
        at = decimals(at + 1, micro);
    if (negative)
        *micro = -*micro;
    return at;
}

static uint8_t arguments(const char *at, struct request *request, uint8_t wanted)
{
    uint8_t count = 0;
    if (*at == '\0')
        return wanted == 0 ? 0 : ERROR_COUNT;
    do {
        int32_t micro = 0;
        at = number(at, &micro);
        if (at == NULL || (*at != ',' && *at != '\0'))
            return ERROR_NUMBER;
        if (count < NUMBERS)
            request->numbers[count] = micro;
        count++;
    } while (*at++ == ',');
    return count == wanted ? 0 : ERROR_COUNT;
}

uint8_t line_parse(const char *text, struct request *request)
{
    if (*text++ != '$')
        return ERROR_UNKNOWN;
    size_t length = strcspn(text, ":");
    for (uint8_t i = 0; i < COMMANDS; i++) {
        if (strlen(rows[i].name) == length && memcmp(rows[i].name, text, length) == 0) {
            request->command = (enum command)i;
            return arguments(text + length + (text[length] == ':'), request, rows[i].arguments);
        }
    }
    return ERROR_UNKNOWN;
}

static char *digits(char *out, uint32_t value, uint8_t least)
{
    char reversed[10];
    uint8_t count = 0;
    do {
        reversed[count++] = (char)('0' + value % 10);
        value /= 10;
    } while (value > 0 || count < least);
    while (count > 0)
        *out++ = reversed[--count];
    return out;
}

char *line_number(char *out, int32_t micro)
{
    uint32_t size = micro < 0 ? 0UL - (uint32_t)micro : (uint32_t)micro;
    if (micro < 0)
        *out++ = '-';
    out = digits(out, size / 1000000UL, 1);
    *out++ = '.';
    out = digits(out, size % 1000000UL, 6);
    *out = '\0';
    return out;
}
