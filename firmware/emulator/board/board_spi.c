/* The SPI: a byte takes eight clocks of the configured rate instead of simavr's 100 us. */
#include "board/board_internal.h"

#define SELECT_PIN 2 /* of port B */

static avr_cycle_count_t spi_cycles(void)
{
    static const uint8_t dividers[8] = {4, 2, 16, 8, 64, 32, 128, 64};
    uint8_t control = board.avr->data[board.spi->r_spcr] & 3, doubled = board.avr->data[board.spi->r_spsr] & 1;
    return 8U * dividers[control << 1 | doubled];
}

static avr_cycle_count_t spi_done(avr_t *avr, avr_cycle_count_t when, void *parameter)
{
    (void)when, (void)parameter;
    board.spi->input_data_register = chain_shift(&board.plant->chain, board.spi_byte);
    avr_raise_interrupt(avr, &board.spi->spi);
    return 0;
}

static void spi_write(avr_t *avr, avr_io_addr_t address, uint8_t value, void *parameter)
{
    (void)address, (void)parameter;
    if (!avr_regbit_get(avr, board.spi->spe))
        return;
    avr_clear_interrupt(avr, &board.spi->spi);
    board.spi_byte = value;
    avr_cycle_timer_register(avr, spi_cycles(), spi_done, NULL);
}

static void select_changed(avr_irq_t *irq, uint32_t value, void *parameter)
{
    (void)irq, (void)parameter;
    chain_select(&board.plant->chain, (value & 1) == 0);
}

void board_wire_spi(void)
{
    board.avr->io[board.spi->r_spdr - DATA_TO_IO].w.c = spi_write;
    avr_irq_register_notify(avr_io_getirq(board.avr, AVR_IOCTL_IOPORT_GETIRQ('B'), SELECT_PIN), select_changed, NULL);
}
