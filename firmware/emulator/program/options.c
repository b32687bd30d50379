#include "program/options.h"

#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "plant/plant_commands.h"
#include "program/state.h"
#include "telemetry.h"

static const char *const help =
    "usage: rig-emulator [OPTION...] gantry.elf\n\n"
    "Runs the gantry's firmware on an emulated ATmega328P, with models of its four L6470 drivers and of the rig. Its\n"
    "serial port is a pseudo terminal. Standard output gets a JSON object a line: {\"ready\": true, \"port\": ...},\n"
    "the true pose {\"t\": s, \"x\": m, \"y\": m, \"yaw\": rad, ...}, {\"event\": ...}.\n"
    "Standard input takes commands.\n\n"
    "  --link PATH        make PATH a symbolic link to the terminal\n"
    "  --pose-rate HZ     of the true pose (100); 0 for none\n"
    "  --publish PATH     send each line to this Unix datagram socket as well\n"
    "  --kind KIND        of the rig, dynamic or circle, as the firmware's build (dynamic)\n"
    "  --start X,Y,YAW    where the rig stands at first, m and degrees (0.1,-0.1,11)\n"
    "  --scale X,Y,YAW    true m (rad) for each that the firmware's constants give (1,1,1); --start is by those constants\n"
    "  --shift X,Y,YAW    true place where they give 0, m and degrees (0,0,0)\n"
    "  --boot S           how long a boot loader delays the firmware after a reset (0)\n"
    "  --memory FILE      keep the controller's EEPROM in a file between starts\n"
    "  --fast             as fast as possible instead of in real time\n"
    "  --stepped          time passes only by the command `run S`\n"
    "  --help\n\n"
    "commands, a line each, answered by {\"done\": true, \"sent\": bytes so far} or {\"error\": ...}:\n" PLANT_HELP
    "  run S               with --stepped: let S seconds pass\n"
    "  await N             wait, while no time passes, for the client's next N bytes\n"
    "  unplug [power]      pull the USB cable, and with `power` the controller's power with it\n"
    "  plug                plug it in again, with power\n"
    "  noise N             flip a bit in N of a thousand bytes\n"
    "  reset               press the reset button\n"
    "  hold on|off         keep the controller in reset\n"
    "  hang                let the firmware hang\n"
    "  lose                the receiver loses the next byte\n"
    "  times               longest iteration of the firmware's loop and delay of an answer, s, since the last time\n"
    "  overruns            bytes that the controller's receiver lost\n"
    "  lateness            s by which real time was missed in total\n"
    "  quit\n"
    "It ends with `quit`, on SIGTERM, and when standard input is a pipe that ends.\n\n"
    "example: rig-emulator --link /tmp/rig build/firmware/gantry.elf\n";

static bool numbers_of(const char *text, double *numbers)
{
    char rest;
    return sscanf(text, "%lf,%lf,%lf%c", &numbers[0], &numbers[1], &numbers[2], &rest) == 3;
}

static bool place_of(const char *text, double *place)
{
    bool read = numbers_of(text, place);
    place[2] *= 3.14159265358979323846 / 180;
    return read;
}

static bool scale_of(const char *text)
{
    double scale[AXES];
    if (!numbers_of(text, scale))
        return false;
    for (int a = 0; a < AXES; a++)
        emulator.longer[a] = scale[a] - 1;
    return true;
}

static bool kind_of(const char *text)
{
    emulator.kind = strcmp(text, "circle") == 0 ? KIND_CIRCLE : KIND_DYNAMIC;
    return emulator.kind == KIND_CIRCLE || strcmp(text, "dynamic") == 0;
}

static bool option(int which, const char *value)
{
    switch (which) {
    case 'l': emulator.link = value; return true;
    case 'r': emulator.rate = strtod(value, NULL); return emulator.rate >= 0;
    case 'p': return telemetry_publish(value) == 0;
    case 'k': return kind_of(value);
    case 's': return place_of(value, emulator.place);
    case 'c': return scale_of(value);
    case 'o': return place_of(value, emulator.shift);
    case 'b': emulator.boot = strtod(value, NULL); return emulator.boot >= 0;
    case 'm': emulator.memory = value; return true;
    case 'f': emulator.pace = FAST; return true;
    case 't': emulator.pace = STEPPED; return true;
    default: return false;
    }
}

const char *options_read(int argc, char **argv)
{
    static const struct option all[] = {
        {"link", required_argument, NULL, 'l'},    {"pose-rate", required_argument, NULL, 'r'},
        {"publish", required_argument, NULL, 'p'}, {"start", required_argument, NULL, 's'},
        {"scale", required_argument, NULL, 'c'},   {"shift", required_argument, NULL, 'o'},
        {"kind", required_argument, NULL, 'k'},    {"boot", required_argument, NULL, 'b'},
        {"memory", required_argument, NULL, 'm'},  {"fast", no_argument, NULL, 'f'},
        {"stepped", no_argument, NULL, 't'},       {"help", no_argument, NULL, 'h'},
        {NULL, 0, NULL, 0},
    };
    int which;
    while ((which = getopt_long(argc, argv, "h", all, NULL)) != -1) {
        if (which == 'h') {
            fputs(help, stdout);
            exit(0);
        }
        if (!option(which, optarg))
            return NULL;
    }
    bool turns = emulator.kind == KIND_CIRCLE && emulator.longer[AXIS_YAW] != 0; /* a turn is a turn */
    return optind == argc - 1 && !turns ? argv[optind] : NULL;
}
