/* The closed-form impact and the sliding barrier: the C twin of impact.py, sliding.py and barrier_sliding.py. */

#define DEGREE (3.14159265358979323846 / 180) /* [rad] */

/* --- motion on a frictional base (analytic/sliding.py) ----------------------------------------------------------------- */

static double first_stop(double velocity, double acceleration, double jerk) {
    double a = jerk / 2, b = acceleration, c = velocity;
    if (c == 0) return a * b < 0 ? -b / a : INFINITY;
    double discriminant = b * b - 4 * a * c;
    if (discriminant < 0) return INFINITY;
    double q = -(b + copysign(sqrt(discriminant), b)) / 2;
    double first = a != 0 ? q / a : INFINITY, second = q != 0 ? c / q : INFINITY;
    /* A root of +0.0 is a positive one that underflowed: the motion starts with a velocity that is not nil. */
    return fmin(copysign(1.0, first) > 0 ? first : INFINITY, copysign(1.0, second) > 0 ? second : INFINITY);
}

static double breakaway(double force, double force_rate, double friction, double friction_rate) {
    for (double direction = 1; direction >= -1; direction -= 2) {
        double excess = direction * force - friction, rate = direction * force_rate - friction_rate;
        if (excess > 0 || (excess == 0 && rate > 0)) return direction;
    }
    return 0;
}

static double wait_time(double direction, double force, double force_rate, double friction, double friction_rate) {
    double excess = direction * force - friction, rate = direction * force_rate - friction_rate;
    return rate > 0 ? -excess / rate : INFINITY;
}

/* A small change of what a slide begins with and of what acts during it; force and friction change linearly in time. */
typedef struct {
    double displacement, velocity, force, friction, friction_rate;
} Change;

/* Slide for a duration, under a force and a friction that are linear in time. With a change (or NULL) it tells how the
   end changes to first order, as long as the same stretches of sliding and rest follow each other: a stop or a start
   comes earlier or later, and what it shifts is taken into account. */
static void slide(double *displacement, double *velocity, double duration, double force, double force_rate,
                  double friction, double friction_rate, double mass, Change *change) {
    double t = 0, sooner = 0; /* by which the last stop comes */
    while (t < duration) {
        double direction = copysign(1.0, *velocity);
        int waited = 0, rested = *velocity == 0;
        if (*velocity == 0) {
            direction = breakaway(force, force_rate, friction, friction_rate);
            if (direction == 0) {
                double forward = wait_time(1, force, force_rate, friction, friction_rate);
                double backward = wait_time(-1, force, force_rate, friction, friction_rate);
                double wait = backward < forward ? backward : forward;
                direction = backward < forward ? -1 : 1;
                if (t + wait >= duration) return;
                t += wait;
                force += wait * force_rate;
                friction += wait * friction_rate;
                if (change) change->friction += wait * change->friction_rate;
                waited = 1; /* it sets out with force and friction equal, whatever rounding says */
            }
        }
        double acceleration = waited ? 0.0 : (force - direction * friction) / mass;
        double jerk = (force_rate - direction * friction_rate) / mass;
        if (change && rested) change->velocity = waited ? 0 : sooner * acceleration;
        double slip = first_stop(*velocity, acceleration, jerk);
        int stops = t + slip < duration;
        double until = stops ? t + slip : duration, u = until - t;
        if (change) {
            double by = (change->force - direction * change->friction) / mass;
            double by_rate = -direction * change->friction_rate / mass;
            change->displacement += u * (change->velocity + u * (by / 2 + u * by_rate / 6));
            change->velocity += u * (by + u * by_rate / 2);
            change->friction += u * change->friction_rate;
            if (stops) {
                sooner = change->velocity / (acceleration + u * jerk);
                change->velocity = 0;
            }
        }
        *displacement += u * (*velocity + u * (acceleration / 2 + u * jerk / 6));
        *velocity = stops ? 0 : *velocity + u * (acceleration + u * jerk / 2);
        if (!stops) return;
        t = until;
        force += slip * force_rate;
        friction += slip * friction_rate;
        /* What stops a body cannot drive it on: keeps rounding from setting it going again at the same instant. */
        force = direction * fmin(direction * force, friction);
    }
}

/* --- the closed form (analytic/impact.py); times count from arrival --------------------------------------------------------- */

typedef struct {
    double start, stop, force, rate;
} Piece;

static void force_pieces(const Impact *impact, double peak_force, Piece pieces[4]) {
    double T1 = impact->rise_time, T2 = impact->duration;
    double rise = peak_force / T1, fall = T2 > T1 ? -peak_force / (T2 - T1) : 0;
    pieces[0] = (Piece){-INFINITY, 0, 0, 0};
    pieces[1] = (Piece){0, T1, 0, rise};
    pieces[2] = (Piece){T1, T2, peak_force, fall};
    pieces[3] = (Piece){T2, INFINITY, 0, 0};
}

static Loads loads_on(const Impact *impact, double external, double vertical) {
    double weight = impact->mass * impact->gravity;
    return (Loads){external + weight * impact->sine, fmax(weight * impact->cosine + vertical, 0)};
}

/* g (tan(delta_b) cos(theta) - sin(theta)), with which a sliding barrier slows down. */
static double friction_deceleration(const Impact *impact) {
    return impact->fixed ? 0 : impact->gravity * (impact->tangent * impact->cosine - impact->sine);
}

/* Change of the base's friction with its coefficient and the load normal to it; none where nothing presses. */
static double friction_change(const Impact *impact, double pressing, double by_tangent, double by_pressing) {
    return pressing > 0 ? by_tangent * pressing + impact->tangent * by_pressing : 0;
}

/* Carry the barrier from the time `start` to `stop` under the triangle of force and the loads. What changes, if
   anything: the push, the coefficient of friction, the load normal to the base. */
static void carry(const Impact *impact, double peak_force, double start, double stop, Loads loads,
                  double *displacement, double *velocity, Change *change, double by_tangent, double by_pressing) {
    Piece pieces[4];
    if (impact->fixed) return;
    force_pieces(impact, peak_force, pieces);
    for (int i = 0; i < 4; i++) {
        double from = fmax(pieces[i].start, start), to = fmin(pieces[i].stop, stop), rate = pieces[i].rate;
        if (!(to > from)) continue;
        double force = rate != 0 ? pieces[i].force + (from - pieces[i].start) * rate : pieces[i].force;
        double share = impact->vertical_load_ratio, pressing = loads.pressing + share * force;
        if (change) {
            change->friction = friction_change(impact, pressing, by_tangent, loads.pressing > 0 ? by_pressing : 0);
            change->friction_rate = by_tangent * share * rate;
        }
        slide(displacement, velocity, to - from, force + loads.pushing, rate, impact->tangent * pressing,
              impact->tangent * share * rate, impact->mass, change);
    }
}

static double force_at(const Impact *impact, double since) {
    double T1 = impact->rise_time, T2 = impact->duration, peak = impact->peak_force;
    if (since <= 0 || since > T2) return 0;
    return since <= T1 ? since * (peak / T1) : peak + (since - T1) * (-peak / (T2 - T1));
}

static double impulse_until(const Impact *impact, double since) {
    double T1 = impact->rise_time, T2 = impact->duration, peak = impact->peak_force;
    if (since <= 0) return 0;
    if (since > T2) return impact->impulse;
    if (since <= T1) return since * since * peak / T1 / 2;
    return impact->impulse - peak * (T2 - since) * (T2 - since) / (T2 - T1) / 2;
}

static double common_velocity(const Impact *impact) {
    return impact->fixed ? 0 : impact->speed - impact->impulse / impact->flow_mass;
}

static double printed_flow_velocity(const Impact *impact, double since) {
    double T2 = impact->duration, jerk = -2 * impact->impulse / (T2 * T2) / impact->flow_mass;
    if (since <= 0) return impact->speed;
    if (since <= T2) return impact->speed + since * since * jerk / 2;
    if (impact->fixed) return 0;
    return fmax(common_velocity(impact) - (since - T2) * friction_deceleration(impact), 0);
}

static void printed_barrier(const Impact *impact, double since, double *displacement, double *velocity) {
    double T2 = impact->duration, deceleration = friction_deceleration(impact);
    double jerk = 2 * impact->impulse / (T2 * T2) / impact->mass, v20 = impact->initial_velocity;
    double u = fmin(since, T2);
    *velocity = v20 + u * (-deceleration + u * jerk / 2);
    *displacement = u * (v20 + u * (-deceleration / 2 + u * jerk / 6));
    if (since <= T2) return;
    double v = common_velocity(impact), w = since - T2;
    if (v <= 0) {
        *velocity = 0;
        return;
    }
    if (deceleration > 0 && w >= v / deceleration) {
        *displacement += v * v / (2 * deceleration);
        *velocity = 0;
        return;
    }
    *displacement += w * (v - w * deceleration / 2);
    *velocity = v - w * deceleration;
}

static void follow_closed_form(Model *model, double time) {
    const Impact *impact = &model->impact;
    double since = time - impact->arrival;
    model->force = force_at(impact, since);
    model->peak_force = impact->peak_force;
    model->displacement = 0;
    model->velocity = impact->initial_velocity;
    if (since <= 0) {
        model->displacement = since * impact->initial_velocity;
    } else if (impact->variant == VARIANT_AS_PRINTED && !impact->fixed) {
        printed_barrier(impact, since, &model->displacement, &model->velocity);
    } else {
        carry(impact, impact->peak_force, 0, since, loads_on(impact, 0, 0), &model->displacement, &model->velocity,
              NULL, 0, 0);
    }
}

/* Impulse that leaves flow and barrier with one velocity at T2 although friction acts until then. */
static double momentum_closed_impulse(const Impact *impact) {
    double stopping = impact->flow_mass * impact->speed;
    if (impact->fixed) return stopping;
    double share = 1 - impact->vertical_load_ratio * impact->tangent, driven_mass = impact->mass / share;
    double T2 = impact->duration, deceleration = friction_deceleration(impact);
    double R = impact->mass * deceleration / share;
    double reduced_mass = impact->flow_mass / (1 + impact->flow_mass / driven_mass);
    double displacement = 0, velocity = impact->initial_velocity;
    carry(impact, 2 * stopping / T2, 0, T2, loads_on(impact, 0, 0), &displacement, &velocity, NULL, 0, 0);
    if (velocity <= 0) return stopping;
    double never_at_rest = reduced_mass * (impact->speed - impact->initial_velocity + deceleration * T2);
    double ratio = R * T2 / (2 * never_at_rest), rise_ratio = impact->rise_time / T2;
    if (ratio >= 1 || impact->initial_velocity > deceleration * ratio * rise_ratio * T2 / 2) return never_at_rest;
    double A = reduced_mass * (impact->speed + deceleration * T2);
    return (A + sqrt(A * A - reduced_mass * deceleration * rise_ratio * R * T2 * T2)) / 2;
}

/* --- the unit (barrier_sliding.py) ---------------------------------------------------------------------------------- */

/* The base's resistance to sliding while the flow pushes with a force, which brings its vertical load along. */
static double friction_under(const Impact *impact, Loads loads, double force) {
    return impact->tangent * fmax(loads.pressing + impact->vertical_load_ratio * force, 0);
}

static int phase_of(const Model *model, double time, Loads loads, double friction) {
    const Impact *impact = &model->impact;
    double since = time - impact->arrival;
    int impacting = model->force > 0, moving = model->velocity != 0;
    if (!model->integrated) {
        if (since <= 0) return PHASE_APPROACH;
        impacting = since <= impact->duration;
        moving = moving || (impacting && impact->variant == VARIANT_AS_PRINTED && !impact->fixed);
    }
    if (!moving) {
        if (impacting) return PHASE_STICK;
        int arrived = impact->force_is_input ? model->peak_force > 0 : since > 0;
        return arrived ? PHASE_REST : PHASE_APPROACH;
    }
    if (!impacting) return PHASE_INERTIA;
    double direction = model->integrated ? copysign(1.0, model->velocity) : 1;
    return direction * (model->force + loads.pushing) > friction ? PHASE_ACCELERATION : PHASE_DECELERATION;
}

static void write_outputs(Unit *unit, double time, Loads loads) {
    Model *model = &unit->state.model;
    const Impact *impact = &model->impact;
    double *values = unit->state.values, since = time - impact->arrival;
    double friction = friction_under(impact, loads, model->force);
    double v1 = impact->variant == VARIANT_AS_PRINTED && !impact->force_is_input
                    ? printed_flow_velocity(impact, since)
                    : impact->speed - (impact->force_is_input ? model->impulse : impulse_until(impact, since)) /
                                          impact->flow_mass;
    double v2 = model->velocity;
    values[IMPACT_FORCE] = model->force;
    values[PEAK_FORCE] = model->peak_force;
    values[PEAK_PRESSURE] = model->peak_force / impact->flow_height;
    values[BARRIER_VELOCITY] = v2;
    values[BARRIER_DISPLACEMENT] = model->displacement;
    values[FLOW_VELOCITY] = v1;
    values[FLOW_KINETIC_ENERGY] = impact->flow_mass * v1 * v1 / 2;
    values[BARRIER_KINETIC_ENERGY] = impact->fixed ? 0 : impact->mass * v2 * v2 / 2;
    values[IMPACT_PHASE] = phase_of(model, time, loads, friction);
}

/* What the base friction must be, at the start and whenever the importer changes it. */
static int check_friction(Unit *unit, double tangent) {
    const Impact *impact = &unit->state.model.impact;
    double slope = unit->state.values[SLOPE], steepest = fabs(tan(slope * DEGREE));
    if (!impact->fixed && steepest > 0 && tangent <= steepest)
        return refuse(unit, "base_friction is %g, on a slope of %g degrees it must be above %.4g, else the barrier "
                            "slides by its own weight.", tangent, slope, steepest);
    if (impact->vertical_load_ratio * tangent >= 1)
        return refuse(unit, "vertical_load_ratio is %g, it must be in [0, %g).", impact->vertical_load_ratio, 1 / tangent);
    return 1;
}

static int advance(Unit *unit, double end) {
    Model *model = &unit->state.model;
    Impact *impact = &model->impact;
    const double *values = unit->state.values;
    double external = values[EXTERNAL_FORCE], load = values[VERTICAL_LOAD], force = values[IMPACT_FORCE_INPUT];
    double start = unit->state.time, tangent = impact->fixed ? 0 : values[BASE_FRICTION];
    int tuned = tangent != impact->tangent, acted = external != 0 || load != 0 || tuned;
    if (acted && impact->variant == VARIANT_AS_PRINTED)
        return refuse(unit, tuned ? "variant is 3 (as_printed), which is a set of functions of time: base_friction must "
                                    "stay as it was, or choose 1 (stick_slip)."
                                  : "variant is 3 (as_printed), which is a set of functions of time: external_force and "
                                    "vertical_load must be 0, or choose 1 (stick_slip).");
    if (tuned && !check_friction(unit, tangent)) return 0;
    impact->tangent = tangent;
    Loads loads = loads_on(impact, external, load);
    model->last = (Last){start, model->displacement, model->velocity, model->peak_force, loads};
    if (!model->integrated && !acted) {
        follow_closed_form(model, end);
        write_outputs(unit, end, loads);
        return 1;
    }
    model->integrated = 1;
    if (impact->force_is_input) {
        if (!impact->fixed)
            slide(&model->displacement, &model->velocity, end - start, force + loads.pushing, 0,
                  friction_under(impact, loads, force), 0, impact->mass, NULL);
        model->force = force;
        model->impulse += force * (end - start);
        model->peak_force = fmax(model->peak_force, force);
    } else {
        carry(impact, impact->peak_force, start - impact->arrival, end - impact->arrival, loads,
              &model->displacement, &model->velocity, NULL, 0, 0);
        model->force = force_at(impact, end - impact->arrival);
    }
    write_outputs(unit, end, loads);
    return 1;
}

static int unit_start(Unit *unit) {
    const double *values = unit->state.values;
    Model *model = &unit->state.model;
    Impact *impact = &model->impact;
    *model = (Model){0};
    double length = values[FLOW_LENGTH], s1max = values[S1MAX], v20 = values[BARRIER_INITIAL_VELOCITY];
    impact->fixed = values[BARRIER_FIXED] != 0;
    if (s1max > length)
        return refuse(unit, "s1max is %g m, it must be a number in [0, %g] m (at most the flow's length).", s1max, length);
    if (impact->fixed && v20 != 0)
        return refuse(unit, "barrier_initial_velocity is %g m/s, it must be 0 (the barrier is fixed).", v20);
    if (v20 >= values[SPEED])
        return refuse(unit, "barrier_initial_velocity is %g m/s, it must be a number in [0, %g) m/s (below the flow's speed).",
                      v20, values[SPEED]);
    impact->force_is_input = values[IMPACT_FORCE_SOURCE] == SOURCE_INPUT;
    impact->variant = (int)values[VARIANT];
    impact->flow_mass = values[FLOW_MASS];
    impact->flow_height = values[FLOW_HEIGHT];
    impact->speed = values[SPEED];
    impact->mass = values[BARRIER_MASS];
    impact->tangent = impact->fixed ? 0 : values[BASE_FRICTION];
    impact->gravity = values[GRAVITY];
    impact->cosine = cos(values[SLOPE] * DEGREE);
    impact->sine = sin(values[SLOPE] * DEGREE);
    impact->vertical_load_ratio = values[VERTICAL_LOAD_RATIO];
    if (impact->variant == VARIANT_AS_PRINTED && impact->vertical_load_ratio != 0)
        return refuse(unit, "vertical_load_ratio is %g, it must be 0 with as_printed.", impact->vertical_load_ratio);
    if (!check_friction(unit, impact->tangent)) return 0;
    impact->initial_velocity = v20;
    impact->arrival = values[ARRIVAL_TIME];
    double approach = impact->speed - v20;
    impact->duration = 8 * (s1max > 0 ? s1max : length * values[GEOMETRY_CHANGE]) / (3 * approach);
    impact->rise_time = values[RISE_RATIO] * impact->duration;
    double reduced_mass =
        impact->fixed ? impact->flow_mass : impact->flow_mass / (1 + impact->flow_mass / impact->mass);
    impact->impulse =
        impact->variant == VARIANT_MOMENTUM_CLOSED ? momentum_closed_impulse(impact) : reduced_mass * approach;
    impact->peak_force = 2 * impact->impulse / impact->duration;
    if (impact->force_is_input) {
        model->velocity = v20;
        model->integrated = 1;
        return advance(unit, unit->state.time);
    }
    follow_closed_form(model, unit->state.time);
    model->last = (Last){unit->state.time, model->displacement, model->velocity, model->peak_force, loads_on(impact, 0, 0)};
    write_outputs(unit, unit->state.time, model->last.loads);
    return 1;
}

static int unit_step(Unit *unit, double end) { return advance(unit, end); }

/* --- rates of the outputs ----------------------------------------------------------------------------------------------- */

static double force_rate_at(const Impact *impact, double since) {
    double T1 = impact->rise_time, T2 = impact->duration, peak = impact->peak_force;
    if (since <= 0 || since > T2) return 0;
    return since <= T1 ? peak / T1 : -peak / (T2 - T1);
}

/* Acceleration [m/s2] of the barrier at the end of the last step, under the loads as they are now. */
static double acceleration_of(const Unit *unit, double since) {
    const Model *model = &unit->state.model;
    const Impact *impact = &model->impact;
    const double *values = unit->state.values;
    if (impact->fixed) return 0;
    if (impact->variant == VARIANT_AS_PRINTED && !impact->force_is_input) {
        double deceleration = friction_deceleration(impact), T2 = impact->duration;
        if (since <= 0 || (since > T2 && model->velocity == 0)) return 0;
        return since <= T2 ? since * 2 * impact->impulse / (T2 * T2) / impact->mass - deceleration : -deceleration;
    }
    Loads loads = loads_on(impact, values[EXTERNAL_FORCE], values[VERTICAL_LOAD]);
    if (!model->integrated && since <= 0) return 0; /* it has come with its velocity as given */
    double driving = model->force + loads.pushing, friction = friction_under(impact, loads, model->force);
    double direction = model->velocity != 0 ? copysign(1.0, model->velocity) : breakaway(driving, 0, friction, 0);
    return direction == 0 ? 0 : (driving - direction * friction) / impact->mass;
}

static int unit_rate(Unit *unit, int reference, double *rate) {
    const Model *model = &unit->state.model;
    const Impact *impact = &model->impact;
    const double *values = unit->state.values;
    double since = unit->state.time - impact->arrival;
    double flow = -model->force / impact->flow_mass;
    if (impact->variant == VARIANT_AS_PRINTED && !impact->force_is_input) {
        double T2 = impact->duration;
        flow = since <= 0 ? 0
               : since <= T2 ? -since * 2 * impact->impulse / (T2 * T2) / impact->flow_mass
               : values[FLOW_VELOCITY] > 0 ? -friction_deceleration(impact)
                                           : 0;
    }
    switch (reference) {
    case IMPACT_FORCE: *rate = impact->force_is_input ? 0 : force_rate_at(impact, since); return 1;
    case PEAK_FORCE:
    case PEAK_PRESSURE: *rate = 0; return 1;
    case BARRIER_VELOCITY: *rate = acceleration_of(unit, since); return 1;
    case BARRIER_DISPLACEMENT: *rate = values[BARRIER_VELOCITY]; return 1;
    case FLOW_VELOCITY: *rate = flow; return 1;
    case FLOW_KINETIC_ENERGY: *rate = impact->flow_mass * values[FLOW_VELOCITY] * flow; return 1;
    case BARRIER_KINETIC_ENERGY:
        *rate = impact->fixed ? 0 : impact->mass * values[BARRIER_VELOCITY] * acceleration_of(unit, since);
        return 1;
    default: return refuse(unit, "%s has no derivative.", TABLE[reference].name);
    }
}

/* --- derivatives of the outputs with respect to what acted during the last step ----------------------------------------- */

static int unit_slope(Unit *unit, const double *by, double *slope) {
    const Model *model = &unit->state.model;
    const Impact *impact = &model->impact;
    const Last *last = &model->last;
    double end = unit->state.time, duration = end - last->time, share = impact->vertical_load_ratio;
    double by_tangent = impact->fixed ? 0 : by[BASE_FRICTION], by_force = impact->force_is_input ? by[IMPACT_FORCE_INPUT] : 0;
    if (impact->variant == VARIANT_AS_PRINTED && !impact->force_is_input)
        return refuse(unit, "variant is 3 (as_printed), which is a set of functions of time and takes no inputs: choose 1 "
                            "(stick_slip) for derivatives with respect to them.");
    if (!model->integrated && last->time < impact->arrival && last->velocity != 0)
        return refuse(unit, "Before the flow arrives the barrier moves with barrier_initial_velocity, whatever acts on it: there "
                            "are derivatives after a step that begins at arrival_time, %g s, or later.", impact->arrival);
    double displacement = last->displacement, velocity = last->velocity;
    Change change = {0, 0, by_force + by[EXTERNAL_FORCE], 0, 0};
    if (impact->force_is_input && !impact->fixed) {
        double pressing = last->loads.pressing + share * model->force;
        double by_pressing = (last->loads.pressing > 0 ? by[VERTICAL_LOAD] : 0) + share * by_force;
        change.friction = friction_change(impact, pressing, by_tangent, by_pressing);
        slide(&displacement, &velocity, duration, model->force + last->loads.pushing, 0,
              friction_under(impact, last->loads, model->force), 0, impact->mass, &change);
    } else {
        carry(impact, impact->peak_force, last->time - impact->arrival, end - impact->arrival, last->loads, &displacement,
              &velocity, &change, by_tangent, by[VERTICAL_LOAD]);
    }
    slope[IMPACT_FORCE] = by_force;
    slope[PEAK_FORCE] = model->force > last->peak_force ? by_force : 0;
    slope[PEAK_PRESSURE] = slope[PEAK_FORCE] / impact->flow_height;
    slope[BARRIER_VELOCITY] = change.velocity;
    slope[BARRIER_DISPLACEMENT] = change.displacement;
    slope[FLOW_VELOCITY] = -by_force * duration / impact->flow_mass;
    slope[FLOW_KINETIC_ENERGY] = impact->flow_mass * unit->state.values[FLOW_VELOCITY] * slope[FLOW_VELOCITY];
    slope[BARRIER_KINETIC_ENERGY] = impact->fixed ? 0 : impact->mass * model->velocity * change.velocity;
    return 1;
}

NOTHING_BEYOND_THE_STATE
