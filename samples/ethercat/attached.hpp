// The session that is attached to a running application, over the socket of its AttachServer. The application is the
// master of the segment. Commands that would disturb its cycle are refused with a sentence.
#pragma once

#include "attach/client.hpp"
#include "ethercat/session.hpp"

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace margay::ethercat {

class AttachedSession final : public Session {
  public:
    // `path`: of the socket. Connects at the first call that needs it.
    AttachedSession(unsigned index, std::string path) : index_(index), path_(std::move(path)) {}

    Answer<MasterFacts> master() override;
    Answer<std::vector<SlaveFacts>> slaves() override;
    Answer<SlaveTexts> texts(std::uint16_t position) override;
    Answer<ClockFacts> clock(std::uint16_t position) override;
    Answer<RescanFacts> rescan() override;
    Answer<> set_debug_level(unsigned level) override;
    Answer<> set_states(std::span<const std::uint16_t> positions, AlState state) override;
    Answer<std::vector<SyncManagerFacts>> sync_managers(std::uint16_t position) override;
    Answer<std::vector<ConfigFacts>> configs() override;
    Answer<std::vector<DomainFacts>> domains() override;
    Answer<std::vector<DictionaryObjectFacts>> dictionary(std::uint16_t position, bool entries) override;
    Answer<DictionaryEntryFacts> dictionary_entry(std::uint16_t position, std::uint16_t index,
                                                  std::uint8_t subindex) override;
    Answer<Octets> upload(std::uint16_t position, std::uint16_t index, std::uint8_t subindex,
                          bool complete_access) override;
    Answer<> download(std::uint16_t position, std::uint16_t index, std::uint8_t subindex, bool complete_access,
                      std::span<const std::byte> value) override;
    Answer<Octets> foe_read(std::uint16_t position, const FileTransfer& file) override;
    Answer<> foe_write(std::uint16_t position, const FileTransfer& file, std::span<const std::byte> content) override;
    Answer<Octets> soe_read(std::uint16_t position, std::uint8_t drive, Idn idn) override;
    Answer<SoeAttribute> soe_attribute(std::uint16_t position, std::uint8_t drive, Idn idn) override;
    Answer<> soe_write(std::uint16_t position, std::uint8_t drive, Idn idn, std::span<const std::byte> value) override;
    Answer<std::vector<EoeFacts>> eoe(std::chrono::milliseconds during) override;
    Answer<> set_ip(std::uint16_t position, const EoeIp& ip) override;
    Answer<Octets> read_registers(std::uint16_t position, std::uint16_t address, std::size_t bytes) override;
    Answer<> write_registers(std::uint16_t position, std::uint16_t address, std::span<const std::byte> value,
                             bool urgent) override;
    Answer<> read_sii(std::uint16_t position, std::uint32_t word, std::span<std::byte> into) override;
    Answer<> write_sii(std::uint16_t position, std::uint32_t word, std::span<const std::byte> value) override;
    Answer<Description> describe(std::uint16_t position) override;
    void pause(std::chrono::milliseconds time) override;
    std::vector<std::string> messages() override;
    Answer<> close() override { return {}; }

  private:
    [[nodiscard]] Answer<> open();
    // One exchange. The problem contains the text of the error of the application.
    [[nodiscard]] Answer<Octets> ask(attach::Operation operation, const attach::Arguments& arguments,
                                     const TransferProgress& progress = {});
    // The same for the slave at a position.
    [[nodiscard]] Answer<Octets> ask_slave(std::uint16_t position, attach::Operation operation,
                                           attach::Arguments arguments, const TransferProgress& progress = {});
    // With growing memory, until the value fits.
    [[nodiscard]] Answer<Octets> ask_whole(std::uint16_t position, attach::Operation operation,
                                           attach::Arguments arguments);
    [[nodiscard]] Answer<std::vector<attach::SlaveFacts>> table();
    [[nodiscard]] Answer<std::vector<attach::EoePortFacts>> ports();
    [[nodiscard]] Answer<attach::SlaveFacts> slave_at(std::uint16_t position);
    [[nodiscard]] Problem problem_of(const Error& error, std::string_view slave_text) const;
    [[nodiscard]] Answer<> set_target(std::uint16_t position, AlState target);
    [[nodiscard]] Answer<> await_state(std::uint16_t position, AlState wanted,
                                       std::chrono::steady_clock::time_point deadline);
    // Sets the target, and waits until the slave is in this state.
    [[nodiscard]] Answer<> reach(std::uint16_t position, AlState target, AlState wanted);
    [[nodiscard]] Answer<> back_from_boot(const attach::SlaveFacts& before);
    template <class T>
    [[nodiscard]] Answer<T> read(const Answer<Octets>& octets) const {
        if (!octets) return octets.problem();
        T value{};
        attach::Reader from(*octets);
        from(value);
        if (!from.complete()) return Problem{path_ + ": the answer is not complete", samples::exit_code::kSystem};
        return value;
    }

    // SyncManagers and PDOs; attached_process.cpp.
    [[nodiscard]] Answer<const files::EsiDevice*> sii_of(std::uint16_t position);
    [[nodiscard]] Answer<PdoFacts> mapped_pdo(std::uint16_t position, std::uint16_t index, const files::EsiPdo* named);
    [[nodiscard]] Answer<std::vector<PdoFacts>> assigned_pdos(std::uint16_t position, std::uint8_t sync_manager,
                                                              const files::EsiDevice& sii);
    void add_fmmus(DomainFacts& domain, const attach::SlaveFacts& slave);

    unsigned index_;
    std::string path_;
    bool connected_ = false;
    attach::Client client_{};
    std::vector<attach::SlaveFacts> known_{};          // the last table()
    std::map<std::uint16_t, files::EsiDevice> sii_{};  // by position
    Errc last_error_ = Errc::none;                     // of the last exchange
};

}  // namespace margay::ethercat
