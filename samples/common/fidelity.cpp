#include "common/fidelity.hpp"

#include "common/counted.hpp"
#include "wire/sync_manager.hpp"
#include "wire/text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>

namespace margay::samples {

namespace {

using wire::Command;
namespace reg = wire::reg;

// The slaves are switched on this long before the recording starts, so that their start-up is complete.
constexpr Duration kSwitchedOn = std::chrono::seconds(1);

bool within(std::uint32_t address, std::uint32_t from, std::uint32_t to) { return from <= address && address < to; }

// Whether the request and the device alone determine the value at an ESC address. Clocks, counters, events, mailbox,
// process data and values that depend on the speed of a processor are not determined.
bool determined(std::uint32_t address) {
    if (address >= reg::kProcessRam) return false;
    if (within(address, 0x0210, 0x0224) || within(address, 0x0300, 0x0314) || within(address, 0x0440, 0x0444))
        return false;
    if (within(address, 0x0900, 0x0920) || within(address, 0x092C, 0x0930) || within(address, 0x0932, 0x0934))
        return false;
    if (within(address, 0x0984, 0x09A0) || within(address, 0x09AE, 0x09D0)) return false;
    // The status of a SyncManager depends on the time when a mailbox becomes full.
    const bool sync_manager =
        within(address, reg::kSyncManagerBase, reg::kSyncManagerBase + 16u * reg::kSyncManagerStride);
    return !sync_manager || address % reg::kSyncManagerStride != wire::SyncManagerLayout::status::offset;
}

// Clears bits that only show whether the EEPROM is busy: the simulated EEPROM can be faster.
std::byte masked(std::uint32_t address, std::byte value) {
    if (address == reg::kSiiControl.address) return value & std::byte{0xEF};  // bit 4 is reserved and not constant
    return address == reg::kSiiControl.address + 1u ? value & std::byte{0x78} : value;
}

// True when the hardware was still busy reading its EEPROM at the time of the request.
bool answered_while_busy(const DatagramPair& pair) {
    const std::uint32_t ado = pair.request.address.ado();
    const std::uint32_t status_at = reg::kSiiControl.address + 1u;
    if (ado > status_at || status_at >= ado + pair.received.size()) return false;
    return (pair.received[status_at - ado] & std::byte{0x80}) != std::byte{0};
}

std::string name_of(const wire::DatagramHeader& header, std::uint32_t address) {
    if (wire::is_logical(header.command)) return fmt::format("{} process data", wire::to_text(header.command));
    std::array<char, 64> buffer{};
    TextWriter name(buffer);
    wire::describe_register(name, static_cast<std::uint16_t>(address));
    return fmt::format("{} {} (0x{:04x})", wire::to_text(header.command), name.text(), address);
}

std::string octets_text(Bytes bytes) {
    std::string text;
    for (const auto octet : bytes.first(std::min<std::size_t>(bytes.size(), 24)))
        text += fmt::format("{:02x}", std::to_integer<unsigned>(octet));
    return bytes.size() > 24 ? text + "…" : text;
}

void note(FidelityReport& report, const std::string& kind, std::size_t frame, std::string example) {
    auto& entry = report.kinds[kind];
    if (entry.count++ == 0) entry.first_frame = frame, entry.example = std::move(example);
}

void compare_data(FidelityReport& report, const DatagramPair& pair, Bytes simulated) {
    const bool logical = wire::is_logical(pair.request.command);
    const std::uint32_t ado = pair.request.address.ado();
    const bool busy = !logical && answered_while_busy(pair);
    std::size_t first_difference = simulated.size();
    for (std::size_t i = 0; i < simulated.size(); ++i) {
        const auto address = static_cast<std::uint32_t>(ado + i);
        // In process data, only octets that the master has sent and that no slave overwrites are determined.
        if (logical ? pair.request.command != Command::LWR && pair.received[i] != pair.sent[i] : !determined(address))
            continue;
        if (busy && within(address, reg::kSiiData.address, reg::kSiiData.end())) continue;
        ++report.data_octets;
        const bool same = logical ? pair.received[i] == simulated[i]
                                  : masked(address, pair.received[i]) == masked(address, simulated[i]);
        if (same)
            ++report.equal_octets;
        else if (first_difference == simulated.size())
            first_difference = i;
    }
    if (first_difference != simulated.size())
        note(report, "data of " + name_of(pair.request, static_cast<std::uint32_t>(ado + first_difference)), pair.frame,
             fmt::format("hardware {}, simulation {}", octets_text(pair.received), octets_text(simulated)));
}

}  // namespace

FidelityReport measure_fidelity(const Capture& capture, SimulatedSegment& simulated) {
    FidelityReport report;
    for (const auto& exchange : capture.exchanges) {
        auto frame = exchange.request;
        const auto passage = simulated.segment.process(frame, Time{} + kSwitchedOn + exchange.at);
        ++report.frames;
        if (exchange.answer.empty()) {
            ++report.unanswered;
            continue;
        }
        if (!passage.returned) {
            note(report, "frame lost in the simulation", exchange.frame, "");
            continue;
        }
        wire::DatagramReader reader(frame);
        for (const auto& pair : pairs_of(exchange)) {
            const auto answer = reader.next();
            if (!answer) break;
            ++report.datagrams;
            if (answer->wkc == pair.wkc)
                ++report.equal_wkc;
            else
                note(report, "working counter of " + name_of(pair.request, pair.request.address.ado()), pair.frame,
                     fmt::format("{} octets: hardware {}, simulation {}", pair.sent.size(), pair.wkc, answer->wkc));
            if (answer->wkc != 0 && pair.wkc != 0) compare_data(report, pair, answer->data);
        }
    }
    return report;
}

std::string to_text(const FidelityReport& report) {
    const auto equal = [](std::size_t part, std::size_t whole, std::string_view of) {
        if (whole == 0) return std::string("nothing to compare");
        return fmt::format("{} of {} {}equal, {:.3f} %", part, whole, of,
                           100.0 * static_cast<double>(part) / static_cast<double>(whole));
    };
    std::string text;
    auto out = std::back_inserter(text);
    fmt::format_to(out, "{}, {} of them without an answer in the recording\n", counted(report.frames, "frame"),
                   report.unanswered);
    fmt::format_to(out, "working counters  {}\n", equal(report.equal_wkc, report.datagrams, ""));
    fmt::format_to(out, "determined data   {}\n", equal(report.equal_octets, report.data_octets, "octets "));
    for (const auto& [kind, entry] : report.kinds)
        fmt::format_to(out, "  {:5} × {}; first in frame {}{}{}\n", entry.count, kind, entry.first_frame,
                       entry.example.empty() ? "" : ": ", entry.example);
    return text;
}

}  // namespace margay::samples
