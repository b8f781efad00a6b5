/* Sections MOVE and ROWE: corrections of places by the reference, forwards and backwards. */
#include "check.h"
#include "small_model.h"

#include "base/vec.h"
#include "context/constants.h"
#include "context/places.h"
#include "eitskin/frame.h"
#include "frame/constants.h"
#include "frame/reference.h"

#include <math.h>
#include <string.h>

enum { RANK = 4, ERRORS = 16 + 4 * RANK * (RANK + 1), ROWS = 2, TERM = 8 * ROWS, DEGREES = 5 };
enum { HEAD = 16, FOLDS = HEAD + 4 * ROWS * SMALL_FOLDED };
static const uint32_t TERMS[DEGREES] = {1, 3, 6, 10, 15};
static const small_spec SPEC = {
    .rank = RANK, .side = 5, .shape = SMALL_WHITENED, .fields = 1, .spare = 1};

/* `model` with section `tag` in the place of section `old`. */
static small_model with(small_model *model, const char *old, const char *tag, const void *bytes,
                        uint32_t size)
{
    memcpy(small_model_entry(model, old), "XTRA", 4);
    small_model made = small_model_with_section(model, tag, bytes, size);
    small_model_free(model);
    return made;
}

/* With UNCE, and with N two rows: fold k's numbers are .2 and -.1 k. */
static small_model with_places(int geom)
{
    static uint8_t errors[ERRORS], places[4 * ROWS * SMALL_FOLDED];
    small_put_u32(errors, 1); /* row gains */
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        small_put_f32(places + 8 * k, 0.2f);
        small_put_f32(places + 8 * k + 4, -0.1f * (float)k);
    }
    small_model made = small_model_make(SPEC);
    made = with(&made, "XTRA", "UNCE", errors, ERRORS);
    return geom ? with(&made, "META", "GEOM", places, sizeof places) : made;
}

/* Fold k's numbers of M are .2 and -.1 k; number i of U is i - 7.5. */
static small_model with_moves(int geom, uint32_t rows, uint32_t terms, uint32_t rest, uint32_t size)
{
    static uint8_t moves[HEAD + ROWS * 4 * SMALL_FOLDED + 17 * TERM];
    small_put_u32(moves, rows);
    small_put_u32(moves + 4, terms);
    small_put_u32(moves + 8, rest);
    for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
        small_put_f32(moves + HEAD + 8 * k, 0.2f);
        small_put_f32(moves + HEAD + 8 * k + 4, -0.1f * (float)k);
    }
    for (uint32_t i = 0; i < 17 * TERM / 4; ++i)
        small_put_f32(moves + FOLDS + 4 * i, (float)i - 7.5f);
    small_model made = with_places(geom);
    return with(&made, "FLDS", "MOVE", moves, size);
}

static small_model with_terms(uint32_t terms)
{
    return with_moves(1, ROWS, terms, 0, FOLDS + terms * TERM);
}

static eits_status opens(small_model made, eits_model *model)
{
    const eits_status status = eits_model_open(model, made.blob, made.size);
    small_model_free(&made);
    return status;
}

TEST(as_many_numbers_as_a_polynomial_has_are_read_in_place)
{
    for (uint32_t terms = 0, known = 0; terms <= 16; ++terms) {
        const int is_whole = known < DEGREES && terms == TERMS[known];
        known += (uint32_t)is_whole;
        small_model made = with_terms(terms);
        eits_model model;
        CHECK_EQUAL(eits_model_open(&model, made.blob, made.size),
                    is_whole ? EITS_OK : EITS_E_MODEL_SECTION);
        CHECK(!is_whole ||
              (model.uncertainty.move_terms == terms && model.uncertainty.move_rows == ROWS &&
               model.uncertainty.moved[2] == 0.2f && model.uncertainty.moves[3] == -4.5f));
        small_model_free(&made);
    }
}

TEST(moves_of_another_size_without_places_or_out_of_range_are_refused)
{
    const float odd[] = {2e6f, -2e6f, (float)NAN};
    const struct {
        uint32_t rows, terms, rest, size;
    } of_size[] = {{ROWS, 3, 0, 0},
                   {ROWS, 3, 0, HEAD - 4},
                   {ROWS, 3, 0, HEAD},
                   {ROWS, 3, 0, FOLDS + 3 * TERM - 4},
                   {ROWS, 3, 0, FOLDS + 3 * TERM + 4},
                   {0, 3, 0, HEAD},
                   {ROWS + 1, 3, 0, FOLDS + 3 * TERM},
                   {EITS_MAX_PLACE_ROWS + 1, 3, 0, FOLDS + 3 * TERM},
                   {0x80000000u, 3, 0, FOLDS + 3 * TERM},
                   {ROWS, 3, 1, FOLDS + 3 * TERM},
                   {ROWS, 3, EITS_MAX_PLACE_ROWS + 1, FOLDS + 3 * TERM}};
    eits_model model;
    for (size_t k = 0; k < sizeof of_size / sizeof of_size[0]; ++k)
        CHECK_EQUAL(opens(with_moves(1, of_size[k].rows, of_size[k].terms, of_size[k].rest,
                                     of_size[k].size),
                          &model),
                    EITS_E_MODEL_SECTION);
    CHECK_EQUAL(opens(with_moves(0, ROWS, 1, 0, FOLDS + TERM), &model), EITS_E_MODEL_VALUE);
    for (int k = 0; k < 3; ++k) {
        small_model made = with_terms(3);
        uint32_t size;
        small_put_f32(small_model_section(&made, "MOVE", &size) + FOLDS + 3 * TERM - 4, odd[k]);
        small_model_seal(&made);
        CHECK_EQUAL(opens(made, &model), EITS_E_MODEL_VALUE);
    }
}

enum { COUNT = 3, SEEN = 2, ROWE_FOLDS = 4 * (COUNT + SEEN) * SMALL_FOLDED };

/* Section ROWE beside MOVE of `terms` terms (0: without it): number i after the head is i / 16. */
static small_model with_row_errors(uint32_t terms, const uint32_t head[3], float distance,
                                   uint32_t size)
{
    static uint8_t bytes[HEAD + ROWE_FOLDS + 4 * 4 * 17 * SEEN];
    for (int i = 0; i < 3; ++i)
        small_put_u32(bytes + 4 * i, head[i]);
    small_put_f32(bytes + 12, distance);
    for (uint32_t i = 0; i < (sizeof bytes - HEAD) / 4; ++i)
        small_put_f32(bytes + HEAD + 4 * i, (float)i / 16);
    small_model made = terms > 0 ? with_terms(terms) : with_places(1);
    return with(&made, "XTRS", "ROWE", bytes, size);
}

/* Its size for 6 terms. */
enum { ROWE_SIZE = HEAD + ROWE_FOLDS + 4 * 4 * 6 * SEEN };
static const uint32_t ROWE_HEAD[3] = {COUNT, SEEN, 6};

TEST(row_errors_are_read_in_place)
{
    small_model made = with_row_errors(6, ROWE_HEAD, 0.18f, ROWE_SIZE);
    eits_model model;
    CHECK_OK(eits_model_open(&model, made.blob, made.size));
    const eits_row_errors *e = &model.row_errors;
    CHECK(e->count == COUNT && e->move_rows == SEEN && e->distance == 0.18f);
    CHECK((const uint8_t *)e->vectors == small_model_section(&made, "ROWE", NULL) + HEAD);
    CHECK(e->vectors[5] == 5 / 16.0f && e->moved - e->vectors == COUNT * SMALL_FOLDED &&
          e->moves[0] - e->moved == SEEN * SMALL_FOLDED && e->moves[1] - e->moves[0] == 12 * SEEN);
    small_model_free(&made);
    made = with_terms(6); /* a model may lack them */
    CHECK_OK(eits_model_open(&model, made.blob, made.size));
    CHECK(model.row_errors.vectors == NULL && model.row_errors.move_rows == 0);
    small_model_free(&made);
}

TEST(row_errors_of_another_size_without_moves_or_out_of_range_are_refused)
{
    static const struct {
        uint32_t terms, head[3], size;
    } of_size[] = {{6, {COUNT, SEEN, 6}, 0},
                   {6, {COUNT, SEEN, 6}, HEAD - 4},
                   {6, {COUNT, SEEN, 6}, HEAD},
                   {6, {COUNT, SEEN, 6}, ROWE_SIZE - 4},
                   {6, {COUNT, SEEN, 6}, ROWE_SIZE + 4},
                   {6, {0, SEEN, 6}, ROWE_SIZE},
                   {6, {0, SEEN, 6}, ROWE_SIZE - 4 * COUNT * SMALL_FOLDED},
                   {6, {COUNT, 0, 6}, HEAD + 4 * COUNT * SMALL_FOLDED},
                   {6, {COUNT + 1, SEEN, 6}, ROWE_SIZE},
                   {6, {COUNT, SEEN + 1, 6}, ROWE_SIZE},
                   {6, {EITS_MAX_PLACE_ROWS + 1, SEEN, 6}, ROWE_SIZE},
                   {6, {COUNT, EITS_MAX_PLACE_ROWS + 1, 6}, ROWE_SIZE},
                   {6, {0x80000000u, 0x80000000u, 6}, ROWE_SIZE},
                   {6, {COUNT, SEEN, 0}, HEAD + ROWE_FOLDS},
                   /* other terms than MOVE has, and no MOVE */
                   {6, {COUNT, SEEN, 3}, HEAD + ROWE_FOLDS + 4 * 4 * 3 * SEEN},
                   {3, {COUNT, SEEN, 6}, ROWE_SIZE},
                   {0, {COUNT, SEEN, 6}, ROWE_SIZE},
                   {0, {COUNT, SEEN, 0}, HEAD + ROWE_FOLDS}};
    eits_model model;
    for (size_t k = 0; IN_TABLE(k, of_size); ++k)
        CHECK_EQUAL(
            opens(with_row_errors(of_size[k].terms, of_size[k].head, 0.18f, of_size[k].size),
                  &model),
            EITS_E_MODEL_SECTION);
    const float distances[] = {0, -1, 1e-7f, 2e6f, (float)NAN, (float)INFINITY};
    for (size_t k = 0; IN_TABLE(k, distances); ++k)
        CHECK_EQUAL(opens(with_row_errors(6, ROWE_HEAD, distances[k], ROWE_SIZE), &model),
                    EITS_E_MODEL_VALUE);
    const float odd[] = {2e6f, -2e6f, (float)NAN};
    const uint32_t at[] = {HEAD, HEAD + ROWE_FOLDS - 4, ROWE_SIZE - 4};
    for (size_t k = 0; IN_TABLE(k, odd); ++k) {
        for (int place = 0; place < 3; ++place) {
            small_model made = with_row_errors(6, ROWE_HEAD, 0.18f, ROWE_SIZE);
            small_put_f32(small_model_section(&made, "ROWE", NULL) + at[place], odd[k]);
            small_model_seal(&made);
            CHECK_EQUAL(opens(made, &model), EITS_E_MODEL_VALUE);
        }
    }
}

/* The polynomial, in double width, of the reference's sums z = M y. */
static void expected_shift(const eits_model *m, const double z[ROWS], double x_mm, double y_mm,
                           double shift[2])
{
    const double pixel = (double)m->pixel_mm, half = 0.5 * pixel * (m->nx > m->ny ? m->nx : m->ny),
                 x = (x_mm - (double)m->origin_x_mm - 0.5 * pixel * m->nx) / half,
                 y = (y_mm - (double)m->origin_y_mm - 0.5 * pixel * m->ny) / half;
    for (uint32_t axis = 0; axis < 2; ++axis) {
        uint32_t t = 0;
        shift[axis] = 0;
        for (int n = 0; t < m->uncertainty.move_terms; ++n) {
            for (int j = 0; j <= n; ++j, ++t) {
                const float *u =
                    m->uncertainty.moves + (axis * m->uncertainty.move_terms + t) * ROWS;
                shift[axis] -=
                    ((double)u[0] * z[0] + (double)u[1] * z[1]) * pow(x, n - j) * pow(y, j);
            }
        }
    }
}

/* z of a reference whose row i is 1 + part sin i times as large as modelled. */
static void take_reference(small_context *c, double part, double z[ROWS])
{
    const eits_model *m = &c->model;
    eits_real frame[SMALL_ROWS];
    double square = 0, of_model = 0;
    for (uint32_t k = 0; k < m->n_folded; ++k) {
        const double v = (double)m->v_ref[k] * (1 + part * sin(k));
        square += v * v;
        of_model += (double)m->v_ref[k] * (double)m->v_ref[k];
        frame[m->fold[k].first] = (eits_real)v;
        if (m->fold[k].second != EITS_FOLD_NONE)
            frame[m->fold[k].second] = (eits_real)(v * m->fold[k].sign);
    }
    CHECK_EQUAL(eits_reference_set(c->ctx, frame, SMALL_ROWS), EITS_OK);
    z[0] = z[1] = 0;
    for (uint32_t k = 0; k < m->n_folded; ++k) {
        const double y = log((1 + part * sin(k)) * sqrt(of_model / square));
        z[0] += 0.2 * y;
        z[1] += -0.1 * k * y;
    }
}

TEST(touches_go_to_where_they_lie_and_back)
{
    for (uint32_t n = 0; n < DEGREES; ++n) {
        small_model made = with_terms(TERMS[n]);
        small_context c;
        small_context_open(&c, &made, 0);
        double z[ROWS], shift[2];
        take_reference(&c, 0.002, z);
        CHECK_NEAR(c.ctx->reference.place_mm2, z[0] * z[0] + z[1] * z[1], 2e-4);
        for (double place = -14; place <= 14; place += 3.5) {
            const double x = place, y = 3 - 0.5 * place;
            eits_real at[2] = {(eits_real)x, (eits_real)y};
            expected_shift(&c.model, z, x, y, shift);
            CHECK(fabs(shift[0]) < 6 && fabs(shift[1]) < 6); /* within the bound */
            eits_place_on_skin(c.ctx, at);
            CHECK_NEAR(at[0], x + shift[0], 2e-3);
            CHECK_NEAR(at[1], y + shift[1], 2e-3);
            eits_place_in_model(c.ctx, at);
            CHECK_NEAR(at[0], x, 0.2 * fabs(shift[0]) + 0.2 * fabs(shift[1]) + 1e-3);
        }
        small_context_close(&c);
        small_model_free(&made);
    }
}

TEST(a_shift_is_at_most_some_pixels_and_none_without_row_gains)
{
    small_model made = with_terms(15);
    small_context c;
    small_context_open(&c, &made, 0);
    double z[ROWS];
    take_reference(&c, 0.2, z);
    const double most = (double)EITS_MAX_SHIFT * (double)c.model.pixel_mm;
    eits_real at[2] = {5, 2};
    CHECK(eits_corrects_places(c.ctx));
    eits_place_on_skin(c.ctx, at);
    CHECK(fabs((double)at[0] - 5) <= most + 1e-4);
    CHECK_NEAR(fabs((double)at[1] - 2), most, 1e-4);
    CHANGE_OPTIONS(c.ctx, o.row_gains = 0);
    CHECK(!eits_corrects_places(c.ctx));
    at[0] = 5;
    eits_place_on_skin(c.ctx, at);
    eits_place_in_model(c.ctx, at);
    CHECK(at[0] == 5);
    CHANGE_OPTIONS(c.ctx, o.row_gains = 1);
    take_reference(&c, 0.9, z); /* so far is an instrument */
    CHECK(!eits_corrects_places(c.ctx));
    small_context_close(&c);
    small_model_free(&made);
}

/* B has one row: fold 0 alone. */
TEST(rows_with_gains_of_their_own_are_corrected_less)
{
    small_model made = with_moves(1, ROWS, 1, 1, FOLDS + TERM + 4 * SMALL_FOLDED);
    uint32_t size;
    float *row = (float *)(void *)(small_model_section(&made, "MOVE", &size) + FOLDS + TERM);
    memset(row, 0, 4 * SMALL_FOLDED);
    row[0] = 1;
    small_model_seal(&made);
    small_context c;
    small_context_open(&c, &made, 0);
    const double of[] = {0, 0.03, 0.1};
    for (int k = 0; k < 3; ++k) {
        eits_place_sums sums = {{2, 0}, {3, 0}, {0}, {0}};
        eits_add_log_gain(&c.model, 0, (eits_real)of[k], &sums);
        const double spread = (double)EITS_ROW_SPREAD,
                     trust = pow(spread * spread / (spread * spread + of[k] * of[k]), 2);
        eits_learn_places(c.ctx, &sums);
        CHECK_NEAR(c.ctx->reference.place_trust, trust, 1e-6);
        CHECK_NEAR(c.ctx->reference.shift_mm[0][0], -7.5 * (3 + 0.2 * of[k]) * trust, 1e-4);
        CHECK_NEAR(c.ctx->reference.place_mm2, pow(2 + 0.2 * of[k], 2), 1e-5);
    }
    small_context_close(&c);
    small_model_free(&made);
}

/* With fields and row errors, the correction is of touches that are fitted jointly: on a skin near
 * the model of those in white noise, on one that is far of those with the model's errors. */
TEST(touches_that_are_fitted_jointly_have_corrections_of_their_own)
{
    static float rowe[COUNT * SMALL_FOLDED + SEEN * SMALL_FOLDED + 4 * 3 * SEEN];
    const double part[] = {0.01, 0.1};
    small_model made = with_terms(3);
    small_context c;
    small_context_open(&c, &made, 0);
    for (uint32_t i = 0; i < sizeof rowe / sizeof rowe[0]; ++i)
        rowe[i] = (float)(i % 17) / 16;
    float *seen = rowe + COUNT * SMALL_FOLDED, *moves = seen + SEEN * SMALL_FOLDED;
    const uint16_t stored = 0;
    for (int far = 0; far < 2; ++far) {
        double y[SMALL_FOLDED], z[ROWS], sums[SEEN] = {0}, square = 0, of_model = 0;
        for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
            const double v = (double)c.model.v_ref[k];
            y[k] = log(1 + part[far] * sin(k));
            of_model += v * v;
            square += pow(v * (1 + part[far] * sin(k)), 2);
        }
        for (uint32_t k = 0; k < SMALL_FOLDED; ++k) {
            for (uint32_t j = 0; j < SEEN; ++j)
                sums[j] += (y[k] + 0.5 * log(of_model / square)) * (double)seen[SEEN * k + j];
        }
        for (int joint = 0; joint < 2; ++joint) {
            c.model.row_errors = (eits_row_errors){.vectors = joint ? rowe : NULL,
                                                   .count = COUNT,
                                                   .distance = 0.1f,
                                                   .moved = joint ? seen : NULL,
                                                   .moves = {moves, moves + 2 * 3 * SEEN},
                                                   .move_rows = joint ? SEEN : 0};
            c.model.fields.at.data = joint ? &stored : NULL;
            take_reference(&c, part[far], z);
            CHECK_EQUAL(eits_may_fit_jointly(c.ctx), joint);
            CHECK_EQUAL(eits_weighs_errors(c.ctx), far);
            for (int t = 0; t < 3; ++t) {
                const float *u =
                    joint ? moves + (6 * far + t) * SEEN : c.model.uncertainty.moves + t * ROWS;
                const double *of = joint ? sums : z;
                CHECK_NEAR(c.ctx->reference.shift_mm[0][t],
                           -((double)u[0] * of[0] + (double)u[1] * of[1]), 3e-3);
            }
        }
    }
    c.model.fields.at.data = NULL;
    small_context_close(&c);
    small_model_free(&made);
}

RUN_TESTS("places")
