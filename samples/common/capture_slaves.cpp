#include "common/capture_slaves.hpp"

#include "wire/esc.hpp"
#include "wire/sii.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace margay::samples {

namespace {

using wire::Command;
namespace reg = wire::reg;

bool wanted(std::uint32_t address) {
    return address < reg::kDlInformation.end() || address == 0x0140 || address == 0x0141 || address == 0x0502 ||
           address == 0x0503 || (address >= 0x0E00 && address < 0x0E10);
}

class Reader {
  public:
    std::vector<SeenSlave> run(const Capture& capture) {
        for (const auto& exchange : capture.exchanges)
            for (const auto& pair : pairs_of(exchange)) look(pair);
        std::vector<SeenSlave> slaves;
        std::uint16_t next = 0;
        for (auto& [position, slave] : by_position_) {
            finish(slave);
            next = static_cast<std::uint16_t>(position + 1);
            slaves.push_back(slave);
        }
        for (auto& [station, slave] : strangers_) {
            slave.position = next++;
            slave.station_before = station;
            finish(slave);
            slaves.push_back(slave);
        }
        return slaves;
    }

  private:
    SeenSlave* find(const DatagramPair& pair) {
        const auto adp = pair.request.address.adp();
        // The answer to a broadcast read ORs the data of all slaves. It describes a single slave only when the segment
        // has one slave; other datagrams show the number of slaves.
        if (pair.request.command == Command::BRD && slaves_seen_ == 1) {
            by_position_[0].position = 0;
            return &by_position_[0];
        }
        switch (pair.request.command) {
            case Command::APRD:
            case Command::APWR: {
                const auto position = static_cast<std::uint16_t>(-adp);
                by_position_[position].position = position;
                return &by_position_[position];
            }
            case Command::FPRD:
            case Command::FPWR: {
                const auto found = stations_.find(adp);
                return found != stations_.end() ? &by_position_[found->second] : &strangers_[adp];
            }
            default: return nullptr;
        }
    }

    // The slave that this datagram addresses, if it has answered an earlier datagram.
    SeenSlave* known(const DatagramPair& pair) {
        const auto adp = pair.request.address.adp();
        switch (pair.request.command) {
            case Command::APRD:
            case Command::APWR: {
                const auto found = by_position_.find(static_cast<std::uint16_t>(-adp));
                return found != by_position_.end() ? &found->second : nullptr;
            }
            case Command::FPRD:
            case Command::FPWR: {
                if (const auto found = stations_.find(adp); found != stations_.end())
                    return &by_position_[found->second];
                const auto found = strangers_.find(adp);
                return found != strangers_.end() ? &found->second : nullptr;
            }
            default: return nullptr;
        }
    }

    // An answer from a clock register shows that the register exists; a missing answer shows that it does not.
    void look_at_clock(const DatagramPair& pair) {
        const std::uint32_t ado = pair.request.address.ado();
        const std::uint32_t end = ado + static_cast<std::uint32_t>(pair.sent.size());
        if (ado < reg::kPortReceiveTime.address || end > 0x0A00) return;
        auto* const slave = known(pair);
        if (slave == nullptr) return;
        const bool answered = pair.wkc != 0;
        const auto note = [&](std::optional<bool>& fact) { fact = fact.value_or(false) || answered; };
        if (end <= reg::kSystemTime.address) note(slave->receive_times);
        if (ado >= reg::kSystemTime.address) note(slave->clock);
        const bool read = pair.request.command == Command::APRD || pair.request.command == Command::FPRD;
        const bool time = ado == reg::kSystemTime.address || ado == reg::kProcessingUnitReceiveTime.address;
        if (answered && read && time && pair.received.size() == 8) {
            const bool upper = load_le<std::uint32_t>(pair.received, 4) != 0;
            slave->clock_has_64_bits = slave->clock_has_64_bits.value_or(false) || upper;
        }
    }

    void look(const DatagramPair& pair) {
        look_at_clock(pair);
        if (pair.wkc == 0) return;
        if (pair.request.command == Command::BRD) slaves_seen_ = std::max(slaves_seen_, pair.wkc);
        auto* slave = find(pair);
        if (slave == nullptr) return;
        const std::uint32_t ado = pair.request.address.ado();
        const bool write = pair.request.command == Command::APWR || pair.request.command == Command::FPWR;
        const auto offset_of = [&](std::uint32_t address, std::size_t length) -> std::optional<std::size_t> {
            if (address < ado || address + length > ado + pair.sent.size()) return std::nullopt;
            return address - ado;
        };
        if (write) {
            if (const auto at = offset_of(reg::kStationAddress.address, 2); at && pair.request.command == Command::APWR)
                stations_[load_le<std::uint16_t>(pair.sent, *at)] = slave->position;
            if (const auto at = offset_of(reg::kSiiAddress.address, 4))
                words_[slave] = load_le<std::uint32_t>(pair.sent, *at);
            if (const auto at = offset_of(reg::kSiiControl.address + 1u, 1))
                reading_[slave] = pair.sent[*at] == std::byte{1};
            return;
        }
        for (std::size_t i = 0; i < pair.received.size(); ++i)
            if (wanted(static_cast<std::uint32_t>(ado + i)))
                slave->registers.try_emplace(static_cast<std::uint16_t>(ado + i), pair.received[i]);
        if (const auto status = offset_of(reg::kSiiControl.address, 2);
            status && (load_le<std::uint16_t>(pair.received, *status) & wire::sii_control::kBusy) != 0)
            return;
        if (const auto at = offset_of(reg::kSiiAddress.address, 4))
            words_[slave] = load_le<std::uint32_t>(pair.received, *at);
        if (const auto at = offset_of(reg::kSiiData.address, 1)) take(*slave, pair.received.subspan(*at));
    }

    // Copies the data of an EEPROM read: four or eight octets, as many as the slave fetched.
    void take(SeenSlave& slave, Bytes data) {
        const auto word = words_.find(&slave);
        if (word == words_.end() || !reading_[&slave]) return;
        const auto status = slave.registers.find(reg::kSiiControl.address);
        const bool eight = status != slave.registers.end() && (status->second & std::byte{0x40}) != std::byte{0};
        const std::size_t at = std::size_t{word->second} * 2;
        const auto count = std::min<std::size_t>(data.size(), eight ? 8 : 4);
        if (at + count > 0x20000) return;
        if (slave.sii.size() < at + count) slave.sii.resize(at + count, std::byte{0xFF});
        auto& read = read_[&slave];
        for (std::size_t i = 0; i < count; ++i) {
            slave.sii[at + i] = data[i];
            if (read.insert(at + i).second) ++slave.sii_octets_read;
        }
    }

    // Words 0–7 that the master did not read are filled in, so that they agree with the registers of the chip.
    void finish(SeenSlave& slave) {
        namespace sii = wire::sii;
        const auto& read = read_[&slave];
        if (slave.sii.size() < sii::kFixedBytes + 2) slave.sii.resize(sii::kFixedBytes + 2, std::byte{0xFF});
        slave.sii.resize((slave.sii.size() + 127) / 128 * 128, std::byte{0xFF});
        bool all = true;
        for (std::size_t i = 0; i < sii::kConfigurationBytes; ++i) all &= read.contains(i);
        if (all) return;
        sii::Configuration configuration;
        const auto octet = [&](std::uint16_t address) {
            const auto found = slave.registers.find(address);
            return found == slave.registers.end() ? 0u : std::to_integer<unsigned>(found->second);
        };
        configuration.pdi_control = static_cast<std::uint16_t>(octet(0x0140) | octet(0x0141) << 8);
        sii::store_configuration(slave.sii, configuration);
        if (!read.contains(sii::word::kSize * 2))
            store_le(MutableBytes(slave.sii), sii::word::kSize * 2,
                     sii::size_word(static_cast<std::uint32_t>(slave.sii.size())));
    }

    std::uint16_t slaves_seen_ = 0;  // the working counter of broadcast reads
    std::map<std::uint16_t, SeenSlave> by_position_;
    std::map<std::uint16_t, SeenSlave> strangers_;
    std::map<std::uint16_t, std::uint16_t> stations_;
    std::map<const SeenSlave*, std::uint32_t> words_;
    std::map<const SeenSlave*, bool> reading_;
    std::map<const SeenSlave*, std::set<std::size_t>> read_;
};

}  // namespace

std::vector<SeenSlave> slaves_of(const Capture& capture) { return Reader().run(capture); }

std::string no_slaves_reason(const Capture& capture) {
    std::uint16_t most = 0;
    for (const auto& exchange : capture.exchanges)
        for (const auto& pair : pairs_of(exchange))
            if (pair.request.command == Command::BRD || pair.request.command == Command::BWR)
                most = std::max(most, pair.wkc);
    if (most == 0) return "no slave answers in this recording";
    return fmt::format(
        "{} slave{} in this recording (working counter of broadcasts), but it has no answer of a single slave, so the "
        "slaves cannot be identified",
        most, most == 1 ? " answers" : "s answer");
}

namespace {

// The clock as a value of `dc` in a segment description; empty when the recording does not show it.
std::string_view dc_of(const SeenSlave& slave) {
    if (!slave.clock) return {};
    if (!*slave.clock) return slave.receive_times.value_or(true) ? "receive_times" : "none";
    const auto features = slave.registers.find(reg::kFeatures.address);
    if (features == slave.registers.end()) return slave.clock_has_64_bits.value_or(true) ? "64" : "32";
    const auto bits = std::to_integer<unsigned>(features->second);
    return (bits & wire::features::kDistributedClocks64Bit) != 0 ? "64" : "32";
}

}  // namespace

std::string describe_segment(const std::vector<SeenSlave>& slaves, const std::string& title) {
    std::string text = fmt::format("title = \"{}\"\n", title);
    for (const auto& slave : slaves) {
        text += fmt::format("\n[[slave]]\nname = \"slave{}\"\nsii = \"slave{}.bin\"\n", slave.position + 1,
                            slave.position + 1);
        const auto number = [&](std::uint16_t address, std::string_view key, unsigned octets = 1) {
            unsigned value = 0;
            for (unsigned i = 0; i < octets; ++i) {
                const auto found = slave.registers.find(static_cast<std::uint16_t>(address + i));
                if (found == slave.registers.end()) return;
                value |= std::to_integer<unsigned>(found->second) << (8 * i);
            }
            text += fmt::format("{} = 0x{:0{}x}\n", key, value, octets * 2);
        };
        number(0x0000, "type");
        number(0x0001, "revision");
        number(0x0002, "build", 2);
        number(0x0004, "fmmus");
        number(0x0005, "sync_managers");
        number(0x0006, "ram_kib");
        number(0x0008, "features", 2);
        if (const auto dc = dc_of(slave); !dc.empty()) text += fmt::format("dc = \"{}\"\n", dc);
        if (const auto ports = slave.registers.find(0x0007); ports != slave.registers.end()) {
            constexpr std::array<std::string_view, 4> kKinds{"none", "unused", "ebus", "mii"};
            const auto bits = std::to_integer<unsigned>(ports->second);
            text += fmt::format("ports = [\"{}\", \"{}\", \"{}\", \"{}\"]\n", kKinds[bits & 3], kKinds[bits >> 2 & 3],
                                kKinds[bits >> 4 & 3], kKinds[bits >> 6]);
        }
        if (const auto status = slave.registers.find(0x0502); status != slave.registers.end()) {
            const auto bits = std::to_integer<unsigned>(status->second);
            text += fmt::format("sii_8_bytes = {}\n", (bits & 0x40) != 0);
            if ((bits & 0xA0) != 0) text += fmt::format("sii_status = 0x{:02x}\n", bits & 0xA0);
        }
        if (slave.station_before) text += fmt::format("station = 0x{:04x}\n", *slave.station_before);
    }
    return text;
}

}  // namespace margay::samples
