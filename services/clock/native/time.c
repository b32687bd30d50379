/* Clocks and sleeps: the time of the test, which stands still while anything of the application runs. */
#define _GNU_SOURCE
#include "library.h"

#include <string.h>
#include <sys/prctl.h>
#include <sys/time.h>
#include <sys/times.h>

int64_t later(int64_t from_ns, int64_t by_ns)
{
    int64_t sum;
    return __builtin_add_overflow(from_ns, by_ns, &sum) ? (by_ns < 0 ? INT64_MIN : TIME_NEVER) : sum;
}

int64_t nanoseconds(const struct timespec *given)
{
    if (given->tv_sec > TIME_NEVER / NANOSECONDS - 1)
        return TIME_NEVER;
    if (given->tv_sec < 0)
        return -1;
    return given->tv_sec * NANOSECONDS + given->tv_nsec;
}

bool is_valid(const struct timespec *given)
{
    return given->tv_nsec >= 0 && given->tv_nsec < NANOSECONDS;
}

struct timespec timespec_of(int64_t ns)
{
    if (ns < 0)
        ns = 0;
    return (struct timespec){ns / NANOSECONDS, ns % NANOSECONDS};
}

static bool is_monotonic(clockid_t clock)
{
    return clock == CLOCK_MONOTONIC || clock == CLOCK_MONOTONIC_RAW || clock == CLOCK_MONOTONIC_COARSE
           || clock == CLOCK_BOOTTIME || clock == CLOCK_BOOTTIME_ALARM;
}

static bool is_of_the_day(clockid_t clock)
{
    return clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE || clock == CLOCK_REALTIME_ALARM
           || clock == CLOCK_TAI;
}

int64_t deadline_on(clockid_t clock, const struct timespec *given)
{
    int64_t at = nanoseconds(given);
    return is_monotonic(clock) && at != TIME_NEVER ? later(at, page->monotonic_base_ns) : at;
}

/* While libraries are loaded, they look at the clock often. Who yields to another thread has to let that go on. */
static void spin(bool yields)
{
    static _Atomic bool is_noted;
    int64_t now = now_ns(), start = page->monotonic_base_ns + START_UPTIME_S * NANOSECONDS;
    unsigned most = now == start && !(yields && process.threads > 1) ? MOST_START_SPINS : MOST_SPINS;
    if (self.spin_ns != now) {
        self.spin_ns = now;
        self.spins = 0;
    }
    if (++self.spins <= most)
        return;
    char name[16] = "";
    RAW_2(SYS_prctl, PR_GET_NAME, name); /* threads get theirs after their slot */
    bool is_of_dds = !strcmp(name, "dds.ev.0"); /* of Fast DDS, which looks at the clock until an event is past */
    if (!is_of_dds && !atomic_exchange(&is_noted, true))
        note(TIME_NOTE_SPIN, name);
    self.spins = 0;
    sleep_until(later(now, SPIN_SLEEP_NS));
}

void count_spin(void)
{
    if (is_managed())
        spin(false);
}

int sleep_until(int64_t deadline_ns)
{
    do {
        enter(TIME_SLEEP, deadline_ns);
        if (pass_gate() == EINTR && now_ns() < deadline_ns)
            return EINTR;
    } while (now_ns() < deadline_ns);
    return 0;
}

/* -- clocks --------------------------------------------------------------------------------------------------------- */

PUBLIC int clock_gettime(clockid_t clock, struct timespec *result)
{
    bool monotonic = is_monotonic(clock);
    if ((!monotonic && !is_of_the_day(clock)) || !is_managed())
        return (int)answer(RAW_2(SYS_clock_gettime, clock, result));
    count_spin();
    int64_t ns = now_ns() - (monotonic ? page->monotonic_base_ns : 0);
    *result = (struct timespec){ns / NANOSECONDS, ns % NANOSECONDS};
    return 0;
}

PUBLIC int gettimeofday(struct timeval *restrict result, void *restrict zone)
{
    struct timespec now;
    if (zone)
        *(struct timezone *)zone = (struct timezone){0, 0};
    clock_gettime(CLOCK_REALTIME, &now);
    *result = (struct timeval){now.tv_sec, now.tv_nsec / 1000};
    return 0;
}

PUBLIC time_t time(time_t *result)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (result)
        *result = now.tv_sec;
    return now.tv_sec;
}

PUBLIC int timespec_get(struct timespec *result, int base)
{
    return base == TIME_UTC && !clock_gettime(CLOCK_REALTIME, result) ? base : 0;
}

PUBLIC clock_t times(struct tms *result)
{
    long ticks = answer(RAW_1(SYS_times, result));
    if (ticks == -1 || !is_managed())
        return ticks;
    return (now_ns() - page->monotonic_base_ns) / (NANOSECONDS / sysconf(_SC_CLK_TCK));
}

/* -- sleeps --------------------------------------------------------------------------------------------------------- */

PUBLIC int clock_nanosleep(clockid_t clock, int flags, const struct timespec *wanted, struct timespec *left)
{
    if ((!is_monotonic(clock) && !is_of_the_day(clock)) || !is_managed())
        return (int)-RAW_4(SYS_clock_nanosleep, clock, flags, wanted, left);
    if (!is_valid(wanted) || wanted->tv_sec < 0)
        return EINVAL;
    bool is_absolute = flags & TIMER_ABSTIME;
    int64_t deadline = is_absolute ? deadline_on(clock, wanted) : later(now_ns(), nanoseconds(wanted));
    if (deadline <= now_ns())
        count_spin();
    int error = sleep_until(deadline);
    if (error && left && !is_absolute)
        *left = timespec_of(deadline - now_ns());
    return error;
}

PUBLIC int nanosleep(const struct timespec *wanted, struct timespec *left)
{
    int error = clock_nanosleep(CLOCK_MONOTONIC, 0, wanted, left);
    return error ? fail_with(error) : 0;
}

PUBLIC int usleep(useconds_t microseconds)
{
    struct timespec wanted = timespec_of(microseconds * INT64_C(1000));
    return nanosleep(&wanted, NULL);
}

PUBLIC unsigned sleep(unsigned seconds)
{
    struct timespec wanted = {seconds, 0}, left = {0, 0};
    int error = errno;
    if (!nanosleep(&wanted, &left))
        return 0;
    errno = error;
    return (unsigned)left.tv_sec + (left.tv_nsec > 0);
}

PUBLIC int sched_yield(void)
{
    if (!is_managed())
        return (int)answer(RAW_1(SYS_sched_yield, 0));
    spin(true); /* no other thread may run meanwhile */
    return 0;
}
