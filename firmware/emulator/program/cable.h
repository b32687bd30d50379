/* The serial cable: a pseudo terminal that a client opens. */
#ifndef CABLE_H
#define CABLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Plug it in; link, if not NULL, becomes a symbolic link to the terminal. Returns its path, or NULL with errno. */
const char *cable_plug(const char *link);

/* Unplug it: clients see the terminal hang up. */
void cable_unplug(void);

/* Whether a client opened the terminal since the last call and DTR rose, which resets an Arduino. It rises unless the
 * previous client left it high (HUPCL off, as stty -hupcl does). */
bool cable_opened(void);

/* Fetch what the client sent, up to the size of the buffer. */
void cable_fetch(void);

/* Wait until so many bytes are fetched and unread; false when they do not arrive within 5 s. */
bool cable_await(size_t count);

/* Read the next byte from the client; false when there is none. */
bool cable_read(uint8_t *byte);

/* Write bytes for the client; they are lost when no one reads. */
void cable_write(const uint8_t *bytes, size_t count);

/* The total of bytes written. */
size_t cable_written(void);

#endif
