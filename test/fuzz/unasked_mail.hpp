// Mail for listeners without a segment, for fuzz harnesses.
#pragma once

#include "client_input.hpp"
#include "mailbox/mailboxes.hpp"
#include "oshw/nic.hpp"

#include <algorithm>
#include <span>
#include <vector>

namespace margay::fuzzing {

class NoNic final : public Nic {
  public:
    SendStatus send(std::span<const std::byte>) noexcept override { return SendStatus::sent; }
    std::size_t receive(std::span<std::byte>) noexcept override { return 0; }
    LinkState link_state() noexcept override { return LinkState::up; }
    MacAddress source_mac() const noexcept override { return {}; }
};

// Offers mail of slave 1 to one listener.
class Post {
  public:
    explicit Post(MailListener& listener) { mailboxes_.listen(listener); }
    // The octets are copied, so that AddressSanitizer finds a read beyond their end.
    bool deliver(MailboxType type, Bytes data) {
        const std::vector<std::byte> copy(data.begin(), data.end());
        return mailboxes_.offer({.slave = 1, .type = type, .data = copy});
    }

  private:
    NoNic nic_;
    std::vector<FrameSlot> slots_ = std::vector<FrameSlot>(1);
    std::vector<std::byte> memory_ = std::vector<std::byte>(Arena::memory_for(1024));
    Engine engine_{nic_, slots_, memory_};
    Mailboxes mailboxes_{engine_, {}, {}};
};

}  // namespace margay::fuzzing
