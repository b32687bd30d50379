/* Time: real, as fast as possible, or as it is ordered. */
#define _GNU_SOURCE
#include <poll.h>
#include <time.h>
#include <unistd.h>

#include "board.h"
#include "cable.h"
#include "emulator.h"
#include "say.h"

#define SLICE 10 /* steps between two looks at the world: 1 ms */
#define LISTEN 5 /* steps between two looks at the cable */
#define LATE 0.05 /* s */

double pace_wall(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

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
    if (self.rate > 0 && self.plant.time >= self.next_pose) {
        say_pose(&self.plant);
        self.next_pose = self.plant.time + 1 / self.rate - 1e-9;
    }
}

static void admit_lateness(double late)
{
    self.late += late;
    say("\"event\": \"late\", \"t\": %.4f, \"late\": %.4f, \"total\": %.4f", self.plant.time, late, self.late);
    self.base_wall = pace_wall();
    self.base_time = self.plant.time;
}

/* ms that there is nothing to do */
static int idle(void)
{
    double ahead = self.plant.time - self.base_time - (pace_wall() - self.base_wall);
    if (self.pace == FAST)
        return 0;
    if (self.pace == STEPPED)
        return self.plant.time < self.until - PLANT_DT / 2 ? 0 : 1000;
    if (ahead < -LATE)
        admit_lateness(-ahead);
    return ahead > 0.001 ? (int)(ahead * 1000) : 0;
}

static void look_around(int patience)
{
    struct pollfd input = {.fd = self.running ? STDIN_FILENO : -1, .events = POLLIN};
    orders_take();
    if (self.waiting || self.used > 0)
        patience = 0;
    if (poll(&input, 1, patience) > 0)
        orders_read();
    orders_take();
}

void pace_live(void)
{
    while (!self.ended && !board_crashed()) {
        look_around(idle());
        if (idle() > 0)
            continue;
        pass_slice();
        if (self.waiting && self.plant.time >= self.until - PLANT_DT / 2) {
            self.waiting = false;
            orders_done();
        }
    }
}
