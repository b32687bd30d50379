/* The limits in the controller's EEPROM: two copies, each with the rig's kind and a checksum, written one after the
 * other, first the one that does not hold, so that writes that a loss of power cuts, however many, leave the limits from
 * before, or the new ones. */
#ifndef RECORD_H
#define RECORD_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

/* Which limits hold, or that others are being written: see LIMITS in the protocol. */
extern uint8_t record_source;

/* The limits that hold, or that are being written, micro. */
extern int32_t record_limits[LIMITS];

/* Read the memory, and let its limits hold; a memory that is damaged leaves the narrowest ones. */
void record_start(void);

/* Write limits and let them hold afterwards; false when they are beyond what the firmware is built for. */
bool record_write(const int32_t set[LIMITS]);

/* Write the next byte; call once a tick. */
void record_tick(void);

#endif
