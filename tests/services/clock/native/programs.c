/* What tests of the test's time run: each program prints what it did, and when, in ms since it began. */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <linux/futex.h>
#include <mqueue.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <semaphore.h>
#include <signal.h>
#include <spawn.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/random.h>
#include <sys/sem.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/timerfd.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <linux/sockios.h>

static const char *own;

static double now(void)
{
    struct timespec at;
    clock_gettime(CLOCK_MONOTONIC, &at);
    return (double)(at.tv_sec - 1000) * 1e3 + (double)at.tv_nsec / 1e6;
}

static void say(const char *what, long result)
{
    printf("%s %ld at %g\n", what, result, now());
    fflush(stdout);
}

static struct timespec from_now(clockid_t clock, int ms)
{
    struct timespec at;
    clock_gettime(clock, &at);
    at.tv_nsec += ms * 1000000L;
    at.tv_sec += at.tv_nsec / 1000000000;
    at.tv_nsec %= 1000000000;
    return at;
}

static void in_thread(void *(*routine)(void *), void *argument)
{
    pthread_t thread;
    pthread_create(&thread, NULL, routine, argument);
    pthread_detach(thread);
}

static void sleeps(void)
{
    struct timespec until = from_now(CLOCK_MONOTONIC, 25), left;
    say("nanosleep", usleep(10000));
    say("until", clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL));
    until = from_now(CLOCK_REALTIME, 5);
    say("until", clock_nanosleep(CLOCK_REALTIME, TIMER_ABSTIME, &until, NULL));
    say("sleep", sleep(2));
    struct timeval of_day;
    gettimeofday(&of_day, NULL);
    say("time", (long)(time(NULL) == of_day.tv_sec));
    say("bad", nanosleep(&(struct timespec){0, -1}, &left));
}

/* -- conditions, semaphores, locks ---------------------------------------------------------------------------------- */

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t cond = PTHREAD_COND_INITIALIZER;
static sem_t semaphore;
static int value;

static void *change(void *ms)
{
    usleep((useconds_t)(intptr_t)ms * 1000);
    pthread_mutex_lock(&mutex);
    value++;
    pthread_cond_signal(&cond);
    say("signals", value);
    usleep(5000); /* holds the mutex */
    pthread_mutex_unlock(&mutex);
    return NULL;
}

static void conds(void)
{
    struct timespec until = from_now(CLOCK_REALTIME, 20);
    pthread_mutex_lock(&mutex);
    say("timed", pthread_cond_timedwait(&cond, &mutex, &until));
    in_thread(change, (void *)30);
    until = from_now(CLOCK_MONOTONIC, 100);
    say("clock", pthread_cond_clockwait(&cond, &mutex, CLOCK_MONOTONIC, &until));
    in_thread(change, (void *)10);
    while (value < 2)
        pthread_cond_wait(&cond, &mutex);
    say("waited", value);
    pthread_mutex_unlock(&mutex);
}

static void *post(void *ms)
{
    usleep((useconds_t)(intptr_t)ms * 1000);
    sem_post(&semaphore);
    return NULL;
}

static void semaphores(void)
{
    struct timespec until = from_now(CLOCK_REALTIME, 20);
    sem_init(&semaphore, 0, 1);
    say("free", sem_wait(&semaphore));
    say("none", sem_trywait(&semaphore));
    say("timed", sem_timedwait(&semaphore, &until));
    in_thread(post, (void *)15);
    say("posted", sem_wait(&semaphore));
    in_thread(post, (void *)15);
    until = from_now(CLOCK_MONOTONIC, 20);
    say("clock", sem_clockwait(&semaphore, CLOCK_MONOTONIC, &until));
}

static pthread_rwlock_t readers_writer = PTHREAD_RWLOCK_INITIALIZER;

static void *hold(void *unused)
{
    pthread_mutex_lock(&mutex);
    pthread_rwlock_rdlock(&readers_writer);
    usleep(30000);
    pthread_mutex_unlock(&mutex);
    usleep(30000);
    pthread_rwlock_unlock(&readers_writer);
    return unused;
}

static void locks(void)
{
    struct timespec until;
    pthread_t thread;
    pthread_create(&thread, NULL, hold, NULL);
    usleep(10000);
    say("busy", pthread_mutex_trylock(&mutex));
    until = from_now(CLOCK_REALTIME, 10);
    say("timed", pthread_mutex_timedlock(&mutex, &until));
    say("locked", pthread_mutex_lock(&mutex));
    say("reads", pthread_rwlock_rdlock(&readers_writer));
    pthread_rwlock_unlock(&readers_writer);
    until = from_now(CLOCK_REALTIME, 10);
    say("timed", pthread_rwlock_timedwrlock(&readers_writer, &until));
    say("writes", pthread_rwlock_wrlock(&readers_writer));
    say("joined", pthread_join(thread, NULL));
}

static void futexes(void)
{
    static uint32_t word = 7;
    struct timespec timeout = {0, 40000000};
    say("timed", syscall(SYS_futex, &word, FUTEX_WAIT_PRIVATE, 7, &timeout, NULL, 0));
    say("other", syscall(SYS_futex, &word, FUTEX_WAIT_PRIVATE, 8, NULL, NULL, 0));
    say("none", syscall(SYS_futex, &word, FUTEX_WAKE_PRIVATE, 1, NULL, NULL, 0));
}

/* Three workers and a mutex that all want; who has it when depends on the order of the threads alone. */
static uint64_t history;

static void *work(void *given)
{
    for (int round = 0; round < 200; round++) {
        pthread_mutex_lock(&mutex);
        history = history * 31 + (uint64_t)(intptr_t)given + (uint64_t)now();
        pthread_cond_broadcast(&cond);
        if (round % 7 == (intptr_t)given)
            pthread_cond_wait(&cond, &mutex);
        if (round % 5 == 0)
            usleep(300);
        pthread_mutex_unlock(&mutex);
        if (round % 11 == 0)
            usleep((useconds_t)(200 + 100 * (intptr_t)given));
    }
    pthread_mutex_lock(&mutex);
    value++;
    pthread_cond_broadcast(&cond);
    pthread_mutex_unlock(&mutex);
    return NULL;
}

static void *remind(void *unused)
{
    for (; value < 3; usleep(1000))
        pthread_cond_broadcast(&cond);
    return unused;
}

static void workers(void)
{
    pthread_t threads[4];
    for (intptr_t at = 0; at < 3; at++)
        pthread_create(&threads[at], NULL, work, (void *)at);
    pthread_create(&threads[3], NULL, remind, NULL);
    for (int at = 0; at < 4; at++)
        pthread_join(threads[at], NULL);
    printf("%llx\n", (unsigned long long)history);
    say("joined", value);
}

/* -- descriptors ---------------------------------------------------------------------------------------------------- */

static int pair[2];

static void *write_later(void *ms)
{
    usleep((useconds_t)(intptr_t)ms * 1000);
    return (void *)write(pair[1], "x", 1);
}

static void files(void)
{
    char byte;
    struct timeval timeout = {0, 20000};
    struct epoll_event event = {.events = EPOLLIN};
    fd_set set;
    socketpair(AF_UNIX, SOCK_STREAM, 0, pair);
    struct pollfd polled = {.fd = pair[0], .events = POLLIN};
    int epoll = epoll_create1(0);
    epoll_ctl(epoll, EPOLL_CTL_ADD, pair[0], &event);
    FD_ZERO(&set);
    FD_SET(pair[0], &set);
    say("select", select(pair[0] + 1, &set, NULL, NULL, &timeout));
    say("left", timeout.tv_usec);
    say("poll", poll(&polled, 1, 20));
    say("epoll", epoll_wait(epoll, &event, 1, 20));
    in_thread(write_later, (void *)10);
    say("poll", poll(&polled, 1, 100));
    say("epoll", epoll_wait(epoll, &event, 1, 100));
    say("read", read(pair[0], &byte, 1));
    setsockopt(pair[0], SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout);
    timeout = (struct timeval){0, 30000};
    setsockopt(pair[0], SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout);
    say("recv", recv(pair[0], &byte, 1, 0));
    in_thread(write_later, (void *)10);
    say("recv", recv(pair[0], &byte, 1, 0));
    say("none", recv(pair[0], &byte, 1, MSG_DONTWAIT));
    for (int file = 3; file < 1024; file++) /* also those that are not ours */
        close(file);
    say("pipe", pipe(pair));
    in_thread(write_later, (void *)10);
    say("read", read(pair[0], &byte, 1));
    say("nothing", poll(NULL, 0, 10));
}

static void *shut_later(void *file)
{
    usleep(10000);
    shutdown(*(int *)file, SHUT_RDWR);
    return NULL;
}

static void datagrams(void)
{
    struct sockaddr_in here = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    struct timeval stamp;
    socklen_t size = sizeof here;
    char byte;
    int in = socket(AF_INET, SOCK_DGRAM, 0), out = socket(AF_INET, SOCK_DGRAM, 0);
    bind(in, (struct sockaddr *)&here, sizeof here);
    getsockname(in, (struct sockaddr *)&here, &size);
    usleep(7000);
    say("sent", sendto(out, "x", 1, 0, (struct sockaddr *)&here, sizeof here));
    say("got", recvfrom(in, &byte, 1, 0, NULL, NULL));
    say("stamped", ioctl(in, SIOCGSTAMP, &stamp));
    say("then", (long)(stamp.tv_sec * 1000 + stamp.tv_usec / 1000 - 1699999990000));
    in_thread(shut_later, &in);
    say("shut", recvfrom(in, &byte, 1, 0, NULL, NULL));
}

static mqd_t queue;

static void *send_later(void *unused)
{
    usleep(10000);
    mq_send(queue, "x", 1, 0);
    return unused;
}

static void queues(void)
{
    char name[32], byte;
    struct mq_attr attributes = {.mq_maxmsg = 1, .mq_msgsize = 1};
    struct timespec until = from_now(CLOCK_REALTIME, 20), timeout = {0, 20000000};
    snprintf(name, sizeof name, "/dodo-%d", getpid());
    queue = mq_open(name, O_RDWR | O_CREAT, 0600, &attributes);
    mq_unlink(name);
    say("timed", mq_timedreceive(queue, &byte, 1, NULL, &until));
    in_thread(send_later, NULL);
    say("received", mq_receive(queue, &byte, 1, NULL));
    say("sent", mq_send(queue, "x", 1, 0));
    until = from_now(CLOCK_REALTIME, 20);
    say("full", mq_timedsend(queue, "x", 1, 0, &until));
    struct epoll_event event;
    int epoll = epoll_create1(0);
    say("epoll", syscall(SYS_epoll_pwait2, epoll, &event, 1, &timeout, NULL, 0));
    say("select", syscall(SYS_pselect6, 0, NULL, NULL, NULL, &timeout, NULL));
}

/* What the next file with the number of a source or a timer is. */
static void numbers(void)
{
    char bytes[100000];
    struct pollfd timer;
    struct itimerspec once = {{0, 0}, {0, 10000000}};
    fclose(fopen("/dev/urandom", "r"));
    int file = open("/dev/null", O_RDONLY), source = open("/dev/random", O_RDONLY), copy = dup(source);
    say("fclose", read(file, bytes, sizeof bytes));
    say("dup", read(copy, bytes, sizeof bytes));
    dup2(file, source);
    say("dup2", read(source, bytes, sizeof bytes));
    close_range((unsigned)copy, (unsigned)copy, 0);
    say("range", read(open("/dev/null", O_RDONLY), bytes, sizeof bytes));
    fclose(fdopen(timerfd_create(CLOCK_MONOTONIC, 0), "r"));
    timer = (struct pollfd){timerfd_create(CLOCK_MONOTONIC, 0), POLLIN, 0};
    close_range((unsigned)timer.fd + 1, UINT32_MAX, 0);
    for (int other = 3; other < 1024; other++)
        if (other != timer.fd)
            close(other);
    timerfd_settime(timer.fd, 0, &once, NULL);
    say("timer", poll(&timer, 1, 1000));
}

/* -- timers and signals --------------------------------------------------------------------------------------------- */

static void on_signal(int number)
{
    say("signal", number);
}

static void timers(void)
{
    uint64_t count = 0;
    struct itimerspec every = {{0, 10000000}, {0, 15000000}}, left;
    struct itimerval once = {{0, 0}, {0, 20000}};
    struct sigaction action = {.sa_handler = on_signal};
    int file = timerfd_create(CLOCK_MONOTONIC, 0);
    timerfd_settime(file, 0, &every, NULL);
    say("read", read(file, &count, sizeof count));
    say("count", (long)count);
    usleep(25000);
    timerfd_gettime(file, &left);
    say("left", left.it_value.tv_nsec / 1000);
    say("read", read(file, &count, sizeof count));
    say("count", (long)count);
    close(file);
    sigaction(SIGALRM, &action, NULL);
    setitimer(ITIMER_REAL, &once, NULL);
    say("sleep", usleep(50000));
    struct sigevent event = {.sigev_notify = SIGEV_SIGNAL, .sigev_signo = SIGALRM};
    timer_t timer;
    say("create", timer_create(CLOCK_REALTIME, &event, &timer));
    every = (struct itimerspec){{0, 0}, {0, 5000000}};
    timer_settime(timer, 0, &every, NULL);
    say("pause", pause());
}

static pthread_t first;

static void *kill_first(void *unused)
{
    usleep(10000);
    pthread_kill(first, SIGUSR1);
    say("killed", 0);
    usleep(1000);
    pthread_kill(first, SIGUSR1);
    return unused;
}

static void signals(void)
{
    struct sigaction action = {.sa_handler = on_signal}, before;
    struct timespec wanted = {0, 50000000}, left;
    sigset_t set;
    sigaction(SIGUSR1, &action, NULL);
    sigaction(SIGUSR1, NULL, &before);
    say("same", before.sa_handler == on_signal && !before.sa_flags);
    first = pthread_self();
    in_thread(kill_first, NULL);
    say("sleep", nanosleep(&wanted, &left));
    say("left", left.tv_nsec / 1000000);
    sem_init(&semaphore, 0, 0);
    say("semaphore", sem_wait(&semaphore));
    sigemptyset(&set);
    sigaddset(&set, SIGUSR2);
    sigprocmask(SIG_BLOCK, &set, NULL);
    wanted.tv_nsec = 15000000;
    say("none", sigtimedwait(&set, NULL, &wanted));
    kill(getpid(), SIGUSR2);
    say("waited", sigtimedwait(&set, NULL, &wanted));
}

static void system_v(void)
{
    int id = semget(IPC_PRIVATE, 1, 0600);
    struct sembuf take = {0, -1, 0}, give = {0, 1, 0};
    struct timespec timeout = {0, 25000000};
    say("timed", semtimedop(id, &take, 1, &timeout));
    if (!fork()) {
        usleep(10000);
        semop(id, &give, 1);
        _exit(0);
    }
    say("taken", semop(id, &take, 1));
    say("waited", wait(NULL) > 0);
    semctl(id, 0, IPC_RMID);
}

/* -- processes ------------------------------------------------------------------------------------------------------ */

extern char **environ;

static void ended(const char *what)
{
    int status;
    wait(&status);
    say(what, WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status));
}

static void forks(void)
{
    static char stack[1 << 16] __attribute__((aligned(16)));
    char *const words[] = {(char *)own, "nap", NULL}, *const nothing[] = {NULL};
    pid_t child = fork();
    if (!child) {
        usleep(20000);
        say("child", 0);
        _exit(3);
    }
    ended("ended");
    if (!fork())
        execve(own, words, nothing);
    ended("executed");
    posix_spawn(&child, own, NULL, NULL, words, environ);
    ended("spawned");
    say("system", WEXITSTATUS(system("sleep 1; exit 4")));
    if (!syscall(SYS_clone, SIGCHLD, NULL, NULL, NULL, NULL)) {
        usleep(10000);
        _exit(6);
    }
    ended("cloned");
    clone((int (*)(void *))(void *)usleep, &stack[sizeof stack], CLONE_VM | CLONE_VFORK | SIGCHLD, (void *)10000);
    ended("cloned");
    say("uring", syscall(SYS_io_uring_setup, 1, NULL));
    /* what a process killed at any moment leaves stops nobody */
    child = fork();
    if (!child)
        for (;;)
            usleep(1000);
    usleep(10000);
    kill(child, SIGKILL);
    ended("killed");
    usleep(100000);
    say("end", 0);
}

static void nap(void)
{
    usleep(15000);
    say("nap", 0);
    exit(5);
}

static void shares(void)
{
    sem_t *shared = mmap(NULL, 4096, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    struct timespec until = from_now(CLOCK_REALTIME, 20);
    sem_init(shared, 1, 0);
    say("timed", sem_timedwait(shared, &until));
    if (!fork()) {
        usleep(10000);
        sem_post(shared);
        _exit(0);
    }
    say("posted", sem_wait(shared));
    wait(NULL);
}

/* -- what is not cooperative ---------------------------------------------------------------------------------------- */

static atomic_int flag;

static void *raise_flag(void *unused)
{
    usleep(5000);
    flag = 1;
    return unused;
}

static void spins(void)
{
    int reads = 0;
    for (double begin = now(); now() < begin + 10;)
        reads++;
    say("clock", reads);
    in_thread(raise_flag, NULL);
    while (!flag)
        sched_yield();
    say("yields", flag);
}

static void storm(void)
{
    for (;;)
        nanosleep(&(struct timespec){0, 1}, NULL);
}

static void randoms(void)
{
    uint32_t values[4] = {0};
    int file = open("/dev/urandom", O_RDONLY);
    FILE *stream = fopen("/dev/random", "r");
    getrandom(&values[0], 4, 0);
    getentropy(&values[1], 4);
    for (int reads = 0; reads < 20000; reads++)
        if (read(file, &values[2], 4) != 4)
            exit(1);
    if (!stream || fread(&values[3], 4, 1, stream) != 1)
        exit(1);
    printf("%x %x %x %x\n", values[0], values[1], values[2], values[3]);
}

/* Writes what it likes into the page, again and again. */
static void garbage(void)
{
    char path[256];
    uint64_t seed = 1;
    snprintf(path, sizeof path, "%s/page", getenv("DODO_TIME"));
    int file = open(path, O_RDWR);
    size_t size = (size_t)lseek(file, 0, SEEK_END);
    unsigned char *page = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    for (int round = 0; round < 50; round++) {
        for (size_t at = 4096 + 4096 + 128 * 100; at < size; at++) /* behind the slots in use */
            page[at] = (unsigned char)((seed = seed * 6364136223846793005 + 1442695040888963407) >> 60);
        usleep(1000);
    }
    say("wrote", 0);
}

static void ticks(void)
{
    for (int at = 0; at < 2000; at++)
        usleep(10000);
    say("ticks", 0);
}

/* Prints the processor time of a read of the clock in ns. */
static void reads(void)
{
    enum { ROUNDS = 200, READS = 900 /* not yet a spin */ };
    struct timespec from, to, at;
    double ns = 0;
    for (int round = 0; round < ROUNDS; round++) {
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &from);
        for (int read = 0; read < READS; read++)
            clock_gettime(CLOCK_MONOTONIC, &at);
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &to);
        ns += (double)(to.tv_sec - from.tv_sec) * 1e9 + (double)(to.tv_nsec - from.tv_nsec);
        usleep(100);
    }
    printf("%g\n", ns / ROUNDS / READS);
}

int main(int count, char **words)
{
    static const struct { const char *name; void (*run)(void); } programs[] = {
        {"sleeps", sleeps}, {"conds", conds}, {"semaphores", semaphores}, {"locks", locks}, {"futexes", futexes},
        {"workers", workers}, {"files", files}, {"queues", queues}, {"numbers", numbers}, {"datagrams", datagrams}, {"timers", timers}, {"signals", signals},
        {"system_v", system_v}, {"forks", forks}, {"nap", nap}, {"shares", shares}, {"spins", spins}, {"storm", storm},
        {"randoms", randoms}, {"garbage", garbage}, {"ticks", ticks}, {"reads", reads}};
    own = words[0];
    for (size_t at = 0; count > 1 && at < sizeof programs / sizeof *programs; at++)
        if (!strcmp(programs[at].name, words[1])) {
            programs[at].run();
            return 0;
        }
    return 2;
}
