// Stores mailbox messages that no request waits for until the program reads them.
#pragma once

#include <margay/margay.hpp>

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

namespace margay::soem {

struct Letter {
    std::uint16_t slave = 0;
    MailboxType type{};
    std::vector<std::byte> data{};  // behind the mailbox header
};

// For a thread that owns the context.
class Inbox {
  public:
    static constexpr std::size_t kMost = 256;  // older letters are dropped

    explicit Inbox(Context& context);
    // The oldest letter of the slave and of the type. Without a type: of any type except mailbox errors.
    std::optional<Letter> take(std::uint16_t slave, std::optional<MailboxType> type = std::nullopt);
    // The oldest letter of the type from any slave.
    std::optional<Letter> take_any(MailboxType type);
    void clear() { letters_.clear(); }

  private:
    class Ear final : public MailListener {
      public:
        Ear(Inbox& inbox, MailboxType type) : MailListener(type), inbox_(inbox) {}

      private:
        bool take(const UnaskedMail& mail) override;
        Inbox& inbox_;
    };
    std::deque<Ear> ears_;
    std::deque<Letter> letters_;
};

}  // namespace margay::soem
