#include "common/eeprom.hpp"

#include "common/counted.hpp"
#include "common/sii_text.hpp"
#include "wire/sii.hpp"
#include "wire/sii_area.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace margay::samples {
namespace {

namespace sii = wire::sii;

constexpr std::size_t kReadOctets = 256;  // per read; between two reads `progress` is called
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
        return {0,
                fmt::format(
                    "the size of the EEPROM of {} is unknown (word 0x003e is blank): eepromtool reads it with --size",
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

EepromContent read_used_part(Eeprom& eeprom, const Progress& progress) {
    const auto size = eeprom_size(eeprom);
    if (!size.error.empty()) return {{}, size.error};
    const auto octets = std::min<std::size_t>(size.octets, UINT32_MAX);
    const auto end = sii::content_end_word(static_cast<std::uint32_t>(octets));
    EepromContent out;
    // Reads more octets, up to `word`.
    const auto read_to = [&](std::uint32_t word) {
        while (out.error.empty() && out.octets.size() < word * sii::kWordBytes) {
            const auto at = out.octets.size();
            if (!progress("reading", at, word * sii::kWordBytes)) {
                out.error = "stopped";
                break;
            }
            out.octets.resize(std::min(at + kReadOctets, word * sii::kWordBytes));
            out.error =
                eeprom.read(static_cast<std::uint32_t>(at / sii::kWordBytes), MutableBytes(out.octets).subspan(at));
        }
        if (!out.error.empty()) out.octets.clear();
        return out.error.empty();
    };
    if (!read_to(std::min(end, sii::word::kCategories))) return out;
    sii::CategoryChain chain(end);
    while (chain.more()) {
        const auto at = chain.header_word();
        if (!read_to(std::min(end, at + 1))) return out;
        std::array<std::byte, sii::kCategoryHeaderBytes> header{};
        const bool end_mark = word_of(out.octets, at) == sii::category::kEnd;
        if (!end_mark && !read_to(std::min(end, at + 2))) return out;
        const auto rest = Bytes(out.octets).subspan(at * sii::kWordBytes);
        std::copy_n(rest.begin(), std::min(rest.size(), header.size()), header.begin());
        const auto place = chain.step(header);
        if (place && !read_to(place->word + place->words)) return out;
    }
    return out;
}

std::string image_fault(Bytes image) {
    if (image.size() % sii::kWordBytes != 0)
        return counted(image.size(), "octet is", "octets are") + " not a whole number of words";
    for (const auto& finding : sii_findings(image)) {
        switch (finding.fault) {
            case sii::Fault::blank:
            case sii::Fault::truncated:
            case sii::Fault::no_end:
            case sii::Fault::category_past_end:
            case sii::Fault::category_overlap:
            case sii::Fault::checksum: return finding_text(finding);
            case sii::Fault::size_mismatch:  // a short file is usual: it leaves out the unused rest of the EEPROM
                if (finding.actual < image.size()) return finding_text(finding);
                break;
            default: break;
        }
    }
    return {};
}

namespace {

// Writes an image step by step. When a step fails, all steps are undone, so that the slave keeps its old content.
class ImageWriter {
  public:
    ImageWriter(Eeprom& eeprom, Bytes image, const Progress& progress)
        : eeprom_(eeprom), image_(image), progress_(progress) {}

    WriteReport run() {
        report_.words = image_.size() / sii::kWordBytes;
        auto before = read_eeprom(eeprom_, image_.size(), progress_);
        if (!before.error.empty()) return failed(std::move(before.error));
        before_ = std::move(before.octets);
        plan();
        if (!write_all()) {
            if (!refused_) restore();
            return std::move(report_);
        }
        auto error = report_.different != 0 ? eeprom_.keep() : std::string();
        if (!error.empty()) return failed(std::move(error));
        verify();
        return std::move(report_);
    }

  private:
    struct Step {
        std::uint32_t word = 0;
        std::uint16_t before = 0;
        std::uint16_t after = 0;
    };

    WriteReport failed(std::string error) {
        report_.error = std::move(error);
        return std::move(report_);
    }

    // Plans a step for each word that differs. The configuration area is last, in an order that can stop at any word
    // (plan_area()).
    void plan() {
        const bool has_area = image_.size() >= sii::kConfigurationBytes;
        for (std::size_t word = has_area ? sii::word::kIdentity : 0; word < report_.words; ++word)
            if (word_of(before_, word) != word_of(image_, word))
                steps_.push_back({static_cast<std::uint32_t>(word), word_of(before_, word), word_of(image_, word)});
        report_.different = steps_.size();
        if (!has_area) return;
        for (std::size_t word = 0; word < sii::word::kIdentity; ++word)
            report_.different += word_of(before_, word) != word_of(image_, word);
        const auto area = sii::plan_area(before_, image_);
        for (const auto& write : area.writes()) steps_.push_back({write.word, write.before, write.after});
    }

    // Writes neighbouring words together, a few at a time.
    bool write_all() {
        while (done_ < steps_.size()) {
            if (!progress_("writing", done_, steps_.size())) {
                report_.error = "stopped";
                return false;
            }
            std::vector<std::byte> run;
            auto end = done_;
            do {
                run.push_back(static_cast<std::byte>(steps_[end].after & 0xFF));
                run.push_back(static_cast<std::byte>(steps_[end].after >> 8));
                ++end;
            } while (end < steps_.size() && end - done_ < kWriteWords && steps_[end].word == steps_[end - 1].word + 1);
            auto written = eeprom_.write(steps_[done_].word, run);
            done_ += written.words;
            report_.written = std::min(done_, report_.different);
            refused_ = written.refused && done_ == 0;
            if (refused_) {
                report_.error = written.error;
                return false;
            }
            if (!written.error.empty()) {
                report_.error = fmt::format("it is uncertain whether word 0x{:04x} was written: {}", steps_[done_].word,
                                            written.error);
                ++done_;  // it is unknown whether the word of the failed step was written
                return false;
            }
        }
        return true;
    }

    // Undoes the steps, the last step first. After a word that fails it continues with the next word. After three
    // failures in a row it stops, because the EEPROM cannot be reached.
    void restore() {
        constexpr int kMostFailures = 3;
        const auto total = done_;
        int failures = 0;
        for (auto n = total; n-- > 0 && failures < kMostFailures;) {
            (void)progress_("restoring", total - 1 - n, total);
            const std::array octets{static_cast<std::byte>(steps_[n].before & 0xFF),
                                    static_cast<std::byte>(steps_[n].before >> 8)};
            failures = eeprom_.write(steps_[n].word, octets).error.empty() ? 0 : failures + 1;
        }
        tell_what_is_left();
    }

    void tell_what_is_left() {
        const auto back = read_eeprom(eeprom_, image_.size(), no_progress());
        if (!back.error.empty()) {
            report_.left = fmt::format(
                "the present content could not be read: {}; write the EEPROM again before the slave is used",
                back.error);
            return;
        }
        std::size_t changed = 0;
        std::size_t first = 0;
        for (std::size_t word = report_.words; word-- > 0;) {
            if (word_of(back.octets, word) == word_of(before_, word)) continue;
            ++changed;
            first = word;
        }
        report_.restored = changed == 0;
        if (report_.restored) {
            report_.left = "the old content was restored";
            return;
        }
        report_.left = fmt::format("{} from the old content, the first is word 0x{:04x}",
                                   counted(changed, "word differs", "words differ"), first);
        if (back.octets.size() >= sii::kConfigurationBytes)
            report_.left += sii::checksum_right(back.octets)
                                ? "; the checksum of words 0x00 to 0x06 is right"
                                : "; the checksum of words 0x00 to 0x06 is wrong: the slave does not load them";
        report_.left += "; write the EEPROM again before the slave is used";
    }

    void verify() {
        const auto verifying = [this](std::string_view, std::size_t done, std::size_t total) {
            return progress_("verifying", done, total);
        };
        const auto back = read_eeprom(eeprom_, image_.size(), verifying);
        if (!back.error.empty()) {
            report_.error = fmt::format("could not be verified: {}", back.error);
            report_.left = "each word was read back when it was written";
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
                fmt::format(" ({} of {} words are wrong; the EEPROM is probably smaller than its size word says)",
                            wrong, report_.words);
            restore();
            const auto kept = eeprom_.keep();
            if (!kept.empty()) report_.left = kept;
            return;
        }
        report_.verified = true;
    }

    Eeprom& eeprom_;
    Bytes image_;
    const Progress& progress_;
    std::vector<std::byte> before_;
    std::vector<Step> steps_;
    bool refused_ = false;  // before the first word
    std::size_t done_ = 0;  // number of finished steps; the result of the last step may be unknown
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
        report.error = fmt::format("the EEPROM of {} is blank: write a complete image before the alias", eeprom.name());
    else if (!force && !sii::checksum_right(area.octets))
        report.error = fmt::format(
            "the checksum of words 0x00 to 0x06 is 0x{:02x}, the correct one is 0x{:02x}; --force writes the "
            "alias and corrects the checksum",
            sii::load_configuration(area.octets).checksum & 0xFF, sii::checksum(area.octets));
    if (!report.error.empty()) return report;

    auto wanted = area.octets;
    store_le(wanted, sii::word::kAlias * sii::kWordBytes, alias);
    wanted[sii::word::kChecksum * sii::kWordBytes] = static_cast<std::byte>(sii::checksum(wanted));
    const auto written = write_eeprom(eeprom, wanted, no_progress());
    report.error = written.error;
    if (!written.left.empty()) report.error += "\n" + written.left;
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
