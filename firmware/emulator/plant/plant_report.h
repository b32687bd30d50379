/* The plant's state as telemetry. */
#ifndef PLANT_REPORT_H
#define PLANT_REPORT_H

#include "plant/plant.h"

/* The true pose. */
void plant_report_pose(const struct plant *plant);

/* The drivers' highest speeds and ramps, and their travel. */
void plant_report_extremes(const struct plant *plant);

#endif
