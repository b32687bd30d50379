/* Threads and processes: each begins, forks and ends with its own slot. */
#define _GNU_SOURCE
#include "library.h"

#include <linux/sched.h>
#include <stdarg.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/sem.h>
#include <sys/wait.h>

#ifndef SYS_pidfd_open
#define SYS_pidfd_open 434
#endif

enum { MOST_CHILDREN = 128, RETRY_NS = 1000000, LOOK_AGAIN_NS = 100000000 };

static pthread_key_t at_end;

/* glibc's and musl's. */
extern int __register_atfork(void (*)(void), void (*)(void), void (*)(void), void *) __attribute__((weak));
extern int pthread_atfork(void (*)(void), void (*)(void), void (*)(void)) __attribute__((weak));

/* The last of the destructors that a thread has. */
static void end_thread(void *value)
{
    if (++self.endings < PTHREAD_DESTRUCTOR_ITERATIONS)
        pthread_setspecific(at_end, value);
    else
        release_slot();
}

void processes_start(void)
{
    pthread_key_create(&at_end, end_thread);
    if (__register_atfork)
        __register_atfork(before_fork, NULL, in_forked_child, NULL);
    else if (pthread_atfork)
        pthread_atfork(before_fork, NULL, in_forked_child);
}

/* -- threads -------------------------------------------------------------------------------------------------------- */

struct beginning {
    void *(*routine)(void *);
    void *argument;
    unsigned slot;
};

static void *begin(void *given)
{
    struct beginning beginning = *(struct beginning *)given;
    free(given);
    adopt_slot(beginning.slot);
    pthread_setspecific(at_end, &at_end);
    begin_as_ready();
    return beginning.routine(beginning.argument);
}

PUBLIC int pthread_create(pthread_t *restrict thread, const pthread_attr_t *restrict attributes,
                          void *(*routine)(void *), void *restrict argument)
{
    if (!is_managed())
        return real.pthread_create(thread, attributes, routine, argument);
    struct beginning *beginning = malloc(sizeof *beginning);
    if (!beginning)
        return EAGAIN;
    unsigned slot = take_slot(process.number, process.threads++);
    *beginning = (struct beginning){routine, argument, slot};
    int error = real.pthread_create(thread, attributes, begin, beginning);
    if (error) {
        free(beginning);
        if (slot != TIME_SLOTS)
            page->slot[slot].state = TIME_FREE;
    }
    return error;
}

PUBLIC int pthread_join(pthread_t thread, void **result)
{
    is_managed();
    if (!real.pthread_tryjoin_np(thread, result))
        return 0;
    enter_kernel();
    int error = real.pthread_join(thread, result);
    leave_kernel();
    return error;
}

/* -- processes ------------------------------------------------------------------------------------------------------ */

static _Atomic int children[MOST_CHILDREN];

void add_child(int pid)
{
    for (int at = 0, none = 0; pid > 0 && at < MOST_CHILDREN; at++, none = 0)
        if (atomic_compare_exchange_strong(&children[at], &none, pid))
            return;
}

static void remove_child(int pid)
{
    for (int at = 0; pid > 0 && at < MOST_CHILDREN; at++)
        if (children[at] == pid)
            children[at] = 0;
}

void processes_after_fork(void)
{
    memset(children, 0, sizeof children);
}

static void after_fork(long child)
{
    if (child < 0)
        forget_child();
    add_child((int)child);
}

PUBLIC pid_t fork(void)
{
    is_managed();
    pid_t child = real.fork();
    after_fork(child);
    return child;
}

/* The parent of a vfork waits until the child executes a program; that of a fork need not. */
ALIAS(vfork, fork);

/* Flags of a clone as those of a fork: memory that a waiting parent shares, it need not share. Of threads made so, nothing is known. */
static uint64_t as_fork(uint64_t flags)
{
    if (flags & CLONE_VM && !(flags & CLONE_VFORK))
        note(TIME_NOTE_CLONE, self.slot->name);
    return flags & CLONE_VFORK ? flags & ~(uint64_t)(CLONE_VM | CLONE_VFORK) : flags;
}

struct cloned {
    int (*routine)(void *);
    void *argument;
};

static int begin_cloned(void *given)
{
    struct cloned *cloned = given;
    in_forked_child();
    _exit(cloned->routine(cloned->argument));
}

PUBLIC int clone(int (*routine)(void *), void *stack, int given, void *argument, ...)
{
    va_list more;
    va_start(more, argument);
    void *parent = va_arg(more, void *), *local = va_arg(more, void *), *own = va_arg(more, void *);
    va_end(more);
    int flags = is_managed() ? (int)as_fork((uint32_t)given) : given;
    if (!self.slot || flags & CLONE_VM)
        return real.clone(routine, stack, flags, argument, parent, local, own);
    struct cloned cloned = {routine, argument};
    before_fork();
    int child = real.clone(begin_cloned, stack, flags, &cloned, parent, local, own);
    after_fork(child);
    return child;
}

long fork_by(long number, const long *given)
{
    struct clone_args wanted = {.exit_signal = SIGCHLD};
    long first = given[0], size = given[1];
    if (number == SYS_clone)
        first = (long)as_fork((uint64_t)first);
    if (number == SYS_clone3 && size >= 64 && size <= (long)sizeof wanted) {
        memcpy(&wanted, (void *)first, (size_t)size);
        wanted.flags = as_fork(wanted.flags);
        first = (long)&wanted;
    }
    if ((number == SYS_clone ? (uint64_t)first : wanted.flags) & CLONE_VM)
        return RAW_6(number, first, size, given[2], given[3], given[4], 0);
    before_fork();
    long child = RAW_6(number, first, size, given[2], given[3], given[4], 0);
    if (!child)
        in_forked_child();
    else
        after_fork(child);
    return child;
}

/* Until a child may have ended: 0 or EINTR. In wait4 itself, a thread seems to sleep while it takes the child's status,
 * and the agent would let time go on. */
static int wait_for_child(pid_t wanted)
{
    struct pollfd files[MOST_CHILDREN + 1];
    unsigned count = 0;
    for (int at = 0; at < MOST_CHILDREN; at++) {
        int pid = wanted > 0 ? (at ? 0 : wanted) : children[at];
        long file = pid ? RAW_2(SYS_pidfd_open, pid, 0) : -1;
        if (file >= 0)
            files[count++] = (struct pollfd){.fd = (int)file, .events = POLLIN};
    }
    int error = wait_for_files(files, count, later(now_ns(), count ? LOOK_AGAIN_NS : RETRY_NS), NULL);
    for (unsigned at = 0; at < count; at++)
        RAW_1(SYS_close, files[at].fd);
    return error;
}

PUBLIC pid_t wait4(pid_t pid, int *status, int options, struct rusage *usage)
{
    for (;;) {
        long result = RAW_4(SYS_wait4, pid, status, options | WNOHANG, usage);
        if (result == 0 && is_managed()) {
            if (options & WNOHANG)
                count_spin();
            else if (wait_for_child(pid) != EINTR || self.is_restarting)
                continue;
            else
                return fail_with(EINTR);
        }
        remove_child((int)result);
        return (pid_t)answer(result);
    }
}

PUBLIC pid_t waitpid(pid_t pid, int *status, int options)
{
    return wait4(pid, status, options, NULL);
}

PUBLIC pid_t wait3(int *status, int options, struct rusage *usage)
{
    return wait4(-1, status, options, usage);
}

PUBLIC pid_t wait(int *status)
{
    return wait4(-1, status, 0, NULL);
}

PUBLIC int waitid(idtype_t type, id_t id, siginfo_t *about, int options)
{
    for (;;) {
        siginfo_t found = {0};
        long result = RAW_6(SYS_waitid, type, id, &found, options | WNOHANG, NULL, 0);
        if (!result && !found.si_pid && !(options & WNOHANG) && is_managed()) {
            if (wait_for_child(type == P_PID ? (pid_t)id : -1) != EINTR || self.is_restarting)
                continue;
            return fail_with(EINTR);
        }
        if (!(options & WNOWAIT))
            remove_child(found.si_pid);
        if (about && !result)
            *about = found;
        return (int)answer(result);
    }
}

/* -- waits that the kernel ends ------------------------------------------------------------------------------------- */

PUBLIC int semtimedop(int id, struct sembuf *operations, size_t count, const struct timespec *timeout)
{
    enum { MOST_OPERATIONS = 500 };
    if (count == 0 || count > MOST_OPERATIONS)
        return fail_with(count ? E2BIG : EINVAL);
    struct sembuf at_once[count];
    bool may_wait = true;
    memcpy(at_once, operations, count * sizeof *operations);
    for (size_t at = 0; at < count; at++) {
        may_wait &= !(operations[at].sem_flg & IPC_NOWAIT);
        at_once[at].sem_flg |= IPC_NOWAIT;
    }
    long result = RAW_4(SYS_semtimedop, id, at_once, count, NULL);
    if (result != -EAGAIN || !may_wait) {
        if (result == -EAGAIN)
            count_spin();
        return (int)answer(result);
    }
    if (!is_managed())
        return (int)answer(RAW_4(SYS_semtimedop, id, operations, count, timeout));
    int64_t deadline = timeout ? later(now_ns(), nanoseconds(timeout)) : TIME_NEVER;
    if (now_ns() >= deadline)
        return count_spin(), fail_with(EAGAIN);
    int timer = interrupt_at(deadline);
    enter_kernel();
    result = RAW_4(SYS_semtimedop, id, operations, count, NULL);
    leave_kernel();
    interrupt_end(timer);
    return (int)answer(result == -EINTR && now_ns() >= deadline ? -EAGAIN : result);
}

PUBLIC int semop(int id, struct sembuf *operations, size_t count)
{
    return semtimedop(id, operations, count, NULL);
}

PUBLIC int system(const char *command)
{
    if (!command || !is_managed())
        return is_starting() ? fail_with(EAGAIN) : real.system(command);
    enter_kernel();
    int result = real.system(command);
    leave_kernel();
    return result;
}

PUBLIC int pclose(FILE *stream)
{
    enter_kernel();
    int result = real.pclose(stream);
    leave_kernel();
    return result;
}
