/* The serial cable: a pseudo terminal whose other end is opened by a client, and noise on the line. */
#ifndef CABLE_H
#define CABLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Plug it in; link, if not NULL, becomes a symbolic link to the terminal. The terminal's path, or NULL with errno. */
const char *cable_plug(const char *link);

/* Pull it out: clients see the terminal hang up. */
void cable_unplug(void);

/* Whether a client opened the terminal since the last time, with a rise of DTR, which resets an Arduino: it rises
 * unless the client before left it up (HUPCL off, as stty -hupcl does). */
bool cable_opened(void);

/* Of a thousand bytes in either direction so many get a wrong bit. */
void cable_noise(unsigned per_mille);

/* Fetch what the client sent, as far as there is room. */
void cable_listen(void);

/* Wait until so many bytes have been fetched and not read yet; false when they do not come within 5 s. */
bool cable_await(size_t count);

/* The next byte from the client; false when there is none. */
bool cable_read(uint8_t *byte);

/* Bytes for the client; lost when nobody reads. */
void cable_write(const uint8_t *bytes, size_t count);

/* Bytes that were written, all together. */
size_t cable_written(void);

#endif
