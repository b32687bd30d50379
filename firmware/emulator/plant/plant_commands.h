/* Orders to the rig's model, a line each: faults, and what one asks it. */
#ifndef PLANT_COMMANDS_H
#define PLANT_COMMANDS_H

#include "plant/plant.h"

#define PLANT_HELP \
    "  pose                                the true pose\n" \
    "  extremes                            highest speed and ramp of the drivers, and their way, since the last time\n" \
    "  push MOTOR STEPS                    move a carriage by full steps; four lose the motor's hold\n" \
    "  switch MOTOR works|open|closed      a limit switch that is stuck\n" \
    "  heat MOTOR cool|warm|hot            a driver that warns, or shuts down\n" \
    "  miscount MOTOR STEPS                a driver whose counter is off by full steps\n" \
    "  tear MOTOR                          a belt that is off: the motor turns and nothing moves\n" \
    "  short MOTOR                         a driver that sees too much current\n" \
    "  deaf MOTOR on|off                   a driver that answers, and does nothing of what it is told\n" \
    "  freeze MOTOR on|off                 a driver whose counter stands still\n" \
    "  forget MOTOR                        a driver that starts anew and has no flag of it\n" \
    "  cut spi|clock|data|nothing          wires to the drivers, which go on with what they do\n" \
    "  motors on|off                       the motors' supply\n"

/* Whether the order was one of these and done. */
bool plant_command(struct plant *plant, const char *line);

#endif
