/* A bad network for every process that loads this: one in 20 datagrams is lost, the others are sent 50 ms later. */
#define _GNU_SOURCE
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

enum { LOST_ONE_IN = 20, DELAY_NS = 50 * 1000 * 1000, SECOND_NS = 1000 * 1000 * 1000 };

struct waiting {
    struct waiting *next;
    struct timespec due;
    struct sockaddr_storage to;
    socklen_t to_size;
    int socket;
    size_t size;
    char data[];
};

static struct waiting *first, **last = &first;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t filled = PTHREAD_COND_INITIALIZER;
static pid_t carrier_of;

static void *carry(void *nothing) {
    (void)nothing;
    for (;;) {
        pthread_mutex_lock(&lock);
        while (!first)
            pthread_cond_wait(&filled, &lock);
        struct waiting *one = first;
        first = one->next;
        if (!first)
            last = &first;
        pthread_mutex_unlock(&lock);
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &one->due, NULL);
        const struct sockaddr *to = one->to_size ? (struct sockaddr *)&one->to : NULL;
        syscall(SYS_sendto, one->socket, one->data, one->size, MSG_DONTWAIT, to, one->to_size);
        close(one->socket);
        free(one);
    }
    return NULL;
}

static void queue(struct waiting *one) {
    pthread_mutex_lock(&lock);
    if (carrier_of != getpid()) { /* threads do not live on in a forked process */
        pthread_t carrier;
        carrier_of = getpid();
        srandom((unsigned)carrier_of);
        pthread_create(&carrier, NULL, carry, NULL);
        pthread_detach(carrier);
    }
    *last = one;
    last = &one->next;
    pthread_cond_signal(&filled);
    pthread_mutex_unlock(&lock);
}

static int is_datagram(int socket) {
    int type = 0, domain = 0;
    socklen_t size = sizeof type;
    getsockopt(socket, SOL_SOCKET, SO_TYPE, &type, &size);
    size = sizeof domain;
    getsockopt(socket, SOL_SOCKET, SO_DOMAIN, &domain, &size);
    return type == SOCK_DGRAM && domain == AF_INET;
}

ssize_t sendto(int socket, const void *data, size_t size, int flags, const struct sockaddr *to, socklen_t to_size) {
    if (!is_datagram(socket))
        return syscall(SYS_sendto, socket, data, size, flags, to, to_size);
    if (random() % LOST_ONE_IN == 0)
        return (ssize_t)size;
    struct waiting *one = calloc(1, sizeof *one + size);
    clock_gettime(CLOCK_MONOTONIC, &one->due);
    one->due.tv_nsec += DELAY_NS;
    if (one->due.tv_nsec >= SECOND_NS) {
        one->due.tv_sec++;
        one->due.tv_nsec -= SECOND_NS;
    }
    if (to)
        memcpy(&one->to, to, to_size);
    one->to_size = to ? to_size : 0;
    one->socket = dup(socket);
    one->size = size;
    memcpy(one->data, data, size);
    queue(one);
    return (ssize_t)size;
}

ssize_t send(int socket, const void *data, size_t size, int flags) {
    return sendto(socket, data, size, flags, NULL, 0);
}
