/* Resets, power, and the drivers' standby line. */
#include <string.h>

#include "board/board_internal.h"
#include "telemetry.h"

#define STANDBY_MASK 0x10 /* of port D */
#define MCUSR_DATA 0x54
#define START_UP 0.065  /* s, the chip's own after any reset */
#define HOLD 0.25       /* s that a capacitor keeps the undriven reset of the drivers high */
#define JUMP_TO_ITSELF 0xCFFF

static void unhang(void)
{
    if (board.hung_word == 0)
        return;
    memcpy(board.avr->flash + board.hung_at, &board.hung_word, sizeof board.hung_word);
    board.hung_word = 0;
}

/* simavr calls it at the end of each reset, also the watchdog's. */
static void after_reset(avr_t *avr)
{
    if (board.reset != NULL)
        board.reset(avr);
    unhang();
    board.was_reset = true;
    board.sent_count = 0;
    board.busy_until = board.debt = board.looped = board.line_end = 0;
    board.starts = board.plant->time + START_UP;
    chain_select(&board.plant->chain, false);
    if (!board.requested)
        telemetry_send("\"event\": \"reset\", \"t\": %.4f, \"reason\": \"watchdog\"", board.plant->time);
}

void board_reset(enum board_reset reason)
{
    static const char *const names[] = {"power", "opened", "watchdog", "ordered"};
    static const uint8_t flags[] = {1, 2, 8, 2}; /* of MCUSR */
    if (!board.powered)
        return;
    board.requested = true;
    avr_reset(board.avr);
    board.requested = false;
    board.avr->data[MCUSR_DATA] = flags[reason];
    board.starts = board.plant->time + START_UP;
    telemetry_send("\"event\": \"reset\", \"t\": %.4f, \"reason\": \"%s\"", board.plant->time, names[reason]);
}

void board_power(bool on)
{
    bool begins = on && !board.powered;
    board.powered = on;
    if (begins)
        board_reset(RESET_POWER);
    if (!on)
        board.standby_until = board.plant->time;
}

void board_hold(bool held)
{
    bool ends = board.held && !held;
    board.held = held;
    if (ends)
        board_reset(RESET_BUTTON);
}

void board_hang(void)
{
    const uint16_t jump = JUMP_TO_ITSELF;
    unhang();
    board.hung_at = board.avr->pc;
    memcpy(&board.hung_word, board.avr->flash + board.hung_at, sizeof board.hung_word);
    memcpy(board.avr->flash + board.hung_at, &jump, sizeof jump);
    board.avr->sreg[S_I] = 0;
    board.avr->state = cpu_Running;
}

/* An undriven pin keeps its level for a while; a controller without power pulls it low. */
void board_update_standby(void)
{
    avr_ioport_state_t port = {.ddr = 0};
    double now = board.plant->time;
    avr_ioctl(board.avr, AVR_IOCTL_IOPORT_GETSTATE('D'), &port);
    bool driven = board_runs() && (port.ddr & STANDBY_MASK) != 0;
    if (driven)
        board.standby_until = (port.port & STANDBY_MASK) != 0 ? now + HOLD : now;
    bool alive = board.powered && now < board.standby_until;
    for (int i = 0; i < CHIPS; i++)
        l6470_wake(&board.plant->chain.chips[i], alive);
}

void board_wire_resets(void)
{
    board.reset = board.avr->reset;
    board.avr->reset = after_reset;
}
