#include "common/eeprom.hpp"

#include "common/sii_text.hpp"
#include "wire/sii.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace margay::samples {
namespace {

namespace sii = wire::sii;

constexpr std::size_t kReadOctets = 256;  // at once, between two calls of progress
constexpr std::size_t kWriteWords = 8;

std::uint16_t word_of(Bytes octets, std::size_t word) { return load_le<std::uint16_t>(octets, word * sii::kWordBytes); }

}  // namespace

EepromSize eeprom_size(Eeprom& eeprom) {
    if (eeprom.known_size() != 0) return {eeprom.known_size()};
    std::array<std::byte, sii::kWordBytes> word{};
    auto error = eeprom.read(sii::word::kSize, word);
    if (!error.empty()) return {0, std::move(error)};
    const auto value = load_le<std::uint16_t>(word);
    if (value == 0xFFFF)
        return {0, fmt::format("the EEPROM of {} does not tell its size (word 0x003e is blank): say --size",
                               eeprom.name())};
    return {sii::eeprom_bytes(value)};
}

EepromContent read_eeprom(Eeprom& eeprom, std::size_t octets, const Progress& progress) {
    EepromContent out;
    out.octets.resize(octets);
    for (std::size_t at = 0; at < octets; at += kReadOctets) {
        if (!progress("reading", at, octets)) return {{}, "stopped"};
        const auto part = MutableBytes(out.octets).subspan(at, std::min(kReadOctets, octets - at));
        auto error = eeprom.read(static_cast<std::uint32_t>(at / sii::kWordBytes), part);
        if (!error.empty()) return {{}, std::move(error)};
    }
    (void)progress("reading", octets, octets);
    return out;
}

std::string why_not_to_write(Bytes image) {
    if (image.size() % sii::kWordBytes != 0)
        return fmt::format("{} octets are not a whole number of words", image.size());
    for (const auto& finding : sii_findings(image)) {
        switch (finding.fault) {
            case sii::Fault::blank:
            case sii::Fault::truncated:
            case sii::Fault::no_end:
            case sii::Fault::category_past_end:
            case sii::Fault::category_overlap:
            case sii::Fault::checksum: return finding_text(finding);
            case sii::Fault::size_mismatch:  // shorter is usual: the rest of the EEPROM is not in the file
                if (finding.actual < image.size()) return finding_text(finding);
                break;
            default: break;
        }
    }
    return {};
}

namespace {

class ImageWriter {
  public:
    ImageWriter(Eeprom& eeprom, Bytes image, const Progress& progress)
        : eeprom_(eeprom), image_(image), progress_(progress) {}

    WriteReport run() {
        report_.words = image_.size() / sii::kWordBytes;
        auto before = read_eeprom(eeprom_, image_.size(), progress_);
        if (!before.error.empty()) return failed(std::move(before.error));
        before_ = std::move(before.octets);
        for (std::size_t word = 0; word < report_.words; ++word) report_.different += differs(word);
        const std::size_t body = std::min<std::size_t>(sii::word::kIdentity, report_.words);
        if (!write_range(body, report_.words) || !write_range(0, body)) return std::move(report_);
        auto error = report_.different != 0 ? eeprom_.keep() : std::string();
        if (!error.empty()) return failed(std::move(error));
        verify();
        return std::move(report_);
    }

  private:
    [[nodiscard]] bool differs(std::size_t word) const { return word_of(before_, word) != word_of(image_, word); }

    WriteReport failed(std::string error) {
        report_.error = std::move(error);
        return std::move(report_);
    }

    // Runs of words that differ, a few at a time.
    bool write_range(std::size_t from, std::size_t end) {
        while (from < end) {
            if (!differs(from)) {
                ++from;
                continue;
            }
            if (!progress_("writing", report_.written, report_.different)) {
                report_.error = "stopped";
                return false;
            }
            std::size_t run_end = from + 1;
            while (run_end < end && run_end - from < kWriteWords && differs(run_end)) ++run_end;
            auto written = eeprom_.write(static_cast<std::uint32_t>(from),
                                         image_.subspan(from * sii::kWordBytes, (run_end - from) * sii::kWordBytes));
            report_.written += written.words;
            if (!written.error.empty()) {
                report_.error =
                    fmt::format("word 0x{:04x} is not written for sure: {}", from + written.words, written.error);
                return false;
            }
            from = run_end;
        }
        return true;
    }

    void verify() {
        const auto verifying = [this](std::string_view, std::size_t done, std::size_t total) {
            return progress_("verifying", done, total);
        };
        const auto back = read_eeprom(eeprom_, image_.size(), verifying);
        if (!back.error.empty()) {
            report_.error = fmt::format("could not be verified: {}", back.error);
            return;
        }
        std::size_t wrong = 0;
        for (std::size_t word = report_.words; word-- > 0;) {
            if (word_of(back.octets, word) == word_of(image_, word)) continue;
            ++wrong;
            report_.error = fmt::format("word 0x{:04x} reads 0x{:04x}, written was 0x{:04x}", word,
                                        word_of(back.octets, word), word_of(image_, word));
        }
        if (wrong != 0) {
            report_.error +=
                fmt::format(" ({} of {} words are wrong; an EEPROM that is smaller than it should be does that)", wrong,
                            report_.words);
            return;
        }
        report_.verified = true;
    }

    Eeprom& eeprom_;
    Bytes image_;
    const Progress& progress_;
    std::vector<std::byte> before_;
    WriteReport report_;
};

struct Area {
    std::array<std::byte, sii::kConfigurationBytes> octets{};
    std::string error{};
};

Area read_area(Eeprom& eeprom) {
    Area area;
    area.error = eeprom.read(sii::word::kPdiControl, area.octets);
    return area;
}

}  // namespace

WriteReport write_eeprom(Eeprom& eeprom, Bytes image, const Progress& progress) {
    return ImageWriter(eeprom, image, progress).run();
}

AliasReport read_alias(Eeprom& eeprom) {
    const auto area = read_area(eeprom);
    const auto alias = sii::load_configuration(area.octets).alias;
    return {alias, alias, area.error};
}

AliasReport write_alias(Eeprom& eeprom, std::uint16_t alias, bool force) {
    const auto area = read_area(eeprom);
    if (!area.error.empty()) return {0, 0, area.error};
    AliasReport report{.before = sii::load_configuration(area.octets).alias, .after = alias};
    if (!force && sii::is_blank(area.octets))
        report.error =
            fmt::format("the EEPROM of {} is blank; an alias alone does not make it one of a slave", eeprom.name());
    else if (!force && !sii::checksum_right(area.octets))
        report.error = fmt::format(
            "the checksum of words 0x00 to 0x06 is 0x{:02x}, of what is there it is 0x{:02x}; --force makes "
            "it right whatever is in them",
            sii::load_configuration(area.octets).checksum & 0xFF, sii::checksum(area.octets));
    if (!report.error.empty()) return report;

    auto wanted = area.octets;
    store_le(wanted, sii::word::kAlias * sii::kWordBytes, alias);
    wanted[sii::word::kChecksum * sii::kWordBytes] = static_cast<std::byte>(sii::checksum(wanted));
    const auto written = write_eeprom(eeprom, wanted, no_progress());
    report.error = written.error;
    return report;
}

std::string FileEeprom::read(std::uint32_t word, MutableBytes into) {
    const auto at = word * sii::kWordBytes;
    if (at + into.size() > file_.octets.size())
        return fmt::format("{} ends at word 0x{:04x}", path_, file_.octets.size() / sii::kWordBytes);
    std::copy_n(file_.octets.begin() + static_cast<std::ptrdiff_t>(at), into.size(), into.begin());
    return {};
}

Eeprom::Written FileEeprom::write(std::uint32_t word, Bytes octets) {
    const auto at = word * sii::kWordBytes;
    if (at + octets.size() > file_.octets.size())
        return {0, fmt::format("{} ends at word 0x{:04x}", path_, file_.octets.size() / sii::kWordBytes)};
    std::copy(octets.begin(), octets.end(), file_.octets.begin() + static_cast<std::ptrdiff_t>(at));
    return {octets.size() / sii::kWordBytes};
}

}  // namespace margay::samples
