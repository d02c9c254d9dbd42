/* State of the ground anchor; included by unit.h. Names as in ground_anchor.py. */
#ifndef GROUND_ANCHOR_H
#define GROUND_ANCHOR_H

typedef struct {
    double plastic_elongation, plastic_before; /* now, and before the last step [m] */
    double stiffness, yield_force;             /* of the last step */
} Model;

PLAIN_STATE

#endif
