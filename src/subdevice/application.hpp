// What a device does beside talking EtherCAT: the interface its author implements. All calls come from within
// Device's functions; each has an answer already, so that an application says only what it has to say.
#pragma once

#include "subdevice/esm.hpp"

#include <optional>

namespace margay::subdevice {

class DiagnosisHistory;
class Emergencies;

class Application {
  public:
    // The device's description, the same at all times.
    [[nodiscard]] virtual const DeviceDescription& description() const = 0;

    // --- State changes; see EsmClient ---
    [[nodiscard]] virtual Verdict before(Transition transition, Time now) {
        (void)transition, (void)now;
        return Verdict::go();
    }
    virtual void dropped(Transition transition) { (void)transition; }
    virtual void after(Transition transition, Time now) { (void)transition, (void)now; }

    // --- Process data ---
    // The application hook. Mapped outputs have been put into the dictionary's image when `outputs_valid` (in
    // OP); inputs are taken from there when this returns. Called from SAFEOP on; in interrupt modes from the
    // interrupt.
    virtual void cycle(Time now, bool outputs_valid) { (void)now, (void)outputs_valid; }

    // Outputs stop: OP is left, whatever the reason. Mapped outputs have their initial values again.
    virtual void safe_outputs(Time now) { (void)now; }

    // In place of the PDO assignment in the dictionary: how many octets the process data have now. Nothing: by the
    // assignment, or without it as many as the description says at most.
    [[nodiscard]] virtual std::optional<ProcessDataSizes> process_data_sizes() { return std::nullopt; }

    // In place of the PDO mapping: outputs out of the octets of SM2, inputs into those of SM3. False: the
    // mapping does it.
    virtual bool unpack_outputs(Bytes raw) {
        (void)raw;
        return false;
    }
    virtual bool pack_inputs(MutableBytes raw) {
        (void)raw;
        return false;
    }

    // --- Where the hooks of 0x1003 and 0x10F3 find what they show; nullptr: the device has none ---
    [[nodiscard]] virtual Emergencies* emergencies() { return nullptr; }
    [[nodiscard]] virtual DiagnosisHistory* diagnosis() { return nullptr; }

  protected:
    ~Application() = default;
};

}  // namespace margay::subdevice
