// The firmware of the library's devices: the whole slave stack on the simulated ESC, and a model.
#pragma once

#include "sim/library/model.hpp"
#include "sim/library/odd_mail.hpp"
#include "sim/library/odd_pdi.hpp"
#include "sim/process_data.hpp"
#include "subdevice/coe_server.hpp"

#include <optional>
#include <vector>

namespace margay::sim {

class StackFirmware final : public ProcessDataFirmware {
  public:
    explicit StackFirmware(const Blueprint& blueprint);
    StackFirmware(const StackFirmware&) = delete;
    StackFirmware& operator=(const StackFirmware&) = delete;

    void start(subdevice::EscAccess& esc, Time now) override;
    Time step(Time now) override;
    void fetch() const override;
    [[nodiscard]] bool feeds_pdi_watchdog() const override { return true; }
    bool add_quirk(Quirk quirk, std::vector<std::byte>& sii) override;

    // The measured values of the model, and the outputs from the master.
    [[nodiscard]] MutableBytes inputs() override { return model_->measured(); }
    [[nodiscard]] Bytes outputs() override;
    void poke() override;
    [[nodiscard]] EthernetPort* ethernet() override { return model_->ethernet(); }
    [[nodiscard]] BridgeHalf* bridge() override { return model_->bridge(); }

    [[nodiscard]] Model& model() { return *model_; }
    [[nodiscard]] subdevice::ObjectDictionary& dictionary() { return dictionary_; }

  private:
    void assign_other_pdos();

    const Blueprint& blueprint_;
    std::unique_ptr<Model> model_;
    std::vector<std::byte> image_;
    subdevice::ObjectDictionary dictionary_;
    std::vector<std::byte> staging_ = std::vector<std::byte>(4096);
    subdevice::CoeServer coe_;
    std::optional<subdevice::FoeServer> foe_;
    std::vector<subdevice::MailboxProtocol> protocols_;
    std::vector<subdevice::MailboxProtocol> odd_protocols_;  // the same protocols behind OddMail
    std::vector<std::unique_ptr<OddMail>> odd_mail_;
    OddPdi odd_pdi_;
    Quirks quirks_;
    std::vector<std::byte> receive_;
    std::vector<std::byte> send_;
    subdevice::ProcessDataMemory<1024, 1024, 64> process_memory_;
    subdevice::EscAccess* esc_ = nullptr;
    std::optional<subdevice::ProcessData> process_data_;
    std::optional<subdevice::Mailbox> mailbox_;
    std::optional<subdevice::Device> device_;
    Time away_until_ = kNever;  // end of a restart of the firmware
};

}  // namespace margay::sim
