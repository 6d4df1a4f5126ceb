// A simulated slave with the mailbox and CoE server of the slave stack: the bench device of test/subdevice, with
// mailboxes of a chosen size.
#pragma once

#include "sim/devices.hpp"
#include "sim/firmware.hpp"
#include "subdevice/bench_device.hpp"
#include "subdevice/emergency.hpp"
#include "subdevice/sii_image.hpp"

#include <memory>
#include <optional>
#include <vector>

namespace margay {

class StackSlave final : public sim::Firmware {
  public:
    explicit StackSlave(std::uint16_t mailbox_bytes, bool complete_access = true)
        : mailbox_bytes_(mailbox_bytes), complete_access_(complete_access) {
        namespace s = subdevice;
        auto& d = application.description_value;
        d.mailbox = {.receive = {.start = 0x1000, .size_bytes = mailbox_bytes},
                     .send = {.start = 0x1800, .size_bytes = mailbox_bytes}};
        d.outputs.start = 0x2000;
        d.inputs.start = 0x2200;
        d.complete_access = complete_access;
        dictionary.emplace(s::testing::table::kObjects, image, &application);
        stored_.emplace(*dictionary, store_, stored_memory_);
        application.stored = &*stored_;
    }

    [[nodiscard]] std::vector<std::byte> sii() {
        std::vector<std::byte> eeprom(2048);
        subdevice::SiiWorkspace<8, 32> workspace;
        const auto written = subdevice::write_sii(application.description_value, {}, *dictionary, workspace, eeprom);
        EXPECT_TRUE(written.ok());
        return eeprom;
    }
    [[nodiscard]] static sim::EscDescription chip() {
        auto chip = sim::lan9252();
        chip.ram_kib = 16;
        chip.fmmus = 4;
        return chip;
    }

    void start(subdevice::EscAccess& esc, Time now) override {
        namespace s = subdevice;
        device.reset();
        mailbox.reset();
        process_data.reset();
        coe.emplace(*dictionary, staging, complete_access_, application.emergencies());
        protocols_ = {{{wire::MailboxType::coe, &*coe}}};
        receive_.assign(mailbox_bytes_, std::byte{0});
        send_.assign(std::size_t{mailbox_bytes_} * 4, std::byte{0});
        mailbox.emplace(esc, MutableBytes(receive_), MutableBytes(send_), protocols_);
        process_data.emplace(esc, application, *dictionary, process_memory_);
        device.emplace(esc, application, *process_data, &*mailbox);
        device->start(now);
    }
    Time step(Time now) override { return device->step(now); }
    [[nodiscard]] bool polls() const override { return true; }

    subdevice::testing::BenchApplication application;
    std::array<std::byte, subdevice::testing::Values::bytes> image{};
    std::optional<subdevice::ObjectDictionary> dictionary;
    std::array<std::byte, 1024> staging{};
    std::optional<subdevice::CoeServer> coe;
    std::optional<subdevice::Mailbox> mailbox;
    std::optional<subdevice::ProcessData> process_data;
    std::optional<subdevice::Device> device;

  private:
    // The device has all objects of the table, also the stored values.
    struct NoFlash final : subdevice::ValueStore {
        std::size_t load(MutableBytes) override { return 0; }
        subdevice::HookAnswer save(Bytes, Time) override { return subdevice::Abort::hardware_error; }
    };
    NoFlash store_;
    std::array<std::byte, subdevice::stored_bytes(subdevice::testing::table::kObjects)> stored_memory_{};
    std::optional<subdevice::StoredValues> stored_;
    std::uint16_t mailbox_bytes_;
    bool complete_access_;
    std::array<subdevice::MailboxProtocol, 1> protocols_{};
    std::vector<std::byte> receive_;
    std::vector<std::byte> send_;
    subdevice::ProcessDataMemory<16, 16, 8> process_memory_;
};

}  // namespace margay
