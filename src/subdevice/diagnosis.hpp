// The diagnosis history, object 0x10F3 (ETG.1020 "Diagnosis history object"). It contains messages with code, text id,
// time stamp and parameters; a master reads and acknowledges them.
#pragma once

#include "subdevice/emergency.hpp"
#include "subdevice/object_dictionary.hpp"

namespace margay::subdevice {

enum class DiagnosisType : std::uint8_t { information = 0, warning = 1, error = 2 };

struct DiagnosisMessage {
    // 0xE8xxyyyy: code of the manufacturer; the low half is the emergency error code if there is one
    std::uint32_t code = 0;
    DiagnosisType type = DiagnosisType::information;
    std::uint16_t text_id = 0;
    std::uint64_t time_stamp_ns = 0;
    std::uint8_t parameters = 0;  // number of parameters
    Bytes parameter_bytes{};      // each parameter with its flags word, in the format of the mailbox message
};

// Subindex 4 (new messages available) is set by a new message. In acknowledge mode (flags bit 4) it is cleared when all
// messages are acknowledged by a write to subindex 3; in overwrite mode also when the newest message is read.
class DiagnosisHistory {
  public:
    static constexpr std::uint8_t kFirstSubindex = 6;
    static constexpr std::size_t kHeadBytes = 16;  // octets of a message without its parameters

    // `memory` holds `lines` messages (1 to 250) of equal size: kHeadBytes, the parameters, and 2 octets for the
    // length. With `emergencies`, each new message is also sent as an emergency while the master has set bit 0 of the
    // flags (subindex 5): error code is the low half of the message code, the data are text id and type. Without them,
    // the master cannot set this bit.
    DiagnosisHistory(MutableBytes memory, std::uint8_t lines, Emergencies* emergencies = nullptr)
        : memory_(memory), lines_(lines), emergencies_(emergencies) {
        clear();
    }

    // Adds a message. Returns false when the message is discarded: the master's filter excludes its type, or in
    // acknowledge mode the history is full of unacknowledged messages. Parameters that do not fit into the memory are
    // left out. From the context of step() only: not from Application::cycle() in an interrupt handler.
    bool add(const DiagnosisMessage& message);
    void clear();

    // Used by the hooks of 0x10F3.
    [[nodiscard]] MutableBytes field(unsigned subindex);
    [[nodiscard]] Abort check_write(unsigned subindex, Bytes data) const;
    void written(unsigned subindex);
    void read(unsigned subindex);  // the master reads the subindex

  private:
    // Layout of subindices 1 to 5 in head_.
    using maximum = Field<std::uint8_t, 0>;
    using latest = Field<std::uint8_t, 1>;
    using acknowledged = Field<std::uint8_t, 2>;
    using available = Field<std::uint8_t, 3>;
    using flags = Field<std::uint16_t, 4>;
    [[nodiscard]] std::size_t room() const { return memory_.size() / lines_; }
    [[nodiscard]] MutableBytes line(std::size_t n) { return memory_.subspan(n * room(), room()); }
    [[nodiscard]] static std::size_t length(Bytes line);
    [[nodiscard]] bool full() const;

    MutableBytes memory_;
    std::uint8_t lines_;
    Emergencies* emergencies_;
    std::uint8_t next_ = 0;    // line of the next message
    std::uint8_t unread_ = 0;  // messages newer than the newest acknowledged message
    std::array<std::byte, 6> head_{};
};

// The entries of 0x10F3 with memory for `Lines` messages, and the hooks. The hooks get the history from
// Application::diagnosis(). Without an application, or when that function returns nullptr, an access is aborted with
// Abort::no_object.
template <std::uint8_t Lines>
inline constexpr std::array<Entry, 7> kDiagnosisEntries = {
    entry_count(DiagnosisHistory::kFirstSubindex - 1 + Lines),
    provided(1, "Maximum messages", DataType::unsigned8, 8, od::kReadOnly),
    provided(2, "Newest message", DataType::unsigned8, 8, od::kReadOnly | od::kTxMappable),
    provided(3, "Newest acknowledged message", DataType::unsigned8, 8, od::kReadWrite),
    provided(4, "New messages available", DataType::boolean, 1, od::kReadOnly | od::kTxMappable),
    provided(5, "Flags", DataType::unsigned16, 16, od::kReadWrite),
    provided(6, "Diagnosis message", DataType::octet_string, 0, od::kReadOnly).times(Lines)};

namespace diagnosis_history {
[[nodiscard]] bool exists(const ObjectAccess& access);
[[nodiscard]] HookAnswer before_read(const ObjectAccess& access);
[[nodiscard]] HookAnswer before_write(const ObjectAccess& access, Bytes data);
void after_write(const ObjectAccess& access);
[[nodiscard]] MutableBytes memory(const ObjectAccess& access);
}  // namespace diagnosis_history
inline constexpr ObjectHooks kDiagnosisHooks{.exists = diagnosis_history::exists,
                                             .before_read = diagnosis_history::before_read,
                                             .before_write = diagnosis_history::before_write,
                                             .after_write = diagnosis_history::after_write,
                                             .memory = diagnosis_history::memory};

}  // namespace margay::subdevice
