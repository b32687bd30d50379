/* The emulated rig: the gantry's firmware, unchanged, in front of models of its drivers and mechanics. Time is real, or
 * passes in steps on command. */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "board/board.h"
#include "plant/plant_commands.h"
#include "program/cable.h"
#include "telemetry.h"

#define SLICE_STEPS 10       /* steps between two polls of the commands: 1 ms */
#define FETCH_EVERY 5        /* steps between two fetches from the cable */
#define LATE 0.05            /* s */
#define POSE_PERIOD 0.01     /* s */
#define MOST_STEPPED 3600.0  /* s of one command */

static const char *const help =
    "usage: rig-emulator [OPTION...] gantry.elf\n\n"
    "Runs the gantry's firmware on an emulated ATmega328P, with models of its four L6470 drivers and of the rig. Its\n"
    "serial port is a pseudo terminal. Standard output gets a JSON object a line: {\"ready\": true, \"port\": ...},\n"
    "the true pose {\"t\": s, \"x\": m, \"y\": m, \"yaw\": rad, ...}, {\"event\": ...}.\n\n"
    "  --link PATH        make PATH a symbolic link to the terminal\n"
    "  --kind KIND        of the rig, dynamic or circle, as the firmware's build (dynamic)\n"
    "  --start X,Y,YAW    where the rig stands at first, m and degrees (0.1,-0.1,11)\n"
    "  --scale X,Y,YAW    true m (rad) for each that the firmware's constants give (1,1,1); --start is by those constants\n"
    "  --shift X,Y,YAW    true place where they give 0, m and degrees (0,0,0)\n"
    "  --stepped          time passes only by the command `run S`, and the pose is reported only by `pose`\n"
    "  --help\n\n"
    "Standard input takes commands, a line each, answered by {\"done\": true, \"sent\": bytes so far} or {\"error\": ...}:\n" PLANT_HELP
    "  run S               with --stepped: let S seconds pass\n"
    "  await N             wait, while no time passes, for the client's next N bytes\n"
    "  unplug [power]      pull the USB cable, and with `power` the controller's power with it\n"
    "  plug                plug it in again, with power\n"
    "  reset               press the reset button\n"
    "  hold on|off         keep the controller in reset\n"
    "  hang                let the firmware hang\n"
    "  lose                the receiver loses the next byte\n"
    "  times               longest iteration of the firmware's loop and delay of an answer, s, since the last time\n"
    "  overruns            bytes that the controller's receiver lost\n"
    "  quit\n"
    "It ends with `quit`, on SIGTERM, and when standard input is a pipe that ends.\n\n"
    "example: rig-emulator --link /tmp/rig build/firmware/gantry.elf\n";

static struct plant plant;
static const char *link_path;
static enum kind kind;
static bool stepped, stdin_ends, reads = true, waits;
static double until, next_pose, late_total, base_wall, base_time;
static char input[65536]; /* commands that wait */
static size_t used;
static volatile sig_atomic_t ended;

static double wall_clock(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

static bool plug(void)
{
    const char *terminal = cable_plug(link_path);
    if (terminal == NULL)
        return false;
    board_power(true);
    telemetry_send("\"ready\": true, \"port\": \"%s\", \"t\": %.4f", terminal, plant.time);
    return true;
}

static bool execute(const char *line)
{
    if (strcmp(line, "plug") == 0)
        return plug();
    if (strncmp(line, "await ", 6) == 0)
        return cable_await(strtoul(line + 6, NULL, 10));
    if (strcmp(line, "unplug") == 0 || strcmp(line, "unplug power") == 0) {
        cable_unplug();
        if (line[6] != '\0')
            board_power(false);
    } else if (strcmp(line, "reset") == 0)
        board_reset(RESET_BUTTON);
    else if (strcmp(line, "hold on") == 0 || strcmp(line, "hold off") == 0)
        board_hold(line[6] == 'n');
    else if (strcmp(line, "lose") == 0)
        board_lose_next();
    else if (strcmp(line, "hang") == 0)
        board_hang();
    else if (strcmp(line, "quit") == 0)
        ended = 1;
    else if (strcmp(line, "overruns") == 0)
        telemetry_send("\"overruns\": %lu", board_overruns());
    else if (strcmp(line, "times") == 0) {
        struct board_times times = board_times();
        telemetry_send("\"loop\": %.6f, \"answer\": %.6f", times.loop, times.answer);
    } else
        return plant_command(&plant, line);
    return true;
}

static void report_done(void)
{
    telemetry_send("\"done\": true, \"t\": %.4f, \"sent\": %zu", plant.time, cable_written());
}

static void execute_line(const char *line)
{
    double seconds;
    if (sscanf(line, "run %lf", &seconds) == 1 && stepped && seconds > 0 && seconds <= MOST_STEPPED) {
        until = plant.time + seconds;
        waits = true;
    } else if (execute(line))
        report_done();
    else
        telemetry_send("\"error\": \"no such command, see --help\"");
}

/* Up to the next command that lets time pass. */
static void execute_lines(void)
{
    char *line_end;
    while (!waits && (line_end = memchr(input, '\n', used)) != NULL) {
        *line_end = '\0';
        execute_line(input);
        used -= (size_t)(line_end - input) + 1;
        memmove(input, line_end + 1, used);
    }
}

static void read_commands(void)
{
    ssize_t count = read(STDIN_FILENO, input + used, sizeof input - used);
    if (count > 0)
        used += (size_t)count;
    else if (count == 0 || errno != EAGAIN) {
        reads = false;
        ended |= stdin_ends;
    }
    if (used == sizeof input)
        used = 0;
}

static void poll_commands(int patience)
{
    struct pollfd state = {.fd = reads ? STDIN_FILENO : -1, .events = POLLIN};
    execute_lines();
    if (poll(&state, 1, waits || used > 0 ? 0 : patience) > 0)
        read_commands();
    execute_lines();
}

static void serve_cable(void)
{
    uint8_t bytes[256];
    size_t count = board_transmitted(bytes, sizeof bytes);
    if (cable_opened())
        board_reset(RESET_OPENED);
    if (count > 0)
        cable_write(bytes, count);
}

static void pass_slice(void)
{
    uint8_t byte;
    for (int i = 0; i < SLICE_STEPS; i++) {
        if (i % FETCH_EVERY == 0)
            cable_fetch();
        if (board_ready() && cable_read(&byte))
            board_receive(byte);
        board_step();
        serve_cable();
    }
    if (!stepped && plant.time >= next_pose) {
        plant_report_pose(&plant);
        next_pose = plant.time + POSE_PERIOD - 1e-9;
    }
}

static void report_lateness(double late)
{
    late_total += late;
    telemetry_send("\"event\": \"late\", \"t\": %.4f, \"late\": %.4f, \"total\": %.4f", plant.time, late, late_total);
    base_wall = wall_clock();
    base_time = plant.time;
}

/* Milliseconds until there is something to do. */
static int idle_ms(void)
{
    double ahead = plant.time - base_time - (wall_clock() - base_wall);
    if (stepped)
        return plant.time < until - PLANT_DT / 2 ? 0 : 1000;
    if (ahead < -LATE)
        report_lateness(-ahead);
    return ahead > 0.001 ? (int)(ahead * 1000) : 0;
}

static void run(void)
{
    while (!ended && !board_crashed()) {
        poll_commands(idle_ms());
        if (idle_ms() > 0)
            continue;
        pass_slice();
        if (waits && plant.time >= until - PLANT_DT / 2) {
            waits = false;
            report_done();
        }
    }
}

static bool numbers_of(const char *text, double *numbers, double yaw_unit)
{
    char rest;
    bool whole = sscanf(text, "%lf,%lf,%lf%c", &numbers[0], &numbers[1], &numbers[2], &rest) == 3;
    numbers[AXIS_YAW] *= yaw_unit;
    return whole;
}

/* Start as the options say; the ELF file's path, or NULL when one is invalid. --help ends the program. */
static const char *start(int argc, char **argv)
{
    static const struct option all[] = {
        {"link", required_argument, NULL, 'l'},  {"start", required_argument, NULL, 's'},
        {"scale", required_argument, NULL, 'c'}, {"shift", required_argument, NULL, 'o'},
        {"kind", required_argument, NULL, 'k'},  {"stepped", no_argument, NULL, 't'},
        {"help", no_argument, NULL, 'h'},        {NULL, 0, NULL, 0},
    };
    const double degree = 3.14159265358979323846 / 180;
    double place[AXES] = {0.1, -0.1, 0.2}, scale[AXES] = {1, 1, 1}, shift[AXES] = {0};
    bool valid = true;
    int which;
    while ((which = getopt_long(argc, argv, "h", all, NULL)) != -1) {
        switch (which) {
        case 'l': link_path = optarg; break;
        case 's': valid &= numbers_of(optarg, place, degree); break;
        case 'c': valid &= numbers_of(optarg, scale, 1); break;
        case 'o': valid &= numbers_of(optarg, shift, degree); break;
        case 't': stepped = true; break;
        case 'k':
            kind = strcmp(optarg, "circle") == 0 ? KIND_CIRCLE : KIND_DYNAMIC;
            valid &= kind == KIND_CIRCLE || strcmp(optarg, "dynamic") == 0;
            break;
        case 'h': fputs(help, stdout); exit(0);
        default: valid = false;
        }
    }
    if (!valid || optind != argc - 1 || (kind == KIND_CIRCLE && scale[AXIS_YAW] != 1)) /* a turn is a turn */
        return NULL;
    plant_start(&plant, kind, place);
    for (int a = 0; a < AXES; a++) {
        plant.longer[a] = scale[a] - 1;
        plant.shift[a] = shift[a];
    }
    return argv[optind];
}

static void end(int number)
{
    (void)number;
    ended = 1;
}

int main(int argc, char **argv)
{
    struct stat status;
    struct sigaction action = {.sa_handler = end};
    const char *elf = start(argc, argv);
    if (elf == NULL) {
        fputs("rig-emulator: expected options as --help shows them, and the firmware's ELF file\n", stderr);
        return 2;
    }
    if (!board_start(&plant, elf)) {
        fprintf(stderr, "rig-emulator: %s is not a firmware that can be read: build it with make firmware\n", elf);
        return 2;
    }
    stdin_ends = fstat(STDIN_FILENO, &status) == 0 && S_ISFIFO(status.st_mode);
    fcntl(STDIN_FILENO, F_SETFL, fcntl(STDIN_FILENO, F_GETFL) | O_NONBLOCK);
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGINT, &action, NULL);
    signal(SIGPIPE, SIG_IGN);
    base_wall = wall_clock();
    if (!plug()) {
        fprintf(stderr, "rig-emulator: no pseudo terminal, or no link at %s: %s\n", link_path, strerror(errno));
        return 2;
    }
    run();
    cable_unplug();
    if (!board_crashed())
        return 0;
    fputs("rig-emulator: the controller's program ended, which it must not\n", stderr);
    return 1;
}
