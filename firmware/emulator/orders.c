/* Orders on standard input. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "board.h"
#include "cable.h"
#include "control.h"
#include "emulator.h"
#include "say.h"

#define MOST_STEPPED 3600.0 /* s of one order */

bool orders_plug(void)
{
    const char *terminal = cable_plug(self.link);
    if (terminal == NULL)
        return false;
    board_power(true);
    say("\"ready\": true, \"port\": \"%s\", \"t\": %.4f", terminal, self.plant.time);
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
    self.until = self.plant.time + seconds;
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
        return orders_plug();
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
        self.ended = 1;
    else
        return question(line) || control(&self.plant, line);
    return true;
}

void orders_done(void)
{
    say("\"done\": true, \"t\": %.4f, \"sent\": %zu", self.plant.time, cable_written());
}

static void take_order(const char *line)
{
    if (strncmp(line, "run ", 4) == 0) {
        if (!step(line + 4))
            say("\"error\": \"run takes seconds up to %g, with --stepped\"", MOST_STEPPED);
    } else if (obey(line))
        orders_done();
    else
        say("\"error\": \"no such order, see --help\"");
}

void orders_take(void)
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

void orders_read(void)
{
    ssize_t count = read(STDIN_FILENO, self.orders + self.used, sizeof self.orders - self.used);
    if (count > 0)
        self.used += (size_t)count;
    else if (count == 0 || errno != EAGAIN) {
        self.running = false;
        self.ended |= self.stdin_ends;
    }
    if (self.used == sizeof self.orders)
        self.used = 0;
}
