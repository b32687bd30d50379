#include "plant/plant_commands.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "telemetry.h"

void plant_report_pose(const struct plant *plant)
{
    struct pose p = plant_pose(plant);
    telemetry_send(
        "\"t\": %.4f, \"x\": %.7f, \"y\": %.7f, \"yaw\": %.7f, \"vx\": %.5f, \"vy\": %.5f, \"vyaw\": %.5f, "
        "\"skew\": %.7f, \"moves\": %s, \"crashes\": %lu",
        plant->time, p.place[AXIS_X], p.place[AXIS_Y], p.place[AXIS_YAW], p.speed[AXIS_X], p.speed[AXIS_Y],
        p.speed[AXIS_YAW], p.skew, plant_moves(plant) ? "true" : "false", plant->crashes);
}

static void report_extremes(const struct plant *plant)
{
    const struct extremes *x = &plant->extremes[MOTOR_X], *a = &plant->extremes[MOTOR_ALPHA];
    const struct extremes *y = &plant->extremes[MOTOR_Y1], *w = &plant->extremes[MOTOR_Y2];
    telemetry_send("\"speed\": [%.5f, %.5f, %.5f], \"ramp\": [%.5f, %.5f, %.5f], \"way\": [%.7f, %.7f, %.7f]", x->speed,
        fmax(y->speed, w->speed), a->speed, x->ramp, fmax(y->ramp, w->ramp), a->ramp, x->way, fmax(y->way, w->way), a->way);
}

static int which(const char *word, const char *const *words, int count)
{
    for (int i = 0; i < count; i++)
        if (strcmp(word, words[i]) == 0)
            return i;
    return -1;
}

static int motor_of(const char *word)
{
    return which(word, telemetry_motors, MOTORS);
}

static bool inject_fault(struct plant *plant, const char *command, int motor, const char *how)
{
    static const char *const stuck[] = {"works", "open", "closed"}, *const heats[] = {"cool", "warm", "hot"};
    static const char *const off_on[] = {"off", "on"};
    struct l6470 *chip = &plant->chain.chips[motor];
    int choice;
    if (strcmp(command, "push") == 0 && fabs(strtod(how, NULL)) <= 10000)
        plant_push(plant, (enum motor)motor, strtod(how, NULL));
    else if (strcmp(command, "switch") == 0 && (choice = which(how, stuck, 3)) >= 0)
        plant->carriages[motor].stuck = (enum stuck)choice;
    else if (strcmp(command, "heat") == 0 && (choice = which(how, heats, 3)) >= 0)
        l6470_heat(chip, (enum l6470_heat)choice);
    else if (strcmp(command, "miscount") == 0 && fabs(strtod(how, NULL)) <= 10000)
        chip->zero += round(strtod(how, NULL) * 128);
    else if (strcmp(command, "tear") == 0)
        plant->carriages[motor].torn = true;
    else if (strcmp(command, "short") == 0)
        l6470_short(chip);
    else if (strcmp(command, "freeze") == 0 && (choice = which(how, off_on, 2)) >= 0)
        l6470_freeze(chip, choice);
    else if (strcmp(command, "deaf") == 0 && (choice = which(how, off_on, 2)) >= 0)
        chip->deaf = choice;
    else if (strcmp(command, "forget") == 0)
        l6470_forget(chip);
    else
        return false;
    return true;
}

static bool cut(struct plant *plant, const char *word)
{
    static const char *const wires[] = {"nothing", "spi", "clock", "data"};
    int wire = which(word, wires, 4);
    if (wire >= 0)
        plant->chain.cut = (enum cut)wire;
    return wire >= 0;
}

bool plant_command(struct plant *plant, const char *line)
{
    char command[16] = "", first[16] = "", second[16] = "";
    int words = sscanf(line, "%15s %15s %15s", command, first, second);
    if (words == 1 && strcmp(command, "pose") == 0) {
        plant_report_pose(plant);
    } else if (words == 1 && strcmp(command, "extremes") == 0) {
        report_extremes(plant);
        memset(plant->extremes, 0, sizeof plant->extremes);
    } else if (words == 2 && strcmp(command, "cut") == 0) {
        return cut(plant, first);
    } else if (words == 2 && strcmp(command, "motors") == 0 && (!strcmp(first, "on") || !strcmp(first, "off"))) {
        plant_motor_power(plant, strcmp(first, "on") == 0);
    } else {
        return words >= 2 && motor_of(first) >= 0 && inject_fault(plant, command, motor_of(first), second);
    }
    return true;
}
