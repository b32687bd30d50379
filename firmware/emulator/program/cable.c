#include "program/cable.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#define PATIENCE_MS 5000
#define POLL_EVERY 10 /* calls of cable_opened between two polls of the terminal */

static int master = -1;
static bool hung, dtr;
static unsigned polls;
static uint8_t buffer[8192];
static size_t begin, end, written;
static char terminal[64], *linked;

static bool make_link(const char *link)
{
    char fresh[4096];
    if (snprintf(fresh, sizeof fresh, "%s.new", link) >= (int)sizeof fresh) {
        errno = ENAMETOOLONG;
        return false;
    }
    unlink(fresh);
    free(linked);
    linked = strdup(link);
    return symlink(terminal, fresh) == 0 && rename(fresh, link) == 0;
}

const char *cable_plug(const char *link)
{
    int slave;
    struct termios raw;
    if (master >= 0)
        return terminal;
    if (openpty(&master, &slave, terminal, NULL, NULL) != 0)
        return NULL;
    tcgetattr(slave, &raw);
    cfmakeraw(&raw);
    raw.c_cflag |= HUPCL;
    tcsetattr(slave, TCSANOW, &raw);
    close(slave);
    fcntl(master, F_SETFL, O_NONBLOCK);
    fcntl(master, F_SETFD, FD_CLOEXEC);
    hung = true;
    dtr = false;
    begin = end = 0;
    return link == NULL || make_link(link) ? terminal : NULL;
}

void cable_unplug(void)
{
    if (linked != NULL)
        unlink(linked);
    if (master >= 0)
        close(master);
    master = -1;
}

static bool stays_up(void)
{
    struct termios left;
    return tcgetattr(master, &left) == 0 && (left.c_cflag & HUPCL) == 0;
}

bool cable_opened(void)
{
    struct pollfd state = {.fd = master, .events = 0};
    if (master < 0 || ++polls % POLL_EVERY != 0)
        return false;
    poll(&state, 1, 0);
    bool now_hung = (state.revents & POLLHUP) != 0, rises = hung && !now_hung && !dtr;
    if (now_hung && !hung)
        dtr = stays_up();
    else if (!now_hung)
        dtr = true;
    hung = now_hung;
    return rises;
}

void cable_fetch(void)
{
    if (master < 0)
        return;
    memmove(buffer, buffer + begin, end - begin);
    end -= begin;
    begin = 0;
    ssize_t count = end < sizeof buffer ? read(master, buffer + end, sizeof buffer - end) : 0;
    end += count > 0 ? (size_t)count : 0;
}

bool cable_await(size_t count)
{
    struct pollfd state = {.fd = master, .events = POLLIN};
    cable_fetch();
    while (end - begin < count && end < sizeof buffer && poll(&state, 1, PATIENCE_MS) > 0) {
        if ((state.revents & POLLIN) == 0)
            break;
        cable_fetch();
    }
    return end - begin >= count;
}

bool cable_read(uint8_t *byte)
{
    if (begin == end)
        return false;
    *byte = buffer[begin++];
    return true;
}

void cable_write(const uint8_t *bytes, size_t count)
{
    for (size_t i = 0; i < count && master >= 0 && !hung; i++) {
        if (write(master, bytes + i, 1) != 1)
            return;
        written++;
    }
}

size_t cable_written(void)
{
    return written;
}
