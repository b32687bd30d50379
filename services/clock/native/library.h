/* What the files of the preloaded library share: the thread's slot, its waits, queues, timers and the real functions.
 *
 * A thread that would wait enters its wait in its slot and passes the gate only when the agent grants it (time_page.h). Its own waits and
 * reads are raw system calls, as each function of libc may be one of ours.
 */
#ifndef DODO_TIME_LIBRARY_H
#define DODO_TIME_LIBRARY_H

#include "time_page.h"

#include <errno.h>
#include <limits.h>
#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <signal.h>
#include <spawn.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <time.h>
#include <unistd.h>

#define PUBLIC __attribute__((visibility("default")))
#define ALIAS(name, of) PUBLIC __typeof__(of) name __attribute__((alias(#of)))
#define NANOSECONDS INT64_C(1000000000)

enum { MOST_SPINS = 1000, MOST_START_SPINS = 1000000, SPIN_SLEEP_NS = 1000000, LIBRARY_FILES_FROM = 900, INTERRUPTION = 63 /* a signal of ours */ };

/* Functions of libc that are wrapped here and called there. */
#define REAL_FUNCTIONS(X)                                                                                              \
    X(clone) X(fopen) X(fork) X(fexecve) X(execve) X(execvpe) X(pclose) X(posix_spawn) X(posix_spawnp)               \
    X(pthread_barrier_wait) X(pthread_create) X(pthread_join) X(pthread_mutex_lock) X(pthread_mutex_trylock)           \
    X(pthread_mutex_unlock) X(pthread_once) X(pthread_rwlock_tryrdlock) X(pthread_rwlock_trywrlock)                    \
    X(pthread_rwlock_unlock) X(pthread_spin_trylock) X(pthread_tryjoin_np) X(sem_post) X(sem_trywait)                  \
    X(sigaction) X(system)

struct real_functions {
#define X(name) __typeof__(&name) name;
    REAL_FUNCTIONS(X)
#undef X
};
extern struct real_functions real;

/* This thread. */
struct self {
    struct time_slot *slot;
    bool has_ended, is_restarting; /* `is_restarting`: the handler that interrupted its last wait has SA_RESTART */
    unsigned spins, endings;
    int64_t spin_ns; /* when it spun */
    uint64_t drawn;  /* random numbers so far */
};
extern __thread struct self self __attribute__((tls_model("initial-exec")));
extern struct time_page *page;

/* Which process of which service this is, how many threads it has had, where the page lies and the library. */
struct process {
    _Atomic uint32_t threads;
    uint32_t service, number;
    char folder[256], library[PATH_MAX];
};
extern struct process process;

/* -- preload.c ------------------------------------------------------------------------------------------------------ */

/* Whether this thread has a slot, after making sure of it: false while the library begins and when a thread ends. */
bool is_managed(void);
bool is_starting(void);
void enter(uint32_t kind, int64_t deadline_ns);
/* Until the agent grants this thread: 0, or EINTR if a signal's handler ran meanwhile. */
int pass_gate(void);
/* As `pass_gate`, for a thread that the kernel woke. */
int pass_gate_as_ready(void);
/* Around a wait that the kernel ends. */
void enter_kernel(void);
void leave_kernel(void);
void begin_as_ready(void);
void announce(void);
void note(uint32_t kind, const char *name);
unsigned own_index(void);
/* A slot for a thread of this or of a new process; TIME_SLOTS when all are taken. */
unsigned take_slot(uint32_t process, uint32_t thread);
void adopt_slot(unsigned at);
void release_slot(void);
uint32_t next_process_number(void);
void before_fork(void);
void in_forked_child(void);
void forget_child(void); /* none was made */
void block_signals(uint64_t *before);
void restore_signals(const uint64_t *before);
/* A lock for a moment, which no signal's handler of its holder can want. */
void take_lock(_Atomic uint32_t *lock, uint64_t *signals);
void give_lock(_Atomic uint32_t *lock, const uint64_t *signals);

/* -- time.c --------------------------------------------------------------------------------------------------------- */

int64_t later(int64_t from_ns, int64_t by_ns); /* their sum, TIME_NEVER at most */
int64_t nanoseconds(const struct timespec *given);
bool is_valid(const struct timespec *given);
struct timespec timespec_of(int64_t ns);
/* The deadline of an absolute time on a clock. */
int64_t deadline_on(clockid_t clock, const struct timespec *given);
/* 0 at the deadline, or EINTR. */
int sleep_until(int64_t deadline_ns);
/* Counts what a spinning thread does; the thousandth in a row sleeps a millisecond. */
void count_spin(void);

/* -- wait.c --------------------------------------------------------------------------------------------------------- */

void queue_join(const void *address, bool is_shared, uint32_t bits);
bool queue_leave(void);
int queue_wait(uint32_t kind, int64_t deadline_ns, bool is_interruptible);
int queue_wake(const void *address, bool is_shared, int most, uint32_t bits);
void queues_after_fork(void);
long virtual_futex(uint32_t *word, int operation, uint32_t value, const struct timespec *timeout, uint32_t bits);
int lock_mutex(pthread_mutex_t *mutex, int64_t deadline_ns);
int unlock_mutex(pthread_mutex_t *mutex);

/* -- files.c -------------------------------------------------------------------------------------------------------- */

/* `files` has room for one more. 0, or EINTR; nothing may be ready yet. */
int wait_for_files(struct pollfd *files, unsigned count, int64_t deadline_ns, const sigset_t *mask);
int await_file(int file, short events, int64_t deadline_ns);
void files_after_fork(void);

/* -- timers.c ------------------------------------------------------------------------------------------------------- */

/* Interrupts this thread's kernel wait at the deadline, unless `interrupt_end` comes before. */
int interrupt_at(int64_t deadline_ns);
void interrupt_end(int timer);
void timers_after_fork(void);
/* Before the application closes a descriptor: false if it is ours. */
bool forget_timer_file(int file);

/* -- signals.c, process.c, random.c --------------------------------------------------------------------------------- */

void processes_start(void);
void processes_after_fork(void);
void add_child(int pid);
/* A system call that makes a process. */
long fork_by(long number, const long *arguments);
void draw(void *bytes, size_t size);
bool is_random_file(int file);

/* -- raw system calls: -errno, or the result ------------------------------------------------------------------------ */

static inline long raw(long number, long a, long b, long c, long d, long e, long f)
{
#if defined(__x86_64__)
    long result;
    register long r10 __asm__("r10") = d;
    register long r8 __asm__("r8") = e;
    register long r9 __asm__("r9") = f;
    __asm__ volatile("syscall"
                     : "=a"(result)
                     : "a"(number), "D"(a), "S"(b), "d"(c), "r"(r10), "r"(r8), "r"(r9)
                     : "rcx", "r11", "memory");
    return result;
#elif defined(__aarch64__)
    register long x8 __asm__("x8") = number;
    register long x0 __asm__("x0") = a;
    register long x1 __asm__("x1") = b;
    register long x2 __asm__("x2") = c;
    register long x3 __asm__("x3") = d;
    register long x4 __asm__("x4") = e;
    register long x5 __asm__("x5") = f;
    __asm__ volatile("svc 0" : "+r"(x0) : "r"(x8), "r"(x1), "r"(x2), "r"(x3), "r"(x4), "r"(x5) : "memory", "cc");
    return x0;
#else
#error "the test's time works on amd64 and arm64"
#endif
}

#define RAW_1(n, a) raw(n, (long)(a), 0, 0, 0, 0, 0)
#define RAW_2(n, a, b) raw(n, (long)(a), (long)(b), 0, 0, 0, 0)
#define RAW_3(n, a, b, c) raw(n, (long)(a), (long)(b), (long)(c), 0, 0, 0)
#define RAW_4(n, a, b, c, d) raw(n, (long)(a), (long)(b), (long)(c), (long)(d), 0, 0)
#define RAW_6(n, a, b, c, d, e, f) raw(n, (long)(a), (long)(b), (long)(c), (long)(d), (long)(e), (long)(f))

/* A function that _FORTIFY_SOURCE puts in the place of another, with the size of what it writes. */
#define CHECKED(type, name, is_too_long, call, ...)                                                                    \
    PUBLIC type name(__VA_ARGS__)                                                                                      \
    {                                                                                                                  \
        if (is_too_long)                                                                                               \
            abort();                                                                                                   \
        return call;                                                                                                   \
    }

/* As functions of libc answer: -1 and errno. */
static inline long answer(long result)
{
    if (result >= 0 || result < -4095)
        return result;
    errno = (int)-result;
    return -1;
}

static inline int fail_with(int error)
{
    errno = error;
    return -1;
}

/* What glibc and musl have in different places, and what only one of them has: the library, compiled with glibc, runs in programs of both.
 * musl takes libc.so.6 for itself and looks at no versions, so it is enough to need no function that it lacks. */
extern const char *gnu_get_libc_version(void) __attribute__((weak));

static inline int word_of(const void *object, unsigned in_glibc, unsigned in_musl)
{
    return __atomic_load_n((const int *)object + (gnu_get_libc_version ? in_glibc : in_musl), __ATOMIC_RELAXED);
}

static inline int64_t now_ns(void)
{
    return atomic_load_explicit(&page->now_ns, memory_order_acquire);
}

#endif
