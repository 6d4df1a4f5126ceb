// The interface that the author of a device implements: everything that the device does apart from EtherCAT
// communication. Device calls these functions from within its own functions. Every function except description() has a
// default, so an application overrides only the functions that it needs.
#pragma once

#include "subdevice/esm.hpp"

#include <optional>

namespace margay::subdevice {

class DiagnosisHistory;
class Emergencies;
class ObjectDictionary;
class StoredValues;

// The modules of a modular device as the state machine sees them; modules.hpp has the implementation.
class ModuleLayout {
  public:
    // INIT→PREOP, and start: makes the objects of the present modules.
    virtual void lay_out(ObjectDictionary& dictionary) = 0;
    // PREOP→SAFEOP: AlStatusCode::none, or why the modules cannot exchange process data.
    [[nodiscard]] virtual AlStatusCode check() const = 0;

  protected:
    ~ModuleLayout() = default;
};

class Application {
  public:
    // Inside of an application these names need no namespace: margay::Transition, of the master, is another type.
    using Transition = subdevice::Transition;
    using Verdict = subdevice::Verdict;

    // The description of the device. It must not change while the device exists.
    [[nodiscard]] virtual const DeviceDescription& description() const = 0;

    // The device id that the master asks for (ETG.1020 "Explicit Device Identification"); 0: not supported. A device
    // with a rotary switch returns the position of the switch, and sets DeviceDescription::device_id_switch.
    [[nodiscard]] virtual std::uint16_t device_id() { return description().device_id; }

    // --- State changes: see EsmClient ---
    [[nodiscard]] virtual Verdict before(Transition transition, Time now) {
        (void)transition, (void)now;
        return Verdict::go();
    }
    virtual void dropped(Transition transition) { (void)transition; }
    virtual void after(Transition transition, Time now) { (void)transition, (void)now; }

    // --- Process data ---
    // The cyclic function of the application. When `outputs_valid` is true (in OP), the mapped outputs have already
    // been copied into the image of the dictionary. After this function returns, the mapped inputs are copied from that
    // image. Called in SAFEOP and OP, with the lock of EscAccess held: in the run modes `mixed` and `interrupts` from
    // the interrupt handler, at deadlines from step().
    virtual void cycle(Time now, bool outputs_valid) { (void)now, (void)outputs_valid; }

    // DC: SYNC1 has occurred (DcDescription::sync1, or Device::sync1()). Called as cycle() is.
    virtual void sync1(Time now) { (void)now; }

    // The outputs must go to a safe state, because the device has left OP for any reason. The mapped outputs already
    // have their initial values again. Called with the lock of EscAccess held.
    virtual void safe_outputs(Time now) { (void)now; }

    // Current sizes in octets of process data that have no PDO assignment object (0x1C12, 0x1C13, in general 0x1C10 +
    // number of the SyncManager) in the dictionary. With the assignment objects of all SyncManagers of a direction, the
    // mapping determines the sizes. nullopt: the maximum sizes of the description.
    [[nodiscard]] virtual std::optional<ProcessDataSizes> process_data_sizes() { return std::nullopt; }

    // Replace the PDO mapping: unpack_outputs() reads the outputs from the octets of the output SyncManagers,
    // pack_inputs() writes the inputs into the octets of the input SyncManagers. Return false to use the PDO mapping
    // instead.
    virtual bool unpack_outputs(Bytes raw) {
        (void)raw;
        return false;
    }
    virtual bool pack_inputs(MutableBytes raw) {
        (void)raw;
        return false;
    }

    // --- Times ---
    // The time now, for the times that objects 0x1C32 and 0x1C33 measure; `now` is the time of the event that is being
    // served. Default: no clock, nothing is measured. Called with the lock of EscAccess held.
    [[nodiscard]] virtual Time clock(Time now) { return now; }
    // The value of object 0x10F8, and the time to use for DiagnosisMessage::time_stamp_ns. Default: the time of step()
    // and of the handlers. A device with distributed clocks may return its system time. Called with the lock of
    // EscAccess held.
    [[nodiscard]] virtual std::uint64_t timestamp_ns(Time now) {
        return static_cast<std::uint64_t>(now.time_since_epoch().count());
    }

    // --- Data for the hooks of objects 0x1003; 0x10F3; 0x1010, 0x1011 and 0x10F0. nullptr: the device does not have
    // the object ---
    [[nodiscard]] virtual Emergencies* emergencies() { return nullptr; }
    [[nodiscard]] virtual DiagnosisHistory* diagnosis() { return nullptr; }
    [[nodiscard]] virtual StoredValues* stored_values() { return nullptr; }

    // The modules of a modular device; nullptr: the device is not modular.
    [[nodiscard]] virtual ModuleLayout* modules() { return nullptr; }

  protected:
    ~Application() = default;
};

}  // namespace margay::subdevice
