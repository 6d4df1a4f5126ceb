// The session that opens a SOURCE itself and is the master of its segment, by the public API.
#pragma once

#include "common/cycle_pace.hpp"
#include "common/source.hpp"
#include "common/xml_files.hpp"
#include "ethercat/session.hpp"

#include <margay/files/esi.hpp>
#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace margay::ethercat {

struct StandaloneSettings {
    unsigned index = 0;  // number of the master, for names of interfaces
    std::string source{};
    samples::SourceOptions options{};
    bool take_over = false;
    std::string eni{};         // path; empty: none
    bool note_states = false;  // read the AL status of each slave before the scan, for found_states()
};

// Opens and scans the segment at the first call that needs it.
class StandaloneSession final : public Session {
  public:
    explicit StandaloneSession(StandaloneSettings settings) : settings_(std::move(settings)) {}
    ~StandaloneSession() override;

    Answer<MasterFacts> master() override;
    Answer<std::vector<SlaveFacts>> slaves() override;
    Answer<SlaveTexts> texts(std::uint16_t position) override;
    Answer<ClockFacts> clock(std::uint16_t position) override;
    Answer<RescanFacts> rescan() override;
    Answer<> set_debug_level(unsigned level) override;
    Answer<> set_states(std::span<const std::uint16_t> positions, AlState state) override;
    Answer<std::vector<SyncManagerFacts>> sync_managers(std::uint16_t position) override;
    Answer<std::vector<ConfigFacts>> configs() override;
    // The same without SyncManagers and start-up commands: the slaves are not mapped for it.
    Answer<std::vector<ConfigFacts>> expected();
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
    Answer<> close() override;

    // The AL status of each slave before the scan, by position; empty without StandaloneSettings::note_states.
    [[nodiscard]] const std::vector<AlStatus>& found_states() const { return found_states_; }
    // Whether the segment was not scanned because another master may be running it.
    [[nodiscard]] bool refused() const { return refused_; }
    [[nodiscard]] bool virtual_time() const { return source_ != nullptr && source_->virtual_time(); }
    // Brings all slaves to OP and exchanges process data with outputs of 0. They stay in OP until close(), if the
    // caller calls pause() between its readings.
    struct CycleRun {
        samples::CycleFigures figures{};
        Duration period{0};
        std::string problem{};  // why not all slaves have reached OP; empty: they have
    };
    Answer<CycleRun> run_cycles(unsigned cycles, const samples::PaceOptions& pace);

  private:
    Answer<> open();
    Answer<> open_source();
    Answer<std::uint16_t> scan();
    // Opens the segment, and finds the slave.
    Answer<std::uint16_t> number_of(std::uint16_t position);
    [[nodiscard]] std::uint16_t position_of(std::uint16_t number);
    Answer<> map();
    [[nodiscard]] const files::EniConfiguration* eni() const {
        return eni_.configuration ? &*eni_.configuration : nullptr;
    }
    void exchange();
    [[nodiscard]] bool follows_clock() const { return pace_ && pace_->follows_clock(); }
    // With the cycle of the ENI.
    Result<> bring_to(AlState state, samples::CyclePace& pace);
    Answer<const files::EsiDevice*> sii_of(std::uint16_t number);
    Answer<> to_boot_and_back(std::uint16_t number, bool boot);
    Answer<> reach_with_process_data(std::span<const std::uint16_t> numbers, AlState state);
    // Data of the object dictionary: the entries of a PDO, and the PDOs of a SyncManager. `named` and `sii` contain the
    // names of the SII.
    Result<PdoFacts> mapped_pdo(std::uint16_t number, std::uint16_t index, const files::EsiPdo* named);
    Result<std::vector<PdoFacts>> assigned_pdos(std::uint16_t number, std::uint8_t sync_manager,
                                                const files::EsiDevice& sii);
    [[nodiscard]] DomainFacts domain_facts(std::uint16_t index);
    void add_fmmus(DomainFacts& domain, const Slave& slave);
    void wait_until(Time end);

    StandaloneSettings settings_;
    bool silent_ = false;
    bool closed_ = false;
    std::optional<Problem> failure_{};  // of opening
    bool refused_ = false;
    std::vector<AlStatus> found_states_{};
    std::unique_ptr<samples::Source> source_{};
    samples::EniFile eni_{};
    std::unique_ptr<HostContext> ctx_{};
    bool mapped_ = false;
    // The pace of run_cycles(). If it follows a clock, later exchanges continue it, because the slaves leave OP when
    // the phase of the cycle jumps.
    std::optional<samples::CyclePace> pace_{};
    bool keep_states_ = false;  // the user has requested a state, which is kept at the end
    bool clocks_measured_ = false;
    std::vector<std::byte> image_{};
    std::map<std::uint16_t, files::EsiDevice> sii_{};  // by number
};

// The error of the library in words. The library counts slaves from 1; the words name the position, which counts from
// 0.
[[nodiscard]] Problem problem_of(Context& ctx, const Error& error);

}  // namespace margay::ethercat
