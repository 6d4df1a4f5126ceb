// Where the process data of a group lies: from what each slave shall exchange to its place in the image, its logical
// addresses, its FMMUs and its SyncManagers. Pure functions of the slave table; no bus.
//
// The image is the outputs of all slaves followed by the inputs of all slaves, each in the order of the ring, and
// behind them, from an octet of their own on, the mailbox status bits. Its logical addresses follow the image;
// overlapped, outputs and inputs begin at the same logical address, slave by slave, and both halves of the image are as
// long as the longer of the two needs.
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
    // What an offset into the inputs' half of the image, in octets, is more than its offset in logical address space.
    [[nodiscard]] std::uint32_t input_shift_bytes() const { return overlapped ? output_bytes : 0; }
};

// Gives every slave of the group its place in `image`: fills slave.image. On an error nothing is mapped any more.
// Errors, with the slave: image_too_large, sm_shortage, sm_memory, invalid_argument (a SyncManager that is there
// twice).
[[nodiscard]] Result<ImageLayout> lay_out(std::span<Slave> slaves, std::uint8_t group, const GroupConfiguration& wanted,
                                          std::span<std::byte> image);

// The FMMUs of one slave, by their number in the ESC; those not needed are not active.
struct SlaveFmmus {
    static constexpr std::size_t kMost = 16;
    std::array<wire::Fmmu, kMost> at{};
    std::uint8_t count = 0;  // of those that are active
};

// Which FMMU does what follows the SII where it says so. A slave without process data has none. Errors: fmmu_shortage.
[[nodiscard]] Result<SlaveFmmus> make_fmmus(const Slave& slave, const ImageLayout& layout);

// Whether a slave that came after lay_out() can do what was laid out for it without knowing it; `lrw`: its group
// exchanges by LRW. Errors: sm_shortage, sm_memory, unsupported (FMMUs of single bits, LRW).
[[nodiscard]] Result<> check_place(const Slave& slave, const ImageLayout& layout, bool lrw);

// What goes into the registers of a SyncManager for process data: whole octets, and enabled unless it has no length.
[[nodiscard]] wire::SyncManager make_sync_manager(const ProcessSm& sm);

// The first bit of a SyncManager's data in the image; `n` counts slave.config.sms.
[[nodiscard]] std::uint32_t sm_offset_bits(const Slave& slave, Packing packing, std::size_t n);

}  // namespace margay
