/* The serial line, with buffers. */
#ifndef UART_H
#define UART_H

#include <stdbool.h>
#include <stdint.h>

void uart_start(void);

bool uart_has_byte(void);

/* The next byte; 0 stands for one that was lost or damaged. */
bool uart_read(uint8_t *byte);

#endif
