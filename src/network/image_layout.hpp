// The layout of a group's process data: computes from the process data of each slave its place in the image, its
// logical addresses, its FMMUs and its SyncManagers. Pure functions of the slave table; no bus access.
//
// The image consists of the outputs of all slaves, then the inputs of all slaves, each in the order of the ring, then,
// from a new octet on, the mailbox status bits. The logical addresses follow the image. In an overlapped layout outputs
// and inputs start at the same logical address, slave by slave, and both halves of the image have the length of the
// longer one.
#pragma once

#include "wire/fmmu.hpp"
#include "wire/sync_manager.hpp"

#include <margay/configuration.hpp>
#include <margay/result.hpp>
#include <margay/slave.hpp>

#include <array>
#include <span>

namespace margay {

struct ImageLayout {
    LogicalAddress start;
    Packing packing = Packing::bytes;
    bool overlapped = false;
    std::uint32_t output_bytes = 0;
    std::uint32_t input_bytes = 0;   // mailbox status bits included
    std::uint32_t status_bytes = 0;  // of them, the last ones: mailbox status bits

    [[nodiscard]] std::uint32_t image_bytes() const { return output_bytes + input_bytes; }
    // Octets of logical address space.
    [[nodiscard]] std::uint32_t logical_bytes() const { return overlapped ? input_bytes : image_bytes(); }
    // Difference in octets between an offset in the image and the offset in logical address space, for inputs.
    [[nodiscard]] std::uint32_t input_shift_bytes() const { return overlapped ? output_bytes : 0; }
};

// Checks the process data that was found for a slave. SyncManagers that the slave itself describes and cannot have are
// forgotten. Errors, with the slave: sm_shortage, sm_memory, invalid_argument (a SyncManager is listed twice).
[[nodiscard]] Result<> check_found(Slave& slave);

// Assigns every slave of the group its place in `image`: fills slave.image. A slave whose process data failed is not
// checked, because it does not exchange. On an error no slave of the group has a place. Errors, with the slave:
// image_too_large, and the errors of check_found().
[[nodiscard]] Result<ImageLayout> lay_out(std::span<Slave> slaves, std::uint8_t group, const GroupConfiguration& wanted,
                                          std::span<std::byte> image);

// The FMMUs of one slave, by their number in the ESC; unused ones are inactive.
struct SlaveFmmus {
    static constexpr std::size_t kMost = 16;
    std::array<wire::Fmmu, kMost> at{};
    std::uint8_t count = 0;  // number of active FMMUs
};

// Whether the application has not changed what decides about the slave's place (the SyncManagers, their directions and
// sizes) since the mapping. Changes take effect with the next mapping.
[[nodiscard]] bool is_as_mapped(const Slave& slave);

// The logical addresses that the slave reads and writes, by its place in the image alone. For working counters: as
// FMMUs without physical address.
[[nodiscard]] SlaveFmmus exchanged_ranges(const Slave& slave, const ImageLayout& layout);

// Each FMMU gets the use that the SII describes for it, where possible. A slave without process data has no FMMU.
// Errors: fmmu_shortage, remapping_needed (see is_as_mapped()).
[[nodiscard]] Result<SlaveFmmus> make_fmmus(const Slave& slave, const ImageLayout& layout);

// Checks whether a slave that was absent during lay_out() can use the place that was reserved for it; `lrw`: its group
// exchanges by LRW. Errors: sm_shortage, sm_memory, unsupported (FMMUs of single bits, LRW).
[[nodiscard]] Result<> check_place(const Slave& slave, const ImageLayout& layout, bool lrw);

// The register values of a process data SyncManager: length in whole octets, enabled unless the length is 0.
[[nodiscard]] wire::SyncManager make_sync_manager(const ProcessSm& sm);

// Offset of a SyncManager's data in the image, in bits; `n` is the index in slave.config.sms.
[[nodiscard]] std::uint32_t sm_offset_bits(const Slave& slave, Packing packing, std::size_t n);

}  // namespace margay
