/* Hardware abstraction: implemented for the ATmega in avr/, and for a host by the bench. */
#ifndef PORT_H
#define PORT_H

#include <stdbool.h>
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

/* A byte of the memory that needs no power, read, or begun to be written: not while it is busy, for 3.4 ms. */
uint8_t port_memory_read(uint8_t address);
void port_memory_write(uint8_t address, uint8_t byte);
bool port_memory_busy(void);

/* Queue a line for the host, without its end; the whole line is dropped when there is no room. Never blocks. */
void port_send_line(const char *line);

#endif
