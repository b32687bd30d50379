/* Timers: one thread of ours a process, made with the first timer, sleeps until the next and does what it is for.
 *
 * A timerfd is an eventfd here, which this thread writes: both count, are read and polled alike.
 */
#define _GNU_SOURCE
#include "library.h"

#include <fcntl.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <sys/time.h>
#include <sys/timerfd.h>

enum { MOST_TIMERS = 256, ITIMER = 0, HANDLE = 0x7d0d0 /* what `timer_create` gives: 16 times this and the index */ };
enum use { UNUSED, OF_FILE, OF_SIGNAL, OF_THREAD_SIGNAL, OF_FUNCTION, OF_NOTHING, OF_INTERRUPTION };

struct timer {
    enum use use;
    clockid_t clock;
    int64_t deadline_ns, interval_ns; /* TIME_NEVER while it is not set; 0 without one */
    int file, kept_file;              /* the descriptor as the application knows it, and ours */
    int signal, thread, overruns;
    union sigval value;
    void (*function)(union sigval);
};

static struct timer timers[MOST_TIMERS];
static _Atomic uint32_t timers_lock;
static struct time_slot *_Atomic keeper;
static bool has_keeper;

void timers_after_fork(void)
{
    timers_lock = 0;
    has_keeper = false;
    keeper = NULL;
    for (int at = 0; at < MOST_TIMERS; at++) {
        timers[at].deadline_ns = TIME_NEVER;
        if (timers[at].use != OF_FILE)
            timers[at].use = UNUSED;
    }
}

/* -- the thread ----------------------------------------------------------------------------------------------------- */

static int64_t earliest(void)
{
    int64_t found = TIME_NEVER;
    for (int at = 0; at < MOST_TIMERS; at++)
        if (timers[at].use != UNUSED && timers[at].deadline_ns < found)
            found = timers[at].deadline_ns;
    return found;
}

struct call {
    void (*function)(union sigval);
    union sigval value;
};

static void *call_function(void *given)
{
    struct call call = *(struct call *)given;
    free(given);
    call.function(call.value);
    return NULL;
}

static void start_function(const struct timer *timer)
{
    pthread_t thread;
    struct call *call = malloc(sizeof *call);
    if (!call)
        return;
    *call = (struct call){timer->function, timer->value};
    if (pthread_create(&thread, NULL, call_function, call))
        free(call);
    else
        pthread_detach(thread);
}

static void send_signal(const struct timer *timer)
{
    siginfo_t about = {.si_signo = timer->signal, .si_code = SI_TIMER};
    about.si_value = timer->value;
    long pid = RAW_1(SYS_getpid, 0);
    if (timer == &timers[ITIMER])
        RAW_2(SYS_kill, pid, SIGALRM);
    else if (timer->use == OF_THREAD_SIGNAL)
        RAW_4(SYS_rt_tgsigqueueinfo, pid, timer->thread, timer->signal, &about);
    else
        RAW_3(SYS_rt_sigqueueinfo, pid, timer->signal, &about);
}

static void fire(const struct timer *timer)
{
    uint64_t once = 1;
    if (timer->use == OF_FILE)
        RAW_3(SYS_write, timer->kept_file, &once, sizeof once);
    else if (timer->use == OF_FUNCTION)
        start_function(timer);
    else if (timer->use == OF_INTERRUPTION)
        RAW_3(SYS_tgkill, RAW_1(SYS_getpid, 0), timer->thread, INTERRUPTION);
    else if (timer->use != OF_NOTHING)
        send_signal(timer);
}

static void fire_what_is_due(void)
{
    uint64_t signals;
    for (int at = 0; at < MOST_TIMERS; at++) {
        struct timer *timer = &timers[at], copy = {0};
        take_lock(&timers_lock, &signals);
        if (timer->use != UNUSED && timer->deadline_ns <= now_ns()) {
            copy = *timer;
            timer->deadline_ns = timer->interval_ns ? later(timer->deadline_ns, timer->interval_ns) : TIME_NEVER;
        }
        give_lock(&timers_lock, &signals);
        if (copy.use != UNUSED)
            fire(timer == &timers[ITIMER] ? timer : &copy);
    }
}

static void *keep_timers(void *unused)
{
    (void)unused;
    RAW_2(SYS_prctl, PR_SET_NAME, "dodo-timers");
    keeper = self.slot;
    while (self.slot) {
        enter(TIME_SLEEP, earliest());
        pass_gate();
        fire_what_is_due();
    }
    return NULL;
}

/* Behind each change of a timer. */
static void look_again(void)
{
    if (keeper && keeper->state == TIME_WAITING)
        keeper->deadline_ns = earliest();
    if (has_keeper)
        return;
    pthread_t thread;
    uint64_t signals;
    has_keeper = true;
    block_signals(&signals); /* the thread has them blocked, too */
    if (!pthread_create(&thread, NULL, keep_timers, NULL))
        pthread_detach(thread);
    restore_signals(&signals);
}

/* -- setting a timer ------------------------------------------------------------------------------------------------ */

static struct timer *new_timer(enum use use, clockid_t clock)
{
    uint64_t signals;
    struct timer *found = NULL;
    take_lock(&timers_lock, &signals);
    for (int at = ITIMER + 1; at < MOST_TIMERS && !found; at++)
        if (timers[at].use == UNUSED) {
            found = &timers[at];
            *found = (struct timer){.use = use, .clock = clock, .deadline_ns = TIME_NEVER};
        }
    give_lock(&timers_lock, &signals);
    return found;
}

static void free_timer(struct timer *timer)
{
    if (timer->use == OF_FILE)
        RAW_1(SYS_close, timer->kept_file);
    timer->use = UNUSED;
}

static struct itimerspec left_of(const struct timer *timer)
{
    struct itimerspec left = {timespec_of(timer->interval_ns), {0, 0}};
    if (timer->deadline_ns != TIME_NEVER)
        left.it_value = timespec_of(timer->deadline_ns > now_ns() ? timer->deadline_ns - now_ns() : 1);
    return left;
}

static int set_timer(struct timer *timer, bool is_absolute, const struct itimerspec *wanted, struct itimerspec *before)
{
    if (!is_valid(&wanted->it_value) || !is_valid(&wanted->it_interval))
        return fail_with(EINVAL);
    struct itimerspec kept = left_of(timer);
    int64_t value = nanoseconds(&wanted->it_value);
    timer->interval_ns = nanoseconds(&wanted->it_interval);
    if (!value)
        timer->deadline_ns = TIME_NEVER;
    else
        timer->deadline_ns = is_absolute ? deadline_on(timer->clock, &wanted->it_value) : later(now_ns(), value);
    look_again();
    if (before)
        *before = kept;
    return 0;
}

/* -- timerfd -------------------------------------------------------------------------------------------------------- */

static struct timer *timer_of_file(int file)
{
    for (int at = 0; at < MOST_TIMERS; at++)
        if (timers[at].use == OF_FILE && timers[at].file == file)
            return &timers[at];
    return NULL;
}

bool forget_timer_file(int file)
{
    struct timer *timer = timer_of_file(file);
    if (timer)
        free_timer(timer);
    for (int at = 0; at < MOST_TIMERS; at++)
        if (timers[at].use == OF_FILE && timers[at].kept_file == file)
            return false;
    return true;
}

PUBLIC int timerfd_create(clockid_t clock, int flags)
{
    if (!is_managed())
        return (int)answer(RAW_2(SYS_timerfd_create, clock, flags));
    if (flags & ~(TFD_CLOEXEC | TFD_NONBLOCK))
        return fail_with(EINVAL);
    int file = (int)answer(RAW_2(SYS_eventfd2, 0, flags));
    forget_timer_file(file); /* that libc has closed without a word */
    struct timer *timer = file < 0 ? NULL : new_timer(OF_FILE, clock);
    if (!timer) {
        if (file >= 0)
            RAW_1(SYS_close, file);
        return file < 0 ? -1 : fail_with(ENFILE);
    }
    timer->file = file;
    timer->kept_file = (int)RAW_3(SYS_fcntl, file, F_DUPFD_CLOEXEC, LIBRARY_FILES_FROM);
    return file;
}

PUBLIC int timerfd_settime(int file, int flags, const struct itimerspec *wanted, struct itimerspec *before)
{
    struct timer *timer = timer_of_file(file);
    uint64_t count;
    if (!timer)
        return (int)answer(RAW_4(SYS_timerfd_settime, file, flags, wanted, before));
    int is_counted = poll(&(struct pollfd){.fd = file, .events = POLLIN}, 1, 0);
    if (is_counted > 0)
        RAW_3(SYS_read, file, &count, sizeof count);
    return set_timer(timer, flags & TFD_TIMER_ABSTIME, wanted, before);
}

PUBLIC int timerfd_gettime(int file, struct itimerspec *left)
{
    struct timer *timer = timer_of_file(file);
    if (!timer)
        return (int)answer(RAW_2(SYS_timerfd_gettime, file, left));
    *left = left_of(timer);
    return 0;
}

/* -- setitimer and alarm -------------------------------------------------------------------------------------------- */

PUBLIC int setitimer(__itimer_which_t which, const struct itimerval *restrict wanted,
                     struct itimerval *restrict before)
{
    if (which != ITIMER_REAL || !is_managed())
        return (int)answer(RAW_3(SYS_setitimer, which, wanted, before));
    struct timer *timer = &timers[ITIMER];
    if (timer->use == UNUSED)
        *timer = (struct timer){.use = OF_SIGNAL, .clock = CLOCK_MONOTONIC, .deadline_ns = TIME_NEVER, .signal = SIGALRM};
    struct itimerspec in_ns = {{0, 0}, {0, 0}}, kept;
    if (wanted)
        in_ns = (struct itimerspec){{wanted->it_interval.tv_sec, wanted->it_interval.tv_usec * 1000},
                                    {wanted->it_value.tv_sec, wanted->it_value.tv_usec * 1000}};
    if (set_timer(timer, false, &in_ns, &kept))
        return -1;
    if (before)
        *before = (struct itimerval){{kept.it_interval.tv_sec, kept.it_interval.tv_nsec / 1000},
                                     {kept.it_value.tv_sec, kept.it_value.tv_nsec / 1000}};
    return 0;
}

PUBLIC unsigned alarm(unsigned seconds)
{
    struct itimerval wanted = {{0, 0}, {seconds, 0}}, before = {{0, 0}, {0, 0}};
    setitimer(ITIMER_REAL, &wanted, &before);
    unsigned left = (unsigned)before.it_value.tv_sec;
    return before.it_value.tv_usec >= 500000 || (!left && before.it_value.tv_usec) ? left + 1 : left;
}

/* -- timer_create --------------------------------------------------------------------------------------------------- */

static struct timer *timer_of(timer_t handle)
{
    uintptr_t number = (uintptr_t)handle;
    if (number / MOST_TIMERS != HANDLE || timers[number % MOST_TIMERS].use == UNUSED)
        return NULL;
    return &timers[number % MOST_TIMERS];
}

PUBLIC int timer_create(clockid_t clock, struct sigevent *restrict event, timer_t *restrict handle)
{
    if (!is_managed() || clock == CLOCK_PROCESS_CPUTIME_ID || clock == CLOCK_THREAD_CPUTIME_ID)
        return fail_with(EINVAL); /* of processor time there is none here */
    static const enum use uses[] = {
        [SIGEV_SIGNAL] = OF_SIGNAL, [SIGEV_NONE] = OF_NOTHING, [SIGEV_THREAD] = OF_FUNCTION, [SIGEV_THREAD_ID] = OF_THREAD_SIGNAL};
    int notify = event ? event->sigev_notify : SIGEV_SIGNAL;
    if (notify < 0 || notify > SIGEV_THREAD_ID || (notify && uses[notify] == UNUSED))
        return fail_with(EINVAL);
    struct timer *timer = new_timer(uses[notify], clock);
    if (!timer)
        return fail_with(EAGAIN);
    uintptr_t number = (uintptr_t)(timer - timers);
    timer->signal = event ? event->sigev_signo : SIGALRM;
    timer->value = event ? event->sigev_value : (union sigval){.sival_int = (int)number};
    if (notify == SIGEV_THREAD)
        timer->function = event->sigev_notify_function;
    if (notify == SIGEV_THREAD_ID)
        timer->thread = event->_sigev_un._tid;
    *handle = (timer_t)((uintptr_t)HANDLE * MOST_TIMERS + number);
    return 0;
}

PUBLIC int timer_settime(timer_t handle, int flags, const struct itimerspec *restrict wanted,
                         struct itimerspec *restrict before)
{
    struct timer *timer = timer_of(handle);
    return timer ? set_timer(timer, flags & TIMER_ABSTIME, wanted, before) : fail_with(EINVAL);
}

PUBLIC int timer_gettime(timer_t handle, struct itimerspec *left)
{
    struct timer *timer = timer_of(handle);
    if (!timer)
        return fail_with(EINVAL);
    *left = left_of(timer);
    return 0;
}

PUBLIC int timer_getoverrun(timer_t handle)
{
    return timer_of(handle) ? 0 : fail_with(EINVAL);
}

PUBLIC int timer_delete(timer_t handle)
{
    struct timer *timer = timer_of(handle);
    if (!timer)
        return fail_with(EINVAL);
    free_timer(timer);
    return 0;
}

/* -- the end of a wait in the kernel -------------------------------------------------------------------------------- */

static void do_nothing(int number)
{
    (void)number;
}

int interrupt_at(int64_t deadline_ns)
{
    struct sigaction wanted = {.sa_handler = do_nothing};
    uint64_t own = UINT64_C(1) << (INTERRUPTION - 1);
    struct timer *timer = deadline_ns == TIME_NEVER || !is_managed() ? NULL : new_timer(OF_INTERRUPTION, CLOCK_REALTIME);
    if (!timer)
        return -1;
    real.sigaction(INTERRUPTION, &wanted, NULL);
    RAW_4(SYS_rt_sigprocmask, SIG_UNBLOCK, &own, NULL, sizeof own);
    timer->thread = (int)RAW_1(SYS_gettid, 0);
    timer->deadline_ns = deadline_ns;
    look_again();
    return (int)(timer - timers);
}

void interrupt_end(int timer)
{
    if (timer >= 0)
        free_timer(&timers[timer]);
}
