/* The rig's mechanics: four motors whose rotors follow their drivers' fields, limit switches, frame ends, and the true
 * pose. Rotors count in full steps from the place where the switch at home opens. */
#ifndef PLANT_H
#define PLANT_H

#include "l6470/chain.h"
#include "protocol.h"

#define PLANT_DT 1e-4 /* s of a step */

enum stuck { SWITCH_WORKS, SWITCH_OPEN, SWITCH_CLOSED };

struct carriage {
    double at, speed;  /* full steps, full steps/s */
    double origin;     /* at - field when nothing was lost */
    long slips;        /* turns of four full steps that rotor and field are apart */
    bool closed, crashed, torn; /* torn: the belt is off */
    double bounces_until;       /* s */
    enum stuck stuck;
};

struct extremes {
    double speed, ramp, way; /* of a driver, in m, s or rad, s; way is the total travel */
};

struct plant {
    struct chain chain;
    struct carriage carriages[MOTORS];
    struct extremes extremes[MOTORS];
    double time; /* s */
    unsigned long crashes;
    double longer[AXES], shift[AXES]; /* how the rig differs from Table 4.2: a share, and m, m, rad */
};

struct pose {
    double place[AXES], speed[AXES], skew; /* m, m, rad; a circle's yaw from -pi up to pi */
};

/* Set up a rig of a kind that stands at a place (m, m, rad), with all power on. */
void plant_start(struct plant *plant, enum kind kind, const double *place);

/* Let PLANT_DT pass. */
void plant_step(struct plant *plant);

/* Where the rig truly is: as Table 4.2 has it, longer by a share and shifted. */
struct pose plant_pose(const struct plant *plant);

/* Whether any driver moves its field. */
bool plant_moves(const struct plant *plant);

/* m or rad of a motor's full step. */
double plant_unit(enum motor motor);

/* Push a carriage by full steps, as by hand. */
void plant_push(struct plant *plant, enum motor motor, double steps);

void plant_motor_power(struct plant *plant, bool on);

#endif
