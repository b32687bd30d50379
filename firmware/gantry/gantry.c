#include "gantry.h"

#include <string.h>

#include "drivers/circle.h"
#include "drivers/rig.h"
#include "line.h"
#include "memory/record.h"
#include "motion/motion.h"
#include "port.h"
#include "supervision/supervision.h"

static struct line line;
static uint32_t ticked;

static void answer_error(uint8_t error)
{
    char text[] = "$ERROR:10", *at = text + sizeof text - 3;
    if (error >= 10)
        at++;
    *at++ = (char)('0' + error % 10);
    *at = '\0';
    port_send_line(text);
}

static uint8_t status(void)
{
    if (rig.trouble != 0)
        return rig.trouble;
    if (rig.mode == MODE_HOMING)
        return STATUS_HOMING;
    if (rig.mode == MODE_GOTO_PENDING || rig.mode == MODE_GOTO || rig_moving())
        return STATUS_MOVING;
    return rig.calibrated ? STATUS_IDLE : STATUS_NOT_CALIBRATED;
}

static void answer_status(void)
{
    char text[] = "$0";
    text[1] = (char)('0' + status());
    port_send_line(text);
}

static uint8_t answer_position(void)
{
    char text[3 * 12 + 2], *at = text;
    if (!rig.calibrated)
        return ERROR_UNCALIBRATED;
    rig_poll();
    for (uint8_t a = 0; a < AXES; a++) {
        *at++ = a == 0 ? '$' : ',';
        at = line_number(at, rig_position(a));
    }
    port_send_line(text);
    return 0;
}

static void answer_limits(void)
{
    char text[8 + LIMITS * 10 + 2] = "$LIMITS:", *at = text + 8;
    for (uint8_t i = 0; i < LIMITS; i++) {
        at = line_number(at, record_limits[i]);
        *at++ = ',';
    }
    *at++ = (char)('0' + record_source);
    *at = '\0';
    port_send_line(text);
}

/* Why the limits, and that home is known, may not change now; 0 when they may. */
static uint8_t engaged(void)
{
    if (rig.mode == MODE_HOMING)
        return ERROR_HOMING;
    if (rig.trouble != 0)
        return ERROR_TROUBLE;
    return rig.mode != MODE_REST || rig_moving() || record_source == SOURCE_WRITING ? ERROR_BUSY : 0;
}

static uint8_t forget(void)
{
    uint8_t error = engaged();
    if (error == 0)
        rig_void_position();
    return error;
}

static uint8_t set_limits(const int32_t *set)
{
    uint8_t error = engaged();
    if (error != 0)
        return error;
    if (rig.calibrated)
        return ERROR_BUSY;
    return record_write(set) ? 0 : ERROR_BOUNDS;
}

static uint8_t calibrate(void)
{
    if (rig.mode == MODE_HOMING)
        return ERROR_HOMING;
    if (record_source == SOURCE_WRITING)
        return ERROR_BUSY;
    homing_start();
    return 0;
}

static void stop(void)
{
    rig_stop(0);
    rig_acknowledge();
}

static uint8_t goto_heading(const struct request *request)
{
    uint8_t error = motion_goto(request->numbers);
    if (error == 0)
        circle.way = request->command == COMMAND_GOTO       ? WAY_SHORTEST
                     : request->command == COMMAND_GOTOLEFT ? WAY_LEFT
                                                            : WAY_RIGHT;
    return error;
}

static uint8_t execute(const struct request *request)
{
    if (RIG_KIND == KIND_CIRCLE && (request->command == COMMAND_GOTO || request->command >= COMMAND_GOTOLEFT))
        return goto_heading(request);
    if (request->command == COMMAND_STOP || request->command == COMMAND_CALIBRATE)
        rig.resumed = false;
    switch (request->command) {
    case COMMAND_GOTO:
        return motion_goto(request->numbers);
    case COMMAND_RUN:
        return motion_run(request->numbers, port_now());
    case COMMAND_STOP:
        stop();
        return 0;
    case COMMAND_CALIBRATE:
        return calibrate();
    case COMMAND_POSITION:
        return answer_position();
    case COMMAND_LIMITS:
        answer_limits();
        return 0;
    case COMMAND_SETLIMITS:
        return set_limits(request->numbers);
    case COMMAND_FORGET:
        return forget();
    default:
        answer_status();
        return 0;
    }
}

void gantry_receive(uint8_t byte)
{
    struct request request;
    enum line_state state = line_receive(&line, byte);
    if (state == LINE_OPEN || (state == LINE_DONE && line.text[0] == '\0'))
        return;
    uint8_t error = state == LINE_DAMAGED ? ERROR_DAMAGED : line_parse(line.text, &request);
    if (error == 0)
        error = execute(&request);
    if (error == 0)
        rig.line_received = port_now();
    else
        answer_error(error);
}

/* GOTO and CALIBRATE end when the host falls silent. */
static void supervise_host(uint32_t now)
{
    bool unattended = rig.mode == MODE_GOTO_PENDING || rig.mode == MODE_GOTO || rig.mode == MODE_HOMING;
    if (unattended && now - rig.line_received >= WATCHDOG_MS)
        rig_fail(STATUS_WATCHDOG, 0);
}

void gantry_start(void)
{
    memset(&line, 0, sizeof line);
    memset(&rig, 0, sizeof rig);
    if (RIG_KIND == KIND_CIRCLE)
        memset(&circle, 0, sizeof circle);
    ticked = port_now();
    record_start();
    homing_restore();
}

void gantry_tick(void)
{
    uint32_t now = port_now();
    if (now - ticked < TICK_MS)
        return;
    ticked = now;
    rig_poll();
    supervision_tick();
    if (RIG_KIND == KIND_CIRCLE)
        turns_tick();
    supervise_host(now);
    motion_tick(now);
    driver_monitor_tick(now);
    homing_tick(now);
    record_tick();
}
