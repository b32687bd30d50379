/* System calls that libstdc++, Python and others make by syscall(). */
#define _GNU_SOURCE
#include "library.h"

#include <linux/futex.h>
#include <mqueue.h>
#include <stdarg.h>
#include <sys/epoll.h>
#include <sys/random.h>
#include <sys/select.h>
#include <sys/sem.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/timerfd.h>

static bool is_ours(int futex_operation)
{
    int command = futex_operation & FUTEX_CMD_MASK;
    return command == FUTEX_WAIT || command == FUTEX_WAIT_BITSET || command == FUTEX_WAKE || command == FUTEX_WAKE_BITSET;
}

#define P(at) ((void *)a[at])
#define AS(name, ...) case SYS_##name: return name(__VA_ARGS__);

PUBLIC long syscall(long number, ...)
{
    long a[6];
    va_list arguments;
    va_start(arguments, number);
    for (int at = 0; at < 6; at++)
        a[at] = va_arg(arguments, long);
    va_end(arguments);
    if (!is_managed())
        return answer(RAW_6(number, a[0], a[1], a[2], a[3], a[4], a[5]));
    switch (number) {
        AS(clock_gettime, a[0], P(1))
        AS(gettimeofday, P(0), P(1))
        AS(nanosleep, P(0), P(1))
        AS(getrandom, P(0), a[1], a[2])
        AS(sched_yield)
        AS(ppoll, P(0), a[1], P(2), P(3))
        AS(epoll_pwait, a[0], P(1), a[2], a[3], P(4))
        AS(epoll_pwait2, a[0], P(1), a[2], P(3), P(4))
        AS(read, a[0], P(1), a[2])
        AS(recvfrom, a[0], P(1), a[2], a[3], P(4), P(5))
        AS(recvmsg, a[0], P(1), a[2])
        AS(recvmmsg, a[0], P(1), a[2], a[3], P(4))
        AS(semtimedop, a[0], P(1), a[2], P(3))
        AS(mq_timedreceive, a[0], P(1), a[2], P(3), P(4))
        AS(mq_timedsend, a[0], P(1), a[2], a[3], P(4))
        AS(timerfd_create, a[0], a[1])
        AS(timerfd_settime, a[0], a[1], P(2), P(3))
        AS(timerfd_gettime, a[0], P(1))
#ifdef __x86_64__
        AS(time, P(0))
        AS(poll, P(0), a[1], a[2])
        AS(select, a[0], P(1), P(2), P(3), P(4))
        AS(epoll_wait, a[0], P(1), a[2], a[3])
#endif
    case SYS_pselect6:
        return pselect((int)a[0], P(1), P(2), P(3), P(4), a[5] ? *(const sigset_t **)P(5) : NULL);
    case SYS_rt_sigtimedwait:
        return sigtimedwait(P(0), P(1), P(2));
    case SYS_clock_nanosleep: {
        int error = clock_nanosleep((clockid_t)a[0], (int)a[1], P(2), P(3));
        return error ? fail_with(error) : 0;
    }
    case SYS_clone:
    case SYS_clone3:
#ifdef __x86_64__
    case SYS_fork:
    case SYS_vfork:
#endif
        return answer(fork_by(number, a));
    case 449: /* futex_waitv: programs then wait for one word each */
    case SYS_io_uring_setup: /* or for files otherwise */
        return fail_with(ENOSYS);
    case SYS_futex:
        if (is_ours((int)a[1]))
            return answer(virtual_futex(P(0), (int)a[1], (uint32_t)a[2], P(3), (uint32_t)a[5]));
        break;
    default:
        break;
    }
    return answer(RAW_6(number, a[0], a[1], a[2], a[3], a[4], a[5]));
}
