/* The page that the agent (agent.c) and the library in the application's processes (preload.c) share.
 *
 * All fields are little-endian atomics. The application can write whatever it likes into the page: the agent checks each
 * index, state and number that it reads here, and takes the page for nothing but who waits, and until when.
 */
#ifndef DODO_TIME_PAGE_H
#define DODO_TIME_PAGE_H

#include <stdatomic.h>
#include <stdint.h>

#define TIME_MAGIC UINT64_C(0x454d49544f444f44) /* "DODOTIME" */
#define TIME_VERSION 1
#define TIME_SLOTS 1024
#define TIME_SERVICES 64
#define TIME_NOTES 64
#define TIME_NEVER INT64_MAX
#define START_UPTIME_S 1000 /* CLOCK_MONOTONIC as the application starts */

/* What a thread does. Only its own thread writes FREE, RUNNING, WAITING and READY, but for a waker
 * that turns WAITING into READY; only the agent writes GRANTED. Changes from WAITING are made by compare-and-exchange. */
enum time_state { TIME_FREE, TIME_RUNNING, TIME_WAITING, TIME_READY, TIME_GRANTED };

/* What it waits for. The kernel wakes those of kind FD and KERNEL, the agent or a waker all others. */
enum time_kind { TIME_START, TIME_SLEEP, TIME_COND, TIME_LOCK, TIME_FD, TIME_KERNEL };

enum time_note { TIME_NOTE_NONE, TIME_NOTE_STATIC, TIME_NOTE_SETUID, TIME_NOTE_SLOTS, TIME_NOTE_SPIN, TIME_NOTE_CLONE };

struct time_slot {
    _Atomic uint32_t state;
    _Atomic uint32_t wake; /* futex word, not private: changes with each grant */
    _Atomic int64_t deadline_ns; /* test time since 1970; TIME_NEVER without one */
    _Atomic uint32_t kind;
    _Atomic uint32_t service; /* index of the service of the application */
    _Atomic uint32_t process; /* n-th process of its service */
    _Atomic uint32_t thread; /* n-th thread of its process */
    _Atomic int32_t pid, tid; /* as the process itself sees them */
    char name[16];
    _Atomic uint32_t key; /* of what it waits for, if several processes share that; 0 once one of them wakes it */
    char unused[68];
};

struct time_message {
    _Atomic uint32_t kind; /* written last */
    _Atomic uint32_t service;
    char name[56];
};

struct time_page {
    _Atomic uint64_t magic; /* written last */
    _Atomic uint32_t version, slots;
    _Atomic int64_t now_ns; /* test time since 1970: CLOCK_REALTIME; only the agent writes it */
    _Atomic int64_t monotonic_base_ns; /* CLOCK_MONOTONIC is now_ns less this */
    _Atomic uint64_t seed;
    _Atomic uint32_t activity; /* futex word: increments when a slot begins to wait or becomes READY */
    _Atomic uint32_t notes; /* how many were written; the n-th is at n % TIME_NOTES */
    _Atomic uint32_t processes[TIME_SERVICES]; /* how many each service has had */
    _Atomic uint32_t sources; /* of randomness that were opened */
    char unused[4096 - 52 - 4 * TIME_SERVICES];
    struct time_message note[TIME_NOTES];
    struct time_slot slot[TIME_SLOTS];
};

_Static_assert(sizeof(struct time_slot) == 128, "a slot has 128 bytes");
_Static_assert(sizeof(struct time_message) == 64, "a note has 64 bytes");
_Static_assert(sizeof(struct time_page) == 4096 + 64 * TIME_NOTES + 128 * TIME_SLOTS, "the page has no gaps");

#endif
