/* Commands on standard input, a line each. */
#ifndef COMMANDS_H
#define COMMANDS_H

#include <stdbool.h>

/* Plug the cable in, with power; false with errno when there is no terminal. */
bool commands_plug(void);

/* Read what standard input has. */
void commands_read(void);

/* Execute the commands that were read, up to the next one that lets time pass. */
void commands_execute(void);

/* Report that a command is done. */
void commands_done(void);

#endif
