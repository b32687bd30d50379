/* The rig's state: targets, commands sent, what the drivers report, and trouble. */
#ifndef RIG_H
#define RIG_H

#include <stdbool.h>
#include <stdint.h>

#include "drivers/drivers.h"
#include "protocol.h"

enum mode { MODE_REST, MODE_RUN, MODE_GOTO_PENDING, MODE_GOTO, MODE_HOMING };

/* A motor's travel since it reached the commanded speed. */
struct travel {
    uint32_t began;    /* ms */
    int32_t start;     /* microsteps */
    int32_t commanded; /* units of SPEED */
};

struct rig {
    enum mode mode;
    uint8_t trouble; /* the status that ended a motion, until it is acknowledged; 0 for none */
    bool calibrated;
    bool resumed;           /* the position is from before a reset that the host has not acknowledged */
    uint32_t run_received;  /* ms, time of the last RUN */
    uint32_t line_received; /* ms, time of the last valid line */
    uint32_t phase_began;   /* ms, start of homing's phase */
    bool held;              /* the drivers are held in reset, as commands do not reach them */
    uint8_t missed_polls;   /* consecutive polls that a driver did not answer */
    uint16_t status[MOTORS];
    int32_t position[MOTORS]; /* microsteps; a circle's alpha counts on beyond its turn, and its counter's 22 bits */
    bool switch_handled[MOTORS]; /* the switch closed, and that was handled */
    int32_t target[AXES];        /* micro/s, of the last RUN */
    int32_t commanded[AXES];     /* units of SPEED, of the last command */
    uint32_t sent;               /* ms, when all commands of a RUN were last sent */
    uint32_t consistent;         /* ms, when no driver contradicted its command */
    bool contradiction_handled;  /* a contradiction has already caused braking */
    struct travel travel[MOTORS];
    int32_t goal[AXES];            /* steps */
    int8_t blocked[AXES];          /* the direction in which a switch was hit, until home is found; or 0 */
    uint8_t phase, attempts;       /* of homing */
    uint8_t quiet_polls, closed;   /* polls without change; motors (1 << motor) whose switches were closed then */
    int32_t phase_start[MOTORS];   /* position at the start of homing's phase */
};

extern struct rig rig;

/* Read STATUS and ABS_POS of all drivers. */
void rig_poll(void);

/* Whether any motor moves. */
bool rig_moving(void);

/* The measured position of an axis, micro; of a circle's yaw from -pi up to pi. */
int32_t rig_position(enum axis axis);

/* Brake all axes; those in the mask hard (1 << axis) stop at once. */
void rig_stop(uint8_t hard);

/* Invalidate the position, also beyond a reset of the controller. */
void rig_void_position(void);

/* Stop as rig_stop does, and report a status from now on. */
void rig_fail(uint8_t status, uint8_t hard);

/* Hold the drivers in reset, without current, until the trouble is acknowledged. */
void rig_hold(void);

/* Whether a driver, or any driver, does not answer. */
bool rig_driver_absent(enum motor motor);
bool rig_any_driver_absent(void);

/* Clear the trouble, and flags whose cause is gone. False, with the position void, when a flag or a driver that lost
 * its configuration contradicts the position. */
bool rig_acknowledge(void);

#endif
