// The EEPROM: its content, against itself and against the chip, and its interface.
#include "subdevice_check/check.hpp"
#include "wire/sii_category.hpp"
#include "wire/sii_check.hpp"

#include <algorithm>

namespace margay::samples::conformance {
namespace {

using namespace std::chrono_literals;
namespace sii = wire::sii;
namespace control = wire::sii_control;

constexpr std::string_view kContent = "ETG.2010, EtherCAT Slave Information Interface";
constexpr std::string_view kInterface = "ETG.1000.4, SII EEPROM interface";
constexpr Duration kSlowRead = 2ms;
constexpr std::uint16_t kSiiVersion = 1;

void needs_content(Session& session) {
    if (!session.sii_fault.empty() && session.sii.empty())
        session.bench.skip("the EEPROM cannot be read (eeprom.content)");
}

void check_content(Session& session) {
    auto& bench = session.bench;
    if (!session.sii_fault.empty() && bench.slave().error.code == Errc::sii_blank)
        bench.fail("the EEPROM was never written: all octets are 0xFF");
    else if (!session.sii_fault.empty())
        bench.fail("the content cannot be read to its end: " + session.sii_fault);
    if (session.sii.empty()) return;
    std::array<sii::Finding, 32> findings{};
    // The used part only: the size word describes the whole EEPROM.
    const auto count = sii::check_image(session.sii, findings);
    for (std::size_t n = 0; n < std::min(count, findings.size()); ++n) {
        const auto& finding = findings[n];
        if (finding.fault == sii::Fault::size_mismatch) continue;
        auto text = fmt::format("word 0x{:04x}", finding.word);
        if (finding.category != sii::category::kEnd)
            text += fmt::format(" (category {})", sii::category::name(finding.category));
        text += fmt::format(": {}", sii::to_text(finding.fault));
        if (finding.expected != 0 || finding.actual != 0)
            text += fmt::format(" (expected 0x{:x}, actual 0x{:x})", finding.expected, finding.actual);
        bench.fail(std::move(text));
    }
}

void check_loaded(Session& session) {
    auto& bench = session.bench;
    const auto status = bench.read<std::uint16_t>(reg::kSiiControl.address);
    if ((status & control::kChecksumError) != 0)
        bench.fail("the ESC has found a wrong checksum when it was switched on (0x0502 bit 11)");
    if ((status & control::kNotLoaded) != 0) bench.fail("the ESC has not loaded its configuration (0x0502 bit 12)");
    const auto dl = bench.read<std::uint16_t>(reg::kDlStatus.address);
    if ((dl & wire::dl_status::kPdiOperational) == 0)
        bench.fail("the PDI is not operational (0x0110 bit 0): the EEPROM is not loaded");
}

// Contents that the SII has twice, or that a master needs to use the other contents.
void check_agrees(Session& session) {
    needs_content(session);
    auto& bench = session.bench;
    if (session.sii.size() < sii::word::kCategories * sii::kWordBytes) bench.skip("the EEPROM has no categories");
    const auto& slave = bench.slave();
    const auto mailbox_agrees = [&](unsigned n, SmType type, std::uint16_t start, std::uint16_t bytes) {
        if (n >= slave.sm_count || slave.sync_managers[n].type != type || !bench.has_mailbox()) return;
        const auto& info = slave.sync_managers[n];
        if (info.length_bytes == 0 || (info.start == start && info.length_bytes == bytes)) return;
        bench.fail(fmt::format("SyncManager {}, a mailbox, is 0x{:04x} with {} octets in the category SyncM, and "
                               "0x{:04x} with {} in words 0x18 to 0x1b",
                               n, info.start, info.length_bytes, start, bytes),
                   "ETG.2010, category SyncM");
    };
    mailbox_agrees(0, SmType::mailbox_out, slave.mailbox.out_start, slave.mailbox.out_bytes);
    mailbox_agrees(1, SmType::mailbox_in, slave.mailbox.in_start, slave.mailbox.in_bytes);
    for (const auto& area : bench.areas()) {
        const auto& info = slave.sync_managers[area.sync_manager];
        if (info.length_bytes != 0 && (info.enable & sii::sm_enable::kEnable) == 0)
            bench.remark(fmt::format("SyncManager {} has {} octets of process data and is switched off",
                                     area.sync_manager, info.length_bytes),
                         "ETG.2010, category SyncM");
        const auto uses = sii::find_category(session.sii, sii::category::kFmmu);
        const auto wanted = static_cast<std::byte>(area.outputs ? FmmuUse::outputs : FmmuUse::inputs);
        if (info.length_bytes != 0 && uses && std::ranges::find(*uses, wanted) == uses->end())
            bench.fail(fmt::format("SyncManager {} has {}, and no FMMU is for {}", area.sync_manager,
                                   area.outputs ? "outputs" : "inputs", area.outputs ? "outputs" : "inputs"),
                       "ETG.2010, category FMMU");
    }
    if (bench.has(mailbox_protocol::kCoE) && sii::find_category(session.sii, sii::category::kGeneral) &&
        (slave.coe_details & coe_detail::kSdo) == 0)
        bench.fail("the SII announces CoE, and its CoE details do not announce SDO", "ETG.2010, category General");
    const auto version = load_le<std::uint16_t>(session.sii, sii::word::kVersion * sii::kWordBytes);
    if (version != kSiiVersion)
        bench.remark(fmt::format("the version of the SII (word 0x3f) is {}, expected {}", version, kSiiVersion));
}

// Printable texts: a master shows them, and writes them into logs and file names.
void check_strings(Session& session) {
    needs_content(session);
    const auto strings = sii::find_category(session.sii, sii::category::kStrings);
    if (!strings) session.bench.skip("the SII has no strings");
    const auto count = sii::string_count(*strings);
    std::size_t odd = 0;
    unsigned first = 0;
    for (unsigned n = 1; n <= count; ++n) {
        const auto text = sii::string(*strings, static_cast<std::uint8_t>(n));
        const bool printable =
            std::ranges::all_of(text.value, [](std::byte octet) { return std::to_integer<unsigned>(octet) >= 0x20; });
        if (text.ok() && printable) continue;
        if (odd++ == 0) first = n;
    }
    if (odd != 0)
        session.bench.fail(
            fmt::format("{} of {} strings have control characters or zeros, the first is string {}", odd, count, first),
            "ETG.2010, category STRINGS");
}

void check_process_data(Session& session) {
    needs_content(session);
    auto& bench = session.bench;
    if (bench.areas().empty()) bench.skip("the SII describes no process data");
    const bool any = sii::find_category(session.sii, sii::category::kTxPdo).has_value() ||
                     sii::find_category(session.sii, sii::category::kRxPdo).has_value();
    const bool soe = bench.has(mailbox_protocol::kSoE);
    if (!any && !soe)
        bench.remark("the SII has no PDOs: a master without CoE does not know the process data",
                     "ETG.2010, category TXPDO and RXPDO");
    for (const auto& area : bench.areas()) {
        const auto& info = bench.slave().sync_managers[area.sync_manager];
        const auto bits = bits_of(sii_pdos(session, area.sync_manager));
        const auto bytes = (bits + 7) / 8;
        if (!any || soe || bytes == info.length_bytes) continue;
        const auto text = fmt::format("SyncManager {} has a length of {} octets in the SII, its PDOs have {}",
                                      area.sync_manager, info.length_bytes, bytes);
        if (info.length_bytes == 0 && (info.enable & sii::sm_enable::kEnable) == 0)
            bench.remark(text + "; it is switched off");
        else
            bench.fail(text, "ETG.2010, category SyncM");
    }
}

void check_chip(Session& session) {
    needs_content(session);
    auto& bench = session.bench;
    const auto features = bench.read<std::uint16_t>(reg::kFeatures.address);
    const auto content = sii::find_category(session.sii, sii::category::kGeneral);
    if (!content) bench.skip("the SII has no category General");
    const auto general = sii::parse_general(*content).value;
    if ((features & wire::features::kLrwNotSupported) != 0 && (general.flags & sii::general_flag::kNotLrw) == 0)
        bench.fail("the ESC does not support LRW (0x0008 bit 9), and the SII does not say so (flag NotLRW)",
                   "ETG.2010, category General");
    for (const auto& area : bench.areas())
        if (area.sync_manager >= bench.slave().dl.sync_managers)
            bench.fail(fmt::format("the SII uses SyncManager {}, and the ESC has {}", area.sync_manager,
                                   bench.slave().dl.sync_managers),
                       "ETG.2010, category SyncM");
    const std::size_t memory = 0x1000U + bench.slave().dl.ram_kib * 1024U;
    for (const auto& area : bench.areas()) {
        // Three buffers behind each other.
        const bool buffered = (area.setting.control & wire::sm_control::kModeMask) == wire::sm_control::kModeBuffered;
        const bool ram = area.setting.physical_start >= reg::kProcessRam;
        const std::size_t end = area.setting.physical_start + (buffered && ram ? 3U : 1U) * area.setting.length_bytes;
        if (ram && bench.slave().dl.ram_kib != 0 && end > memory)
            bench.fail(fmt::format("SyncManager {} with its buffers ends at 0x{:04x}, the memory of the ESC at "
                                   "0x{:04x}",
                                   area.sync_manager, end, memory),
                       "ETG.2010, category SyncM");
    }
}

// One command; returns the status when the interface is not busy any more.
std::uint16_t execute_command(Bench& bench, std::uint16_t command, std::uint32_t word) {
    bench.write<std::uint32_t>(reg::kSiiAddress.address, word);
    bench.write<std::uint16_t>(reg::kSiiControl.address, command);
    for (const Time until = bench.now() + 100ms; bench.now() < until;) {
        const auto status = bench.read<std::uint16_t>(reg::kSiiControl.address);
        if ((status & control::kBusy) == 0) return status;
        bench.wait(50us);
    }
    bench.skip("the EEPROM interface stays busy");
}

void check_read(Session& session) {
    needs_content(session);
    auto& bench = session.bench;
    bench.reset();
    Duration slowest{};
    for (std::uint32_t word = 8; word < 16; word += 2) {
        const Time begun = bench.now();
        const auto status = execute_command(bench, control::kCommandRead, word);
        slowest = std::max(slowest, bench.now() - begun);
        if ((status & control::kErrorMask & ~(control::kChecksumError | control::kNotLoaded)) != 0) {
            bench.fail(fmt::format("a read command of word 0x{:04x} ended with the status 0x{:04x}", word, status));
            return;
        }
        std::array<std::byte, 4> octets{};
        bench.read_octets(reg::kSiiData.address, octets);
        if (session.sii.size() >= 2 * word + 4 &&
            !std::equal(octets.begin(), octets.end(), session.sii.begin() + static_cast<std::ptrdiff_t>(2 * word)))
            bench.fail(fmt::format("word 0x{:04x} is {} now and was {} before", word, hex(octets),
                                   hex(Bytes(session.sii).subspan(2 * word, 4))));
    }
    if (slowest > kSlowRead) bench.remark(fmt::format("a read command takes {} µs", slowest / 1us));
}

// The PDI gets the EEPROM in PREOP, and the master takes it back.
void check_ownership(Session& session) {
    needs_content(session);
    auto& bench = session.bench;
    bench.enter(AlState::preop);
    bench.give_eeprom(false);
    if ((bench.read<std::uint8_t>(reg::kSiiPdiAccess.address) & 1) != 0)
        bench.fail("the master has forced the access to the EEPROM, and the PDI still has it (0x0501)");
    const auto status = execute_command(bench, control::kCommandRead, 8);
    if ((status & control::kErrorMask & ~(control::kChecksumError | control::kNotLoaded)) != 0)
        bench.fail(fmt::format("in PREOP a read command of the master ended with the status 0x{:04x}", status));
    if (const auto al = bench.al_status(); al.error || al.state != AlState::preop)
        bench.fail(fmt::format("the master read the EEPROM in PREOP, and the slave is in {}", status_text(al)));
}

// Writes a word and waits until the EEPROM has stored it: it acknowledges nothing meanwhile. Returns the last status.
std::uint16_t write_word(Bench& bench, std::uint32_t word, std::uint16_t value) {
    std::uint16_t status = control::kBusy;
    const Time begun = bench.now();
    while ((status & (control::kBusy | control::kMissingAcknowledge)) != 0 && bench.now() - begun < 100ms) {
        bench.write<std::uint16_t>(reg::kSiiData.address, value);
        bench.write<std::uint32_t>(reg::kSiiAddress.address, word);
        bench.write<std::uint16_t>(reg::kSiiControl.address, control::kWriteEnable | control::kCommandWrite);
        status = control::kBusy;
        while ((status & control::kBusy) != 0 && bench.now() - begun < 200ms) {
            bench.wait(100us);
            status = bench.read<std::uint16_t>(reg::kSiiControl.address);
        }
        if ((status & control::kWriteEnableError) != 0) return status;
    }
    return status;
}

std::uint16_t read_stored_word(Bench& bench, std::uint32_t word) {
    std::uint16_t status = control::kMissingAcknowledge;
    for (const Time until = bench.now() + 100ms; bench.now() < until && (status & control::kMissingAcknowledge) != 0;)
        status = execute_command(bench, control::kCommandRead, word);
    return bench.read<std::uint16_t>(reg::kSiiData.address);
}

// The alias keeps its value, so that a loss of power does no harm. The word behind the content, which no program reads,
// shows whether the EEPROM stores words: the check writes another value to it, and then its old value.
void check_stored(Bench& bench, Bytes content) {
    constexpr std::uint16_t kBad = control::kBusy | control::kMissingAcknowledge | control::kWriteEnableError;
    const auto word = static_cast<std::uint32_t>(content.size() / sii::kWordBytes);
    if (content.size() + sii::kWordBytes > bench.slave().sii_bytes) return;
    const auto before = read_stored_word(bench, word);
    const auto other = static_cast<std::uint16_t>(~before);
    if ((write_word(bench, word, other) & kBad) != 0) return;  // the device does not allow writing this word
    const auto after = read_stored_word(bench, word);
    if (after != other)
        bench.fail(
            fmt::format("word 0x{:04x} took 0x{:04x} without an error and still reads 0x{:04x}: the EEPROM "
                        "stores nothing, or it is write-protected",
                        word, other, after));
    if (after == before) return;
    (void)write_word(bench, word, before);
    if (const auto now = read_stored_word(bench, word); now != before)
        bench.fail(
            fmt::format("word 0x{:04x}, which is not in use, was 0x{:04x} and is 0x{:04x} now", word, before, now));
}

void check_eeprom_write(Session& session) {
    if (!session.options.write_eeprom) session.bench.skip("the EEPROM is written only with --eeprom-write");
    needs_content(session);
    auto& bench = session.bench;
    if (!sii::checksum_right(session.sii)) bench.skip("the checksum is wrong: nothing is written");
    bench.reset();
    const auto before = load_le<std::uint16_t>(session.sii, sii::word::kAlias * sii::kWordBytes);
    const Time begun = bench.now();
    const auto status = write_word(bench, sii::word::kAlias, before);
    if ((status & control::kWriteEnableError) != 0) {
        bench.fail(fmt::format("a write command with write enable ended with the status 0x{:04x}", status));
        return;
    }
    if ((status & (control::kBusy | control::kMissingAcknowledge)) != 0)
        bench.fail("a word could not be written within 100 ms");
    const auto after = read_stored_word(bench, sii::word::kAlias);
    const Duration longest = bench.now() - begun;
    if (after != before)
        bench.fail(fmt::format("the alias 0x{:04x} was written and 0x{:04x} was read back", before, after));
    if (longest > 15ms) bench.remark(fmt::format("to write a word and to read it back takes {} ms", longest / 1ms));
    check_stored(bench, session.sii);
    // Without write enable, the EEPROM must not store a word.
    bench.write<std::uint16_t>(reg::kSiiData.address, static_cast<std::uint16_t>(~before));
    if ((execute_command(bench, control::kCommandWrite, sii::word::kAlias) & control::kWriteEnableError) == 0)
        bench.fail("a write command without write enable is no error (0x0502 bit 14)");
}

constexpr Check kEepromChecks[] = {
    {"eeprom.content", "the content keeps the rules of its format", kContent, check_content},
    {"eeprom.agrees", "what the SII says twice agrees", kContent, check_agrees},
    {"eeprom.loaded", "the ESC has loaded its configuration", kInterface, check_loaded},
    {"eeprom.strings", "the strings are texts", kContent, check_strings},
    {"eeprom.process_data", "SyncManagers and PDOs of the SII agree", kContent, check_process_data},
    {"eeprom.chip", "the SII describes the chip that is there", kContent, check_chip},
    {"eeprom.read", "the interface executes read commands", kInterface, check_read},
    {"eeprom.ownership", "the master gives the EEPROM to the PDI and takes it back", kInterface, check_ownership},
    {"eeprom.write", "a word can be written and is stored, and only with write enable", kInterface, check_eeprom_write},
};

}  // namespace

std::span<const Check> eeprom_checks() { return kEepromChecks; }

}  // namespace margay::samples::conformance
