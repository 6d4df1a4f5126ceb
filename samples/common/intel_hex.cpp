#include "common/intel_hex.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

namespace margay::samples {
namespace {

enum class RecordType : std::uint8_t {
    data = 0,
    end = 1,
    segment_address = 2,
    segment_start = 3,
    linear_address = 4,
    linear_start = 5,
};
constexpr std::size_t kOverheadOctets = 5;  // length, address, type, checksum
// The largest size that the size word of the SII can express.
constexpr std::size_t kMostOctets = std::size_t{8} * 1024 * 1024;

std::optional<unsigned> digit(char c) {
    if (c >= '0' && c <= '9') return static_cast<unsigned>(c - '0');
    if (c >= 'A' && c <= 'F') return static_cast<unsigned>(c - 'A' + 10);
    if (c >= 'a' && c <= 'f') return static_cast<unsigned>(c - 'a' + 10);
    return std::nullopt;
}

std::string_view trimmed(std::string_view line) {
    const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
    while (!line.empty() && blank(line.back())) line.remove_suffix(1);
    while (!line.empty() && blank(line.front())) line.remove_prefix(1);
    return line;
}

class Parser {
  public:
    HexContent run(std::string_view text) {
        for (; !text.empty() && out_.error.empty(); ++line_) {
            const auto end = text.find('\n');
            const auto line = trimmed(text.substr(0, end));
            text.remove_prefix(end == text.npos ? text.size() : end + 1);
            if (!line.empty()) take_line(line);
        }
        if (out_.error.empty() && !ended_) out_.error = "there is no end record: the file is cut off";
        if (out_.error.empty() && out_.octets.empty()) out_.error = "there are no data records";
        if (!out_.error.empty()) out_.octets.clear();
        return std::move(out_);
    }

  private:
    template <class... Arguments>
    void fail(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
        out_.error = fmt::format("line {}: ", line_) + fmt::format(format, std::forward<Arguments>(arguments)...);
    }

    void take_line(std::string_view line) {
        if (ended_) return fail("there is text behind the end record");
        if (line.front() != ':') return fail("not a record: it does not begin with a colon");
        line.remove_prefix(1);
        std::vector<std::uint8_t> octets;
        for (std::size_t i = 0; i + 1 < line.size(); i += 2) {
            const auto high = digit(line[i]);
            const auto low = digit(line[i + 1]);
            if (!high || !low) return fail("'{}' is not two hexadecimal digits", line.substr(i, 2));
            octets.push_back(static_cast<std::uint8_t>(*high * 16 + *low));
        }
        if (line.size() % 2 != 0) return fail("an odd number of digits");
        if (octets.size() < kOverheadOctets) return fail("too short for a record");
        if (octets.size() != octets[0] + kOverheadOctets)
            return fail("the record says {} octets and has {}", octets[0], octets.size() - kOverheadOctets);
        unsigned sum = 0;
        for (std::size_t i = 0; i + 1 < octets.size(); ++i) sum += octets[i];
        const auto checksum = static_cast<std::uint8_t>(0x100 - (sum & 0xFF));
        if (octets.back() != checksum)
            return fail("the checksum is 0x{:02X}, the correct one is 0x{:02X}", octets.back(), checksum);
        const auto address = octets[1] * 0x100U + octets[2];
        take_record(address, octets[3], std::span(octets).subspan(4, octets[0]));
    }

    void take_record(unsigned address, std::uint8_t type, std::span<const std::uint8_t> data) {
        switch (static_cast<RecordType>(type)) {
            case RecordType::data: return take_data(base_ + address, data);
            case RecordType::end: ended_ = true; return;
            case RecordType::segment_address:
            case RecordType::linear_address: {
                if (data.size() != 2) return fail("an address record has two octets, not {}", data.size());
                const auto value = data[0] * std::size_t{0x100} + data[1];
                base_ = static_cast<RecordType>(type) == RecordType::linear_address ? value << 16 : value << 4;
                return;
            }
            case RecordType::segment_start:
            case RecordType::linear_start: return;
        }
        fail("record type {} does not exist", type);
    }

    void take_data(std::size_t address, std::span<const std::uint8_t> data) {
        if (address + data.size() > kMostOctets) return fail("address 0x{:X} is beyond any EEPROM", address);
        if (out_.octets.size() < address + data.size()) {
            out_.octets.resize(address + data.size(), std::byte{0xFF});
            told_.resize(address + data.size());
        }
        for (std::size_t i = 0; i < data.size(); ++i) {
            if (told_[address + i]) return fail("the octet at 0x{:X} is given twice", address + i);
            told_[address + i] = true;
            out_.octets[address + i] = static_cast<std::byte>(data[i]);
        }
    }

    HexContent out_;
    std::vector<bool> told_;
    std::size_t line_ = 1;
    std::size_t base_ = 0;
    bool ended_ = false;
};

void put_record(std::string& out, std::size_t address, RecordType type, Bytes data) {
    unsigned sum = 0;
    const auto put = [&](unsigned octet) {
        sum += octet;
        out += fmt::format("{:02X}", octet & 0xFF);
    };
    out += ':';
    put(static_cast<unsigned>(data.size()));
    put((address >> 8) & 0xFF);
    put(address & 0xFF);
    put(static_cast<unsigned>(type));
    for (const auto octet : data) put(std::to_integer<unsigned>(octet));
    put((0x100 - (sum & 0xFF)) & 0xFF);
    out += '\n';
}

}  // namespace

HexContent parse_intel_hex(std::string_view text) { return Parser().run(text); }

std::string to_intel_hex(Bytes octets) {
    constexpr std::size_t kRecordOctets = 16;
    std::string out;
    for (std::size_t at = 0; at < octets.size(); at += kRecordOctets) {
        if (at != 0 && (at & 0xFFFF) == 0) {
            const std::byte upper[] = {static_cast<std::byte>(at >> 24), static_cast<std::byte>(at >> 16)};
            put_record(out, 0, RecordType::linear_address, upper);
        }
        put_record(out, at & 0xFFFF, RecordType::data, octets.subspan(at, std::min(kRecordOctets, octets.size() - at)));
    }
    put_record(out, 0, RecordType::end, {});
    return out;
}

bool looks_like_intel_hex(std::string_view content) {
    const auto start = content.find_first_not_of(" \t\r\n");
    if (start == content.npos || content.size() - start < 1 + 2 * kOverheadOctets || content[start] != ':')
        return false;
    return std::ranges::all_of(content.substr(start + 1, 2 * kOverheadOctets),
                               [](char c) { return digit(c).has_value(); });
}

}  // namespace margay::samples
