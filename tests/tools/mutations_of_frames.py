"""Mistakes in what is found wrong with a frame, and in how rows are left out of it."""

from __future__ import annotations

from mutation import of

OBSERVED = (
    of(
        "observed.c",
        (
            "lost directions weigh a hundred times as much",
            "LOST = R(0.01)",
            "LOST = R(1.0)",
            "observed",
        ),
        ("lost directions are not held", "row[i] += lost;", "row[i] += 0;", "observed"),
        (
            "the map's rows not scaled",
            "row_of(ctx, r, i)[k] *= share * ctx->row_scale[k];",
            "row_of(ctx, r, i)[k] *= share;",
            "observed",
        ),
        (
            "the step's margin left out",
            "STEP_MARGIN = R(0.995)",
            "STEP_MARGIN = R(1.05)",
            "observed",
        ),
        (
            "rows in use for those left out",
            "if (in_use(ctx, k) == by_missing)",
            "if (in_use(ctx, k) != by_missing)",
            "observed",
        ),
        (
            "strengths left out of the metric",
            "row_of(ctx, r, i)[k] * ctx->row_strength[k];",
            "row_of(ctx, r, i)[k];",
            "observed",
        ),
        (
            "the metric without its floor",
            "left > 0 ? left + floor : floor",
            "left > 0 ? left : floor",
            "observed",
        ),
        (
            "the map not solved for",
            "add_row(ctx, k, row, -weight[k], row_of(ctx, r, k));",
            ";",
            "observed",
        ),
        ("data whitened by half", "    solve(ctx, metric_of(ctx), v);\n", "", "observed"),
        (
            "data without the weights",
            "v[i] *= ctx->map_square * ctx->row_scale[i] * ctx->row_scale[i];",
            "v[i] *= 1;",
            "observed",
        ),
        (
            "noise as though no row were left out",
            "return ctx->noise_ratio * ctx->baseline",
            "return ctx->baseline",
            "observed",
        ),
        ("noise probes not mapped", "        (void)eits_map(ctx, v);\n", "", "observed"),
        (
            "the greatest noise grows as the mean",
            "ctx->noise_ratio = of_all * (ratio * eits_sqrt(eits_sqrt(ratio)));",
            "ctx->noise_ratio = of_all * ratio;",
            "observed",
        ),
        (
            "rows left out beside the model's noise",
            "(PROBES * whole)) / of_all;",
            "(PROBES * whole));",
            "observed",
        ),
        (
            "the noise of a raised floor is the model's",
            "    ctx->noise_ratio = noise;\n",
            "",
            "floor",
        ),
        (
            "the energy of a raised floor is the model's",
            "ctx->sheet_energy_stored * eits_floor_weights(ctx, floor, map_of(ctx));",
            "ctx->sheet_energy_stored + 0 * eits_floor_weights(ctx, floor, map_of(ctx));",
            "floor",
        ),
        (
            "energies of the rows before",
            "    ctx->sheet_energy = ctx->sheet_energy_stored;\n    if",
            "    if",
            "floor",
        ),
        (
            "the floor of the rows before",
            "    ctx->floor_in_force = ctx->floor;\n    ctx",
            "    ctx",
            "floor",
        ),
        (
            "numbers that overflow are used",
            "|| !(noise > 0) || !eits_is_finite(noise))",
            ")",
            "floor",
        ),
        ("any P counts as the builder's", "<= FORM))", "<= 1000))", "observed"),
    )
    + of(
        "map.c",
        (
            "a residual of the other sign",
            "eits_axpy(ctx, out, -1, sx, stride);",
            "eits_axpy(ctx, out, 1, sx, stride);",
            "solve",
        ),
        (
            "forward without the projection",
            "return macs + eits_project(ctx, v);",
            "return macs;",
            "observed",
        ),
        (
            "the adjoint is the map",
            "add_row(ctx, i, room, v[i], row_of(ctx, map_of(ctx), i));",
            "room[i] = dot_of_row(ctx, i, row_of(ctx, map_of(ctx), i), v);",
            "observed",
        ),
        (
            "the residual of S, not of D S",
            "eits_fma(-weight[i], sx[i], ctx->y[i]);",
            "ctx->y[i] - sx[i];",
            "floor",
        ),
        (
            "the residual's projection forgotten",
            "return ctx->model->rank + eits_project(ctx, out);",
            "return ctx->model->rank;",
            "floor",
        ),
        (
            "the adjoint without its weights",
            "        weigh(ctx, v, room);\n        return room;\n",
            "        return v;\n",
            "floor",
        ),
        ("the map without its weights", "        weigh(ctx, v, v);\n", "        ;\n", "floor"),
    )
    + of(
        "floor.c",
        (
            "the floor for rows left out is the model's",
            "cube = left * left * left",
            "cube = 1",
            "observed",
        ),
        (
            "no least floor",
            "cube > LEAST_FLOOR_SHARE ? cube : LEAST_FLOOR_SHARE",
            "cube",
            "observed",
        ),
        (
            "noise asks for no higher floor where rows are out",
            "asked > of_model ? asked : of_model",
            "of_model",
            "observed",
        ),
        (
            "noise asks for as much of few rows",
            "asked = left * least_floor(ctx)",
            "asked = least_floor(ctx)",
            "observed",
        ),
        (
            "no greatest floor",
            "return asked < MOST_FLOOR ? asked : MOST_FLOOR;",
            "return asked;",
            "floor",
        ),
        ("a lift that cannot be seen", "AS_IT_IS = R(1.01)", "AS_IT_IS = R(1.0)", "floor"),
        ("noise in volts", "(b->noise_v / b->v0_rms)", "b->noise_v", "floor"),
        (
            "the strongest direction loses weight",
            "ctx->strongest_square * (1 + floor) /",
            "ctx->strongest_square /",
            "floor",
        ),
        (
            "weights not rooted",
            "eits_sqrt(square) * ctx->row_scale[i]",
            "square * ctx->row_scale[i]",
            "floor",
        ),
        (
            "noise weighed once",
            "eits_fma(square * w2_kept, w2_kept, sum)",
            "eits_fma(square, w2_kept, sum)",
            "floor",
        ),
        (
            "noise of weak directions forgotten",
            "ctx->row_strength[i] * w2 * w2;",
            "ctx->row_strength[i] * w2;",
            "floor",
        ),
        (
            "weights in the padding",
            "    eits_zero(weight, EITS_STRIDE(ctx->model->rank));\n",
            "",
            "floor",
        ),
    )
    + of(
        "context.c",
        (
            "the floor of the options before",
            " || o->floor_noise_factor != ctx->options.floor_noise_factor)",
            ")",
            "floor",
        ),
    )
    + of(
        "solve.c",
        ("the floor is not said", "    ctx->info.floor = ctx->floor_in_force;\n", "", "floor"),
    )
    + of(
        "frame.c",
        (
            "drift not mapped",
            "macs += ctx->rewhitened ? eits_observed_data(ctx, ctx->residual) : 0;",
            "macs += 0;",
            "observed",
        ),
        (
            "data not mapped",
            "*macs += ctx->rewhitened ? eits_observed_data(ctx, ctx->y) : 0;",
            ";",
            "observed",
        ),
        (
            "the map of the rows before",
            "uint64_t macs = eits_observed_build(ctx);",
            "uint64_t macs = 0;",
            "observed",
        ),
        (
            "rounding where no direction is left",
            "if (ctx->basis_count >= directions)",
            "if (0)",
            "observed",
        ),
        ("stray of the drift before", "    ctx->stray_stale = 1;\n", "", "unpaired"),
        (
            "a dead front end imaged",
            "if (status == EITS_OK && dead)",
            "if (0 && dead)",
            "electrodes",
        ),
        (
            "findings of the frame before",
            "info->findings = info->saturated",
            "info->saturated",
            "electrodes",
        ),
        (
            "electrodes of the frame before",
            "    memset(ctx->electrode, 0, sizeof ctx->electrode);\n",
            "",
            "electrodes",
        ),
        (
            "masked rows count as saturated",
            "masked == 0 && saturated != 0",
            "saturated != 0",
            "frame",
        ),
        (
            "glitches left out are imaged",
            "        changed |= fold_data(ctx, frame);\n",
            "",
            "findings",
        ),
        (
            "unpaired glitches are imaged",
            "        if (fold_data(ctx, frame))\n            *macs += rebuild_basis(ctx);\n",
            "",
            "unpaired",
        ),
        (
            "unpaired glitches count for nothing",
            "            return status;\n        if (fold_data(ctx, frame))",
            "            ;\n        if (fold_data(ctx, frame))",
            "unpaired",
        ),
        (
            "turned rows taken for a glitch",
            "if (!known && eits_wants",
            "if (eits_wants",
            "unpaired",
        ),
    )
)

ELECTRODES = of(
    "electrodes.c",
    ("glitches not counted", "    ++ctx->info.glitches;\n", "", "findings"),
    ("glitches not named", "    ctx->info.findings |= EITS_FINDING_GLITCH;\n", "", "findings"),
    (
        "rows are dead only below nothing",
        "share > most.noise ? share : most.noise",
        "R(1e-9)",
        "electrodes",
    ),
    (
        "no noise in what dead is",
        "limit = share > most.noise ? share : most.noise",
        "limit = share",
        "electrodes",
    ),
    (
        "no share in what dead is",
        "limit = share > most.noise ? share : most.noise",
        "limit = most.noise + R(1e-9)",
        "electrodes",
    ),
    ("rows that tell nothing judged", "!(size >= most.significant) || ", "", "electrodes"),
    (
        "masked rows are dead ones",
        " || (ctx->unusable[i] & EITS_ROW_MASKED) != 0",
        "",
        "electrodes",
    ),
    (
        "turned rows are dead ones",
        "return along > -limit ? DEAD : ALIVE | TURNED;",
        "return DEAD;",
        "electrodes",
    ),
    (
        "an electrode is open with one dead row",
        "rows[e] >= EITS_ROWS_TO_JUDGE && !alive[e])\n",
        "1)\n",
        "electrodes",
    ),
    ("all electrodes open", "    if (open == judged)\n        return 0;\n", "", "electrodes"),
    (
        "three of four electrodes of a row",
        "k < 4; ++k) {\n            const uint8_t e = eits_row",
        "k < 3; ++k) {\n            const uint8_t e = eits_row",
        "electrodes",
    ),
    (
        "rows that measure at an open electrode stay",
        " | ctx->electrode[row[2]] | ctx->electrode[row[3]];",
        ";",
        "electrodes",
    ),
    (
        "a bridged pair with one row",
        "return dead >= EITS_ROWS_TO_JUDGE;",
        "return dead > 0;",
        "electrodes",
    ),
    (
        "a bridged pair that lives",
        "if ((state & ALIVE) != 0)\n            return 0;",
        "if (0)\n            return 0;",
        "electrodes",
    ),
    (
        "rows that drive across a pair alone",
        "(!eits_is_pair(row, e, f) && !eits_is_pair(row + 2, e, f))",
        "!eits_is_pair(row, e, f)",
        "electrodes",
    ),
    ("pairs in one order only", " || (two[0] == f && two[1] == e)", "", "electrodes"),
    (
        "rows of bridged electrodes stay",
        "    eits_leave_electrodes(ctx, EITS_ELECTRODE_BRIDGED, EITS_ROW_BRIDGED);\n",
        "",
        "electrodes",
    ),
    ("many turned rows are glitches", "turned + grown < EITS_ROWS_TO_JUDGE && ", "", "electrodes"),
    ("grown rows stay", " || is_grown(ctx, frame, most, i))", ")", "electrodes"),
    ("small rows grow too soon", "v0 > least ? v0 : least", "v0", "electrodes"),
    (
        "few turned rows are a misfit",
        "if (turned >= EITS_ROWS_TO_JUDGE &&",
        "if (turned > 0 &&",
        "electrodes",
    ),
    (
        "a silent front end that lives",
        "return silent < EITS_ROWS_TO_JUDGE;",
        "return 1;",
        "electrodes",
    ),
)

GLITCH = of(
    "glitch.c",
    ("both sides go", "if (!(second <= EITS_GLITCH_NEARER * first))", "if (1)", "unpaired"),
    (
        "the right side goes",
        "d + half - predicted[a]) : 1, second",
        "d - half - predicted[a]) : 1, second",
        "unpaired",
    ),
    ("the flagged predict each other", "sum / l[b][b];", "0 * sum;", "unpaired"),
    (
        "own reading left in the prediction",
        "sum = (a == b ? R(1.0) : 0) - eits",
        "sum = (a == b ? R(1.0) : 0) - 0 * eits",
        "unpaired",
    ),
    (
        "the prediction not shrunk",
        "        ctx->sz[i] *= ctx->sheet_shrink[i];\n",
        "        ctx->sz[i] *= 1;\n",
        "unpaired",
    ),
    ("predicted from nothing", "if (a == b && !(sum > EITS_GLITCH_PIVOT))", "if (0)", "unpaired"),
    (
        "predicted from folds left out",
        "ctx->sheet_known && all_known(ctx) &&",
        "ctx->sheet_known &&",
        "unpaired",
    ),
    (
        "noise without the gain or sqrt(2)",
        "EITS_GLITCH_NOISE * eits_sqrt(R(2.0)) *",
        "EITS_GLITCH_NOISE * R(0.1) *",
        "unpaired",
    ),
    (
        "noise of ratios that of volts",
        "first = b->noise_v / b->v0[ctx->model->fold[k].first]",
        "first = 1",
        "unpaired",
    ),
    ("shares of the largest datum left out", "|| !(off > most.largest))", ")", "unpaired"),
    (
        "shares of their own left out",
        "return off > EITS_GLITCH_SHARE *",
        "return off > 0 *",
        "unpaired",
    ),
    (
        "the robust deviation is the greatest",
        "eits_kth(ctx->list_value, count, count / 2);\n        most",
        "eits_kth(ctx->list_value, count, count - 1);\n        most",
        "findings",
    ),
    (
        "as many as are are glitches",
        "if (count > EITS_GLITCH_MOST)\n        find",
        "if (count > EITS_GLITCH_MOST - 1)\n        find",
        "unpaired",
    ),
    (
        "noisy with half of the folds",
        "        if (!((eits_real)shared[e] >= EITS_NOISY_SHARE *",
        "        if (!((eits_real)shared[e] >= 0 *",
        "findings",
    ),
    (
        "rows of noisy electrodes stay",
        "        eits_leave_electrodes(ctx, EITS_ELECTRODE_NOISY, EITS_ROW_NOISY);",
        "        ;",
        "findings",
    ),
    ("channels are electrodes", "if (any == 2 && is_channel(", "if (0 && is_channel(", "unpaired"),
    (
        "any two electrodes are a channel",
        "        if (!eits_is_pair(row, e, f) && !eits_is_pair(row + 2, e, f))\n",
        "        if (0)\n",
        "unpaired",
    ),
    (
        "rows that drive a channel go",
        "eits_row(ctx, i) + 2, e, f)",
        "eits_row(ctx, i), e, f)",
        "unpaired",
    ),
    (
        "unpaired: any reciprocals",
        "ctx->apart[k] != 0)\n            return 0;",
        "0)\n            return 0;",
        "unpaired",
    ),
    (
        "unpaired: the fold's own leverage left out",
        "off / eits_sqrt(left) : 0;",
        "off : 0;",
        "unpaired",
    ),
    ("unpaired: of several", "!(worst * worst > EITS_GLITCH_ENERGY * energy) || ", "", "unpaired"),
    ("unpaired: out of noise", "!(worst > EITS_GLITCH_UNPAIRED *", "!(worst > 0 *", "unpaired"),
    (
        "unpaired: folds that none determines",
        "left > EITS_GLITCH_PIVOT ? off",
        "left > 0 ? off",
        "unpaired",
    ),
    (
        "unpaired: copies stay",
        "    leave_row(ctx, ctx->model->fold[at].second);\n    return 1;",
        "    return 1;",
        "unpaired",
    ),
    ("the median is of another place", "        if (k <= j)\n", "        if (k < j)\n", "findings"),
)

QUIET = of(
    "quiet.c",
    (
        "quiet: reciprocals do not tell",
        "for (int way = 1; way >= 0",
        "for (int way = 0; way >= 0",
        "judgements",
    ),
    (
        "quiet: signs of reciprocals",
        "(eits_real)fold.sign * change(ctx, fold.second",
        "change(ctx, fold.second",
        "judgements",
    ),
    ("quiet: both rows go", "if (first > 0 && first >= R(0.5) * second)", "if (1)", "findings"),
    (
        "quiet: many are glitches",
        "    return count > EITS_GLITCH_MOST ? 0 : count;",
        "    return count;",
        "judgements",
    ),
    (
        "quiet: many are marked",
        "k < ctx->model->n_folded && count > EITS_GLITCH_MOST; ++k",
        "0; ++k",
        "judgements",
    ),
    (
        "quiet: the wrong one of the first two",
        "                first[i] = second[i];\n",
        "                second[i] = first[i];\n",
        "findings",
    ),
    (
        "quiet: left out for ever",
        "ctx->bad[i] == EITS_BAD_NOW ? 0 : ctx->bad[i]",
        "ctx->bad[i]",
        "findings",
    ),
    (
        "quiet: masked rows come back",
        "ctx->bad[i] == EITS_BAD_NOW ? 0 : ctx->bad[i]",
        "0",
        "baseline",
    ),
    (
        "quiet: not counted",
        "        left += count;\n        while (count > 0)\n            ctx",
        "        while (count > 0)\n            ctx",
        "findings",
    ),
    (
        "quiet: a twentieth of itself is odd",
        "off > limit && off > OWN_LEAST *",
        "off > limit && off > 0 *",
        "judgements",
    ),
    (
        "quiet: whatever the spread",
        "return limit > least ? limit : least;",
        "return least;",
        "judgements",
    ),
)

MISFIT = of(
    "misfit.c",
    (
        "noise is a misfit",
        "eits_sqrt((off - noise) / whole)",
        "eits_sqrt(off / whole)",
        "judgements",
    ),
    (
        "noise that is more than thrice itself",
        "off > EITS_MISFIT_NOISE * EITS_MISFIT_NOISE * noise",
        "1",
        "judgements",
    ),
    ("a small share is a misfit", "return share > EITS_MISFIT_SHARE &&", "return", "judgements"),
    ("drift is a misfit", "off -= stray > 0 ? astray * astray / stray : 0;", ";", "unpaired"),
    ("drift is in the whole", "        whole -= along * along / drift;\n", "", "unpaired"),
    (
        "the sheet's part left in",
        "off = whole - eits_dot(ctx, ctx->sz, ctx->y, rank);",
        "off = whole;",
        "unpaired",
    ),
    (
        "noise where none was learned",
        "rank >= folds || !(ctx->baseline.noise_v > 0)",
        "rank >= folds",
        "unpaired",
    ),
    (
        "two measurements are one",
        "ctx->apart[k] != 0 ? R(0.5) * each : each",
        "0 ? R(0.5) * each : each",
        "judgements",
    ),
    (
        "copies are two measurements",
        "EITS_SIDE_BOTH && ctx->apart[k] != 0 ? R(0.5)",
        "EITS_SIDE_BOTH ? R(0.5)",
        "judgements",
    ),
    (
        "any P is a sheet's",
        "if (is_orthogonal(ctx, 3) && is_orthogonal(ctx, 5))",
        "if (1)",
        "findings",
    ),
    ("the ridge is none", "eits_fma(EITS_GLITCH_RIDGE, most, squared)", "squared", "judgements"),
    (
        "stale: the way touches go",
        "sign == EITS_SIGN_INCREASE ? EITS_SIGN_DECREASE :",
        "sign == EITS_SIGN_INCREASE ? EITS_SIGN_INCREASE :",
        "judgements",
    ),
    (
        "stale: at any ratio",
        "against > EITS_STALE_RATIO * ctx->info.lambda_max &&",
        "against > 0 &&",
        "judgements",
    ),
    ("stale: noise", " && against > least)", ")", "judgements"),
)

CROWDED = of(
    "crowded.c",
    (
        "crowded: distances of x",
        "eits_sqrt(eits_fma(dx, dx, dy * dy))",
        "eits_fabs(dx)",
        "judgements",
    ),
    (
        "crowded: how near",
        "sum = eits_fma(NEAREST, nearest(touches, count), sum);",
        "",
        "judgements",
    ),
    (
        "crowded: nearest beyond far",
        "eits_real least = FAR;",
        "eits_real least = 100;",
        "judgements",
    ),
    (
        "crowded: how wide",
        "sum = eits_fma(WIDEST, widest / ctx->options.touch_seed_radius_mm, sum);",
        "",
        "judgements",
    ),
    (
        "crowded: the first touch's width",
        "widest ? touches[k].radius_mm : widest;",
        "widest ? 0 : widest;",
        "judgements",
    ),
    ("crowded: what is left", "sum = eits_fma(LEFT, eits_sqrt(left), sum);", "", "judgements"),
    ("crowded: the weakest over noise", "sum = eits_fma(WEAKEST, above, sum);", "", "judgements"),
    (
        "crowded: the first is the weakest",
        "weakest = lesser(weakest, touches[k].confidence);",
        "",
        "judgements",
    ),
    ("crowded: how clear", "return eits_fma(CLEAREST, clear, sum);", "return sum;", "judgements"),
    ("crowded: how many", "(eits_real)count, OFFSET)", "1, OFFSET)", "judgements"),
    (
        "crowded: electrodes",
        "TOUCHES * OF_ELECTRODES / (eits_real)ctx->model->n_electrodes",
        "TOUCHES",
        "judgements",
    ),
    ("crowded: as many as may be", "count >= ctx->options.max_touches || ", "", "judgements"),
    (
        "crowded: in noise",
        " || ctx->info.lambda_max < FAINT * ctx->info.lambda_noise",
        "",
        "judgements",
    ),
    (
        "crowded: as the frame before",
        "    ctx->info.findings &= ~(uint32_t)EITS_FINDING_CROWDED;\n",
        "",
        "judgements",
    ),
)

FRAMES = OBSERVED + ELECTRODES + GLITCH + QUIET + MISFIT + CROWDED
