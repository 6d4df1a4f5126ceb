// Shared parts of the devices that tests and fuzzing harnesses build with a mailbox over PlainEsc: the master's side
// of the mailbox, and an application that reports emergencies and diagnosis messages.
#pragma once

#include "subdevice/application.hpp"
#include "subdevice/diagnosis.hpp"
#include "subdevice/emergency.hpp"
#include "wire/mailbox.hpp"

#include "subdevice/plain_esc.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

namespace margay::subdevice::testing {

// The master's side of SM0 at 0x1000 and SM1 at 0x1100.
class MailHand {
  public:
    explicit MailHand(PlainEsc& esc) : esc_(esc) {}

    // Enables both mailboxes with this size.
    void configure(std::uint16_t mailbox_bytes) {
        bytes_ = mailbox_bytes;
        esc_.configure(0, {0x1000, mailbox_bytes, 0x26, 1});
        esc_.configure(1, {0x1100, mailbox_bytes, 0x22, 1});
    }
    [[nodiscard]] std::uint16_t bytes() const { return bytes_; }

    // Data behind a mailbox header, with the next counter or with the given one. Data that do not fit are cut off.
    [[nodiscard]] std::vector<std::byte> message(wire::MailboxType type, Bytes data,
                                                 std::optional<std::uint8_t> counter = std::nullopt) {
        counter_ = counter ? *counter : wire::next_mailbox_counter(counter_);
        const auto taken = std::min<std::size_t>(data.size(), bytes_ - wire::kMailboxHeaderBytes);
        std::vector<std::byte> out(wire::kMailboxHeaderBytes + taken);
        wire::store_mailbox_header(out,
                                   {.length = static_cast<std::uint16_t>(taken), .type = type, .counter = counter_});
        std::copy_n(data.begin(), taken, out.begin() + wire::kMailboxHeaderBytes);
        return out;
    }
    // Writes a message, truncated or padded with zeros to the size of the mailbox. Returns false when the mailbox is
    // full.
    bool put(std::vector<std::byte> message) {
        message.resize(bytes_);
        return esc_.ecat_write(0x1000, message);
    }
    // Returns the whole send mailbox; empty: there is no message.
    [[nodiscard]] std::vector<std::byte> fetch() {
        std::vector<std::byte> whole(bytes_);
        if (!esc_.ecat_read(0x1100, whole)) whole.clear();
        return whole;
    }

  private:
    PlainEsc& esc_;
    std::uint16_t bytes_ = 0;
    std::uint8_t counter_ = 0;
};

// The template arguments are the capacities for queued emergencies, for the error history, and for the diagnosis
// history.
template <std::uint8_t Queue, std::uint8_t Errors, std::uint8_t Messages>
class ReportingApplication : public Application {
  public:
    [[nodiscard]] Emergencies* emergencies() override { return &emergencies_; }
    [[nodiscard]] DiagnosisHistory* diagnosis() override { return &diagnosis_; }

  private:
    std::array<EmergencyMessage, Queue> queue_{};
    std::array<std::byte, std::size_t{4} * Errors> history_{};
    std::array<std::byte, std::size_t{32} * Messages> messages_{};
    Emergencies emergencies_{queue_, history_};
    DiagnosisHistory diagnosis_{messages_, Messages, &emergencies_};
};

}  // namespace margay::subdevice::testing
