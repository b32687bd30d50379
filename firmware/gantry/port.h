/* What the gantry needs of its hardware: the ATmega gives it (avr/), and so do the tests on a host. */
#ifndef PORT_H
#define PORT_H

#include <stdint.h>

/* Bytes that are exchanged with the drivers' chain while chip select is low, one for each driver; the answer replaces
 * them. The first is for the driver that is nearest to the controller's output. */
void port_exchange(uint8_t *bytes);

/* Pull the drivers' reset down and up again, and wait until they listen. They forget everything. */
void port_reset_drivers(void);

/* Pull the drivers' reset down and leave it there: no motor has current, whatever else is broken. */
void port_hold_drivers(void);

/* Milliseconds since the start; it wraps. */
uint32_t port_now(void);

/* Queue a line for the host, without its end; dropped as a whole when there is no room. Never waits. */
void port_answer(const char *line);

#endif
