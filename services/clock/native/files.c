/* Waits for file descriptors: the kernel says when one is ready, the agent when the deadline has come and who goes on.
 *
 * Each call is made without waiting first. Only if it would block the thread polls the descriptors and its own FIFO,
 * into which the agent writes at the deadline; then the call is made without waiting again.
 */
#define _GNU_SOURCE
#include "library.h"

#include <fcntl.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/select.h>
#include <sys/stat.h>

enum { MOST_FILES = 1024, SIGNALS_SIZE = 8 };

static struct { int file; ino_t inode; dev_t device; } fifos[TIME_SLOTS]; /* `file` is one more than the descriptor */

/* -- the wait ------------------------------------------------------------------------------------------------------- */

/* Programs close descriptors that are not theirs; then the FIFO is opened again. */
static int own_fifo(void)
{
    unsigned at = own_index();
    struct stat found;
    if (fifos[at].file && !fstat(fifos[at].file - 1, &found) && found.st_ino == fifos[at].inode
        && found.st_dev == fifos[at].device)
        return fifos[at].file - 1;
    char path[300];
    snprintf(path, sizeof path, "%s/w%u", process.folder, at);
    int file = (int)RAW_4(SYS_openat, AT_FDCWD, path, O_RDWR | O_NONBLOCK | O_CLOEXEC, 0);
    if (file < 0)
        return -1;
    int high = (int)RAW_3(SYS_fcntl, file, F_DUPFD_CLOEXEC, LIBRARY_FILES_FROM);
    if (high >= 0)
        RAW_1(SYS_close, file);
    else
        high = file;
    if (fstat(high, &found))
        return -1;
    fifos[at].file = high + 1;
    fifos[at].inode = found.st_ino;
    fifos[at].device = found.st_dev;
    return high;
}

void files_after_fork(void)
{
    for (unsigned at = 0; at < TIME_SLOTS; at++)
        if (fifos[at].file) {
            RAW_1(SYS_close, fifos[at].file - 1);
            fifos[at].file = 0;
        }
}

static void empty(int fifo)
{
    char bytes[64];
    while (RAW_3(SYS_read, fifo, bytes, sizeof bytes) > 0) {
    }
}

static long poll_now(struct pollfd *files, unsigned count)
{
    struct timespec none = {0, 0};
    return raw(SYS_ppoll, (long)files, count, (long)&none, 0, SIGNALS_SIZE, 0);
}

int wait_for_files(struct pollfd *files, unsigned count, int64_t deadline_ns, const sigset_t *mask)
{
    uint64_t before;
    int fifo = own_fifo(), error = 0;
    if (fifo < 0)
        return sleep_until(deadline_ns < later(now_ns(), SPIN_SLEEP_NS) ? deadline_ns : later(now_ns(), SPIN_SLEEP_NS));
    files[count] = (struct pollfd){.fd = fifo, .events = POLLIN};
    block_signals(&before); /* a handler must not take the grant before the poll begins */
    enter(TIME_FD, deadline_ns);
    for (;;) {
        long ready = raw(SYS_ppoll, (long)files, count + 1, 0, mask ? (long)mask : (long)&before, SIGNALS_SIZE, 0);
        if (ready == -EINTR)
            error = EINTR;
        if (ready > 0 && files[count].revents) {
            empty(fifo);
            if (ready == 1 && self.slot->state == TIME_WAITING)
                continue; /* left over from a wait before */
        }
        break;
    }
    if (pass_gate_as_ready() == EINTR)
        error = EINTR;
    restore_signals(&before);
    return error;
}

/* Until the descriptor is ready: 0, ETIMEDOUT or EINTR. With an error at it, it is ready. */
int await_file(int file, short events, int64_t deadline_ns)
{
    for (;;) {
        struct pollfd files[2] = {{.fd = file, .events = events}};
        if (poll_now(files, 1) != 0)
            return 0;
        if (now_ns() >= deadline_ns)
            return ETIMEDOUT;
        if (wait_for_files(files, 1, deadline_ns, NULL) == EINTR && !(self.is_restarting && deadline_ns == TIME_NEVER))
            return EINTR;
    }
}

static int64_t deadline_after(const struct timespec *timeout)
{
    return timeout ? later(now_ns(), nanoseconds(timeout)) : TIME_NEVER;
}

/* -- poll ----------------------------------------------------------------------------------------------------------- */

/* Repeats a call that does not wait until it has something; `wait_for_files` takes `copies`, and may write there. */
#define UNTIL_READY(call, copies, count, deadline_ns, mask)                                                             \
    for (bool is_first = true;; is_first = false) {                                                                     \
        long ready = call;                                                                                              \
        if (ready)                                                                                                      \
            return (int)answer(ready);                                                                                  \
        if (now_ns() >= deadline_ns) {                                                                                  \
            if (is_first)                                                                                               \
                count_spin();                                                                                           \
            return 0;                                                                                                   \
        }                                                                                                               \
        if (wait_for_files(copies, count, deadline_ns, mask) == EINTR)                                                  \
            return fail_with(EINTR);                                                                                    \
    }

static int poll_until(struct pollfd *files, nfds_t count, int64_t deadline_ns, const sigset_t *mask)
{
    struct timespec none = {0, 0};
    unsigned waited = count < MOST_FILES ? (unsigned)count : MOST_FILES;
    struct pollfd copies[waited + 1];
    memcpy(copies, files, waited * sizeof *files);
    UNTIL_READY(raw(SYS_ppoll, (long)files, (long)count, (long)&none, (long)mask, SIGNALS_SIZE, 0), copies, waited, deadline_ns, mask)
}

PUBLIC int ppoll(struct pollfd *files, nfds_t count, const struct timespec *timeout, const sigset_t *mask)
{
    if (!is_managed())
        return (int)answer(raw(SYS_ppoll, (long)files, (long)count, (long)timeout, (long)mask, SIGNALS_SIZE, 0));
    if (timeout && (!is_valid(timeout) || timeout->tv_sec < 0))
        return fail_with(EINVAL);
    return poll_until(files, count, deadline_after(timeout), mask);
}

PUBLIC int poll(struct pollfd *files, nfds_t count, int timeout_ms)
{
    struct timespec timeout = {timeout_ms / 1000, timeout_ms % 1000 * INT64_C(1000000)};
    return ppoll(files, count, timeout_ms < 0 ? NULL : &timeout, NULL);
}

CHECKED(int, __poll_chk, size / sizeof *files < count, poll(files, count, timeout_ms), struct pollfd *files, nfds_t count,
        int timeout_ms, size_t size)
CHECKED(int, __ppoll_chk, size / sizeof *files < count, ppoll(files, count, timeout, mask), struct pollfd *files,
        nfds_t count, const struct timespec *timeout, const sigset_t *mask, size_t size)

/* -- select --------------------------------------------------------------------------------------------------------- */

enum { BITS = 8 * sizeof(long) };

static bool has(const fd_set *set, int file)
{
    return set && ((const unsigned long *)set)[file / BITS] >> file % BITS & 1;
}

/* The files of three sets, with room for one more. */
static unsigned files_of(int end, const fd_set *reads, const fd_set *writes, const fd_set *others, struct pollfd *files)
{
    unsigned count = 0;
    for (int file = 0; file < end && count < MOST_FILES; file++) {
        short events = (short)((has(reads, file) ? POLLIN | POLLRDNORM : 0) | (has(writes, file) ? POLLOUT : 0)
                               | (has(others, file) ? POLLPRI : 0));
        if (events)
            files[count++] = (struct pollfd){.fd = file, .events = events};
    }
    return count;
}

/* A call that finds nothing empties the sets, so they are filled before each. */
static long select_now(int end, fd_set *sets[3], unsigned long *kept[3], size_t size, const sigset_t *mask)
{
    struct timespec none = {0, 0};
    struct { const sigset_t *mask; size_t size; } signals = {mask, SIGNALS_SIZE};
    for (int at = 0; at < 3; at++)
        if (sets[at])
            memcpy(sets[at], kept[at], size);
    return RAW_6(SYS_pselect6, end, sets[0], sets[1], sets[2], &none, &signals);
}

static int select_until(int end, fd_set *sets[3], int64_t deadline_ns, const sigset_t *mask)
{
    size_t size = end > 0 ? ((size_t)end + BITS - 1) / BITS * sizeof(long) : 0;
    unsigned long wanted[3][size / sizeof(long) + 1], *kept[3] = {wanted[0], wanted[1], wanted[2]};
    struct pollfd files[MOST_FILES + 1];
    for (int at = 0; at < 3; at++)
        if (sets[at])
            memcpy(kept[at], sets[at], size);
    unsigned count = files_of(end, sets[0], sets[1], sets[2], files);
    UNTIL_READY(select_now(end, sets, kept, size, mask), files, count, deadline_ns, mask)
}

PUBLIC int pselect(int end, fd_set *restrict reads, fd_set *restrict writes, fd_set *restrict others,
                   const struct timespec *restrict timeout, const sigset_t *restrict mask)
{
    struct { const sigset_t *mask; size_t size; } signals = {mask, SIGNALS_SIZE};
    fd_set *sets[3] = {reads, writes, others};
    if (!is_managed())
        return (int)answer(RAW_6(SYS_pselect6, end, reads, writes, others, timeout, &signals));
    if (end < 0 || end > 1 << 16 || (timeout && (!is_valid(timeout) || timeout->tv_sec < 0)))
        return fail_with(EINVAL);
    return select_until(end, sets, deadline_after(timeout), mask);
}

PUBLIC int select(int end, fd_set *restrict reads, fd_set *restrict writes, fd_set *restrict others,
                  struct timeval *restrict timeout)
{
    if (timeout && (timeout->tv_sec < 0 || timeout->tv_usec < 0))
        return fail_with(EINVAL);
    struct timespec wanted = {0, 0};
    if (timeout)
        wanted = (struct timespec){timeout->tv_sec + timeout->tv_usec / 1000000, timeout->tv_usec % 1000000 * 1000};
    int64_t begin = is_managed() ? now_ns() : 0;
    int result = pselect(end, reads, writes, others, timeout ? &wanted : NULL, NULL);
    if (timeout && is_managed()) { /* Linux says what is left */
        struct timespec left = timespec_of(nanoseconds(&wanted) - (now_ns() - begin));
        *timeout = (struct timeval){left.tv_sec, left.tv_nsec / 1000};
    }
    return result;
}

/* -- epoll ---------------------------------------------------------------------------------------------------------- */

static int epoll_until(int file, struct epoll_event *events, int most, int64_t deadline_ns, const sigset_t *mask)
{
    struct pollfd files[2] = {{.fd = file, .events = POLLIN}};
    UNTIL_READY(RAW_6(SYS_epoll_pwait, file, events, most, 0, mask, SIGNALS_SIZE), files, 1, deadline_ns, mask)
}

PUBLIC int epoll_pwait2(int file, struct epoll_event *events, int most, const struct timespec *timeout,
                        const sigset_t *mask)
{
    if (!is_managed()) {
        int ms = timeout ? (int)(timeout->tv_sec * 1000 + timeout->tv_nsec / 1000000) : -1;
        return (int)answer(RAW_6(SYS_epoll_pwait, file, events, most, ms, mask, SIGNALS_SIZE));
    }
    if (timeout && (!is_valid(timeout) || timeout->tv_sec < 0))
        return fail_with(EINVAL);
    return epoll_until(file, events, most, deadline_after(timeout), mask);
}

PUBLIC int epoll_pwait(int file, struct epoll_event *events, int most, int timeout_ms, const sigset_t *mask)
{
    struct timespec timeout = {timeout_ms / 1000, timeout_ms % 1000 * INT64_C(1000000)};
    return epoll_pwait2(file, events, most, timeout_ms < 0 ? NULL : &timeout, mask);
}

PUBLIC int epoll_wait(int file, struct epoll_event *events, int most, int timeout_ms)
{
    return epoll_pwait(file, events, most, timeout_ms, NULL);
}
