/* Condition variables, semaphores and futexes: threads wait in queues by address, and the thread that wakes them makes them ready.
 *
 * What several processes share has no queue here but a key in the waiting slots, made of the address within its page of
 * memory. Others may have the same key; they wake for nothing, which all that wait so allow.
 */
#define _GNU_SOURCE
#include "library.h"

#include <linux/futex.h>
#include <string.h>

/* One a slot: this process's thread there waits for `address`. */
struct waiter {
    struct waiter *next;
    struct time_slot *slot;
    const void *address;
    uint32_t bits;
    _Atomic bool is_queued;
};

static struct waiter waiters[TIME_SLOTS], *first;
static _Atomic unsigned queued;
static _Atomic uint32_t queue_lock;

/* -- queues --------------------------------------------------------------------------------------------------------- */

void queues_after_fork(void)
{
    queue_lock = 0;
    queued = 0;
    first = NULL;
}

static uint32_t key_of(const void *address)
{
    return (uint32_t)((uintptr_t)address % 4096) + 1;
}

void queue_join(const void *address, bool is_shared, uint32_t bits)
{
    struct waiter *own = &waiters[own_index()];
    uint64_t signals;
    if (is_shared) {
        self.slot->key = key_of(address);
        return;
    }
    take_lock(&queue_lock, &signals);
    *own = (struct waiter){.slot = self.slot, .address = address, .bits = bits, .is_queued = true};
    struct waiter **end = &first;
    while (*end)
        end = &(*end)->next;
    *end = own;
    queued++;
    give_lock(&queue_lock, &signals);
}

/* Whether nobody has woken this thread before. */
bool queue_leave(void)
{
    struct waiter *own = &waiters[own_index()];
    bool was_waiting = atomic_exchange(&self.slot->key, 0) != 0;
    uint64_t signals;
    take_lock(&queue_lock, &signals);
    for (struct waiter **each = &first; own->is_queued && *each; each = &(*each)->next)
        if (*each == own) {
            *each = own->next;
            queued--;
            was_waiting = true;
            break;
        }
    own->is_queued = false;
    give_lock(&queue_lock, &signals);
    return was_waiting;
}

static bool is_woken(void)
{
    return !waiters[own_index()].is_queued && !self.slot->key;
}

static void make_ready(struct time_slot *slot)
{
    uint32_t waiting = TIME_WAITING;
    atomic_compare_exchange_strong(&slot->state, &waiting, TIME_READY);
}

static int wake_shared(const void *address)
{
    int count = 0;
    for (unsigned at = 0; at < TIME_SLOTS; at++) {
        uint32_t key = key_of(address);
        if (page->slot[at].key == key && atomic_compare_exchange_strong(&page->slot[at].key, &key, 0)) {
            make_ready(&page->slot[at]);
            count++;
        }
    }
    return count;
}

int queue_wake(const void *address, bool is_shared, int most, uint32_t bits)
{
    uint64_t signals;
    int count = 0;
    if (is_shared)
        return wake_shared(address);
    if (!queued)
        return 0;
    take_lock(&queue_lock, &signals);
    for (struct waiter **each = &first; *each && count < most;) {
        struct waiter *found = *each;
        if (found->address != address || !(found->bits & bits)) {
            each = &found->next;
            continue;
        }
        *each = found->next;
        queued--;
        count++;
        found->is_queued = false;
        make_ready(found->slot);
    }
    give_lock(&queue_lock, &signals);
    return count;
}

/* 0 when another woke this thread, ETIMEDOUT, or EINTR if it may be interrupted. */
int queue_wait(uint32_t kind, int64_t deadline_ns, bool is_interruptible)
{
    for (;;) {
        enter(kind, deadline_ns);
        int error = is_woken() ? pass_gate_as_ready() : pass_gate();
        if (is_woken())
            return 0;
        if (now_ns() >= deadline_ns)
            return queue_leave() ? ETIMEDOUT : 0;
        if (error == EINTR && is_interruptible && !self.is_restarting)
            return queue_leave() ? EINTR : 0;
    }
}

/* -- condition variables -------------------------------------------------------------------------------------------- */

/* Only the functions here use one, and it says only this: zeros, as with PTHREAD_COND_INITIALIZER, are one process and CLOCK_REALTIME. */
struct cond {
    int is_shared;
    clockid_t clock;
};

PUBLIC int pthread_cond_init(pthread_cond_t *restrict cond, const pthread_condattr_t *restrict attributes)
{
    struct cond wanted = {0, CLOCK_REALTIME};
    memset(cond, 0, sizeof *cond);
    if (attributes) {
        pthread_condattr_getpshared(attributes, &wanted.is_shared);
        pthread_condattr_getclock(attributes, &wanted.clock);
    }
    *(struct cond *)cond = wanted;
    return 0;
}

static bool is_shared_cond(const pthread_cond_t *cond)
{
    return ((const struct cond *)cond)->is_shared;
}

static int wait_for_cond(pthread_cond_t *cond, pthread_mutex_t *mutex, int64_t deadline_ns)
{
    if (!is_managed())
        return EINVAL;
    queue_join(cond, is_shared_cond(cond), FUTEX_BITSET_MATCH_ANY);
    int refused = unlock_mutex(mutex);
    if (refused) {
        queue_leave();
        return refused;
    }
    int error = queue_wait(TIME_COND, deadline_ns, false);
    int locked = lock_mutex(mutex, TIME_NEVER);
    return locked ? locked : error;
}

PUBLIC int pthread_cond_wait(pthread_cond_t *restrict cond, pthread_mutex_t *restrict mutex)
{
    return wait_for_cond(cond, mutex, TIME_NEVER);
}

PUBLIC int pthread_cond_clockwait(pthread_cond_t *restrict cond, pthread_mutex_t *restrict mutex, clockid_t clock,
                                  const struct timespec *restrict until)
{
    if (!is_managed() || !is_valid(until) || (clock != CLOCK_MONOTONIC && clock != CLOCK_REALTIME))
        return EINVAL;
    return wait_for_cond(cond, mutex, deadline_on(clock, until));
}

PUBLIC int pthread_cond_timedwait(pthread_cond_t *restrict cond, pthread_mutex_t *restrict mutex,
                                  const struct timespec *restrict until)
{
    return pthread_cond_clockwait(cond, mutex, ((const struct cond *)cond)->clock, until);
}

PUBLIC int pthread_cond_signal(pthread_cond_t *cond)
{
    if (is_managed())
        queue_wake(cond, is_shared_cond(cond), 1, FUTEX_BITSET_MATCH_ANY);
    return 0;
}

PUBLIC int pthread_cond_broadcast(pthread_cond_t *cond)
{
    if (is_managed())
        queue_wake(cond, is_shared_cond(cond), INT_MAX, FUTEX_BITSET_MATCH_ANY);
    return 0;
}

/* -- semaphores ----------------------------------------------------------------------------------------------------- */

static bool is_shared_semaphore(const sem_t *semaphore)
{
    int found = word_of(semaphore, 2, 2);
    return gnu_get_libc_version ? found : !found;
}

static int wait_for_semaphore(sem_t *semaphore, int64_t deadline_ns)
{
    int error = errno;
    if (!is_managed())
        return fail_with(EINTR);
    while (real.sem_trywait(semaphore)) {
        if (errno != EAGAIN)
            return -1;
        errno = error;
        queue_join(semaphore, is_shared_semaphore(semaphore), FUTEX_BITSET_MATCH_ANY);
        if (!real.sem_trywait(semaphore)) {
            queue_leave();
            break;
        }
        int ended = queue_wait(TIME_LOCK, deadline_ns, true);
        if (ended && !(ended == ETIMEDOUT && !real.sem_trywait(semaphore)))
            return fail_with(ended);
        if (ended)
            break;
    }
    errno = error;
    return 0;
}

PUBLIC int sem_wait(sem_t *semaphore)
{
    return wait_for_semaphore(semaphore, TIME_NEVER);
}

PUBLIC int sem_clockwait(sem_t *restrict semaphore, clockid_t clock, const struct timespec *restrict until)
{
    if (!is_managed() || !is_valid(until))
        return fail_with(EINVAL);
    return wait_for_semaphore(semaphore, deadline_on(clock, until));
}

PUBLIC int sem_timedwait(sem_t *restrict semaphore, const struct timespec *restrict until)
{
    return sem_clockwait(semaphore, CLOCK_REALTIME, until);
}

PUBLIC int sem_trywait(sem_t *semaphore)
{
    is_managed(); /* finds the real functions */
    int result = real.sem_trywait(semaphore);
    if (result) {
        int error = errno;
        count_spin();
        errno = error;
    }
    return result;
}

PUBLIC int sem_post(sem_t *semaphore)
{
    bool managed = is_managed(), is_shared = is_shared_semaphore(semaphore);
    int result = real.sem_post(semaphore);
    if (!result && managed)
        queue_wake(semaphore, is_shared, 1, FUTEX_BITSET_MATCH_ANY);
    return result;
}

/* -- futexes -------------------------------------------------------------------------------------------------------- */

/* What libstdc++'s atomics and futures come down to: -errno or the result; `count` or a timeout, by the operation. */
long virtual_futex(uint32_t *word, int operation, uint32_t value, const struct timespec *timeout, uint32_t bits)
{
    int command = operation & FUTEX_CMD_MASK;
    bool is_shared = !(operation & FUTEX_PRIVATE_FLAG);
    if (command == FUTEX_WAKE || command == FUTEX_WAIT)
        bits = FUTEX_BITSET_MATCH_ANY;
    if (command == FUTEX_WAKE || command == FUTEX_WAKE_BITSET) {
        int most = value > INT_MAX ? INT_MAX : (int)value, woken = queue_wake(word, is_shared, most, bits);
        long more = most > woken ? RAW_6(SYS_futex, word, operation, most - woken, NULL, NULL, bits) : 0;
        return more < 0 ? more : woken + more;
    }
    if (!bits || (timeout && !is_valid(timeout)))
        return -EINVAL;
    int64_t deadline = TIME_NEVER;
    if (timeout && command == FUTEX_WAIT)
        deadline = later(now_ns(), nanoseconds(timeout));
    else if (timeout)
        deadline = deadline_on(operation & FUTEX_CLOCK_REALTIME ? CLOCK_REALTIME : CLOCK_MONOTONIC, timeout);
    queue_join(word, is_shared, bits);
    if (__atomic_load_n(word, __ATOMIC_SEQ_CST) != value) {
        queue_leave();
        return -EAGAIN;
    }
    return -queue_wait(TIME_LOCK, deadline, true);
}
