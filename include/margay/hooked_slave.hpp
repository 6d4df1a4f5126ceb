// The slave for a hook, and the functions that the hook may call for this slave: see hook.hpp. The hook must await
// every function that returns a Task. Memory that is passed to the function must live until then.
#pragma once

#include <margay/aoe_address.hpp>
#include <margay/coe.hpp>
#include <margay/eoe_parameters.hpp>
#include <margay/idn.hpp>
#include <margay/slave.hpp>
#include <margay/task.hpp>

#include <cstdint>
#include <span>
#include <string_view>

namespace margay {

struct Network;

// One slave, as the library passes it to a hook. A copy is valid until the hook ends.
class HookedSlave {
  public:
    [[nodiscard]] std::uint16_t number() const { return number_; }
    // The facts about the slave, and its configuration, which a hook may change.
    [[nodiscard]] const Slave& slave() const;
    // The memory of sequences, part of the context (task.hpp).
    [[nodiscard]] Arena& arena() const;

    // Access to the object dictionary; results and errors as of SDOread() and SDOwrite().
    [[nodiscard]] Task<Result<std::size_t>> sdo_read(std::uint16_t index, std::uint8_t subindex,
                                                     std::span<std::byte> into, bool complete_access = false) const;
    [[nodiscard]] Task<> sdo_write(std::uint16_t index, std::uint8_t subindex, std::span<const std::byte> value,
                                   bool complete_access = false) const;
    template <SdoValue T>
    [[nodiscard]] Task<Result<T>> sdo_read(std::uint16_t index, std::uint8_t subindex) const {
        return read_value<T>(*this, index, subindex);
    }
    template <SdoValue T>
    [[nodiscard]] Task<> sdo_write(std::uint16_t index, std::uint8_t subindex, T value) const {
        return write_value(*this, index, subindex, octets_of(value));
    }

    // Access to the parameters of drives; results and errors as of SoEread(), SoEwrite() and SoEcommand(). `drive`: 0
    // to 7.
    [[nodiscard]] Task<Result<std::size_t>> soe_read(std::uint8_t drive, Idn idn, std::span<std::byte> into) const;
    [[nodiscard]] Task<> soe_write(std::uint8_t drive, Idn idn, std::span<const std::byte> value) const;
    [[nodiscard]] Task<> soe_command(std::uint8_t drive, Idn idn) const;

    // Files of the slave; results and errors as of FOEread() and FOEwrite().
    [[nodiscard]] Task<Result<std::size_t>> foe_read(std::string_view name, std::uint32_t password,
                                                     std::span<std::byte> into) const;
    [[nodiscard]] Task<> foe_write(std::string_view name, std::uint32_t password,
                                   std::span<const std::byte> content) const;

    // Sends a mailbox message of any protocol (the octets behind the mailbox header, for example an init command of a
    // configuration file), and receives the answer, which may be as long as `answer`; empty: none. Returns the size of
    // the answer; errors as of raw_mail().
    [[nodiscard]] Task<Result<std::size_t>> raw_mail(MailboxType type, std::span<const std::byte> message,
                                                     std::span<std::byte> answer) const;
    // Gives the slave its NetID; errors as of AOEset_net_id().
    [[nodiscard]] Task<> aoe_set_net_id(const AoeNetId& net_id) const;
    // Sets the parameters of the slave's IP stack; errors as of EOEset_ip().
    [[nodiscard]] Task<> eoe_set_ip(const EoeIp& ip) const;
    // Sets the filter for the frames that the slave passes on; errors as of EOEset_filter().
    [[nodiscard]] Task<> eoe_set_filter(const EoeFilter& filter) const;

    // Access to ESC registers; errors as of read_register() and write_register().
    [[nodiscard]] Task<> register_read(std::uint16_t address, std::span<std::byte> into) const;
    [[nodiscard]] Task<> register_write(std::uint16_t address, std::span<const std::byte> value) const;

    // Waits for this time; other slaves and the cycle continue.
    [[nodiscard]] Task<> sleep(Duration duration) const;

  private:
    friend struct HookAccess;
    HookedSlave(Network& network, std::uint16_t number) : network_(&network), number_(number) {}

    template <SdoValue T>
    static Task<Result<T>> read_value(HookedSlave self, std::uint16_t index, std::uint8_t subindex) {
        std::array<std::byte, sizeof(T)> octets{};
        auto read = co_await self.sdo_read(index, subindex, std::span<std::byte>(octets));
        if (!read) co_return read.error();
        if (*read == sizeof(T)) co_return value_from_octets<T>(octets);
        Error error{.code = Errc::wrong_size,
                    .step = Step::sdo_upload,
                    .slave = self.number_,
                    .index = index,
                    .subindex = subindex};
        error.expected = static_cast<std::uint32_t>(sizeof(T));
        error.actual = static_cast<std::uint32_t>(*read);
        co_return error;
    }
    template <std::size_t N>
    static Task<> write_value(HookedSlave self, std::uint16_t index, std::uint8_t subindex,
                              std::array<std::byte, N> octets) {
        auto written = co_await self.sdo_write(index, subindex, std::span<const std::byte>(octets));
        co_return written;
    }

    Network* network_;
    std::uint16_t number_;
};

}  // namespace margay
