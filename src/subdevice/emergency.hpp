// Emergency messages, and the history of them that object 0x1003 shows (ETG.1000.6 "Emergency").
#pragma once

#include "subdevice/mailbox_server.hpp"
#include "subdevice/object_dictionary.hpp"

namespace margay::subdevice {

struct EmergencyMessage {
    std::uint16_t error_code = 0;  // 0: error reset
    std::uint8_t error_register = 0;
    std::array<std::byte, wire::coe::kEmergencyDataBytes> data{};
};

// Keeps what is to be sent and what was: both as many as the author's memory holds.
class Emergencies {
  public:
    // `queue`: messages that wait for a mailbox. `history`: four octets a line of 0x1003, the newest first.
    Emergencies(std::span<EmergencyMessage> queue, MutableBytes history) : queue_(queue), history_(history) {}

    // Queues a message and notes it in the history. False: the queue was full, and the message is counted as
    // lost (the history has it). Callable at any time from where Device::step() is called.
    bool raise(const EmergencyMessage& message);

    void step(Outbox& out);
    void clear_queue() { waiting_ = 0; }

    [[nodiscard]] std::uint8_t error_register() const { return error_register_; }
    [[nodiscard]] std::uint32_t lost() const { return lost_; }

    // For 0x1003: lines in use, and their memory.
    [[nodiscard]] MutableBytes count() { return count_; }
    [[nodiscard]] MutableBytes line(unsigned subindex);
    void clear_history();

  private:
    std::span<EmergencyMessage> queue_;
    MutableBytes history_;
    std::array<std::byte, 1> count_{};
    std::size_t first_ = 0;  // of the queue
    std::size_t waiting_ = 0;
    std::uint32_t lost_ = 0;
    std::uint8_t error_register_ = 0;
};

// The entries of 0x1003 with room for `Lines` errors; the hooks below find them in the application.
template <std::uint8_t Lines>
inline constexpr std::array<Entry, 2> kErrorHistoryEntries = {
    provided(0, "Number of errors", DataType::unsigned8, 8, od::kReadWrite),
    provided(1, "Error", DataType::unsigned32, 32, od::kReadOnly).times(Lines)};

// Hooks of 0x1003: the application has the emergencies (Application::emergencies()).
namespace error_history {
[[nodiscard]] HookAnswer before_read(const ObjectAccess& access);
[[nodiscard]] HookAnswer before_write(const ObjectAccess& access, Bytes data);
void after_write(const ObjectAccess& access);
[[nodiscard]] MutableBytes memory(const ObjectAccess& access);
}  // namespace error_history
inline constexpr ObjectHooks kErrorHistoryHooks{.before_read = error_history::before_read,
                                                .before_write = error_history::before_write,
                                                .after_write = error_history::after_write,
                                                .memory = error_history::memory};

}  // namespace margay::subdevice
