#define _GNU_SOURCE
#include "program/pace.h"

#include <poll.h>
#include <time.h>
#include <unistd.h>

#include "board/board.h"
#include "plant/plant_report.h"
#include "program/cable.h"
#include "program/commands.h"
#include "program/state.h"
#include "telemetry.h"

#define SLICE_STEPS 10 /* steps between two polls of the commands: 1 ms */
#define FETCH_EVERY 5 /* steps between two fetches from the cable */
#define LATE 0.05 /* s */

double pace_clock(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
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
    if (emulator.rate > 0 && emulator.plant.time >= emulator.next_pose) {
        plant_report_pose(&emulator.plant);
        emulator.next_pose = emulator.plant.time + 1 / emulator.rate - 1e-9;
    }
}

static void report_lateness(double late)
{
    emulator.late += late;
    telemetry_send(
        "\"event\": \"late\", \"t\": %.4f, \"late\": %.4f, \"total\": %.4f", emulator.plant.time, late, emulator.late);
    emulator.base_wall = pace_clock();
    emulator.base_time = emulator.plant.time;
}

/* Milliseconds until there is something to do. */
static int idle_ms(void)
{
    double ahead = emulator.plant.time - emulator.base_time - (pace_clock() - emulator.base_wall);
    if (emulator.pace == FAST)
        return 0;
    if (emulator.pace == STEPPED)
        return emulator.plant.time < emulator.until - PLANT_DT / 2 ? 0 : 1000;
    if (ahead < -LATE)
        report_lateness(-ahead);
    return ahead > 0.001 ? (int)(ahead * 1000) : 0;
}

static void poll_commands(int patience)
{
    struct pollfd input = {.fd = emulator.running ? STDIN_FILENO : -1, .events = POLLIN};
    commands_execute();
    if (emulator.waiting || emulator.used > 0)
        patience = 0;
    if (poll(&input, 1, patience) > 0)
        commands_read();
    commands_execute();
}

void pace_run(void)
{
    while (!emulator.ended && !board_crashed()) {
        poll_commands(idle_ms());
        if (idle_ms() > 0)
            continue;
        pass_slice();
        if (emulator.waiting && emulator.plant.time >= emulator.until - PLANT_DT / 2) {
            emulator.waiting = false;
            commands_done();
        }
    }
}
