/* Mutexes and what else only one thread may hold: a thread that finds it taken waits in a queue, not in the kernel.
 *
 * So who has it next depends on the order of the threads alone. What several processes share and may be left behind by
 * one that died is looked at again every 10 ms of test time.
 */
#define _GNU_SOURCE
#include "library.h"

#include <linux/futex.h>

enum { MUTEX_KINDS = 3, MUTEX_ROBUST = 16 + 4 /* glibc's bit, musl's */, MUTEX_SHARED = 128, ONCE_RUNS = 1, ONCE_DONE = 2 };
enum { LOOK_AGAIN_NS = 10000000, RETRY_NS = 100000 };

static bool is_own(int owner)
{
    return self.slot && (owner & FUTEX_TID_MASK) == self.slot->tid;
}

static int kind_of(const pthread_mutex_t *mutex)
{
    return word_of(mutex, 4, 0);
}

/* Tries until it is not busy, or the deadline. */
static int lock(void *object, int (*attempt)(void *), bool is_shared, int64_t deadline_ns, int64_t look_again_ns)
{
    int error;
    while ((error = attempt(object)) == EBUSY) {
        queue_join(object, is_shared, ~0U);
        if ((error = attempt(object)) != EBUSY) {
            queue_leave();
            break;
        }
        int64_t again = later(now_ns(), look_again_ns);
        queue_wait(TIME_LOCK, again < deadline_ns ? again : deadline_ns, false);
        if (now_ns() >= deadline_ns && (error = attempt(object)) == EBUSY)
            return ETIMEDOUT;
        if (error != EBUSY)
            break;
    }
    return error;
}

/* -- mutexes -------------------------------------------------------------------------------------------------------- */

static int try_mutex(void *mutex)
{
    return real.pthread_mutex_trylock(mutex);
}

int lock_mutex(pthread_mutex_t *mutex, int64_t deadline_ns)
{
    int kind = kind_of(mutex);
    bool managed = is_managed();
    int error = real.pthread_mutex_trylock(mutex);
    if (error != EBUSY)
        return error;
    if (!managed)
        return real.pthread_mutex_lock(mutex);
    if ((kind & MUTEX_KINDS) == PTHREAD_MUTEX_ERRORCHECK && is_own(word_of(mutex, 2, 1)))
        return EDEADLK;
    return lock(mutex, try_mutex, kind & MUTEX_SHARED, deadline_ns, kind & MUTEX_ROBUST ? LOOK_AGAIN_NS : TIME_NEVER);
}

int unlock_mutex(pthread_mutex_t *mutex)
{
    bool managed = is_managed(), is_shared = kind_of(mutex) & MUTEX_SHARED;
    int error = real.pthread_mutex_unlock(mutex);
    if (!error && managed)
        queue_wake(mutex, is_shared, 1, ~0U);
    return error;
}

PUBLIC int pthread_mutex_lock(pthread_mutex_t *mutex)
{
    return lock_mutex(mutex, TIME_NEVER);
}

PUBLIC int pthread_mutex_unlock(pthread_mutex_t *mutex)
{
    return unlock_mutex(mutex);
}

PUBLIC int pthread_mutex_trylock(pthread_mutex_t *mutex)
{
    is_managed();
    int error = real.pthread_mutex_trylock(mutex);
    if (error == EBUSY)
        count_spin();
    return error;
}

PUBLIC int pthread_mutex_clocklock(pthread_mutex_t *restrict mutex, clockid_t clock,
                                   const struct timespec *restrict until)
{
    if (!is_managed() || !is_valid(until))
        return EINVAL;
    return lock_mutex(mutex, deadline_on(clock, until));
}

PUBLIC int pthread_mutex_timedlock(pthread_mutex_t *restrict mutex, const struct timespec *restrict until)
{
    return pthread_mutex_clocklock(mutex, CLOCK_REALTIME, until);
}

/* -- locks of readers and writers ----------------------------------------------------------------------------------- */

static int try_to_read(void *lock)
{
    return real.pthread_rwlock_tryrdlock(lock);
}

static int try_to_write(void *lock)
{
    return real.pthread_rwlock_trywrlock(lock);
}

static int lock_readers_writer(pthread_rwlock_t *object, int (*attempt)(void *), int64_t deadline_ns)
{
    if (!is_managed())
        return attempt(object);
    if (gnu_get_libc_version && is_own(word_of(object, 6, 6)))
        return EDEADLK;
    return lock(object, attempt, word_of(object, 7, 2), deadline_ns, TIME_NEVER);
}

static int lock_readers_writer_until(pthread_rwlock_t *object, int (*attempt)(void *), clockid_t clock,
                                     const struct timespec *until)
{
    if (!is_managed() || !is_valid(until))
        return EINVAL;
    return lock_readers_writer(object, attempt, deadline_on(clock, until));
}

/* The three ways to wait for it. */
#define WAYS_TO(how, attempt)                                                                                           \
    PUBLIC int pthread_rwlock_##how(pthread_rwlock_t *object)                                                          \
    {                                                                                                                  \
        return lock_readers_writer(object, attempt, TIME_NEVER);                                                       \
    }                                                                                                                  \
    PUBLIC int pthread_rwlock_timed##how(pthread_rwlock_t *restrict object, const struct timespec *restrict until)     \
    {                                                                                                                  \
        return lock_readers_writer_until(object, attempt, CLOCK_REALTIME, until);                                      \
    }                                                                                                                  \
    PUBLIC int pthread_rwlock_clock##how(pthread_rwlock_t *restrict object, clockid_t clock,                           \
                                         const struct timespec *restrict until)                                        \
    {                                                                                                                  \
        return lock_readers_writer_until(object, attempt, clock, until);                                               \
    }
WAYS_TO(rdlock, try_to_read)
WAYS_TO(wrlock, try_to_write)

PUBLIC int pthread_rwlock_unlock(pthread_rwlock_t *object)
{
    bool managed = is_managed(), is_shared = word_of(object, 7, 2);
    int error = real.pthread_rwlock_unlock(object);
    if (!error && managed)
        queue_wake(object, is_shared, INT_MAX, ~0U);
    return error;
}

/* -- others --------------------------------------------------------------------------------------------------------- */

PUBLIC int pthread_spin_lock(pthread_spinlock_t *object)
{
    is_managed();
    while (real.pthread_spin_trylock(object))
        if (is_managed())
            sleep_until(later(now_ns(), RETRY_NS));
    return 0;
}

PUBLIC int pthread_barrier_wait(pthread_barrier_t *barrier)
{
    enter_kernel();
    int result = real.pthread_barrier_wait(barrier);
    leave_kernel();
    return result;
}

PUBLIC int pthread_once(pthread_once_t *control, void (*routine)(void))
{
    while (is_managed() && (__atomic_load_n(control, __ATOMIC_ACQUIRE) & (ONCE_RUNS | ONCE_DONE)) == ONCE_RUNS)
        sleep_until(later(now_ns(), RETRY_NS));
    return real.pthread_once(control, routine);
}
