// Emergency messages, and their history in object 0x1003 (ETG.1000.6 "Emergency").
#pragma once

#include "subdevice/mailbox_server.hpp"
#include "subdevice/object_dictionary.hpp"

namespace margay::subdevice {

struct EmergencyMessage {
    std::uint16_t error_code = 0;  // 0: error reset
    std::uint8_t error_register = 0;
    std::array<std::byte, wire::coe::kEmergencyDataBytes> data{};
};

// Holds the queue of messages to send and the history of past messages. The author's memory limits the size of both.
class Emergencies {
  public:
    // `queue`: messages that wait for a free send mailbox. `history`: four octets per line of 0x1003, newest first.
    Emergencies(std::span<EmergencyMessage> queue, MutableBytes history) : queue_(queue), history_(history) {}

    // Queues a message and adds it to the history. Returns false when the queue is full: the message is counted as
    // lost, but the history contains it. May be called from the thread that calls Device::step().
    bool raise(const EmergencyMessage& message);

    void step(Outbox& out);
    void clear_queue() { waiting_ = 0; }

    [[nodiscard]] std::uint8_t error_register() const { return error_register_; }
    [[nodiscard]] std::uint32_t lost() const { return lost_; }

    // For object 0x1003: the number of used lines, and the memory of a line.
    [[nodiscard]] MutableBytes count() { return count_; }
    [[nodiscard]] MutableBytes line(unsigned subindex);
    void clear_history();

  private:
    std::span<EmergencyMessage> queue_;
    MutableBytes history_;
    std::array<std::byte, 1> count_{};
    std::size_t first_ = 0;  // index of the oldest message in queue_
    std::size_t waiting_ = 0;
    std::uint32_t lost_ = 0;
    std::uint8_t error_register_ = 0;
};

// The entries of 0x1003 with memory for `Lines` errors. The hooks below read them from the application.
template <std::uint8_t Lines>
inline constexpr std::array<Entry, 2> kErrorHistoryEntries = {
    provided(0, "Number of errors", DataType::unsigned8, 8, od::kReadWrite),
    provided(1, "Error", DataType::unsigned32, 32, od::kReadOnly).times(Lines)};

// Hooks of 0x1003. They get the emergencies from Application::emergencies(). Without an application, or when that
// function returns nullptr, an access is aborted with Abort::no_object.
namespace error_history {
[[nodiscard]] bool exists(const ObjectAccess& access);
[[nodiscard]] HookAnswer before_read(const ObjectAccess& access);
[[nodiscard]] HookAnswer before_write(const ObjectAccess& access, Bytes data);
void after_write(const ObjectAccess& access);
[[nodiscard]] MutableBytes memory(const ObjectAccess& access);
}  // namespace error_history
inline constexpr ObjectHooks kErrorHistoryHooks{.exists = error_history::exists,
                                                .before_read = error_history::before_read,
                                                .before_write = error_history::before_write,
                                                .after_write = error_history::after_write,
                                                .memory = error_history::memory};

}  // namespace margay::subdevice
