#include "gantry.h"

#include <string.h>

#include "drivers/rig.h"
#include "line.h"
#include "motion/homing.h"
#include "motion/motion.h"
#include "port.h"
#include "supervision/driver_monitor.h"
#include "supervision/supervision.h"

static struct line line;
static uint32_t ticked;

static void answer_error(uint8_t error)
{
    char text[] = "$ERROR:0";
    text[sizeof text - 2] = (char)('0' + error);
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

static uint8_t calibrate(void)
{
    if (rig.mode == MODE_HOMING)
        return ERROR_HOMING;
    homing_start();
    return 0;
}

static void stop(void)
{
    rig_stop(0);
    rig_acknowledge();
}

static uint8_t execute(const struct request *request)
{
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
    ticked = port_now();
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
    supervise_host(now);
    motion_tick(now);
    driver_monitor_tick(now);
    homing_tick(now);
}
