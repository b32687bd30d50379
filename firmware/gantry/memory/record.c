#include "memory/record.h"

#include <string.h>

#include "memory/limits.h"
#include "port.h"

#define FIRST 32 /* where the first copy is: not at 0, which a failing supply damages most easily */
#define COPIES 2
#define SIZE (2 + 4 * LIMITS + 2) /* the version, the kind, the limits, and the checksum of all before it */
#define STEPS (SIZE + 1)          /* of a copy: it is made invalid first, and valid last */
#define VERSION 1
#define BLANK 0xFF

uint8_t record_source;
int32_t record_limits[LIMITS];
static uint8_t step, copy, written;

static uint16_t checksum(uint16_t sum, uint8_t byte)
{
    sum ^= (uint16_t)(byte << 8);
    for (uint8_t i = 0; i < 8; i++)
        sum = (uint16_t)((sum & 0x8000) != 0 ? sum << 1 ^ 0x1021 : sum << 1);
    return sum;
}

/* A byte of a record of limits, but for its checksum. */
static uint8_t content(uint8_t at)
{
    if (at < 2)
        return at == 0 ? VERSION : RIG_KIND;
    return (uint8_t)((uint32_t)record_limits[(at - 2) / 4] >> 8 * ((at - 2) % 4));
}

static uint8_t byte_of(uint8_t at)
{
    uint16_t sum = 0xFFFF;
    if (at < SIZE - 2)
        return content(at);
    for (uint8_t i = 0; i < SIZE - 2; i++)
        sum = checksum(sum, content(i));
    return (uint8_t)(at == SIZE - 2 ? sum : sum >> 8);
}

static uint8_t stored(uint8_t which, uint8_t at)
{
    return port_memory_read((uint8_t)(FIRST + which * SIZE + at));
}

/* Whether a copy is whole, of this kind of rig, and possible; its limits are in record_limits then. */
static bool load(uint8_t which)
{
    int32_t before[LIMITS];
    memcpy(before, record_limits, sizeof before);
    for (uint8_t i = 0; i < LIMITS; i++) {
        uint32_t value = 0;
        for (uint8_t b = 4; b-- > 0;)
            value = value << 8 | stored(which, (uint8_t)(2 + 4 * i + b));
        record_limits[i] = (int32_t)value;
    }
    bool valid = limits_possible(record_limits);
    for (uint8_t at = 0; at < SIZE && valid; at++)
        valid = stored(which, at) == byte_of(at);
    if (!valid)
        memcpy(record_limits, before, sizeof before);
    return valid;
}

/* The second copy is written when the first one is whole, which holds until then: while the second one is blank and
 * the first one is not whole, no limits were ever taken. */
static bool never_written(void)
{
    for (uint8_t at = 0; at < SIZE; at++)
        if (stored(1, at) != BLANK)
            return false;
    return true;
}

static void choose(const int32_t set[LIMITS], enum source source)
{
    memcpy(record_limits, set, sizeof record_limits);
    limits_apply(record_limits);
    record_source = source;
}

void record_start(void)
{
    choose(limits_narrowest, SOURCE_DAMAGED);
    if (load(0) || load(1))
        choose(record_limits, SOURCE_KEPT);
    else if (never_written())
        choose(limits_widest, SOURCE_BUILT);
}

bool record_write(const int32_t set[LIMITS])
{
    if (!limits_possible(set))
        return false;
    copy = load(0) ? 1 : 0; /* first the copy that does not hold: the other one outlasts a cut, whatever was cut before */
    memcpy(record_limits, set, sizeof record_limits);
    step = written = 0;
    record_source = SOURCE_WRITING;
    return true;
}

static void write_step(void)
{
    uint8_t at = step % SIZE;
    port_memory_write((uint8_t)(FIRST + copy * SIZE + at), step == 0 ? BLANK : byte_of(at));
    step++;
    if (step == STEPS) {
        step = 0;
        written++;
        copy = !copy;
    }
}

void record_tick(void)
{
    if (record_source != SOURCE_WRITING || port_memory_busy())
        return;
    if (written < COPIES)
        write_step();
    else if (load(0) && load(1))
        choose(record_limits, SOURCE_KEPT);
    else
        choose(limits_narrowest, SOURCE_DAMAGED);
}
