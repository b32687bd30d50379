/* The rig as the firmware knows it: what it was told, what the drivers say, what went wrong. */
#ifndef RIG_H
#define RIG_H

#include <stdbool.h>
#include <stdint.h>

#include "drivers/drivers.h"
#include "protocol.h"

enum mode { MODE_REST, MODE_RUN, MODE_GOTO_SOON, MODE_GOTO, MODE_HOMING };

/* A motor's way since it has the speed that it was told. */
struct way {
    uint32_t since; /* ms */
    int32_t begin;  /* microsteps */
    int32_t told;   /* units of SPEED */
};

struct rig {
    enum mode mode;
    uint8_t trouble; /* the status that ended a motion, until it is acknowledged; 0 for none */
    bool calibrated;
    bool resumed; /* the position is from before a reset, and nobody said that this was noticed */
    uint32_t heard; /* ms, when the last RUN came */
    uint32_t lived; /* ms, when the last valid line came, whatever it was */
    uint32_t since; /* ms, when homing's phase began */
    bool held;    /* the drivers' reset is down, as orders do not reach them */
    uint8_t mute; /* looks in which a driver did not answer, one after the other */
    uint16_t status[MOTORS];
    int32_t position[MOTORS];
    bool touched[MOTORS];   /* the switch closed, and has been dealt with */
    int32_t want[AXES];     /* micro/s, of the last RUN */
    int32_t told[AXES];     /* units of SPEED, of the last order */
    uint32_t sent;          /* ms, when all orders of a RUN were last given */
    uint32_t obeyed;        /* ms, when no driver contradicted what it was told */
    bool doubted;           /* one still does after it was told to brake */
    struct way way[MOTORS];
    int32_t goal[AXES];     /* steps */
    int8_t blocked[AXES];   /* the direction in which a switch was hit, until home is found; or 0 */
    uint8_t phase, tries;   /* of homing */
    uint8_t quiet, closed;  /* looks without any change; motors (1 << motor) whose switches were closed then */
    int32_t begin[MOTORS];  /* position at the begin of homing's phase */
};

extern struct rig rig;

/* Read STATUS and ABS_POS of all drivers. */
void rig_look(void);

/* Whether any motor turns. */
bool rig_moves(void);

/* Measured position of an axis, micro. */
int32_t rig_position(enum axis axis);

/* Brake all axes; those in the mask (1 << axis) stop at once. */
void rig_stop(uint8_t hard);

/* The position is void from now on, also for whoever starts after a reset. */
void rig_forget(void);

/* End the motion with a status, as rig_stop does. */
void rig_trouble(uint8_t status, uint8_t hard);

/* Take the current from all motors, as orders do not reach them; until the trouble is acknowledged. */
void rig_hold(void);

/* Whether a driver does not answer, and whether any does not. */
bool rig_absent(enum motor motor);
bool rig_mute(void);

/* Take back flags whose reason is over, and the trouble. False when a flag or a driver that forgot what it was told
 * speaks against the position, which is void then. */
bool rig_acknowledge(void);

#endif
