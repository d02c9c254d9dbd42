/* State of the sliding barrier; included by unit.h. Equations and names as in impact.py and barrier_sliding.py. */
#ifndef BARRIER_SLIDING_H
#define BARRIER_SLIDING_H

typedef struct {
    int fixed, force_is_input, variant;
    double flow_mass, speed, flow_height;
    double mass, tangent, gravity, vertical_load_ratio, initial_velocity;
    double cosine, sine;                 /* of the slope */
    double arrival, duration, rise_time; /* arrival time, T2, T1 [s] */
    double impulse, peak_force;          /* J [N s/m], F_peak [N/m] */
} Impact;

/* What acts on the barrier beside the impact: along the base, and normal to it. */
typedef struct {
    double pushing, pressing;
} Loads;

/* How the last step began and what acted during it, for derivatives with respect to that. */
typedef struct {
    double time, displacement, velocity, peak_force;
    Loads loads;
} Last;

typedef struct {
    Impact impact;
    Last last;
    int integrated; /* whether a load has acted from outside: the motion is then carried from step to step */
    double displacement, velocity;
    double impulse, peak_force; /* so far, where the force is an input */
    double force;
} Model;

PLAIN_STATE

#endif
