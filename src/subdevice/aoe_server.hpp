// Automation device specification over EtherCAT: the server for mailbox type AoE (ETG.1020 "AoE"). It passes commands
// on to devices by NetID and port: to the slave itself, and to the devices behind it if the slave is a gateway.
#pragma once

#include "subdevice/mailbox_server.hpp"
#include "wire/aoe.hpp"

#include <array>
#include <span>
#include <string_view>

namespace margay::subdevice {

using AoeError = wire::aoe::ErrorCode;

struct AoeIndex {
    std::uint32_t group = 0;
    std::uint32_t offset = 0;
    friend constexpr bool operator==(const AoeIndex&, const AoeIndex&) = default;
};

struct AoeIdentity {
    std::uint8_t major = 0;
    std::uint8_t minor = 0;
    std::uint16_t build = 0;
    std::string_view name{};  // the first 16 characters are sent
};

// A device that an author implements. Every function has a default. All calls come from Device::step().
class AoeDevice {
  public:
    // Copies the value into `into`, which has the size that the master wants, and its size into `bytes`.
    [[nodiscard]] virtual AoeError read(AoeIndex index, MutableBytes into, std::size_t& bytes, Time now) {
        (void)index, (void)into, (void)bytes, (void)now;
        return AoeError::invalid_group;
    }
    [[nodiscard]] virtual AoeError write(AoeIndex index, Bytes data, Time now) {
        (void)index, (void)data, (void)now;
        return AoeError::invalid_group;
    }
    [[nodiscard]] virtual AoeError read_write(AoeIndex index, Bytes written, MutableBytes into, std::size_t& bytes,
                                              Time now) {
        (void)index, (void)written, (void)into, (void)bytes, (void)now;
        return AoeError::service_not_supported;
    }
    [[nodiscard]] virtual AoeError write_control(AdsState state, std::uint16_t device_state, Bytes data, Time now) {
        (void)state, (void)device_state, (void)data, (void)now;
        return AoeError::service_not_supported;
    }
    [[nodiscard]] virtual AdsState state() const { return AdsState::run; }
    [[nodiscard]] virtual std::uint16_t device_state() const { return 0; }
    [[nodiscard]] virtual AoeIdentity identity() const { return {}; }

  protected:
    ~AoeDevice() = default;
};

// One line of the routing table. The devices of the slave itself have the NetID of the slave.
struct AoeRoute {
    AoeDevice* device = nullptr;
    std::uint16_t port = 0;
    bool behind = false;  // behind the gateway: it has the following NetID
    AoeNetId net_id{};
};

// A value that the server watches for the master.
struct AoeWatch {
    static constexpr std::size_t kMostBytes = 16;
    AoeDevice* device = nullptr;  // nullptr: not in use
    AoeAddress source{};          // of the device
    AoeAddress target{};          // the sender of the request
    AoeIndex index{};
    std::uint32_t handle = 0;
    std::uint8_t bytes = 0;
    bool on_change = false;
    bool sent = false;  // `last` is valid
    Duration every{};
    Time due{};
    std::uint16_t address = 0;
    std::array<std::byte, kMostBytes> last{};
};

class AoeServer final : public MailboxServer {
  public:
    // The index at which the master writes the NetID of the slave.
    static constexpr AoeIndex kNetIdIndex{1, 3};

    // `watches`: memory for notifications, each of up to 16 octets; empty: the slave has none.
    explicit AoeServer(std::span<const AoeRoute> routes, std::span<AoeWatch> watches = {})
        : routes_(routes), watches_(watches) {}

    // The NetID of the slave: all octets 0 until the master sets it.
    [[nodiscard]] const AoeNetId& net_id() const { return net_id_; }

    void start(AlState state, const MailboxRoom& room) override;
    void stop() override;
    std::optional<wire::MailboxErrorCode> receive(const wire::MailboxMessage& message, Outbox& out, Time now) override;
    Time step(Outbox& out, Time now) override;

  private:
    struct Request {
        wire::aoe::Header header;
        Bytes data{};
        AoeDevice* device = nullptr;
        std::uint16_t mail_address = 0;
        Time now{};
    };

    [[nodiscard]] AoeError find(Request& request) const;
    [[nodiscard]] bool sets_net_id(const Request& request) const;
    [[nodiscard]] AoeError execute(const Request& request, MutableBytes response, std::size_t& bytes);
    [[nodiscard]] AoeError read(const Request& request, MutableBytes response, std::size_t& bytes);
    [[nodiscard]] AoeError add_watch(const Request& request, MutableBytes response, std::size_t& bytes);
    [[nodiscard]] AoeError delete_watch(const Request& request);
    [[nodiscard]] bool notify(AoeWatch& watch, Outbox& out, Time now);

    std::span<const AoeRoute> routes_;
    std::span<AoeWatch> watches_;
    AoeNetId net_id_{};
    std::uint32_t last_handle_ = 0;
    std::size_t room_ = 0;
};

}  // namespace margay::subdevice
