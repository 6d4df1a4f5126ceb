// Common parts of the tests of AoE.
#pragma once

#include "mailbox/mailbox_bus.hpp"

namespace margay {

inline constexpr auto kAoe = wire::MailboxType::aoe;
inline constexpr AoeAddress kMaster{{{1, 2, 3, 4, 5, 6}}, 0x8001};

[[nodiscard]] inline Mail joined(std::initializer_list<Mail> parts) {
    Mail all;
    for (const Mail& part : parts) all.insert(all.end(), part.begin(), part.end());
    return all;
}

// Stores the notifications of devices.
class AoeNotes final : public AoeListener {
  public:
    struct Note {
        AoeAddress source;
        std::uint32_t handle;
        std::uint64_t time;
        Mail data;
    };
    std::vector<Note> all;
    void notified(std::uint16_t, const AoeNotification& n) override {
        all.push_back({n.source, n.handle, n.time_stamp, Mail(n.data.begin(), n.data.end())});
    }
};

}  // namespace margay
