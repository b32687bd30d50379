/* The emulator's state, which options, commands and pace share. */
#ifndef STATE_H
#define STATE_H

#include <signal.h>
#include <stddef.h>

#include "plant/plant.h"

enum pace { REALTIME, FAST, STEPPED };

struct emulator {
    struct plant plant;
    const char *link, *memory;
    enum pace pace;
    enum kind kind;
    double rate, boot, place[AXES], longer[AXES], shift[AXES], until, next_pose, late;
    double base_wall, base_time;
    bool stdin_ends, running, waiting;
    char input[65536]; /* commands that wait */
    size_t used;
    volatile sig_atomic_t ended;
};

extern struct emulator emulator;

#endif
