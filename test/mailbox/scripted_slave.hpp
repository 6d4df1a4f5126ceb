// A simulated slave with a mailbox that the test controls: the test receives every message unchanged and writes every
// octet of every reply. The slave does what the hardware of a mailbox must do: it fills SyncManager 1 when it is empty,
// and repeats the last reply on request, unless the test disables this.
#pragma once

#include "sim/devices.hpp"
#include "sim/firmware.hpp"
#include "wire/coe.hpp"
#include "wire/esc.hpp"
#include "wire/mailbox.hpp"
#include "wire/sii_writer.hpp"
#include "wire/sync_manager.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <functional>
#include <initializer_list>
#include <vector>

namespace margay {

using Mail = std::vector<std::byte>;

[[nodiscard]] inline Mail mail_bytes(std::initializer_list<unsigned> octets) {
    Mail out;
    for (const auto v : octets) out.push_back(static_cast<std::byte>(v));
    return out;
}

class ScriptedSlave final : public sim::Firmware {
  public:
    explicit ScriptedSlave(std::uint16_t mailbox_bytes, std::uint16_t protocols = 0x3F, std::uint8_t coe_details = 0x3F)
        : bytes_(mailbox_bytes), protocols_(protocols), coe_details_(coe_details) {}

    // Called with each message, cut to its length. It calls put() for each reply.
    std::function<void(const Mail&)> on_mail;
    bool takes = true;     // reads the messages of the master
    bool repeats = true;   // acknowledges a repeat request, and repeats
    bool forgets = false;  // acknowledges a repeat request, and has no message to repeat
    bool counts = true;    // replies of reply() have counters
    Duration delay{0};     // time from put() to SyncManager 1
    std::vector<Mail> received;
    unsigned repeat_requests = 0;

    // Sends a complete message without changes.
    void put(Mail mail) { out_.push_back({now_ + delay, std::move(mail)}); }
    // Sends data behind a mailbox header with the next counter.
    void reply(const Mail& data, wire::MailboxType type = wire::MailboxType::coe, std::uint16_t address = 0) {
        counter_ = counts ? wire::next_mailbox_counter(counter_) : std::uint8_t{0};
        Mail mail(wire::kMailboxHeaderBytes);
        wire::store_mailbox_header(
            mail,
            {.length = static_cast<std::uint16_t>(data.size()), .address = address, .type = type, .counter = counter_});
        mail.insert(mail.end(), data.begin(), data.end());
        put(std::move(mail));
    }
    void reply(std::initializer_list<unsigned> data) { reply(mail_bytes(data)); }

    [[nodiscard]] std::vector<std::byte> sii() const {
        const std::vector<SmInfo> sms{{0x1000, bytes_, 0x26, 1, SmType::mailbox_out},
                                      {kIn, bytes_, 0x22, 1, SmType::mailbox_in},
                                      {0x2000, 0, 0x64, 0, SmType::outputs},
                                      {0x2100, 0, 0x20, 0, SmType::inputs}};
        const std::vector<FmmuUse> fmmus{FmmuUse::outputs, FmmuUse::inputs, FmmuUse::mailbox_status};
        wire::sii::Description d{.configuration = {.pdi_control = 0x0100},  // device emulation: state changes at once
                                 .identity = {0x4D47, 2, 1, 1},
                                 .mailbox = {0x1000, bytes_, kIn, bytes_, protocols_},
                                 .name = "scripted",
                                 .fmmus = fmmus,
                                 .sync_managers = sms};
        d.general.coe_details = coe_details_;
        std::vector<std::byte> image(1024);
        EXPECT_TRUE(wire::sii::write_image(d, image).ok());
        return image;
    }
    [[nodiscard]] static sim::EscDescription chip() {
        auto chip = sim::lan9252();
        chip.ram_kib = 16;
        return chip;
    }

    void start(subdevice::EscAccess& esc, Time now) override {
        esc_ = &esc;
        now_ = now;
        out_.clear();
        boxed_ = false;
    }

    [[nodiscard]] bool polls() const override { return true; }
    Time step(Time now) override {
        now_ = now;
        serve_repeat();
        if (boxed_ && (status(1) & wire::sm_status::kMailboxFull) == 0) boxed_ = false;
        if (takes && (status(0) & wire::sm_status::kMailboxFull) != 0) take_mail();
        box();
        return now + std::chrono::microseconds(50);
    }

  private:
    static constexpr std::uint16_t kIn = 0x1800;
    struct Outgoing {
        Time due;
        Mail mail;
    };

    [[nodiscard]] std::uint8_t octet(unsigned address) {
        std::array<std::byte, 1> value{};
        esc_->read(static_cast<std::uint16_t>(address), value);
        return std::to_integer<std::uint8_t>(value[0]);
    }
    [[nodiscard]] static unsigned at(unsigned sm, std::size_t offset) {
        return wire::reg::sync_manager(sm).address + static_cast<unsigned>(offset);
    }
    [[nodiscard]] std::uint8_t status(unsigned sm) { return octet(at(sm, wire::SyncManagerLayout::status::offset)); }

    void take_mail() {
        Mail mail(bytes_);
        esc_->read(0x1000, mail);
        mail.resize(std::min<std::size_t>(bytes_, wire::kMailboxHeaderBytes + wire::load_mailbox_header(mail).length));
        received.push_back(mail);
        if (on_mail) on_mail(mail);
    }
    void box() {
        if (boxed_ || out_.empty() || out_.front().due > now_) return;
        Mail mail = out_.front().mail;
        kept_ = mail;
        mail.resize(bytes_);
        esc_->write(kIn, mail);
        out_.pop_front();
        boxed_ = true;
    }
    void serve_repeat() {
        const auto activate = octet(at(1, wire::SyncManagerLayout::activate::offset));
        const auto pdi = octet(at(1, wire::SyncManagerLayout::pdi_control::offset));
        const bool asked = (activate & wire::sm_activate::kRepeatRequest) != 0;
        const bool answered = (pdi & wire::sm_pdi_control::kRepeatAcknowledge) != 0;
        if (asked == answered || !repeats) return;
        ++repeat_requests;
        // Repeats the message that the master read last. A message that was not read is still in the mailbox.
        if (!forgets && !kept_.empty() && (status(1) & wire::sm_status::kMailboxFull) == 0) {
            out_.push_front({now_, kept_});
            boxed_ = false;
            box();
        }
        const std::array<std::byte, 1> acknowledge{asked ? std::byte{wire::sm_pdi_control::kRepeatAcknowledge}
                                                         : std::byte{0}};
        esc_->write(static_cast<std::uint16_t>(at(1, wire::SyncManagerLayout::pdi_control::offset)), acknowledge);
    }

    std::uint16_t bytes_;
    std::uint16_t protocols_;
    std::uint8_t coe_details_;
    std::uint8_t counter_ = 0;
    subdevice::EscAccess* esc_ = nullptr;
    Time now_{};
    std::deque<Outgoing> out_;
    Mail kept_;
    bool boxed_ = false;
};

}  // namespace margay
