/* State of the ground anchor; included by unit.h. Names as in ground_anchor.py. */
#ifndef GROUND_ANCHOR_H
#define GROUND_ANCHOR_H

typedef struct {
    double plastic_elongation; /* [m] */
} Model;

PLAIN_STATE

#endif
