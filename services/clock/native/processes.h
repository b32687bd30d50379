/* The processes of the application as the agent sees them in /proc: whether all of their threads sleep. */
#ifndef DODO_PROCESSES_H
#define DODO_PROCESSES_H

#include <stdbool.h>
#include <stdint.h>

/* Which processes belong to the application. */
struct selection {
    bool nested;        /* those in PID namespaces below the agent's own; else all of its namespace but itself */
    const char *folder; /* with NESTED: only those with DODO_TIME=FOLDER in their environment; NULL for all */
};

/* A thread that kept the application from being quiet. */
struct busy_thread {
    int pid, tid;       /* as the agent sees them; 0 for none */
    int inner_tid;      /* as the thread itself sees it */
    char state;         /* as in /proc/PID/task/TID/status: R or D */
    double processor_s; /* processor time since it was first seen busy in this wait */
    char name[16];
};

/* Processor time since it was asked last, which lacks the last part of processes that have ended meanwhile. */
struct used {
    double seconds;
    bool one_has_ended;
};

void processes_init(const struct selection *selection);
/* A new wait begins: processor time is counted anew. */
void processes_begin_wait(void);
/* Whether all threads slept at one moment during this call; `is_off` says whether the kernel knows of each where. */
bool processes_are_quiet(bool *is_off);
/* The thread that was found busy at last. */
struct busy_thread processes_busy(void);
struct used processes_used(void);
/* The services, as bits by their numbers, that have a process; all bits where nobody may know. */
uint64_t processes_services(void);
/* Whether nothing of the application is left. */
bool processes_have_ended(void);

#endif
