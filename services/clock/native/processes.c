/* All threads of the application sleep: how /proc shows that (proc_pid_stat(5), the kernel's Documentation/scheduler/sched-stats).
 *
 * Two looks at every thread: how often it got a processor and whether it sleeps, then whether it sleeps and how often. If
 * it slept in both looks and got no processor in between, it did not run between the looks: to run and to sleep again
 * takes a processor once more. So there was a moment at which all slept. New threads and processes are found by the
 * number that was given last in this PID namespace (proc_loadavg(5)), which must not change meanwhile. Nor may datagrams
 * be on their way through the network stack: on the loopback device, they may wake a receiver after the sender sleeps.
 */
#define _GNU_SOURCE
#include "processes.h"

#include <dirent.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { MOST_THREADS = 4096, MOST_PROCESSES = 4096, MOST_TEXT = 4096, MOST_REFUSALS = 50, LISTINGS = 3 };

struct thread {
    int pid, tid;
    int stat, runs; /* descriptors of its files stat, and schedstat or status */
    bool has_ended;
    uint64_t got;   /* how often it had got a processor at the first look */
    bool slept;     /* at the last quiet moment, with `got` as it is */
    unsigned wait;  /* the wait in which `ran_before_ns` was read */
    uint64_t ran_before_ns;
    uint64_t used_ns; /* of a process's first thread: what all of its threads had used when it was asked last */
};

static struct selection chosen;
static struct thread *threads, *before;
static int thread_count, own_depth, own_pid, network = -1, numbers = -1;
static int others[MOST_PROCESSES], other_count; /* processes that will never be the application's */
static int undecided[MOST_PROCESSES], undecided_count;
static long listed_number = -1;
static bool is_complete; /* two lists with all asleep in between were the same: none is about to begin that has its number */
static bool one_has_ended; /* a process, since it was asked last what all have used */
static int new_count;    /* threads that the last list had and the one before had not */
static bool has_schedstat;
static unsigned current_wait = 1;
static struct busy_thread busy;

static int read_text(int file, char *text, size_t size)
{
    ssize_t length = file < 0 ? -1 : pread(file, text, size - 1, 0);
    text[length < 0 ? 0 : length] = 0;
    return (int)length;
}

static int read_file(const char *path, char *text, size_t size)
{
    int file = open(path, O_RDONLY | O_CLOEXEC);
    int length = read_text(file, text, size);
    if (file >= 0)
        close(file);
    return length;
}

static const char *field(const char *text, const char *name)
{
    const char *found = strstr(text, name);
    return found ? found + strlen(name) : NULL;
}

/* How many numbers NSpid has; `inner` gets the last one. */
static int depth(const char *text, int *inner)
{
    const char *at = field(text, "\nNSpid:");
    int count = 0;
    while (at && (*at == '\t' || *at == ' ')) {
        char *end;
        *inner = (int)strtol(at, &end, 10);
        count += end != at;
        at = end != at ? end : NULL;
    }
    return count;
}

/* -- which processes ------------------------------------------------------------------------------------------------ */

static bool has_folder(int pid)
{
    char path[64], text[1 << 15], wanted[512];
    snprintf(path, sizeof path, "/proc/%d/environ", pid);
    int length = read_file(path, text, sizeof text);
    snprintf(wanted, sizeof wanted, "DODO_TIME=%s", chosen.folder);
    for (int at = 0; at < length; at += (int)strlen(text + at) + 1)
        if (!strcmp(text + at, wanted))
            return true;
    return false;
}

static bool is_in(const int *pids, int count, int pid)
{
    for (int at = 0; at < count; at++)
        if (pids[at] == pid)
            return true;
    return false;
}

static bool is_application(int pid)
{
    if (!chosen.nested)
        return pid != own_pid;
    if (is_in(others, other_count, pid))
        return false;
    char path[64], text[MOST_TEXT];
    int inner = 0;
    snprintf(path, sizeof path, "/proc/%d/status", pid);
    if (read_file(path, text, sizeof text) <= 0)
        return false;
    if (depth(text, &inner) <= own_depth) {
        if (other_count < MOST_PROCESSES)
            others[other_count++] = pid;
        return false;
    }
    if (!chosen.folder || has_folder(pid))
        return true;
    if (undecided_count < MOST_PROCESSES) /* it may not have executed its program yet */
        undecided[undecided_count++] = pid;
    return false;
}

static long last_number(void)
{
    char text[128];
    const char *at = read_text(numbers, text, sizeof text) > 0 ? strrchr(text, ' ') : NULL;
    return at ? strtol(at, NULL, 10) : -1;
}

static int open_file(int pid, int tid, const char *name)
{
    char path[64];
    snprintf(path, sizeof path, "/proc/%d/task/%d/%s", pid, tid, name);
    return open(path, O_RDONLY | O_CLOEXEC);
}

static void add_threads(int pid, int *kept, int old_count)
{
    char path[64];
    snprintf(path, sizeof path, "/proc/%d/task", pid);
    DIR *tasks = opendir(path);
    for (struct dirent *entry; tasks && thread_count < MOST_THREADS && (entry = readdir(tasks));) {
        int tid = atoi(entry->d_name), old = *kept;
        if (tid <= 0)
            continue;
        while (old < old_count && (before[old].tid != tid || before[old].pid != pid))
            old++;
        if (old < old_count) {
            threads[thread_count++] = before[old];
            before[old].stat = before[old].runs = -1;
            *kept = old + 1; /* both lists are in the kernel's order */
            continue;
        }
        int stat = open_file(pid, tid, "stat"), runs = open_file(pid, tid, has_schedstat ? "schedstat" : "status");
        threads[thread_count++] = (struct thread){.pid = pid, .tid = tid, .stat = stat, .runs = runs};
        new_count++;
    }
    if (tasks)
        closedir(tasks);
}

static void close_thread(const struct thread *each)
{
    if (each->stat >= 0)
        close(each->stat);
    if (each->runs >= 0)
        close(each->runs);
}

/* All threads of the application; false while it grows. */
static bool list(void)
{
    for (int attempt = 0; attempt < LISTINGS; attempt++) {
        long number = last_number();
        struct thread *old = threads;
        int old_count = thread_count, kept = 0;
        threads = before, before = old, thread_count = 0, undecided_count = 0, new_count = 0;
        DIR *proc = opendir("/proc");
        for (struct dirent *entry; proc && (entry = readdir(proc));) {
            int pid = atoi(entry->d_name);
            if (pid > 0 && is_application(pid))
                add_threads(pid, &kept, old_count);
        }
        if (proc)
            closedir(proc);
        for (int at = 0; at < old_count; at++) {
            one_has_ended |= before[at].stat >= 0 && before[at].pid == before[at].tid;
            close_thread(&before[at]);
        }
        listed_number = proc && number == last_number() ? number : -1;
        is_complete = false;
        if (listed_number >= 0)
            return true;
    }
    return false;
}

static bool is_listed(void)
{
    if (!is_complete || last_number() != listed_number)
        return list();
    for (int at = 0; at < undecided_count; at++)
        if (has_folder(undecided[at]))
            return list();
    return true;
}

/* -- what they do --------------------------------------------------------------------------------------------------- */

static uint64_t ran_ns(const struct thread *each)
{
    char path[64], text[128];
    snprintf(path, sizeof path, "/proc/%d/task/%d/schedstat", each->pid, each->tid);
    return read_file(path, text, sizeof text) > 0 ? strtoull(text, NULL, 10) : 0;
}

static void note_busy(struct thread *each, char state)
{
    uint64_t ran = ran_ns(each);
    if (each->wait != current_wait) {
        each->wait = current_wait;
        each->ran_before_ns = ran;
    }
    busy = (struct busy_thread){.pid = each->pid, .tid = each->tid, .state = state};
    busy.processor_s = ran > each->ran_before_ns ? (double)(ran - each->ran_before_ns) / 1e9 : 0;
}

/* How often a thread has got a processor, or else how often it was switched off one. */
static uint64_t runs(const struct thread *each)
{
    char text[MOST_TEXT];
    if (read_text(each->runs, text, sizeof text) <= 0)
        return 0;
    if (has_schedstat) {
        const char *last = strrchr(text, ' ');
        return last ? strtoull(last, NULL, 10) : 0;
    }
    const char *own = field(text, "\nvoluntary_ctxt_switches:"), *forced = field(text, "\nnonvoluntary_ctxt_switches:");
    return (own ? strtoull(own, NULL, 10) : 0) + (forced ? strtoull(forced, NULL, 10) : 0);
}

/* Its state as ps(1) names it; X when it is gone. */
static char state_of(const struct thread *each)
{
    char text[1024];
    if (each->stat < 0 && each->runs < 0)
        return 'X';
    const char *end = read_text(each->stat, text, sizeof text) > 0 ? strrchr(text, ')') : NULL;
    return end && end[1] ? end[2] : 'X';
}

uint64_t processes_services(void)
{
    uint64_t found = 0;
    for (int at = 0; at < thread_count; at++) {
        char path[64], text[1 << 15];
        if (threads[at].pid != threads[at].tid || strchr("ZXx", state_of(&threads[at])))
            continue;
        snprintf(path, sizeof path, "/proc/%d/environ", threads[at].pid);
        int length = read_file(path, text, sizeof text);
        if (length <= 0)
            return UINT64_MAX; /* of another user */
        for (int word = 0; word < length; word += (int)strlen(text + word) + 1)
            if (!strncmp(text + word, "DODO_TIME_SERVICE=", 18))
                found |= UINT64_C(1) << strtoul(text + word + 18, NULL, 10) % 64;
    }
    return found;
}

static bool sleeps(struct thread *each)
{
    char state = state_of(each);
    if (strchr("SZXTtx", state)) {
        bool ends = !strchr("STt", state) && !each->has_ended;
        each->has_ended |= ends; /* who waits for it may not have been woken yet: look once more */
        return !ends;
    }
    note_busy(each, state);
    return false;
}

static bool first_look(void)
{
    for (int at = 0; at < thread_count; at++) {
        struct thread *each = &threads[at];
        uint64_t got = runs(each);
        if (each->slept && got == each->got)
            continue; /* it sleeps since then if it does at the second look */
        each->slept = false;
        each->got = got;
        if (!sleeps(each))
            return false;
    }
    return true;
}

/* Whether no thread is on a processor or waits for one: the kernel then says where it sleeps, if we may know. */
static bool all_are_off(void)
{
    for (int at = 0; at < thread_count; at++) {
        char path[64], text[128];
        snprintf(path, sizeof path, "/proc/%d/task/%d/wchan", threads[at].pid, threads[at].tid);
        if (read_file(path, text, sizeof text) > 0 && !strcmp(text, "0") && !strchr("ZX", state_of(&threads[at])))
            return false;
    }
    return true;
}

static bool second_look(void)
{
    for (int at = 0; at < thread_count; at++)
        if (!sleeps(&threads[at]) || runs(&threads[at]) != threads[at].got)
            return false;
    return true;
}

/* Whether datagrams wait in the queues between sender and receiver: the 12th column of softnet_stat, a row a core. */
static bool network_is_empty(void)
{
    static unsigned refusals;
    char text[1 << 14];
    if (read_text(network, text, sizeof text) <= 0)
        return true;
    for (char *row = text; row && *row; row = strchr(row, '\n'), row = row ? row + 1 : NULL) {
        char *at = row;
        unsigned long value = 0;
        for (int column = 0; column < 12; column++)
            value = strtoul(at, &at, 16);
        if (value && refusals < MOST_REFUSALS) { /* the machine's own traffic may never end */
            refusals++;
            return false;
        }
    }
    refusals = 0;
    return true;
}

void processes_init(const struct selection *selection)
{
    char text[MOST_TEXT];
    int inner;
    chosen = *selection;
    threads = calloc(MOST_THREADS, sizeof *threads);
    before = calloc(MOST_THREADS, sizeof *before);
    if (!threads || !before)
        abort();
    own_pid = getpid();
    if (read_file("/proc/self/status", text, sizeof text) > 0)
        own_depth = depth(text, &inner);
    if (read_file("/proc/self/schedstat", text, sizeof text) > 0)
        has_schedstat = strtoull(strrchr(text, ' ') ? strrchr(text, ' ') : "0", NULL, 10) > 0;
    network = open("/proc/net/softnet_stat", O_RDONLY | O_CLOEXEC);
    numbers = open("/proc/loadavg", O_RDONLY | O_CLOEXEC);
}

void processes_begin_wait(void)
{
    current_wait++;
    busy = (struct busy_thread){0};
}

bool processes_are_quiet(bool *is_off)
{
    if (!is_listed() || !first_look() || !network_is_empty())
        return false;
    if (is_off)
        *is_off = all_are_off();
    if (!second_look() || last_number() != listed_number)
        return false;
    for (int at = 0; at < thread_count; at++)
        threads[at].slept = true;
    if (!is_complete)
        is_complete = list() && !new_count;
    return is_complete;
}

bool processes_have_ended(void)
{
    for (int at = 0; at < thread_count; at++)
        if (!strchr("ZX", state_of(&threads[at])))
            return false;
    return true;
}

struct busy_thread processes_busy(void)
{
    char path[64], text[MOST_TEXT];
    snprintf(path, sizeof path, "/proc/%d/task/%d/status", busy.pid, busy.tid);
    if (read_file(path, text, sizeof text) > 0) {
        depth(text, &busy.inner_tid);
        snprintf(busy.name, sizeof busy.name, "%.*s", (int)strcspn(text + strlen("Name:\t"), "\n"), text + strlen("Name:\t"));
    }
    return busy;
}

struct used processes_used(void)
{
    struct used used = {.one_has_ended = one_has_ended};
    one_has_ended = false;
    for (int at = 0; at < thread_count; at++) {
        struct timespec now;
        clockid_t clock;
        used.one_has_ended |= threads[at].has_ended && threads[at].pid == threads[at].tid;
        if (threads[at].pid != threads[at].tid || clock_getcpuclockid(threads[at].pid, &clock) || clock_gettime(clock, &now))
            continue;
        uint64_t ns = (uint64_t)now.tv_sec * UINT64_C(1000000000) + (uint64_t)now.tv_nsec;
        used.seconds += ns > threads[at].used_ns ? (double)(ns - threads[at].used_ns) / 1e9 : 0;
        threads[at].used_ns = ns;
    }
    return used;
}
