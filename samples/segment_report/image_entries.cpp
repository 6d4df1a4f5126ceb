#include "segment_report/image_entries.hpp"

#include "common/dictionary_report.hpp"

#include <algorithm>
#include <limits>

namespace margay::segment_report {
namespace {

// Bits of the image from `bit`, as octets.
Octets bits_of(const Octets& image, std::uint64_t bit, std::uint32_t bits) {
    Octets value((bits + 7U) / 8U);
    for (std::uint32_t n = 0; n < bits; ++n) {
        const auto at = bit + n;
        if ((std::to_integer<unsigned>(image[at / 8]) >> (at % 8) & 1U) != 0)
            value[n / 8] |= static_cast<std::byte>(1U << (n % 8));
    }
    return value;
}

const SyncManagerFacts* sync_manager_of(const Report& report, const ethercat::FmmuFacts& fmmu) {
    for (const SlaveState& slave : report.slaves)
        if (slave.facts.position == fmmu.position)
            for (const SyncManagerFacts& sm : slave.sync_managers)
                if (sm.number == fmmu.sync_manager) return &sm;
    return nullptr;
}

class Placer {
  public:
    Placer(const DomainFacts& domain, std::vector<ImageEntry>& all) : domain_(domain), all_(all) {}

    void place(const ethercat::FmmuFacts& fmmu, const SyncManagerFacts* sm) {
        const std::uint64_t begin = (std::uint64_t{fmmu.logical} - domain_.base) * 8 + fmmu.start_bit;
        std::uint32_t at = 0;  // in the SyncManager
        const std::uint32_t end = fmmu.offset_bits + fmmu.bits;
        if (sm != nullptr)
            for (const auto& pdo : sm->pdos)
                for (const auto& entry : pdo.entries) {
                    if (at >= fmmu.offset_bits && at < end)
                        add(fmmu, begin + at - fmmu.offset_bits,
                            {.pdo = pdo.index,
                             .index = entry.index,
                             .subindex = entry.subindex,
                             .bits = entry.bits,
                             .pdo_name = pdo.name,
                             .name = entry.name,
                             .data_type = entry.data_type});
                    at += entry.bits;
                }
        const std::uint32_t known = std::max(at, fmmu.offset_bits);
        if (known >= end || end - known < 8) return;  // up to seven bits fill the last octet
        add(fmmu, begin + known - fmmu.offset_bits, {.bits = end - known, .name = "not described by a PDO"});
    }

  private:
    void add(const ethercat::FmmuFacts& fmmu, std::uint64_t bit, ImageEntry entry) {
        if (bit > std::numeric_limits<std::uint32_t>::max()) return;
        entry.bit = static_cast<std::uint32_t>(bit);
        entry.position = fmmu.position;
        entry.sync_manager = fmmu.sync_manager;
        entry.input = fmmu.input;
        if (entry.bits != 0 && (bit + entry.bits + 7) / 8 <= domain_.data.size() &&
            (entry.index != 0 || entry.pdo == 0))
            entry.value = samples::value_text(entry.data_type, bits_of(domain_.data, bit, entry.bits));
        all_.push_back(std::move(entry));
    }

    const DomainFacts& domain_;
    std::vector<ImageEntry>& all_;
};

}  // namespace

std::vector<ImageEntry> image_entries(const Report& report, const DomainFacts& domain) {
    std::vector<ImageEntry> all;
    Placer placer(domain, all);
    for (const auto& fmmu : domain.fmmus)
        if (fmmu.logical >= domain.base) placer.place(fmmu, sync_manager_of(report, fmmu));
    std::ranges::stable_sort(all, {}, &ImageEntry::bit);
    return all;
}

}  // namespace margay::segment_report
