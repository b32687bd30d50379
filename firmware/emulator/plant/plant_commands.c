#include "plant/plant_commands.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "plant/plant_report.h"
#include "telemetry.h"

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
        plant_report_extremes(plant);
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
