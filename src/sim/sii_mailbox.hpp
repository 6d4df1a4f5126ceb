// The mailbox of a device that is known only by its SII image. It serves by CoE the objects that follow from the image,
// and answers all other protocols with a mailbox error, like a device without these protocols.
#pragma once

#include "sim/sii_dictionary.hpp"
#include "subdevice/application.hpp"
#include "subdevice/coe_server.hpp"
#include "subdevice/mailbox.hpp"
#include "subdevice/pdo_mapping.hpp"

#include <optional>

namespace margay::sim {

class SiiMailbox {
  public:
    SiiMailbox(Bytes sii, const SiiModel& model);
    SiiMailbox(const SiiMailbox&) = delete;
    SiiMailbox& operator=(const SiiMailbox&) = delete;

    // Power-up: sets all objects to their initial values.
    void power_up(subdevice::EscAccess& esc);
    [[nodiscard]] subdevice::Mailbox& mailbox() { return *mailbox_; }

    // Current size in octets of the PDOs assigned to a SyncManager; nullopt when there is no assignment.
    [[nodiscard]] std::optional<std::uint16_t> assigned_bytes(std::uint8_t sync_manager);
    // Copies process data into the mapped objects. `process_data` contains all SyncManagers of one direction in
    // sequence.
    void show(bool outputs, Bytes process_data);

  private:
    struct Described final : subdevice::Application {
        subdevice::DeviceDescription device;
        [[nodiscard]] const subdevice::DeviceDescription& description() const override { return device; }
    };
    struct Assignment {
        std::uint8_t sync_manager;
        bool outputs;
    };

    [[nodiscard]] bool build(std::uint8_t sync_manager);

    SiiDictionary objects_;
    Described described_;
    std::vector<std::byte> image_;
    subdevice::ObjectDictionary dictionary_;
    std::vector<std::byte> staging_ = std::vector<std::byte>(2048);
    subdevice::CoeServer coe_;
    std::vector<subdevice::MailboxProtocol> protocols_;
    std::vector<std::byte> receive_;
    std::vector<std::byte> send_;
    std::optional<subdevice::Mailbox> mailbox_;
    std::vector<Assignment> assignments_;
    std::vector<subdevice::MappedEntry> mapped_ = std::vector<subdevice::MappedEntry>(1024);
    subdevice::PdoMapping mapping_{mapped_};  // mapping of the assignment that was read last
};

}  // namespace margay::sim
