/* The anchor, elastic until it yields: the C twin of ground_anchor.py. */

static int pull(Unit *unit) {
    Model *model = &unit->state.model;
    double *values = unit->state.values, stiffness = values[STIFFNESS], yield_force = values[YIELD_FORCE];
    model->plastic_before = model->plastic_elongation;
    double elongation = values[BARRIER_DISPLACEMENT] - values[SLACK] - model->plastic_elongation;
    double tension = fmax(stiffness * elongation, 0);
    if (tension > yield_force) {
        model->plastic_elongation += (tension - yield_force) / stiffness;
        tension = yield_force;
        values[YIELDED] = 1;
    }
    values[FORCE] = 0.0 - tension; /* 0.0 first: a slack anchor shows 0, not -0 */
    values[UTILISATION] = tension / yield_force;
    model->stiffness = stiffness;
    model->yield_force = yield_force;
    return 1;
}

static int unit_start(Unit *unit) {
    unit->state.model.plastic_elongation = 0;
    unit->state.values[YIELDED] = 0;
    return pull(unit);
}

static int unit_step(Unit *unit, double end) {
    (void)end;
    return pull(unit);
}

static int unit_rate(Unit *unit, int reference, double *rate) {
    (void)reference, (void)rate;
    return refuse(unit, "This unit does not offer derivatives.");
}

/* An anchor at the very point of going slack or of yielding is taken for one that does not yet. */
static int unit_slope(Unit *unit, const double *by, double *slope) {
    const Model *model = &unit->state.model;
    double tension = -unit->state.values[FORCE], by_tension = 0;
    if (model->plastic_elongation != model->plastic_before) by_tension = by[YIELD_FORCE];
    else if (tension > 0) by_tension = model->stiffness * by[BARRIER_DISPLACEMENT] + tension / model->stiffness * by[STIFFNESS];
    slope[FORCE] = -by_tension;
    slope[UTILISATION] = (by_tension - tension / model->yield_force * by[YIELD_FORCE]) / model->yield_force;
    return 1;
}

NOTHING_BEYOND_THE_STATE
