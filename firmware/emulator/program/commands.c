#include "program/commands.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "board/board.h"
#include "plant/plant_commands.h"
#include "program/cable.h"
#include "program/state.h"
#include "telemetry.h"

#define MOST_STEPPED 3600.0 /* s of one command */

bool commands_plug(void)
{
    const char *terminal = cable_plug(emulator.link);
    if (terminal == NULL)
        return false;
    board_power(true);
    telemetry_send("\"ready\": true, \"port\": \"%s\", \"t\": %.4f", terminal, emulator.plant.time);
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
    if (emulator.pace != STEPPED || !(seconds > 0 && seconds <= MOST_STEPPED))
        return false;
    emulator.until = emulator.plant.time + seconds;
    emulator.waiting = true;
    return true;
}

static bool query(const char *line)
{
    if (strcmp(line, "overruns") == 0)
        telemetry_send("\"overruns\": %lu", board_overruns());
    else if (strcmp(line, "times") == 0) {
        struct board_times times = board_times();
        telemetry_send("\"loop\": %.6f, \"answer\": %.6f", times.loop, times.answer);
    } else if (strcmp(line, "lateness") == 0)
        telemetry_send("\"lateness\": %.6f", emulator.late);
    else
        return false;
    return true;
}

static bool execute(const char *line)
{
    if (strcmp(line, "plug") == 0)
        return commands_plug();
    if (strcmp(line, "unplug") == 0 || strcmp(line, "unplug power") == 0)
        return unplug(line[6] != '\0');
    if (strncmp(line, "noise ", 6) == 0)
        cable_noise((unsigned)strtoul(line + 6, NULL, 10));
    else if (strncmp(line, "await ", 6) == 0)
        return cable_await(strtoul(line + 6, NULL, 10));
    else if (strcmp(line, "reset") == 0)
        board_reset(RESET_BUTTON);
    else if (strcmp(line, "hold on") == 0 || strcmp(line, "hold off") == 0)
        board_hold(line[6] == 'n');
    else if (strcmp(line, "lose") == 0)
        board_lose_next();
    else if (strcmp(line, "hang") == 0)
        board_hang();
    else if (strcmp(line, "quit") == 0)
        emulator.ended = 1;
    else
        return query(line) || plant_command(&emulator.plant, line);
    return true;
}

void commands_done(void)
{
    telemetry_send("\"done\": true, \"t\": %.4f, \"sent\": %zu", emulator.plant.time, cable_written());
}

static void execute_line(const char *line)
{
    if (strncmp(line, "run ", 4) == 0) {
        if (!step(line + 4))
            telemetry_send("\"error\": \"run takes seconds up to %g, with --stepped\"", MOST_STEPPED);
    } else if (execute(line))
        commands_done();
    else
        telemetry_send("\"error\": \"no such command, see --help\"");
}

void commands_execute(void)
{
    char *line_end;
    while (!emulator.waiting && (line_end = memchr(emulator.input, '\n', emulator.used)) != NULL) {
        char line[128];
        size_t length = (size_t)(line_end - emulator.input), kept = length < sizeof line - 1 ? length : sizeof line - 1;
        memcpy(line, emulator.input, kept);
        line[kept] = '\0';
        emulator.used -= length + 1;
        memmove(emulator.input, line_end + 1, emulator.used);
        execute_line(line);
    }
}

void commands_read(void)
{
    ssize_t count = read(STDIN_FILENO, emulator.input + emulator.used, sizeof emulator.input - emulator.used);
    if (count > 0)
        emulator.used += (size_t)count;
    else if (count == 0 || errno != EAGAIN) {
        emulator.running = false;
        emulator.ended |= emulator.stdin_ends;
    }
    if (emulator.used == sizeof emulator.input)
        emulator.used = 0;
}
