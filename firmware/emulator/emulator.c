/* The emulated rig: the gantry's firmware, unchanged, in front of models of its drivers and mechanics. */
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

#include "board.h"
#include "cable.h"
#include "control.h"
#include "say.h"

#define SLICE 10            /* steps between two looks at the world: 1 ms */
#define LISTEN 5            /* steps between two looks at the cable */
#define LATE 0.05           /* s */
#define MOST_STEPPED 3600.0 /* s of one order */

enum pace { REALTIME, FAST, STEPPED };

static struct plant plant;
static struct {
    const char *link;
    enum pace pace;
    double rate, boot, place[AXES], until, next_pose, begun, late;
    double base_wall, base_time;
    bool stdin_ends, running, waiting;
    char orders[65536];
    size_t used;
} self = {.rate = 100, .place = {0.1, -0.1, 0.2}, .until = 0, .running = true};

static volatile sig_atomic_t ended;

static const char *const help =
    "usage: rig-emulator [OPTION...] gantry.elf\n\n"
    "Runs the gantry's firmware on an emulated ATmega328P, with models of its four L6470 drivers and of the rig. Its\n"
    "serial port is a pseudo terminal. Standard output gets a JSON object a line: {\"ready\": true, \"port\": ...},\n"
    "the true pose {\"t\": s, \"x\": m, \"y\": m, \"yaw\": rad, ...}, {\"event\": ...}. Standard input takes orders.\n\n"
    "  --link PATH        make PATH a symbolic link to the terminal\n"
    "  --pose-rate HZ     of the true pose (100); 0 for none\n"
    "  --publish PATH     send each line to this Unix datagram socket as well\n"
    "  --start X,Y,YAW    where the rig stands at first, m and degrees (0.1,-0.1,11)\n"
    "  --boot S           a boot loader's time after a reset, which a firmware from a programmer has not (0)\n"
    "  --fast             as fast as possible instead of in real time\n"
    "  --stepped          time passes only by the order `run S`\n"
    "  --help\n\n"
    "orders, a line each, answered by {\"done\": true, \"sent\": bytes so far} or {\"error\": ...}:\n" CONTROL_HELP
    "  run S               with --stepped: let S seconds pass\n"
    "  await N             wait, while no time passes, until the client's next N bytes are there\n"
    "  unplug [power]      pull the USB cable, and with `power` the controller's power with it\n"
    "  plug                plug it in again, with power\n"
    "  noise N             of a thousand bytes N have a wrong bit\n"
    "  reset               press the reset button\n"
    "  hold on|off         keep the controller in reset, as a broken one\n"
    "  hang                let the firmware hang\n"
    "  lose                the receiver loses the next byte\n"
    "  times               longest time round the firmware's loop and until an answer begins, s, since the last time\n"
    "  overruns            bytes that the controller's receiver lost\n"
    "  lateness            s that real time was missed by, together\n"
    "  quit\n"
    "It ends with `quit`, on SIGTERM, and when standard input is a pipe that ends.\n\n"
    "example: rig-emulator --link /tmp/rig build/firmware/gantry.elf\n";

static double wall(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

static void end(int number)
{
    (void)number;
    ended = 1;
}

/* Orders */

static bool plug(void)
{
    const char *terminal = cable_plug(self.link);
    if (terminal == NULL)
        return false;
    board_power(true);
    say("\"ready\": true, \"port\": \"%s\", \"t\": %.4f", terminal, plant.time);
    return true;
}

static bool unplug(bool power)
{
    cable_unplug();
    if (power)
        board_power(false);
    return true;
}

static bool step(const char *text)
{
    double seconds = strtod(text, NULL);
    if (self.pace != STEPPED || !(seconds > 0 && seconds <= MOST_STEPPED))
        return false;
    self.until = plant.time + seconds;
    self.waiting = true;
    return true;
}

static bool question(const char *line)
{
    if (strcmp(line, "overruns") == 0)
        say("\"overruns\": %lu", board_overruns());
    else if (strcmp(line, "times") == 0) {
        struct board_times times = board_times();
        say("\"loop\": %.6f, \"answer\": %.6f", times.loop, times.answer);
    } else if (strcmp(line, "lateness") == 0)
        say("\"lateness\": %.6f", self.late);
    else
        return false;
    return true;
}

static bool obey(const char *line)
{
    if (strcmp(line, "plug") == 0)
        return plug();
    if (strcmp(line, "unplug") == 0 || strcmp(line, "unplug power") == 0)
        return unplug(line[6] != '\0');
    if (strncmp(line, "noise ", 6) == 0)
        cable_noise((unsigned)strtoul(line + 6, NULL, 10));
    else if (strncmp(line, "await ", 6) == 0)
        return cable_await(strtoul(line + 6, NULL, 10));
    else if (strcmp(line, "reset") == 0)
        board_reset(RESET_ORDERED);
    else if (strcmp(line, "hold on") == 0 || strcmp(line, "hold off") == 0)
        board_hold(line[6] == 'n');
    else if (strcmp(line, "lose") == 0)
        board_lose_next();
    else if (strcmp(line, "hang") == 0)
        board_hang();
    else if (strcmp(line, "quit") == 0)
        ended = 1;
    else
        return question(line) || control(&plant, line);
    return true;
}

static void say_done(void)
{
    say("\"done\": true, \"t\": %.4f, \"sent\": %zu", plant.time, cable_written());
}

static void take_order(const char *line)
{
    if (strncmp(line, "run ", 4) == 0) {
        if (!step(line + 4))
            say("\"error\": \"run takes seconds up to %g, with --stepped\"", MOST_STEPPED);
    } else if (obey(line))
        say_done();
    else
        say("\"error\": \"no such order, see --help\"");
}

static void take_orders(void)
{
    char *line_end;
    while (!self.waiting && (line_end = memchr(self.orders, '\n', self.used)) != NULL) {
        char line[128];
        size_t length = (size_t)(line_end - self.orders), kept = length < sizeof line - 1 ? length : sizeof line - 1;
        memcpy(line, self.orders, kept);
        line[kept] = '\0';
        self.used -= length + 1;
        memmove(self.orders, line_end + 1, self.used);
        take_order(line);
    }
}

static void read_orders(void)
{
    ssize_t count = read(STDIN_FILENO, self.orders + self.used, sizeof self.orders - self.used);
    if (count > 0)
        self.used += (size_t)count;
    else if (count == 0 || errno != EAGAIN) {
        self.running = false;
        ended |= self.stdin_ends;
    }
    if (self.used == sizeof self.orders)
        self.used = 0;
}

/* Time */

static void serve_cable(void)
{
    uint8_t bytes[256];
    size_t count = board_sent(bytes, sizeof bytes);
    if (cable_opened())
        board_reset(RESET_OPENED);
    if (count > 0)
        cable_write(bytes, count);
}

static void pass_slice(void)
{
    uint8_t byte;
    for (int i = 0; i < SLICE; i++) {
        if (i % LISTEN == 0)
            cable_listen();
        if (board_wants() && cable_read(&byte))
            board_give(byte);
        board_step();
        serve_cable();
    }
    if (self.rate > 0 && plant.time >= self.next_pose) {
        say_pose(&plant);
        self.next_pose = plant.time + 1 / self.rate - 1e-9;
    }
}

static void admit_lateness(double late)
{
    self.late += late;
    say("\"event\": \"late\", \"t\": %.4f, \"late\": %.4f, \"total\": %.4f", plant.time, late, self.late);
    self.base_wall = wall();
    self.base_time = plant.time;
}

/* ms that there is nothing to do */
static int idle(void)
{
    double ahead = plant.time - self.base_time - (wall() - self.base_wall);
    if (self.pace == FAST)
        return 0;
    if (self.pace == STEPPED)
        return plant.time < self.until - PLANT_DT / 2 ? 0 : 1000;
    if (ahead < -LATE)
        admit_lateness(-ahead);
    return ahead > 0.001 ? (int)(ahead * 1000) : 0;
}

static void look_around(int patience)
{
    struct pollfd input = {.fd = self.running ? STDIN_FILENO : -1, .events = POLLIN};
    take_orders();
    if (self.waiting || self.used > 0)
        patience = 0;
    if (poll(&input, 1, patience) > 0)
        read_orders();
    take_orders();
}

static void live(void)
{
    while (!ended && !board_crashed()) {
        look_around(idle());
        if (idle() > 0)
            continue;
        pass_slice();
        if (self.waiting && plant.time >= self.until - PLANT_DT / 2) {
            self.waiting = false;
            say_done();
        }
    }
}

/* Options */

static bool place_of(const char *text)
{
    double degrees;
    char rest;
    if (sscanf(text, "%lf,%lf,%lf%c", &self.place[0], &self.place[1], &degrees, &rest) != 3)
        return false;
    self.place[2] = degrees * 3.14159265358979323846 / 180;
    return true;
}

static bool option(int which, const char *value)
{
    switch (which) {
    case 'l': self.link = value; return true;
    case 'r': self.rate = strtod(value, NULL); return self.rate >= 0;
    case 'p': return say_to(value) == 0;
    case 's': return place_of(value);
    case 'b': self.boot = strtod(value, NULL); return self.boot >= 0;
    case 'f': self.pace = FAST; return true;
    case 't': self.pace = STEPPED; return true;
    default: return false;
    }
}

static const char *options(int argc, char **argv)
{
    static const struct option all[] = {
        {"link", required_argument, NULL, 'l'},    {"pose-rate", required_argument, NULL, 'r'},
        {"publish", required_argument, NULL, 'p'}, {"start", required_argument, NULL, 's'},
        {"boot", required_argument, NULL, 'b'},    {"fast", no_argument, NULL, 'f'},
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
    return optind == argc - 1 ? argv[optind] : NULL;
}

static void begin(void)
{
    struct stat input;
    struct sigaction action = {.sa_handler = end};
    self.stdin_ends = fstat(STDIN_FILENO, &input) == 0 && S_ISFIFO(input.st_mode);
    fcntl(STDIN_FILENO, F_SETFL, fcntl(STDIN_FILENO, F_GETFL) | O_NONBLOCK);
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGINT, &action, NULL);
    signal(SIGPIPE, SIG_IGN);
    self.base_wall = wall();
}

int main(int argc, char **argv)
{
    const char *elf = options(argc, argv);
    if (elf == NULL) {
        fputs("rig-emulator: expected options as --help shows them, and the firmware's ELF file\n", stderr);
        return 2;
    }
    plant_begin(&plant, self.place);
    if (!board_begin(&plant, elf, self.boot)) {
        fprintf(stderr, "rig-emulator: %s is no firmware that can be read: build it with make firmware\n", elf);
        return 2;
    }
    begin();
    if (!plug()) {
        fprintf(stderr, "rig-emulator: no pseudo terminal, or no link at %s: %s\n", self.link, strerror(errno));
        return 2;
    }
    live();
    cable_unplug();
    if (!board_crashed())
        return 0;
    fputs("rig-emulator: the controller's program ended, which it must not\n", stderr);
    return 1;
}
