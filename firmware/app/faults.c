#include "app/faults.h"

#include <string.h>

void fw_faults_init(fw_faults *faults, fw_outbox *outbox)
{
    *faults = (fw_faults){.outbox = outbox};
}

static void tell(fw_faults *faults, eits_fault code, bool there, fw_fault_detail detail)
{
    eits_packet_fault packet = {.code = (uint16_t)code,
                                .raised = there,
                                .frame = detail.frame,
                                .index = detail.index,
                                .value = detail.value};
    if (detail.words != NULL)
        memcpy(packet.words, detail.words, sizeof packet.words);
    (void)fw_outbox_send(faults->outbox, EITS_PACKET_FAULT, &packet, sizeof packet, NULL, 0);
}

static uint32_t with_bit(uint32_t bits, uint32_t bit, bool set)
{
    return set ? bits | bit : bits & ~bit;
}

void fw_fault_set(fw_faults *faults, eits_fault code, bool there, fw_fault_detail detail)
{
    const uint32_t bit = 1u << code;
    if (code == EITS_FAULT_ELECTRODE_OPEN) {
        const uint32_t electrode = 1u << ((uint32_t)detail.index & 31u);
        if (((faults->open_electrodes & electrode) != 0) == there)
            return;
        faults->open_electrodes = with_bit(faults->open_electrodes, electrode, there);
        faults->raised = with_bit(faults->raised, bit, faults->open_electrodes != 0);
    } else {
        if (((faults->raised & bit) != 0) == there)
            return;
        faults->raised = with_bit(faults->raised, bit, there);
    }
    tell(faults, code, there, detail);
}

bool fw_fault_is(const fw_faults *faults, eits_fault code)
{
    return (faults->raised & 1u << code) != 0;
}

void fw_faults_clear(fw_faults *faults, uint32_t frame)
{
    for (uint32_t code = 1; code < 32; ++code) {
        for (int32_t e = 0; code == EITS_FAULT_ELECTRODE_OPEN && e < 32; ++e)
            fw_fault_set(faults, EITS_FAULT_ELECTRODE_OPEN, false, (fw_fault_detail){.frame = frame, .index = e});
        if (code != EITS_FAULT_ELECTRODE_OPEN)
            fw_fault_set(faults, (eits_fault)code, false, (fw_fault_detail){.frame = frame});
    }
}
