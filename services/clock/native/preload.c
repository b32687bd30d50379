/* libdodo-time.so, preloaded into each process of the application: gives it the time of the test.
 *
 * Here: how a process begins, its threads' slots, and the gate at which each waits until the agent grants it. Whatever
 * libc cannot do yet when the first of our functions is called, from the constructor of another library, is not needed.
 */
#define _GNU_SOURCE
#include "library.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <linux/futex.h>
#include <stddef.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/stat.h>

enum stage { NEW, STARTING, STARTED };

struct real_functions real;
__thread struct self self __attribute__((tls_model("initial-exec")));
struct time_page *page;

struct process process;

static _Atomic int stage;

/* -- what this process is ------------------------------------------------------------------------------------------- */

bool is_starting(void)
{
    return stage == STARTING;
}

unsigned own_index(void)
{
    return (unsigned)(self.slot - page->slot);
}

uint32_t next_process_number(void)
{
    return page->processes[process.service]++;
}

static void fail(const char *why)
{
    static const char begin[] = "DoDo's clock: ", end[] = ": this program of a test in lockstep cannot run\n";
    RAW_3(SYS_write, 2, begin, sizeof begin - 1);
    RAW_3(SYS_write, 2, why, strlen(why));
    RAW_3(SYS_write, 2, end, sizeof end - 1);
    RAW_1(SYS_exit_group, 127);
}

void note(uint32_t kind, const char *name)
{
    struct time_message *message = &page->note[page->notes++ % TIME_NOTES];
    message->kind = TIME_NOTE_NONE;
    message->service = process.service;
    strncpy(message->name, name, sizeof message->name);
    message->kind = kind;
}

void block_signals(uint64_t *before)
{
    uint64_t all = ~UINT64_C(0);
    RAW_4(SYS_rt_sigprocmask, SIG_SETMASK, &all, before, sizeof all);
}

void restore_signals(const uint64_t *before)
{
    RAW_4(SYS_rt_sigprocmask, SIG_SETMASK, before, NULL, sizeof *before);
}

void take_lock(_Atomic uint32_t *lock, uint64_t *signals)
{
    block_signals(signals);
    for (uint32_t free = 0; !atomic_compare_exchange_strong(lock, &free, 1); free = 0)
        RAW_1(SYS_sched_yield, 0);
}

void give_lock(_Atomic uint32_t *lock, const uint64_t *signals)
{
    *lock = 0;
    restore_signals(signals);
}

/* -- slots ---------------------------------------------------------------------------------------------------------- */

static unsigned free_slot(void)
{
    for (unsigned at = 0; at < TIME_SLOTS; at++) {
        uint32_t expected = TIME_FREE;
        if (page->slot[at].state == TIME_FREE
            && atomic_compare_exchange_strong(&page->slot[at].state, &expected, TIME_RUNNING))
            return at;
    }
    return TIME_SLOTS;
}

/* Frees slots of threads of this service that have ended without a word. */
static void reclaim_slots(void)
{
    for (unsigned at = 0; at < TIME_SLOTS; at++) {
        struct time_slot *slot = &page->slot[at];
        if (slot->service == process.service && slot->pid && RAW_3(SYS_tgkill, slot->pid, slot->tid, 0) == -ESRCH)
            slot->state = TIME_FREE;
    }
}

unsigned take_slot(uint32_t of_process, uint32_t thread)
{
    unsigned at = free_slot();
    if (at == TIME_SLOTS) {
        reclaim_slots();
        at = free_slot();
    }
    if (at == TIME_SLOTS) {
        note(TIME_NOTE_SLOTS, "");
        return at;
    }
    struct time_slot *slot = &page->slot[at];
    slot->pid = slot->tid = 0;
    slot->kind = TIME_START;
    slot->deadline_ns = TIME_NEVER;
    slot->key = 0;
    slot->service = process.service;
    slot->process = of_process;
    slot->thread = thread;
    return at;
}

void adopt_slot(unsigned at)
{
    self = (struct self){.has_ended = at == TIME_SLOTS};
    if (at == TIME_SLOTS)
        return;
    self.slot = &page->slot[at];
    self.slot->pid = (int)RAW_1(SYS_getpid, 0);
    self.slot->tid = (int)RAW_1(SYS_gettid, 0);
    RAW_2(SYS_prctl, PR_GET_NAME, self.slot->name);
}

void release_slot(void)
{
    if (self.slot)
        self.slot->state = TIME_FREE;
    self.slot = NULL;
    self.has_ended = true;
}

/* -- waits ---------------------------------------------------------------------------------------------------------- */

void announce(void)
{
    page->activity++;
    RAW_3(SYS_futex, &page->activity, FUTEX_WAKE, INT_MAX);
}

void enter(uint32_t kind, int64_t deadline_ns)
{
    self.is_restarting = true;
    self.slot->kind = kind;
    self.slot->deadline_ns = deadline_ns;
    self.slot->state = TIME_WAITING;
    announce();
}

static bool change(uint32_t from, uint32_t to)
{
    return atomic_compare_exchange_strong(&self.slot->state, &from, to);
}

/* The agent took this thread for dead, as somebody had stopped it (SIGSTOP) when it was granted. */
static void take_slot_again(void)
{
    struct time_slot *before = self.slot;
    uint32_t of_process = before->process, thread = before->thread;
    if (before->tid == (int)RAW_1(SYS_gettid, 0) && change(TIME_FREE, TIME_RUNNING))
        return;
    queue_leave();
    unsigned at = take_slot(of_process, thread);
    if (at == TIME_SLOTS)
        at = (unsigned)(before - page->slot);
    adopt_slot(at);
}

int pass_gate(void)
{
    /* With a timeout, a futex ends with EINTR whatever the flags of the signal's handler are */
    struct timespec forever = {INT_MAX, 0};
    bool is_interrupted = false;
    for (;;) {
        uint32_t wake = self.slot->wake, state = self.slot->state;
        if (state == TIME_GRANTED && change(TIME_GRANTED, TIME_RUNNING))
            break;
        if (state == TIME_RUNNING)
            return EINTR; /* the handler passed in its own place */
        if (state == TIME_FREE)
            take_slot_again();
        else if (state > TIME_GRANTED)
            self.slot->state = TIME_READY;
        else if (state != TIME_GRANTED && RAW_4(SYS_futex, &self.slot->wake, FUTEX_WAIT, wake, &forever) == -EINTR) {
            is_interrupted = true;
            if (change(TIME_WAITING, TIME_READY))
                announce();
        }
    }
    if (now_ns() < self.slot->deadline_ns)
        self.spins = 0; /* something came */
    return is_interrupted ? EINTR : 0;
}

int pass_gate_as_ready(void)
{
    if (change(TIME_WAITING, TIME_READY))
        announce();
    return pass_gate();
}

void begin_as_ready(void)
{
    if (!self.slot)
        return;
    self.slot->state = TIME_READY; /* also if a handler that ran meanwhile had been granted */
    announce();
    pass_gate();
}

void enter_kernel(void)
{
    if (is_managed())
        enter(TIME_KERNEL, TIME_NEVER);
}

void leave_kernel(void)
{
    int error = errno;
    begin_as_ready();
    errno = error;
}

/* -- how a process begins ------------------------------------------------------------------------------------------- */

static void find_real_functions(void)
{
#define X(name) real.name = (__typeof__(real.name))dlsym(RTLD_NEXT, #name);
    REAL_FUNCTIONS(X)
#undef X
    Dl_info own;
    if (dladdr(&page, &own) && own.dli_fname)
        strncpy(process.library, own.dli_fname, sizeof process.library - 1);
}

static void open_page(void)
{
    char path[sizeof process.folder + 8];
    const char *given = getenv("DODO_TIME");
    if (!given || strlen(given) >= sizeof process.folder)
        fail("no folder of the test's time is given");
    strcpy(process.folder, given);
    strcat(strcpy(path, process.folder), "/page");
    long file = RAW_4(SYS_openat, AT_FDCWD, path, O_RDWR | O_CLOEXEC, 0);
    if (file < 0)
        fail("the page of the test's time cannot be opened");
    struct stat found;
    if (fstat((int)file, &found) || found.st_size < (off_t)sizeof *page)
        fail("the page of the test's time is too short");
    long at = RAW_6(SYS_mmap, NULL, sizeof *page, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    RAW_1(SYS_close, file);
    if (at < 0 && at > -4096)
        fail("the page of the test's time cannot be mapped");
    page = (struct time_page *)at;
    if (page->magic != TIME_MAGIC || page->version != TIME_VERSION || page->slots != TIME_SLOTS)
        fail("the page of the test's time is of another version");
}

/* The number at the beginning of a variable, and what stands behind it. With new glibcs, strtoul would be a function that musl lacks. */
static uint32_t number_in(const char *text, const char **end)
{
    uint32_t number = 0;
    while (text && *text >= '0' && *text <= '9')
        number = number * 10 + (uint32_t)(*text++ - '0');
    if (end)
        *end = text;
    return number;
}

static uint32_t given_service(void)
{
    return number_in(getenv("DODO_TIME_SERVICE"), NULL) % TIME_SERVICES;
}

/* The number is known before where a process of the application began this one: after execve it is that of before. */
static void take_process_number(void)
{
    char *given = getenv("DODO_TIME_PROCESS");
    const char *end;
    uint32_t number = number_in(given, &end);
    if (!given || end == given || *end != ':') {
        process.number = next_process_number();
        return;
    }
    int of = (int)number_in(end + 1, NULL), own = (int)RAW_1(SYS_getpid, 0);
    *given = 0; /* nobody inherits it */
    process.number = of == 0 || of == own ? number : next_process_number();
    for (unsigned at = 0; of == own && at < TIME_SLOTS; at++) {
        struct time_slot *slot = &page->slot[at];
        if (slot->service == process.service && slot->process == process.number && slot->pid == own)
            slot->state = TIME_FREE; /* of the program before */
    }
}

static void start(void)
{
    int error = errno;
    stage = STARTING;
    find_real_functions();
    open_page();
    process.service = given_service();
    take_process_number();
    adopt_slot(take_slot(process.number, process.threads++));
    processes_start();
    begin_as_ready();
    stage = STARTED;
    errno = error;
}

bool is_managed(void)
{
    if (self.slot)
        return true;
    if (self.has_ended || stage == STARTING)
        return false;
    if (stage == NEW)
        start();
    else { /* not begun by pthread_create */
        adopt_slot(take_slot(process.number, process.threads++));
        if (self.slot)
            note(TIME_NOTE_CLONE, self.slot->name);
    }
    return self.slot != NULL;
}

/* A health check of a container's, or a command that somebody runs in it, keeps the machine's time: nobody would let it
 * go on. It begins again without the library. */
static void leave_to_outside(char **words)
{
    if (stage != NEW || RAW_1(SYS_getppid, 0) != 0 || getenv("DODO_TIME_PROCESS"))
        return;
    open_page();
    if (!page->processes[given_service()])
        return;
    const char *loaded = getenv("LD_PRELOAD"), *others = loaded ? strchr(loaded, ':') : NULL;
    if (others)
        setenv("LD_PRELOAD", others + 1, 1);
    else
        unsetenv("LD_PRELOAD");
    RAW_3(SYS_execve, "/proc/self/exe", words, environ);
    fail("a command that was run in the container cannot keep the machine's time");
}

__attribute__((constructor)) static void on_load(int count, char **words)
{
    if (!gnu_get_libc_version) /* musl gives a constructor no words: they are before the environment, behind their number */
        for (count = 0, words = environ - 1; (uintptr_t)words[-1] != (uintptr_t)count; count++)
            words--;
    leave_to_outside(words);
    is_managed();
}

__attribute__((destructor)) static void on_unload(void)
{
    release_slot();
}

PUBLIC void _exit(int status)
{
    release_slot();
    for (;;)
        RAW_1(SYS_exit_group, status);
}

ALIAS(_Exit, _exit);

/* -- fork ----------------------------------------------------------------------------------------------------------- */

static uint32_t child_process;
static unsigned child_slot = TIME_SLOTS;

void before_fork(void)
{
    child_process = next_process_number();
    child_slot = take_slot(child_process, 0);
}

void forget_child(void)
{
    if (child_slot != TIME_SLOTS)
        page->slot[child_slot].state = TIME_FREE;
}

void in_forked_child(void)
{
    process.number = child_process;
    process.threads = 1;
    queues_after_fork();
    files_after_fork();
    timers_after_fork();
    processes_after_fork();
    adopt_slot(child_slot);
    begin_as_ready();
}
