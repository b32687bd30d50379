/* Signals: a handler that interrupts a thread's wait runs when the agent grants the thread, as everything else.
 *
 * For this each handler of the application is called by one of ours.
 */
#define _GNU_SOURCE
#include "library.h"

#include <string.h>
#include <sys/signalfd.h>

static struct sigaction handlers[NSIG];

static void handle(int number, siginfo_t *about, void *context)
{
    struct sigaction *wanted = &handlers[number];
    void (*handler)(int, siginfo_t *, void *) = wanted->sa_sigaction;
    int flags = wanted->sa_flags, error = errno;
    if (self.slot && self.slot->state != TIME_RUNNING)
        pass_gate_as_ready();
    if (flags & SA_RESETHAND)
        *wanted = (struct sigaction){.sa_handler = SIG_DFL};
    handler(number, about, context);
    self.is_restarting = flags & SA_RESTART;
    errno = error;
}

static bool is_handler(const struct sigaction *wanted)
{
    return wanted->sa_handler != SIG_DFL && wanted->sa_handler != SIG_IGN;
}

PUBLIC int sigaction(int number, const struct sigaction *restrict wanted, struct sigaction *restrict before)
{
    is_managed(); /* finds the real functions */
    if (number <= 0 || number >= NSIG)
        return fail_with(EINVAL);
    struct sigaction own, found, known = handlers[number];
    if (wanted) {
        own = *wanted;
        if (is_handler(wanted)) {
            handlers[number] = *wanted;
            own.sa_sigaction = handle;
            own.sa_flags |= SA_SIGINFO;
        }
    }
    if (real.sigaction(number, wanted ? &own : NULL, &found)) {
        handlers[number] = known;
        return -1;
    }
    if (before) {
        *before = found;
        if (found.sa_sigaction == handle) {
            before->sa_sigaction = known.sa_sigaction;
            before->sa_flags = known.sa_flags;
        }
    }
    return 0;
}

PUBLIC sighandler_t signal(int number, sighandler_t handler)
{
    struct sigaction wanted = {.sa_handler = handler, .sa_flags = SA_RESTART}, before;
    sigemptyset(&wanted.sa_mask);
    return sigaction(number, &wanted, &before) ? SIG_ERR : before.sa_handler;
}

/* -- waits for signals ---------------------------------------------------------------------------------------------- */

PUBLIC int pause(void)
{
    enter_kernel();
    uint64_t mask;
    RAW_4(SYS_rt_sigprocmask, SIG_SETMASK, NULL, &mask, sizeof mask);
    long result = RAW_2(SYS_rt_sigsuspend, &mask, sizeof mask);
    leave_kernel();
    return (int)answer(result);
}

PUBLIC int sigsuspend(const sigset_t *mask)
{
    enter_kernel();
    long result = RAW_2(SYS_rt_sigsuspend, mask, 8);
    leave_kernel();
    return (int)answer(result);
}

PUBLIC int sigtimedwait(const sigset_t *restrict wanted, siginfo_t *restrict about,
                        const struct timespec *restrict timeout)
{
    struct timespec none = {0, 0};
    if (timeout && !is_valid(timeout))
        return fail_with(EINVAL);
    int64_t deadline = timeout && is_managed() ? later(now_ns(), nanoseconds(timeout)) : TIME_NEVER;
    int file = (int)RAW_4(SYS_signalfd4, -1, wanted, 8, SFD_CLOEXEC), error = file < 0 ? -file : 0;
    long result;
    while ((result = RAW_4(SYS_rt_sigtimedwait, wanted, about, &none, 8)) == -EAGAIN && !error)
        error = await_file(file, POLLIN, deadline);
    RAW_1(SYS_close, file);
    return (int)answer(result == -EAGAIN && error != ETIMEDOUT ? -error : result);
}

PUBLIC int sigwaitinfo(const sigset_t *restrict wanted, siginfo_t *restrict about)
{
    return sigtimedwait(wanted, about, NULL);
}

PUBLIC int sigwait(const sigset_t *restrict wanted, int *restrict number)
{
    int found;
    do
        found = sigtimedwait(wanted, NULL, NULL);
    while (found < 0 && errno == EINTR);
    if (found < 0)
        return errno;
    *number = found;
    return 0;
}
