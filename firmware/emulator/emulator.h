/* What the parts of the emulated rig's program share: options, orders, pace. */
#ifndef EMULATOR_H
#define EMULATOR_H

#include <signal.h>
#include <stddef.h>

#include "plant.h"

enum pace { REALTIME, FAST, STEPPED };

struct emulator {
    struct plant plant;
    const char *link;
    enum pace pace;
    double rate, boot, place[AXES], until, next_pose, late;
    double base_wall, base_time;
    bool stdin_ends, running, waiting;
    char orders[65536];
    size_t used;
    volatile sig_atomic_t ended;
};

extern struct emulator self;

/* Take the options; the ELF file, or NULL when they mean nothing. --help ends the program. */
const char *options_read(int argc, char **argv);

/* Plug the cable in, with power; false with errno when there is no terminal. */
bool orders_plug(void);

/* Fetch orders from standard input; obey those that are there, until one lets time pass; say that it has. */
void orders_read(void);
void orders_take(void);
void orders_done(void);

/* Seconds of a clock that only goes on; and let time pass until the end. */
double pace_wall(void);
void pace_live(void);

#endif
