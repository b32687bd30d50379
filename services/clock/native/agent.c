/* dodo-time: decides which thread of the application runs next, and lets test time go on when all of them sleep.
 *
 * The clock of the test (services/clock/resting.py) says over FIFOs how far time may go; docs/explanation/lockstep.md
 * has the whole. Nothing that the application writes into the page is trusted: it can only make itself wait.
 */
#define _GNU_SOURCE
#include "processes.h"
#include "time_page.h"

#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <linux/futex.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#define SECOND INT64_C(1000000000)
#define WINDOW_NS (SECOND / 100)

enum {
    FREE_IN_A_ROW = 64,   /* slots are taken from the first on: behind so many free ones there is none */
    END_MS = 100,         /* between looks whether the test is over */
    REPORT_MS = 500,      /* between reports on a busy thread */
    START_MOST_S = 40,    /* then the clock says which did not */
    UNSEEN_WAIT_MS = 1000, /* that all must sleep, if one of them does not wait in the library and it is not known where */
    SHORTEST_NAP_US = 20,
    LONGEST_NAP_US = 1000,
    DESTROYED = 3,
};

static struct options {
    const char *folder;
    unsigned services;
    int64_t start_ns, begin_ns;
    int64_t patience_s; /* for services that have not begun yet, since the last one did */
    uint64_t seed;
    bool nested, by_environment;
} options = {.services = 1, .patience_s = 3};

static struct time_page *page;
static int folder_file = -1, command_file = -1, reply_file = -1, wakers[TIME_SLOTS];
static int64_t now_ns; /* the page shows it, and the application can write there */
static bool is_overwritten, has_begun[TIME_SERVICES];
static uint32_t waits_unseen[TIME_SLOTS]; /* one more than `wake` of a thread that was found to wait elsewhere, or has ended */
static struct time_slot *last_granted;
static int64_t window_ns, window_cpu_ns; /* when test time last went on by WINDOW_NS, and the agent's processor time then */
static int64_t waits_since, reported; /* wall time: for quiet, and since a report */
static uint32_t notes_told;
static volatile sig_atomic_t is_over;
static bool is_repeatable = true, is_found; /* the clock has said something */

static int64_t time_of(clockid_t clock)
{
    struct timespec now;
    clock_gettime(clock, &now);
    return now.tv_sec * SECOND + now.tv_nsec;
}

static int64_t wall_ns(void)
{
    return time_of(CLOCK_MONOTONIC);
}

static void fail(const char *what)
{
    fprintf(stderr, "dodo-time: %s: %s\n", what, strerror(errno));
    exit(1);
}

/* One line; without a reader, or one that takes nothing, it is lost. */
static void reply(const char *line)
{
    ssize_t length = (ssize_t)strlen(line);
    if (write(reply_file, line, (size_t)length) != length)
        fprintf(stderr, "dodo-time: a reply was lost\n");
}

/* The page is truncated, or a waker replaced. Until the clock reads that, it stays in the FIFO only as long as that is open. */
static void on_destroyed(int number)
{
    static const char line[] = "{\"destroyed\": true}\n";
    int unread = 1;
    (void)number;
    if (write(reply_file, line, sizeof line - 1) < 0)
        _exit(1);
    while (!is_over && !ioctl(reply_file, FIONREAD, &unread) && unread)
        poll(NULL, 0, END_MS);
    _exit(DESTROYED);
}

/* The test is over: the application, which ends now, too, goes on as it likes until nothing of it is left.
 * As process 1 of a container, whose processes are the application's, the agent takes that from outside alone: only kill(2), whose sender
 * the kernel fills in, has this code. */
static void on_end(int number, siginfo_t *about, void *context)
{
    (void)number, (void)context;
    if (getpid() != 1 || (about->si_pid == 0 && about->si_code == SI_USER))
        is_over = 1;
}

static long futex(_Atomic uint32_t *word, int operation, uint32_t value, const struct timespec *timeout)
{
    return syscall(SYS_futex, word, operation, value, timeout, NULL, 0);
}

/* Text from the application as it can stand in JSON. */
static void plain(char *to, const char *from, size_t size)
{
    size_t at = 0;
    for (; at < size - 1 && from[at]; at++)
        to[at] = (from[at] >= ' ' && from[at] <= '~' && from[at] != '"' && from[at] != '\\') ? from[at] : '?';
    to[at] = 0;
}

/* -- slots ---------------------------------------------------------------------------------------------------------- */

/* One more than the number of the last slot in use. */
static unsigned used_slots(void)
{
    unsigned end = 0;
    for (unsigned at = 0; at < TIME_SLOTS && at < end + FREE_IN_A_ROW; at++)
        if (page->slot[at].state != TIME_FREE)
            end = at + 1;
    return end;
}

static bool is_before(struct time_slot *one, struct time_slot *other)
{
    if (one->service != other->service)
        return one->service < other->service;
    if (one->process != other->process)
        return one->process < other->process;
    return one->thread < other->thread;
}

static struct time_slot *first_ready(void)
{
    struct time_slot *found = NULL;
    for (unsigned at = 0, end = used_slots(); at < end; at++) {
        struct time_slot *slot = &page->slot[at];
        if (slot->state == TIME_READY && (!found || is_before(slot, found)))
            found = slot;
    }
    return found;
}

/* The slot whose deadline comes first, and before `limit_ns`. */
static struct time_slot *first_due(int64_t limit_ns, int64_t *due_ns)
{
    struct time_slot *found = NULL;
    *due_ns = limit_ns;
    for (unsigned at = 0, end = used_slots(); at < end; at++) {
        struct time_slot *slot = &page->slot[at];
        int64_t deadline = slot->deadline_ns;
        if (slot->state != TIME_WAITING || deadline >= limit_ns)
            continue;
        if (!found || deadline < *due_ns || (deadline == *due_ns && is_before(slot, found))) {
            found = slot;
            *due_ns = deadline;
        }
    }
    return found;
}

/* Wakes a thread that polls; what is in the folder is the agent's own. */
static void write_waker(unsigned at)
{
    char name[16];
    struct stat found;
    if (!wakers[at]) {
        snprintf(name, sizeof name, "w%u", at);
        wakers[at] = openat(folder_file, name, O_RDWR | O_NONBLOCK | O_CLOEXEC | O_NOFOLLOW);
        if (wakers[at] < 0 || fstat(wakers[at], &found) || !S_ISFIFO(found.st_mode))
            on_destroyed(0);
    }
    if (write(wakers[at], "!", 1) < 0 && errno != EAGAIN)
        fail("a thread cannot be woken");
}

static void grant(struct time_slot *slot, uint32_t state)
{
    bool is_polling = state == TIME_WAITING && slot->kind == TIME_FD;
    if (!atomic_compare_exchange_strong(&slot->state, &state, TIME_GRANTED))
        return;
    last_granted = slot;
    slot->wake++;
    futex(&slot->wake, FUTEX_WAKE, INT32_MAX, NULL);
    if (is_polling)
        write_waker((unsigned)(slot - page->slot));
}

/* All sleep, so a thread that was granted and did not go on has ended. */
static void free_dead_slots(void)
{
    for (unsigned at = 0, end = used_slots(); at < end; at++) {
        uint32_t granted = TIME_GRANTED;
        atomic_compare_exchange_strong(&page->slot[at].state, &granted, TIME_FREE);
    }
}

/* Whether a thread runs by its slot: in wait4, for instance, the kernel calls one asleep that still runs. */
static bool one_runs(bool *is_granted)
{
    *is_granted = false;
    for (unsigned at = 0, end = used_slots(); at < end; at++) {
        struct time_slot *slot = &page->slot[at];
        uint32_t state = slot->state;
        *is_granted |= state == TIME_GRANTED;
        if (state == TIME_RUNNING && waits_unseen[at] != slot->wake + 1)
            return true;
    }
    return false;
}

static void note_unseen_waits(void)
{
    for (unsigned at = 0, end = used_slots(); at < end; at++)
        if (page->slot[at].state == TIME_RUNNING)
            waits_unseen[at] = page->slot[at].wake + 1;
}

static void advance(int64_t to_ns)
{
    if (to_ns > now_ns)
        now_ns = to_ns;
    page->now_ns = now_ns;
}

static bool is_header_whole(void)
{
    return page->magic == TIME_MAGIC && page->version == TIME_VERSION && page->slots == TIME_SLOTS && page->now_ns == now_ns
           && page->monotonic_base_ns == options.start_ns - START_UPTIME_S * SECOND && page->seed == options.seed;
}

static void write_header(void)
{
    page->version = TIME_VERSION;
    page->slots = TIME_SLOTS;
    page->now_ns = now_ns;
    page->monotonic_base_ns = options.start_ns - START_UPTIME_S * SECOND;
    page->seed = options.seed;
    page->magic = TIME_MAGIC;
}

static void repair_header(void)
{
    if (is_header_whole())
        return;
    is_overwritten = true;
    write_header();
}

/* -- replies -------------------------------------------------------------------------------------------------------- */

static int service_of(const struct busy_thread *busy)
{
    for (unsigned at = 0, end = used_slots(); at < end; at++) {
        struct time_slot *slot = &page->slot[at];
        if (slot->state != TIME_FREE && slot->tid == busy->inner_tid && slot->service < options.services)
            return (int)slot->service;
    }
    return -1;
}

/* A thread that computes; or in state W the one that was woken last, if waking threads again and again takes the agent itself
 * longer than that, and test time hardly goes on. So busy other programs do not matter. */
static void report_busy(void)
{
    struct busy_thread busy = processes_busy();
    char line[512], name[sizeof busy.name];
    double waking_s = 3 * (double)(time_of(CLOCK_PROCESS_CPUTIME_ID) - window_cpu_ns) / SECOND; /* the kernel and the threads take their part, too */
    if (waking_s > busy.processor_s && last_granted) {
        busy = (struct busy_thread){.tid = last_granted->tid, .inner_tid = last_granted->tid, .state = 'W', .processor_s = waking_s};
        memcpy(busy.name, last_granted->name, sizeof busy.name);
    }
    plain(name, busy.name, sizeof name);
    snprintf(line, sizeof line,
             "{\"busy\": {\"service\": %d, \"pid\": %d, \"tid\": %d, \"name\": \"%s\", \"state\": \"%c\", \"wall_s\": %.3f, "
             "\"processor_s\": %.3f}}\n",
             service_of(&busy), busy.pid, busy.tid, name, busy.state ? busy.state : '-',
             (double)(wall_ns() - waits_since) / SECOND, busy.processor_s);
    reply(line);
}

static int add_notes(char *text, size_t size)
{
    static const char *const kinds[] = {"", "static", "setuid", "slots", "spin", "clone"};
    uint32_t written = page->notes, first = notes_told;
    if (written - first > TIME_NOTES)
        first = written - TIME_NOTES;
    int length = is_overwritten ? snprintf(text, size, "{\"kind\": \"page\", \"service\": -1, \"name\": \"\"}") : 0;
    is_overwritten = false;
    for (uint32_t at = first; at != written && (size_t)length < size - 160; at++) {
        struct time_message *note = &page->note[at % TIME_NOTES];
        uint32_t kind = note->kind;
        char raw[sizeof note->name + 1] = {0}, name[sizeof raw];
        memcpy(raw, note->name, sizeof note->name);
        plain(name, raw, sizeof name);
        if (kind == TIME_NOTE_NONE || kind > TIME_NOTE_CLONE)
            continue;
        length += snprintf(text + length, size - (size_t)length, "%s{\"kind\": \"%s\", \"service\": %u, \"name\": \"%s\"}",
                           length ? ", " : "", kinds[kind], note->service % TIME_SERVICES, name);
    }
    notes_told = written;
    return length;
}

static void report_time(void)
{
    char line[4000], services[512] = "", gone[512] = "", notes[2600] = "";
    int length = 0, gone_length = 0;
    struct used used = processes_used();
    uint64_t live = used.one_has_ended ? processes_services() : UINT64_MAX;
    for (unsigned at = 0; at < options.services; at++) {
        if (has_begun[at])
            length += snprintf(services + length, sizeof services - (size_t)length, "%s%u", length ? ", " : "", at);
        if (has_begun[at] && !(live >> at & 1))
            gone_length += snprintf(gone + gone_length, sizeof gone - (size_t)gone_length, "%s%u", gone_length ? ", " : "", at);
    }
    add_notes(notes, sizeof notes);
    snprintf(line, sizeof line,
             "{\"now\": %lld, \"services\": [%s], \"gone\": [%s], \"repeatable\": %s, \"ran_s\": %.9f, \"has_ended\": %s, "
             "\"notes\": [%s]}\n",
             (long long)now_ns, services, gone, is_repeatable ? "true" : "false", used.seconds,
             used.one_has_ended ? "true" : "false", notes);
    reply(line);
}

/* -- commands ------------------------------------------------------------------------------------------------------- */

/* A line of the clock's, without waiting; false when there is none. */
static bool next_command(char *line, size_t size)
{
    static char text[1024];
    static size_t length;
    for (;;) {
        char *end = memchr(text, '\n', length);
        if (end) {
            size_t taken = (size_t)(end - text);
            snprintf(line, size, "%.*s", (int)taken, text);
            memmove(text, end + 1, length - taken - 1);
            length -= taken + 1;
            return true;
        }
        if (length == sizeof text)
            length = 0; /* no command is as long */
        ssize_t more = read(command_file, text + length, sizeof text - length);
        if (more <= 0)
            return false;
        length += (size_t)more;
    }
}

/* The clock has opened its FIFOs before the application starts, which may write to all files of a container: then nobody finds them.
 * On the host its sandbox hides them. */
static void hide_channels(void)
{
    struct pollfd commands = {command_file, POLLIN, 0};
    if (getpid() != 1 || is_found || poll(&commands, 1, 0) <= 0)
        return;
    is_found = true;
    unlinkat(folder_file, "command", 0);
    unlinkat(folder_file, "reply", 0);
}

/* Who keeps the clock waiting. */
static void report_at_times(void)
{
    int64_t now = wall_ns();
    if (now - reported > REPORT_MS * (SECOND / 1000)) {
        reported = now;
        report_busy();
    }
}

static void await_quiet(void)
{
    int64_t asleep_since = 0;
    waits_since = wall_ns();
    int64_t nap = SHORTEST_NAP_US;
    processes_begin_wait();
    for (bool is_new = true;;) {
        uint32_t seen = page->activity;
        int64_t now = wall_ns();
        bool is_granted, runs = one_runs(&is_granted), is_off = true;
        if (is_new && (runs || is_granted)) { /* it says soon itself that it waits */
        } else if (processes_are_quiet(runs ? &is_off : NULL)) {
            asleep_since = is_off ? 0 : asleep_since ? asleep_since : now;
            if (is_off || now - asleep_since > UNSEEN_WAIT_MS * (SECOND / 1000)) {
                note_unseen_waits();
                free_dead_slots();
                repair_header();
                return;
            }
        } else {
            asleep_since = 0;
        }
        report_at_times();
        struct timespec pause = {0, nap * 1000};
        is_new = !futex(&page->activity, FUTEX_WAIT, seen, &pause) || errno == EAGAIN;
        nap = is_new ? SHORTEST_NAP_US : nap * 3 / 2 < LONGEST_NAP_US ? nap * 3 / 2 : LONGEST_NAP_US;
    }
}

/* Lets the application run until `limit_ns`: what is due before that, and what is ready. */
static void run(int64_t limit_ns)
{
    reported = wall_ns();
    for (;; report_at_times()) {
        await_quiet();
        if (now_ns - window_ns > WINDOW_NS) {
            window_ns = now_ns;
            window_cpu_ns = time_of(CLOCK_PROCESS_CPUTIME_ID);
        }
        if (is_over && processes_have_ended())
            return;
        if (is_over)
            limit_ns = TIME_NEVER;
        struct time_slot *slot = first_ready();
        int64_t due_ns;
        if (slot) {
            grant(slot, TIME_READY);
        } else if ((slot = first_due(limit_ns, &due_ns))) {
            advance(due_ns);
            grant(slot, TIME_WAITING);
        } else if (is_over) {
            usleep(LONGEST_NAP_US);
        } else {
            advance(limit_ns);
            return;
        }
    }
}

static unsigned begun_services(void)
{
    unsigned count = 0;
    for (unsigned at = 0; at < options.services; at++)
        count += has_begun[at] |= page->processes[at] > 0;
    return count;
}

/* Until each service has a process; then to the start of the test, or beyond it where a service came late. */
static void start(void)
{
    unsigned known = 0;
    int64_t since = wall_ns(), end = since + START_MOST_S * SECOND;
    for (; begun_services() < options.services && wall_ns() < end && !is_over; usleep(2000)) {
        hide_channels();
        if (begun_services() != known) {
            known = begun_services();
            since = wall_ns();
        }
        int64_t late = wall_ns() - since - options.patience_s * SECOND;
        if (known && late > 0) { /* others wait for what these do: time goes on as on the wall */
            is_repeatable = false;
            run(options.start_ns + late);
        }
    }
    hide_channels();
    run(options.begin_ns);
    begun_services();
    window_ns = 0;
}

static void serve(void)
{
    char line[256];
    struct pollfd commands = {command_file, POLLIN, 0};
    while (!is_over) {
        hide_channels();
        if (!next_command(line, sizeof line)) {
            poll(&commands, 1, END_MS);
        } else if (!strncmp(line, "run ", 4)) {
            run(strtoll(line + 4, NULL, 10));
            report_time();
        }
    }
    run(TIME_NEVER);
}

/* -- setting up ----------------------------------------------------------------------------------------------------- */

static void make_fifo(const char *name, mode_t mode)
{
    if (mkfifoat(folder_file, name, mode))
        fail(name);
}

static int make_channel(const char *name)
{
    make_fifo(name, 0600);
    int file = openat(folder_file, name, O_RDWR | O_NONBLOCK | O_CLOEXEC | O_NOFOLLOW);
    if (file < 0)
        fail(name);
    return file;
}

static void make_page(void)
{
    static const char path[] = "page";
    int file = openat(folder_file, path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (file < 0 || posix_fallocate(file, 0, sizeof *page))
        fail(path);
    page = mmap(NULL, sizeof *page, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    if (page == MAP_FAILED)
        fail(path);
    close(file);
    now_ns = options.start_ns;
    write_header();
}

static void set_up(void)
{
    struct rlimit files;
    if (!getrlimit(RLIMIT_NOFILE, &files)) {
        files.rlim_cur = files.rlim_max;
        setrlimit(RLIMIT_NOFILE, &files);
    }
    umask(0);
    if (mkdir(options.folder, 0755) || (folder_file = open(options.folder, O_PATH | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC)) < 0)
        fail(options.folder);
    make_page();
    for (unsigned at = 0; at < TIME_SLOTS; at++) {
        char name[16];
        snprintf(name, sizeof name, "w%u", at);
        make_fifo(name, 0666);
    }
    command_file = make_channel("command");
    reply_file = make_channel("reply");
    sigaction(SIGTERM, &(struct sigaction){.sa_sigaction = on_end, .sa_flags = SA_SIGINFO | SA_RESTART}, NULL);
    signal(SIGBUS, on_destroyed);
    if (mknodat(folder_file, "ready", S_IFREG | 0644, 0))
        fail("ready");
    puts("{\"dodo\": \"ready\"}"); /* to the runner, which cannot see the folder */
    fflush(stdout);
}

static void read_options(int count, char **words)
{
    static const struct option known[] = {
        {"folder", required_argument, NULL, 'f'}, {"services", required_argument, NULL, 'n'},
        {"start", required_argument, NULL, 's'}, {"begin", required_argument, NULL, 'b'},
        {"seed", required_argument, NULL, 'r'}, {"patience", required_argument, NULL, 'w'},
        {"nested", no_argument, NULL, 'p'}, {"version", no_argument, NULL, 'v'}, {"by-environment", no_argument, NULL, 'e'}, {0}};
    for (int option; (option = getopt_long(count, words, "", known, NULL)) != -1;)
        switch (option) {
        case 'f': options.folder = optarg; break;
        case 'n': options.services = (unsigned)strtoul(optarg, NULL, 10); break;
        case 's': options.start_ns = strtoll(optarg, NULL, 10); break;
        case 'b': options.begin_ns = strtoll(optarg, NULL, 10); break;
        case 'w': options.patience_s = strtoll(optarg, NULL, 10); break;
        case 'r': options.seed = strtoull(optarg, NULL, 10); break;
        case 'p': options.nested = true; break;
        case 'e': options.by_environment = true; break;
        case 'v': printf("%d\n", TIME_VERSION); exit(0);
        default: exit(2);
        }
    if (!options.folder || options.services < 1 || options.services > TIME_SERVICES || options.begin_ns < options.start_ns) {
        fprintf(stderr, "dodo-time: expected --folder=F --services=1..64 --start=NS --begin=NS [--patience=S] [--seed=N] "
                        "[--nested [--by-environment]]\n");
        exit(2);
    }
}

int main(int count, char **words)
{
    read_options(count, words);
    signal(SIGCHLD, SIG_IGN); /* as process 1 of a container it would have to wait for orphans */
    prctl(PR_SET_DUMPABLE, 0); /* in a container the application may have the same user: it must not trace the agent */
    set_up();
    processes_init(&(struct selection){options.nested, options.by_environment ? options.folder : NULL});
    start();
    serve();
    return 0;
}
