/* Hardware abstraction: implemented for the ATmega in avr/, and for a host by the bench. */
#ifndef PORT_H
#define PORT_H

#include <stdint.h>

/* Exchange one byte with each driver of the chain while chip select is low; the answers replace the bytes. The first
 * byte belongs to the driver that is nearest to the controller's output. */
void port_exchange(uint8_t *bytes);

/* Pull the drivers' reset low and high again, and wait until they are ready. All their registers are reset. */
void port_reset_drivers(void);

/* Hold the drivers in reset: no motor has current, whatever else fails. */
void port_hold_drivers(void);

/* Milliseconds since the start; wraps around. */
uint32_t port_now(void);

/* Queue a line for the host, without its end; the whole line is dropped when there is no room. Never blocks. */
void port_send_line(const char *line);

#endif
