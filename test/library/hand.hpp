// One library device on a segment, and a master for it that knows only the SII of the device: states, process data,
// SDO, in virtual time.
#pragma once

#include "sim/devices.hpp"
#include "sim/process_data.hpp"
#include "sim/rig.hpp"
#include "sim/sii_model.hpp"
#include "wire/coe.hpp"
#include "wire/mailbox.hpp"

#include <margay/al_state.hpp>

#include <optional>
#include <string>

namespace margay::sim::test {

using namespace std::chrono_literals;
using wire::coe::Abort;

class Hand {
  public:
    Rig rig;
    std::vector<std::byte> outputs;
    std::vector<std::byte> inputs;

    explicit Hand(std::string_view name) : Hand(make_device(name).value()) {}
    explicit Hand(Device device);

    Esc& esc() { return rig.slave(0); }
    ProcessDataFirmware& device() { return *esc().process_data(); }
    [[nodiscard]] AlStatus status();
    // Changes the state in steps from the present state. Process data is exchanged from SAFEOP on. Returns the final
    // status.
    AlStatus to(AlState state);
    AlStatus ask(AlState state, Duration patience = 1s, unsigned control_bits = 0);
    void configure_mailboxes(bool boot = false);
    void configure_process_data();
    // A cycle of a millisecond: writes the outputs, reads the inputs.
    void cycle(unsigned n = 1);
    void wait(Duration how_long);

    // Mailbox messages; `data` is without the mailbox header. exchange() returns the first reply of the same type, and
    // no emergency.
    bool put(wire::MailboxType type, std::vector<std::byte> data);
    struct Mail {
        wire::MailboxHeader header;
        std::vector<std::byte> data;
    };
    std::optional<Mail> take(Duration patience = 1s);
    std::vector<std::byte> exchange(wire::MailboxType type, std::vector<std::byte> data);

    // Uploads of any size, and expedited downloads (`bytes` up to 4).
    std::vector<std::byte> upload(unsigned index, unsigned subindex = 0, bool complete = false);
    std::int64_t number(unsigned index, unsigned subindex = 0);  // sign-extended from its length
    void download(unsigned index, unsigned subindex, std::int64_t value, std::size_t bytes);
    Abort last_abort = Abort::none;

    template <class T>
    void out(std::size_t offset, T value) {
        store_le<T>(outputs, offset, value);
    }
    template <class T>
    T in(std::size_t offset) {
        return load_le<T>(inputs, offset);
    }

    SiiModel model;
    std::uint16_t mailbox_bytes = 0;
    bool keep_cycling = false;  // cycles continue during mailbox transfers

  private:
    void tick();
    void set_sync_manager(unsigned n, std::uint16_t start, std::uint16_t bytes, std::uint8_t control);
    std::uint16_t write_mailbox_ = 0;
    std::uint16_t read_mailbox_ = 0;
    std::uint16_t read_bytes_ = 0;
    std::uint8_t counter_ = 0;
};

}  // namespace margay::sim::test
