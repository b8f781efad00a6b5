/* Several for one: an ellipse is explained by discs side by side before its shape is known. */
#include "joint/joint.h"

#include "base/vec.h"
#include "joint/constants.h"

int eits_joint_near(const eits_shape *a, const eits_shape *b, eits_real radii)
{
    const eits_real dx = a->x - b->x, dy = a->y - b->y, near = radii * (a->radius + b->radius);
    return a->amplitude * b->amplitude > 0 && eits_fma(dx, dx, dy * dy) < near * near;
}

/* group[k]: the lowest number of the shapes that hang together with shape k, each nearer to another
 * than `radii` sums of their radii. Returns the number of groups. */
static uint32_t find_groups(const eits_joint *j, eits_real radii, uint32_t *group)
{
    uint32_t count = 0;
    for (uint32_t k = 0; k < j->count; ++k)
        group[k] = k;
    for (uint32_t k = 1; k < j->count; ++k) {
        for (uint32_t i = 0; i < k; ++i) {
            const uint32_t low = group[i] < group[k] ? group[i] : group[k],
                           high = group[i] < group[k] ? group[k] : group[i];
            if (low == high || !eits_joint_near(&j->shape[i], &j->shape[k], radii))
                continue;
            for (uint32_t l = 0; l <= k; ++l)
                group[l] = group[l] == high ? low : group[l];
        }
    }
    for (uint32_t k = 0; k < j->count; ++k)
        count += group[k] == k;
    return count;
}

/* The ellipse of the group's strength and second moments: an even ellipse with half axes a and b
 * has the moments a^2 / 4 and b^2 / 4. */
static eits_shape of_group(const eits_joint *j, const uint32_t *group, uint32_t of)
{
    eits_real weight = 0, x = 0, y = 0, area = 0, sum = 0, difference = 0, product = 0;
    for (uint32_t k = of; k < j->count; ++k) {
        const eits_shape *s = &j->shape[k];
        const eits_real strength = group[k] == of ? eits_joint_strength(s) : 0;
        weight += strength;
        x = eits_fma(strength, s->x, x);
        y = eits_fma(strength, s->y, y);
        area += group[k] == of ? s->radius * s->radius : 0;
    }
    x /= weight;
    y /= weight;
    for (uint32_t k = of; k < j->count; ++k) {
        const eits_shape *s = &j->shape[k];
        const eits_real dx = s->x - x, dy = s->y - y, r2 = s->radius * s->radius,
                        share = group[k] == of ? s->amplitude * r2 / weight : 0;
        sum = eits_fma(share, eits_fma(dx, dx, eits_fma(dy, dy, r2 / 2)), sum);
        difference = eits_fma(share, eits_fma(dx, dx, -(dy * dy)), difference);
        product = eits_fma(share, 2 * dx * dy, product);
    }
    /* of the moments along the axes, sum and difference: (a^2 + b^2) / 4, (a^2 - b^2) / 4 */
    const eits_real apart = eits_sqrt(eits_fma(difference, difference, product * product)),
                    a = eits_sqrt(2 * (sum + apart)), b = eits_sqrt(2 * (sum - apart)),
                    eta = (a - b) / (a + b), turn = apart > 0 ? eta / apart : 0;
    return (eits_shape){.x = x,
                        .y = y,
                        .radius = eits_sqrt(area),
                        .amplitude = weight / area,
                        .e1 =
                            eits_clamp(turn * difference, -EITS_JOINT_MAX_ETA, EITS_JOINT_MAX_ETA),
                        .e2 = eits_clamp(turn * product, -EITS_JOINT_MAX_ETA, EITS_JOINT_MAX_ETA)};
}

uint32_t eits_joint_merge(eits_joint *j)
{
    uint32_t group[EITS_MAX_TOUCHES], count = find_groups(j, EITS_JOINT_MERGE_APART, group);
    const int crowd = count >= EITS_JOINT_CROWD;
    if (crowd)
        count = find_groups(j, EITS_JOINT_MERGE_CROWD, group);
    const uint32_t fewer = j->count - count;
    if (fewer == 0)
        return 0;
    eits_joint merged = *j;
    merged.count = 0;
    for (uint32_t k = 0; k < j->count; ++k) {
        if (group[k] != k)
            continue;
        eits_shape *of = &merged.shape[merged.count];
        *of = of_group(j, group, k);
        if (crowd)
            of->e1 = of->e2 = 0;
        merged.from[merged.count++] = j->from[k];
    }
    merged.parameters = crowd ? EITS_JOINT_DISC : EITS_JOINT_ELLIPSE;
    *j = merged;
    return crowd ? 0 : fewer;
}
