/* Commands to the plant's model, a line each: fault injection and queries. */
#ifndef PLANT_COMMANDS_H
#define PLANT_COMMANDS_H

#include "plant/plant.h"

#define PLANT_HELP \
    "  pose                                the true pose\n" \
    "  extremes                            the drivers' highest speed and ramp, and travel, since the last time\n" \
    "  push MOTOR STEPS                    move a carriage by full steps; four lose the motor's hold\n" \
    "  switch MOTOR works|open|closed      a limit switch that is stuck\n" \
    "  heat MOTOR cool|warm|hot            a driver that warns, or shuts down\n" \
    "  miscount MOTOR STEPS                a driver whose counter is off by full steps\n" \
    "  tear MOTOR                          a belt that is off: the motor turns and nothing moves\n" \
    "  short MOTOR                         a driver that sees too much current\n" \
    "  deaf MOTOR on|off                   a driver that answers, and ignores commands\n" \
    "  freeze MOTOR on|off                 a driver whose counter stands still\n" \
    "  forget MOTOR                        a driver that resets itself without a flag\n" \
    "  cut spi|clock|data|nothing          wires to the drivers, which continue their last command\n" \
    "  motors on|off                       the motors' supply\n"

/* Execute a command; false when it is none of these. */
bool plant_command(struct plant *plant, const char *line);

/* The true pose as telemetry. */
void plant_report_pose(const struct plant *plant);

#endif
