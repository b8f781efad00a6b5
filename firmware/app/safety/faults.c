#include "app/safety/faults.h"

#include <string.h>

void fw_faults_init(fw_faults *faults, fw_tx_queue *tx_queue)
{
    *faults = (fw_faults){.tx_queue = tx_queue};
}

static void send_fault(fw_faults *faults, eits_fault code, bool there, fw_fault_detail detail)
{
    eits_packet_fault packet = {.code = (uint16_t)code,
                                .raised = there,
                                .frame = detail.frame,
                                .index = detail.index,
                                .value = detail.value};
    if (detail.words != NULL)
        memcpy(packet.words, detail.words, sizeof packet.words);
    (void)fw_tx_queue_send(faults->tx_queue, EITS_PACKET_FAULT, &packet, sizeof packet, NULL, 0);
}

static bool of_electrode(eits_fault code)
{
    return code == EITS_FAULT_ELECTRODE_OPEN || code == EITS_FAULT_BRIDGED ||
           code == EITS_FAULT_ELECTRODE_NOISY;
}

static uint32_t place_of(eits_fault code, fw_fault_detail detail)
{
    return of_electrode(code) ? (uint32_t)detail.index & 31u : 0;
}

static uint32_t with_bit(uint32_t bits, uint32_t place, bool set)
{
    return set ? bits | 1u << place : bits & ~(1u << place);
}

void fw_fault_set(fw_faults *faults, eits_fault code, bool there, fw_fault_detail detail)
{
    const uint32_t place = place_of(code, detail);
    faults->run[code][place] = 0;
    if (((faults->there[code] >> place & 1u) != 0) == there)
        return;
    faults->there[code] = with_bit(faults->there[code], place, there);
    faults->raised = with_bit(faults->raised, code, faults->there[code] != 0);
    send_fault(faults, code, there, detail);
}

void fw_fault_observe(fw_faults *faults, eits_fault code, bool found, fw_fault_detail detail)
{
    const uint32_t place = place_of(code, detail);
    const bool there = (faults->there[code] >> place & 1u) != 0;
    const uint32_t shown = code >= EITS_FAULT_ELECTRODE_NOISY ? EITS_FAULT_RAISE_FRAMES : 1;
    if (found == there)
        faults->run[code][place] = 0;
    else if (++faults->run[code][place] >= (there ? EITS_FAULT_CLEAR_FRAMES : shown))
        fw_fault_set(faults, code, found, detail);
}

bool fw_fault_is(const fw_faults *faults, eits_fault code)
{
    return (faults->raised & 1u << code) != 0;
}

void fw_faults_clear(fw_faults *faults, uint32_t frame)
{
    for (uint32_t code = 1; code < EITS_FAULTS; ++code) {
        for (int32_t k = 0; k < 32; ++k)
            fw_fault_set(faults, (eits_fault)code, false,
                         (fw_fault_detail){.frame = frame, .index = k});
    }
}
