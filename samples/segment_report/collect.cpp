#include "segment_report/collect.hpp"

#include "clock/sync_watch.hpp"
#include "common/eeprom.hpp"
#include "common/program.hpp"
#include "common/segment_look.hpp"
#include "common/sii_text.hpp"
#include "ethercat/session_eeprom.hpp"
#include "segment_report/cables.hpp"
#include "segment_report/differences.hpp"
#include "wire/coe.hpp"
#include "wire/esc.hpp"
#include "wire/sii.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace margay::segment_report {
namespace {

namespace reg = wire::reg;

constexpr std::uint16_t kDeviceName = 0x1008, kHardwareVersion = 0x1009, kSoftwareVersion = 0x100A;
constexpr std::size_t kAlOctets = reg::kAlStatusCode.end() - reg::kAlStatus.address;

bool has_coe(const SlaveFacts& slave) {
    return slave.mailbox.present() && (slave.mailbox.protocols & mailbox_protocol::kCoE) != 0;
}

class Collector {
  public:
    Collector(ethercat::Session& session, const CollectSettings& settings, Report& report)
        : session_(session), settings_(settings), report_(report) {}

    void run() {
        progress("scanning the segment");
        auto slaves = session_.slaves();
        if (!slaves) {
            report_.failure = slaves.problem().text;
            report_.failure_code = slaves.problem().code;
            return;
        }
        for (auto& facts : *slaves) report_.slaves.push_back({.facts = std::move(facts)});
        if (report_.origin == Origin::application) each("links", [&](SlaveState& slave) { read_links(slave); });
        each("error counters", [&](SlaveState& slave) { read_counters(slave, slave.counters_before); });
        each("EEPROM", [&](SlaveState& slave) { read_eeprom(slave); });
        each("PDOs", [&](SlaveState& slave) { read_pdos(slave); });
        each("versions", [&](SlaveState& slave) { read_versions(slave); });
        if (settings_.dictionaries) read_dictionaries();
        read_master();
        // The delays of a broken ring cannot be measured, and its slaves would not be mapped after the attempt.
        const auto ring = ring_of(report_);
        const bool measures = report_.origin != Origin::application;
        if (!measures || !ring.ring || ring.whole()) each("clock", [&](SlaveState& slave) { read_clock(slave); });
        read_image();
        if (settings_.expected) find_missing();
        if (settings_.cycles) {
            progress("cycles");
            report_.cycles = settings_.cycles();
        }
        // Before all other readings, and with process data between: slaves leave OP when the watchdog of their outputs
        // expires.
        each("states", [&](SlaveState& slave) {
            if (settings_.cycles) session_.pause(std::chrono::milliseconds(1));
            read_al_status(slave);
        });
        if (settings_.cycles) read_domains();  // with the process data of the last cycle
        each("counters and clocks", [&](SlaveState& slave) { read_end(slave); });
        refresh_problems();
        read_master();
        progress({});
    }

  private:
    void progress(const std::string& text) const {
        if (settings_.progress) settings_.progress(text);
    }

    template <class Work>
    void each(std::string_view what, const Work& work) {
        for (SlaveState& slave : report_.slaves) {
            if (samples::stop_asked()) return;
            progress(fmt::format("slave {} of {}: {}", slave.facts.position, report_.slaves.size(), what));
            work(slave);
        }
    }

    static void note(SlaveState& slave, std::string_view what, const ethercat::Problem& problem) {
        slave.problems.push_back(fmt::format("{}: {}", what, problem.text));
    }

    // An application keeps the ports of its last reading: those of the whole ring after a break.
    void read_links(SlaveState& slave) {
        const auto octets =
            session_.read_registers(slave.facts.position, reg::kDlStatus.address, reg::kDlStatus.length);
        if (!octets) return note(slave, "links", octets.problem());
        if (octets->size() < reg::kDlStatus.length) return;
        const auto status = load_le<std::uint16_t>(*octets, 0);
        for (unsigned port = 0; port < 4; ++port) {
            slave.facts.signal[port] = (status & wire::dl_status::communication(port)) != 0;
            slave.facts.ports[port].link = (status & wire::dl_status::physical_link(port)) != 0;
            slave.facts.ports[port].open =
                slave.facts.signal[port] && (status & wire::dl_status::loop_closed(port)) == 0;
        }
    }

    void read_counters(SlaveState& slave, std::optional<ErrorCounters>& into) {
        const auto counters = session_.error_counters(slave.facts.position);
        if (counters)
            into = *counters;
        else
            note(slave, "error counters", counters.problem());
    }

    void read_eeprom(SlaveState& slave) {
        ethercat::SessionEeprom eeprom(session_, slave.facts.position);
        auto content = samples::read_used_part(eeprom, samples::no_progress());
        slave.eeprom.problem = content.error;
        slave.eeprom.used = std::move(content.octets);
        if (!content.error.empty()) slave.problems.push_back("EEPROM: " + content.error);
        if (const auto size = samples::eeprom_size(eeprom); size.error.empty()) slave.eeprom.size = size.octets;
        const Bytes used(slave.eeprom.used);
        if (used.size() >= 16) slave.eeprom.checksum = load_le<std::uint16_t>(used, 14);
        for (const auto& finding : samples::sii_findings(used)) {
            // The octets behind the end mark were not read.
            if (finding.fault == wire::sii::Fault::size_mismatch) continue;
            slave.eeprom.checksum_wrong |= finding.fault == wire::sii::Fault::checksum;
            slave.eeprom.findings.push_back(samples::finding_text(finding));
        }
        const auto texts = session_.texts(slave.facts.position);
        if (texts)
            slave.texts = *texts;
        else if (content.error.empty())
            note(slave, "texts of the EEPROM", texts.problem());
    }

    void read_pdos(SlaveState& slave) {
        auto sms = session_.sync_managers(slave.facts.position);
        if (sms)
            slave.sync_managers = std::move(*sms);
        else
            note(slave, "PDOs", sms.problem());
    }

    [[nodiscard]] std::string text_object(SlaveState& slave, std::uint16_t index) {
        const auto value = session_.upload(slave.facts.position, index, 0, false);
        if (!value && value.problem().aborted) return {};  // the slave has no such text
        if (!value && slave.versions.unread.empty()) note(slave, "versions", value.problem());
        if (!value) slave.versions.unread.insert(index);
        if (!value) return {};
        std::string text;
        for (const std::byte b : *value)
            if (b != std::byte{0}) text += static_cast<char>(b);
        return text;
    }

    void read_versions(SlaveState& slave) {
        if (!has_coe(slave.facts)) return;
        slave.versions.name = text_object(slave, kDeviceName);
        slave.versions.hardware = text_object(slave, kHardwareVersion);
        slave.versions.software = text_object(slave, kSoftwareVersion);
    }

    // Slaves of the same product are alike. The entries of slaves with the same revision are read once.
    void read_dictionaries() {
        report_.read_dictionaries = true;
        for (const auto& group : alike_slaves(report_)) {
            std::map<std::uint32_t, std::vector<DictionaryObjectFacts>> known;  // by revision
            for (const auto position : group) {
                SlaveState& slave = report_.slaves[position];
                if (!has_coe(slave.facts) || samples::stop_asked()) continue;
                progress(fmt::format("slave {} of {}: dictionary", position, report_.slaves.size()));
                slave.dictionary = read_dictionary(slave, known);
            }
        }
    }

    Dictionary read_dictionary(const SlaveState& slave,
                               std::map<std::uint32_t, std::vector<DictionaryObjectFacts>>& known) {
        Dictionary dictionary;
        const auto revision = slave.facts.identity.revision;
        if (!known.contains(revision)) {
            auto objects = session_.dictionary(slave.facts.position, true);
            if (!objects) {
                dictionary.problem = objects.problem().text;
                return dictionary;
            }
            known[revision] = std::move(*objects);
        }
        dictionary.objects = known[revision];
        // In a session of our own the slaves are in PREOP; slaves of an application can be in any state.
        const auto readable =
            report_.origin == Origin::application ? wire::coe::access::kRead : wire::coe::access::kReadPreop;
        for (const auto& object : dictionary.objects)
            for (const auto& entry : object.entries) {
                if ((entry.access & readable) == 0) continue;
                auto value = session_.upload(slave.facts.position, object.index, entry.subindex, false);
                if (value)
                    dictionary.values[{object.index, entry.subindex}] = std::move(*value);
                else
                    dictionary.unread.insert({object.index, entry.subindex});
            }
        return dictionary;
    }

    void read_master() {
        const auto master = session_.master();
        if (master)
            report_.master = *master;
        else
            report_.messages.push_back(master.problem().text);
    }

    void read_clock(SlaveState& slave) {
        const auto clock = session_.clock(slave.facts.position);
        if (!clock) return note(slave, "clock", clock.problem());
        slave.clock.facts = *clock;
    }

    void read_image() {
        if (!settings_.map && !settings_.cycles) return;
        progress("process image");
        report_.mapped = true;
        read_domains();
    }

    void read_domains() {
        auto domains = session_.domains();
        if (domains)
            report_.domains = std::move(*domains);
        else
            report_.domains_problem = domains.problem().text;
    }

    void find_missing() {
        const auto configs = settings_.expected();
        if (!configs) {
            report_.messages.push_back(configs.problem().text);
            return;
        }
        for (std::size_t n = 0; n < configs->size(); ++n)
            if (const auto& config = (*configs)[n]; !config.position && !config.may_be_missing)
                report_.missing.push_back(
                    fmt::format("Configured slave {} (vendor 0x{:08x}, product 0x{:08x}) is missing.", n, config.vendor,
                                config.product));
    }

    // The counters and states are read again, because they may have changed until the end.
    void read_al_status(SlaveState& slave) {
        const auto al = session_.read_registers(slave.facts.position, reg::kAlStatus.address, kAlOctets);
        if (al)
            slave.now = samples::al_status_in(*al);
        else
            note(slave, "AL status", al.problem());
    }

    void read_end(SlaveState& slave) {
        read_counters(slave, slave.counters);
        const auto position = slave.facts.position;
        if (!slave.clock.facts.runs) return;
        const auto read = [&](wire::Register place) {
            const auto octets = session_.read_registers(position, place.address, place.length);
            return octets ? *octets : Octets{};
        };
        const auto offset = read(reg::kSystemTimeOffset);
        if (offset.size() >= 8) slave.clock.offset_ns = load_le<std::int64_t>(offset, 0);
        const auto deviation = read(reg::kSystemTimeDifference);
        if (deviation.size() >= 4) slave.clock.deviation_ns = load_difference_ns(load_le<std::uint32_t>(deviation, 0));
    }

    // Mapping may have found more errors of slaves.
    void refresh_problems() {
        const auto slaves = session_.slaves();
        if (!slaves) return;
        for (SlaveState& slave : report_.slaves)
            for (const SlaveFacts& facts : *slaves)
                if (facts.position == slave.facts.position) slave.facts.problem = facts.problem;
    }

    ethercat::Session& session_;
    const CollectSettings& settings_;
    Report& report_;
};

}  // namespace

void collect(ethercat::Session& session, const CollectSettings& settings, Report& report) {
    Collector(session, settings, report).run();
    for (auto& message : session.messages()) report.messages.push_back(std::move(message));
}

}  // namespace margay::segment_report
