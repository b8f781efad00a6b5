#include "app/safety/faults.h"

#include "app/safety/state.h"

#include <string.h>

void fw_faults_at_frame(fw_safety *safety, uint32_t frame)
{
    safety->faults.frame = frame;
}

static void report(const fw_safety *safety, eits_fault code, bool there, fw_fault_detail detail)
{
    eits_packet_fault packet = {.code = (uint16_t)code,
                                .raised = there,
                                .frame = safety->faults.frame,
                                .index = detail.index,
                                .value = detail.value};
    if (detail.words != NULL)
        memcpy(packet.words, detail.words, sizeof packet.words);
    safety->fault_changed(safety->user, &packet);
}

static bool of_electrode(eits_fault code)
{
    return code == EITS_FAULT_ELECTRODE_OPEN || code == EITS_FAULT_BRIDGED ||
           code == EITS_FAULT_ELECTRODE_NOISY;
}

static uint32_t place_of(eits_fault code, fw_fault_detail detail)
{
    return of_electrode(code) ? (uint32_t)detail.index % FW_MAX_ELECTRODES : 0;
}

static uint64_t with_bit(uint64_t bits, uint32_t place, bool set)
{
    const uint64_t bit = (uint64_t)1 << place;
    return set ? bits | bit : bits & ~bit;
}

void fw_fault_set(fw_safety *safety, eits_fault code, bool there, fw_fault_detail detail)
{
    fw_faults *faults = &safety->faults;
    const uint32_t place = place_of(code, detail);
    faults->run[code][place] = 0;
    if (((faults->there[code] >> place & 1u) != 0) == there)
        return;
    faults->there[code] = with_bit(faults->there[code], place, there);
    faults->raised = (uint32_t)with_bit(faults->raised, code, faults->there[code] != 0);
    report(safety, code, there, detail);
}

void fw_fault_observe(fw_safety *safety, eits_fault code, bool shown, fw_fault_detail detail)
{
    fw_faults *faults = &safety->faults;
    const uint32_t place = place_of(code, detail);
    const bool there = (faults->there[code] >> place & 1u) != 0;
    const uint32_t to_raise = code >= EITS_FAULT_ELECTRODE_NOISY ? EITS_FAULT_RAISE_FRAMES : 1;
    if (shown == there)
        faults->run[code][place] = 0;
    else if (++faults->run[code][place] >= (there ? EITS_FAULT_CLEAR_FRAMES : to_raise))
        fw_fault_set(safety, code, shown, detail);
}

uint32_t fw_faults_raised(const fw_safety *safety)
{
    return safety->faults.raised;
}

void fw_faults_clear(fw_safety *safety)
{
    for (uint32_t code = 1; code < EITS_FAULTS; ++code) {
        for (int32_t k = 0; k < (int32_t)FW_MAX_ELECTRODES; ++k)
            fw_fault_set(safety, (eits_fault)code, false, (fw_fault_detail){.index = k});
    }
}
