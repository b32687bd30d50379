/* Reads and writes of sockets and pipes that would block, and when a datagram came. */
#define _GNU_SOURCE
#include "library.h"

#include <fcntl.h>
#include <linux/sockios.h>
#include <mqueue.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/uio.h>

static bool may_block(int file, int flags)
{
    if (flags & MSG_DONTWAIT)
        return false;
    long status = RAW_2(SYS_fcntl, file, F_GETFL);
    return status >= 0 && !(status & O_NONBLOCK);
}

enum { LIBRARY_FILES_UP_TO = 2 * TIME_SLOTS + LIBRARY_FILES_FROM, NOTED_FILES = 1024, LONGEST_TICK_NS = 10000001 };

static int64_t receive_timeouts[NOTED_FILES];

/* The kernel rounds a socket's timeout up to its ticks, whose length depends on how it was built. */
PUBLIC int setsockopt(int file, int level, int option, const void *value, socklen_t size)
{
    long result = RAW_6(SYS_setsockopt, file, level, option, value, size, 0);
    if (!result && level == SOL_SOCKET && option == SO_RCVTIMEO && file < NOTED_FILES && size >= sizeof(struct timeval)) {
        const struct timeval *given = value;
        receive_timeouts[file] = given->tv_sec * NANOSECONDS + given->tv_usec * 1000;
    }
    return (int)answer(result);
}

/* Of SO_RCVTIMEO or SO_SNDTIMEO. */
static int64_t deadline_of(int file, int option)
{
    struct timeval timeout = {0, 0};
    socklen_t size = sizeof timeout;
    if (RAW_6(SYS_getsockopt, file, SOL_SOCKET, option, &timeout, &size, 0) || (!timeout.tv_sec && !timeout.tv_usec))
        return TIME_NEVER;
    int64_t rounded = timeout.tv_sec * NANOSECONDS + timeout.tv_usec * 1000;
    int64_t noted = option == SO_RCVTIMEO && file < NOTED_FILES ? receive_timeouts[file] : 0;
    return later(now_ns(), noted && noted <= rounded && rounded - noted < LONGEST_TICK_NS ? noted : rounded);
}

/* Repeats what would block until it need not, its timeout, or a signal. */
struct attempt {
    int file, flags;
    short events;
    int64_t deadline_ns;
    bool is_begun;
};

/* Another thread has shut it down: a datagram socket then says at once to one that waits that it has 0 bytes. */
static bool is_shut(int file)
{
    struct pollfd waited = {.fd = file, .events = POLLRDHUP};
    struct timespec none = {0, 0};
    return raw(SYS_ppoll, (long)&waited, 1, (long)&none, 0, 8, 0) > 0 && waited.revents & POLLRDHUP;
}

/* Whether to try again after `result`, which is then replaced by the error if not. */
static bool tries_again(struct attempt *attempt, long *result)
{
    if (*result != -EAGAIN || !is_managed())
        return false;
    if (!attempt->is_begun) {
        if (attempt->flags & MSG_ERRQUEUE || !may_block(attempt->file, attempt->flags)) {
            count_spin();
            return false;
        }
        attempt->is_begun = true;
        attempt->deadline_ns = deadline_of(attempt->file, attempt->events == POLLIN ? SO_RCVTIMEO : SO_SNDTIMEO);
    } else if (attempt->events == POLLIN && is_shut(attempt->file)) {
        *result = 0;
        return false;
    }
    int error = await_file(attempt->file, attempt->events, attempt->deadline_ns);
    *result = error == ETIMEDOUT ? -EAGAIN : -error;
    return !error;
}

#define ATTEMPT(file, flags, events, result, call)                                                                      \
    struct attempt attempt = {file, flags, events, 0, false};                                                           \
    long result;                                                                                                        \
    do                                                                                                                  \
        result = call;                                                                                                  \
    while (tries_again(&attempt, &result))

/* -- receiving ------------------------------------------------------------------------------------------------------ */

static long receive_once(int file, void *bytes, size_t size, int flags, struct sockaddr *from, socklen_t *length)
{
    ATTEMPT(file, flags, POLLIN, result,
            RAW_6(SYS_recvfrom, file, bytes, size, flags | MSG_DONTWAIT, from, length));
    return result;
}

PUBLIC ssize_t recvfrom(int file, void *restrict bytes, size_t size, int flags, struct sockaddr *restrict from,
                        socklen_t *restrict length)
{
    long result = receive_once(file, bytes, size, flags, from, length);
    if (result <= 0 || !(flags & MSG_WAITALL) || flags & (MSG_PEEK | MSG_DONTWAIT))
        return answer(result);
    int type = SOCK_DGRAM;
    socklen_t type_size = sizeof type;
    RAW_6(SYS_getsockopt, file, SOL_SOCKET, SO_TYPE, &type, &type_size, 0);
    while (type == SOCK_STREAM && (size_t)result < size) {
        long more = receive_once(file, (char *)bytes + result, size - (size_t)result, flags, NULL, NULL);
        if (more <= 0)
            break;
        result += more;
    }
    return result;
}

PUBLIC ssize_t recv(int file, void *bytes, size_t size, int flags)
{
    return recvfrom(file, bytes, size, flags, NULL, NULL);
}

CHECKED(ssize_t, __recv_chk, size > room, recv(file, bytes, size, flags), int file, void *bytes, size_t size, size_t room,
        int flags)
CHECKED(ssize_t, __recvfrom_chk, size > room, recvfrom(file, bytes, size, flags, from, length), int file,
        void *restrict bytes, size_t size, size_t room, int flags, struct sockaddr *restrict from, socklen_t *restrict length)

/* The kernel says when a datagram came by the machine's clock; here, it came now. */
static void stamp(struct msghdr *message)
{
    struct timespec now = timespec_of(now_ns());
    struct timeval now_in_us = {now.tv_sec, now.tv_nsec / 1000};
    struct cmsghdr *each;
    for (size_t at = 0; at + sizeof *each <= message->msg_controllen; at += CMSG_ALIGN(each->cmsg_len)) {
        each = (struct cmsghdr *)((char *)message->msg_control + at);
        if (each->cmsg_len < sizeof *each)
            break;
        if (each->cmsg_level != SOL_SOCKET)
            continue;
        if (each->cmsg_type == SCM_TIMESTAMP)
            memcpy(CMSG_DATA(each), &now_in_us, sizeof now_in_us);
        else if (each->cmsg_type == SCM_TIMESTAMPNS || each->cmsg_type == SO_TIMESTAMPING)
            memcpy(CMSG_DATA(each), &now, sizeof now);
    }
}

PUBLIC ssize_t recvmsg(int file, struct msghdr *message, int flags)
{
    ATTEMPT(file, flags, POLLIN, result, RAW_3(SYS_recvmsg, file, message, flags | MSG_DONTWAIT));
    if (result >= 0 && page && message->msg_controllen)
        stamp(message);
    return answer(result);
}

PUBLIC int recvmmsg(int file, struct mmsghdr *messages, unsigned count, int flags, struct timespec *timeout)
{
    unsigned got = 0;
    int64_t end = timeout && is_managed() ? later(now_ns(), nanoseconds(timeout)) : TIME_NEVER;
    while (got < count) {
        int how = flags | (got && flags & MSG_WAITFORONE ? MSG_DONTWAIT : 0);
        ssize_t size = recvmsg(file, &messages[got].msg_hdr, how & ~MSG_WAITFORONE);
        if (size < 0)
            return got ? (int)got : -1;
        messages[got++].msg_len = (unsigned)size;
        if (is_managed() && now_ns() >= end)
            break;
    }
    return (int)got;
}

PUBLIC int accept4(int file, struct sockaddr *restrict from, socklen_t *restrict length, int flags)
{
    struct pollfd waited = {.fd = file, .events = POLLIN};
    struct timespec none = {0, 0};
    ATTEMPT(file, 0, POLLIN, result,
            raw(SYS_ppoll, (long)&waited, 1, (long)&none, 0, 8, 0) == 0 && is_managed()
                ? -EAGAIN
                : RAW_4(SYS_accept4, file, from, length, flags));
    return (int)answer(result);
}

PUBLIC int accept(int file, struct sockaddr *restrict from, socklen_t *restrict length)
{
    return accept4(file, from, length, 0);
}

PUBLIC int ioctl(int file, unsigned long request, ...)
{
    va_list arguments;
    va_start(arguments, request);
    void *argument = va_arg(arguments, void *);
    va_end(arguments);
    long result = RAW_3(SYS_ioctl, file, request, argument);
    if (!result && page && (request == SIOCGSTAMP || request == SIOCGSTAMPNS)) {
        struct timespec now = timespec_of(now_ns());
        if (request == SIOCGSTAMP)
            now.tv_nsec /= 1000;
        memcpy(argument, &now, sizeof now);
    }
    return (int)answer(result);
}

/* -- reading and writing -------------------------------------------------------------------------------------------- */

/* Waits before what is not a socket alone, and so has no call that never blocks. */
static int await_ready(int file, short events)
{
    struct pollfd waited = {.fd = file, .events = events};
    struct timespec none = {0, 0};
    if (raw(SYS_ppoll, (long)&waited, 1, (long)&none, 0, 8, 0) != 0 || !is_managed())
        return 0;
    if (!may_block(file, 0)) {
        count_spin();
        return 0;
    }
    int error = await_file(file, events, deadline_of(file, events == POLLIN ? SO_RCVTIMEO : SO_SNDTIMEO));
    return error == ETIMEDOUT ? EAGAIN : error;
}

PUBLIC ssize_t read(int file, void *bytes, size_t size)
{
    if (is_random_file(file))
        return draw(bytes, size), (ssize_t)size;
    int error = await_ready(file, POLLIN);
    return error ? fail_with(error) : answer(RAW_3(SYS_read, file, bytes, size));
}

CHECKED(ssize_t, __read_chk, size > room, read(file, bytes, size), int file, void *bytes, size_t size, size_t room)

PUBLIC ssize_t readv(int file, const struct iovec *parts, int count)
{
    if (count > 0 && is_random_file(file))
        return read(file, parts->iov_base, parts->iov_len);
    int error = await_ready(file, POLLIN);
    return error ? fail_with(error) : answer(RAW_3(SYS_readv, file, parts, count));
}

/* Standard output and error go to who waits for no thread of the application. */
static bool is_output(int file)
{
    return file == STDOUT_FILENO || file == STDERR_FILENO;
}

PUBLIC ssize_t write(int file, const void *bytes, size_t size)
{
    int error = is_output(file) ? 0 : await_ready(file, POLLOUT);
    return error ? fail_with(error) : answer(RAW_3(SYS_write, file, bytes, size));
}

PUBLIC ssize_t writev(int file, const struct iovec *parts, int count)
{
    int error = is_output(file) ? 0 : await_ready(file, POLLOUT);
    return error ? fail_with(error) : answer(RAW_3(SYS_writev, file, parts, count));
}

PUBLIC ssize_t sendto(int file, const void *bytes, size_t size, int flags, const struct sockaddr *to, socklen_t length)
{
    size_t sent = 0;
    do {
        ATTEMPT(file, flags, POLLOUT, result,
                RAW_6(SYS_sendto, file, (const char *)bytes + sent, size - sent, flags | MSG_DONTWAIT, to, length));
        if (result < 0)
            return sent ? (ssize_t)sent : answer(result);
        sent += (size_t)result;
        if (!result)
            break;
    } while (sent < size && may_block(file, flags));
    return (ssize_t)sent;
}

PUBLIC ssize_t send(int file, const void *bytes, size_t size, int flags)
{
    return sendto(file, bytes, size, flags, NULL, 0);
}

PUBLIC ssize_t sendmsg(int file, const struct msghdr *message, int flags)
{
    int error = flags & MSG_DONTWAIT ? 0 : await_ready(file, POLLOUT);
    return error ? fail_with(error) : answer(RAW_3(SYS_sendmsg, file, message, flags));
}

/* -- POSIX message queues, descriptors of the kernel's, too ----------------------------------------------------------- */

static long on_queue(long number, mqd_t queue, const char *message, size_t size, uintptr_t priority,
                     const struct timespec *until)
{
    static const struct timespec past = {0, 0};
    if (!is_managed())
        return answer(RAW_6(number, queue, message, size, priority, until, 0));
    if (until && (!is_valid(until) || until->tv_sec < 0))
        return fail_with(EINVAL);
    int64_t deadline = until ? deadline_on(CLOCK_REALTIME, until) : TIME_NEVER;
    for (;;) {
        long result = RAW_6(number, queue, message, size, priority, &past, 0);
        if (result != -ETIMEDOUT)
            return answer(result);
        int error = await_file(queue, number == SYS_mq_timedreceive ? POLLIN : POLLOUT, deadline);
        if (error)
            return fail_with(error);
    }
}

PUBLIC ssize_t mq_timedreceive(mqd_t queue, char *restrict message, size_t size, unsigned *restrict priority,
                               const struct timespec *restrict until)
{
    return on_queue(SYS_mq_timedreceive, queue, message, size, (uintptr_t)priority, until);
}

PUBLIC ssize_t mq_receive(mqd_t queue, char *message, size_t size, unsigned *priority)
{
    return on_queue(SYS_mq_timedreceive, queue, message, size, (uintptr_t)priority, NULL);
}

PUBLIC int mq_timedsend(mqd_t queue, const char *message, size_t size, unsigned priority, const struct timespec *until)
{
    return (int)on_queue(SYS_mq_timedsend, queue, message, size, priority, until);
}

PUBLIC int mq_send(mqd_t queue, const char *message, size_t size, unsigned priority)
{
    return (int)on_queue(SYS_mq_timedsend, queue, message, size, priority, NULL);
}

/* -- closing -------------------------------------------------------------------------------------------------------- */

PUBLIC int close(int file)
{
    return forget_timer_file(file) ? (int)answer(RAW_1(SYS_close, file)) : fail_with(EBADF);
}

PUBLIC int close_range(unsigned first, unsigned last, int flags)
{
    unsigned file = first;
    while (!flags && file <= last && file < LIBRARY_FILES_UP_TO)
        close((int)file++);
    return file > first && file > last ? 0 : (int)answer(RAW_3(SYS_close_range, file, last, flags));
}

PUBLIC void closefrom(int first)
{
    close_range(first < 0 ? 0 : (unsigned)first, UINT_MAX, 0);
}
