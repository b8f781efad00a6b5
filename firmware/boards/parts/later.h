/* Work that runs when no other interrupt is active: by PendSV, to which the board gives the lowest
 * priority. */
#ifndef LATER_H
#define LATER_H

#include <stdint.h>

#define LATER_ICSR      (*(volatile uint32_t *)0xE000ED04u) /* ARMv7-M, B3.2.4 */
#define LATER_PENDSVSET (1u << 28)

typedef struct later {
    void (*work)(void *user);
    void *user;
} later;

static inline void later_wait(later *waiting, void (*work)(void *user), void *user)
{
    waiting->work = work;
    waiting->user = user;
    LATER_ICSR = LATER_PENDSVSET;
}

#endif
