#include "network/image_layout.hpp"

#include "network/pdo_lists.hpp"
#include "util/check_value.hpp"

#include <algorithm>

namespace margay {

struct SlaveImageAccess {
    static auto& mapped_check(auto& image) { return image.mapped_check_; }
};

namespace {

constexpr std::uint64_t kMostImageBits = 0xFFFF'FFF8;
constexpr std::uint8_t kMailboxFullBit = 3;           // of the status octet of a SyncManager
constexpr std::uint16_t kFirstProcessOctet = 0x0F00;  // digital outputs; registers are below

constexpr std::uint64_t up_to_octet(std::uint64_t bits) { return (bits + 7) & ~std::uint64_t{7}; }

Error fault(Errc code, const Slave& slave, std::uint16_t index = 0) {
    return {.code = code, .step = Step::map_process_data, .slave = slave.number, .index = index};
}

// Whether an FMMU of this slave can start and end in the middle of an octet.
bool maps_bits(const Slave& slave) { return (slave.dl.features & wire::features::kFmmuBitOperationNotSupported) == 0; }

// Whether the slave's data occupies whole octets.
bool whole_octets(const Slave& slave, Packing packing) { return packing == Packing::bytes || !maps_bits(slave); }

std::span<const ProcessSm> process_sms(const Slave& slave) { return slave.config.used_sms(); }

bool wants_mailbox_status(const Slave& slave) { return slave.config.mailbox_status && slave.mailbox.present(); }

// Visits the SyncManagers of one direction, the first of them at bit `at`: visit(sm, its first bit). Returns the end of
// the last one in bits. In an ESC only one FMMU of a direction may map an octet, so the second SyncManager of a slave
// always starts at a new octet.
template <class Visit>
std::uint64_t walk(const Slave& slave, Packing packing, Direction direction, std::uint64_t at, Visit visit) {
    bool first = true;
    for (const ProcessSm& sm : process_sms(slave)) {
        if (sm.direction != direction || sm.bits == 0) continue;
        if (!first || sm.bits >= 8 || whole_octets(slave, packing)) at = up_to_octet(at);
        visit(sm, at);
        at += sm.bits;
        first = false;
    }
    return whole_octets(slave, packing) ? up_to_octet(at) : at;
}

// First bit and end of a slave's data in one direction, if the data of the previous slave ends at `at`.
struct Extent {
    std::uint64_t begin = 0;
    std::uint64_t end = 0;
    [[nodiscard]] bool empty() const { return begin == end; }
};
Extent extent(const Slave& slave, Packing packing, Direction direction, std::uint64_t at) {
    bool any = false;
    Extent e;
    e.end = walk(slave, packing, direction, at, [&](const ProcessSm&, std::uint64_t bit) {
        if (!any) e.begin = bit;
        any = true;
    });
    return any ? e : Extent{};
}

// Whether the resources of the ESC are unknown: the slave was not read yet, or another slave is at its place.
bool not_asked(const Slave& slave) { return slave.place_kept || slave.held; }

bool lies_on(const ProcessSm& sm, std::uint32_t start, std::uint32_t bytes) {
    return sm.start < start + bytes && start < sm.start + sm.bytes();
}

bool lies_on_mailbox(const ProcessSm& sm, const MailboxInfo& mailbox) {
    return mailbox.present() &&
           (lies_on(sm, mailbox.out_start, mailbox.out_bytes) || lies_on(sm, mailbox.in_start, mailbox.in_bytes));
}

Result<> check_sync_managers(const Slave& slave) {
    if (not_asked(slave)) return Result<>();
    const auto sms = process_sms(slave);
    const std::uint32_t memory_end =
        slave.dl.ram_kib == 0 ? 0x10000U : std::min(0x10000U, 0x1000U + slave.dl.ram_kib * 1024U);
    for (const ProcessSm& sm : sms) {
        Error error = fault(Errc::sm_shortage, slave, wire::reg::sync_manager(sm.number).address);
        error.expected = sm.number + 1U;
        error.actual = slave.dl.sync_managers;
        if (sm.number >= slave.dl.sync_managers) return error;
        error = fault(Errc::sm_memory, slave, error.index);
        error.expected = sm.start + sm.bytes();
        error.actual = memory_end;
        if (sm.bits > 0 && (sm.start < kFirstProcessOctet || error.expected > memory_end)) return error;
        for (const ProcessSm& other : sms.first(static_cast<std::size_t>(&sm - sms.data()))) {
            if (other.number == sm.number) {
                error.code = Errc::invalid_argument;
                error.detail = static_cast<std::uint32_t>(Argument::sync_manager_twice);
                return error;
            }
            if (sm.bits > 0 && other.bits > 0 && lies_on(sm, other.start, other.bytes())) return error;
        }
        if (sm.bits > 0 && lies_on_mailbox(sm, slave.mailbox)) return error;
    }
    return Result<>();
}

// A check value of the SyncManagers with their directions and sizes, and of the PDOs and entries in the lists of the
// application.
std::uint16_t check_of_process_data(const Slave& slave) {
    CheckValue check;
    for (const ProcessSm& sm : process_sms(slave)) {
        if (sm.bits == 0) continue;
        check.add(sm.number);
        check.add(static_cast<unsigned>(sm.direction));
        check.add_word(sm.bits);
    }
    if (const detail::PdoPart* lists = pdo_part(slave)) lists->add_to(check, slave);
    return check.folded();
}

// Places one slave after the other, then the mailbox status bits. Used twice: the first pass measures the outputs.
class Layer {
  public:
    Layer(const GroupConfiguration& wanted, std::uint64_t inputs_at)
        : wanted_(wanted), inputs_base_(inputs_at), inputs_at_(inputs_at) {}

    [[nodiscard]] std::uint64_t outputs_end() const { return outputs_at_; }
    [[nodiscard]] std::uint64_t inputs_end() const { return inputs_at_; }

    struct Place {
        Extent outputs;
        Extent inputs;
    };
    Place place(const Slave& slave) {
        Place p;
        const ImagePlace fixed = slave.config.place();
        const bool next = fixed.outputs_bit == ImagePlace::kNext && fixed.inputs_bit == ImagePlace::kNext;
        if (wanted_.overlapped && next) {
            // Outputs and inputs start at the same bit of their halves, also of the next slave.
            const std::uint64_t shift = inputs_at_ - outputs_at_;
            const auto outputs = extent(slave, wanted_.packing, Direction::outputs, outputs_at_);
            const auto inputs = extent(slave, wanted_.packing, Direction::inputs, outputs_at_);
            const std::uint64_t begin =
                std::max(outputs.empty() ? outputs_at_ : outputs.begin, inputs.empty() ? outputs_at_ : inputs.begin);
            p.outputs = extent(slave, wanted_.packing, Direction::outputs, begin);
            p.inputs = extent(slave, wanted_.packing, Direction::inputs, begin + shift);
        } else {
            p.outputs = place_one(slave, Direction::outputs, fixed.outputs_bit, 0, outputs_at_);
            p.inputs = place_one(slave, Direction::inputs, fixed.inputs_bit, inputs_base_, inputs_at_);
        }
        // Slaves with places of their own need not be in the order of the image.
        outputs_at_ = std::max(outputs_at_, p.outputs.end);
        inputs_at_ = std::max(inputs_at_, p.inputs.end);
        if (wanted_.overlapped) {
            outputs_at_ = std::max(outputs_at_, inputs_at_ - inputs_base_);
            inputs_at_ = outputs_at_ + inputs_base_;
        }
        return p;
    }
    // Places the bit that reports mail of the slave.
    std::uint64_t place_mailbox_status(const Slave& slave) {
        if (!status_) inputs_at_ = up_to_octet(inputs_at_);
        status_ = true;
        if (maps_bits(slave)) return inputs_at_++;
        inputs_at_ = up_to_octet(inputs_at_) + 8;
        return inputs_at_ - 8 + kMailboxFullBit;
    }

  private:
    // Data without a place of its own follows the data before it.
    [[gnu::noinline]] Extent place_one(const Slave& slave, Direction direction, std::uint32_t bit, std::uint64_t base,
                                       std::uint64_t next) const {
        return extent(slave, wanted_.packing, direction, bit == ImagePlace::kNext ? next : base + bit);
    }

    const GroupConfiguration& wanted_;
    std::uint64_t inputs_base_;
    std::uint64_t outputs_at_ = 0;
    std::uint64_t inputs_at_;
    bool status_ = false;
};

ImagePart part(const Extent& extent, std::span<std::byte> image) {
    if (extent.empty()) return {};
    const auto first = static_cast<std::size_t>(extent.begin / 8);
    const auto end = static_cast<std::size_t>(up_to_octet(extent.end) / 8);
    return {static_cast<std::uint32_t>(extent.begin), static_cast<std::uint32_t>(extent.end - extent.begin),
            image.subspan(first, end - first)};
}

// The two halves of the image in bits, measured by a first pass over the slaves.
struct Halves {
    Extent outputs;
    Extent inputs;
    std::uint64_t status_bits = 0;  // the last bits of the inputs: mailbox status
};
Halves measure(std::span<Slave> slaves, std::uint8_t group, const GroupConfiguration& wanted) {
    Layer layer(wanted, 0);
    for (Slave& slave : slaves)
        if (slave.image.group == group) (void)layer.place(slave);
    const std::uint64_t outputs = up_to_octet(layer.outputs_end());
    const std::uint64_t inputs = up_to_octet(layer.inputs_end());
    for (Slave& slave : slaves)
        if (slave.image.group == group && wants_mailbox_status(slave)) (void)layer.place_mailbox_status(slave);
    const std::uint64_t with_status = up_to_octet(layer.inputs_end());
    return {{0, outputs}, {outputs, outputs + with_status}, with_status - inputs};
}

// Whether data that was placed from outside is somewhere else, or shares bits with the data of another slave.
[[gnu::noinline]] bool is_misplaced(std::span<const Slave> slaves, const Slave& slave, ImagePart SlaveImage::*which,
                                    std::uint32_t wanted, std::uint32_t base) {
    const ImagePart& part = slave.image.*which;
    if (wanted == ImagePlace::kNext || part.bits == 0) return false;
    if (part.offset_bits != base + wanted) return true;
    return std::ranges::any_of(slaves, [&](const Slave& other) {
        const ImagePart& there = other.image.*which;
        return &other != &slave && other.image.group == slave.image.group && there.bits != 0 &&
               part.offset_bits < there.offset_bits + there.bits && there.offset_bits < part.offset_bits + part.bits;
    });
}

// Checks the places that were set from outside.
Result<> check_places(std::span<const Slave> slaves, std::uint8_t group, const Halves& halves) {
    const auto inputs = static_cast<std::uint32_t>(halves.inputs.begin);
    for (const Slave& slave : slaves) {
        if (slave.image.group != group) continue;
        const ImagePlace fixed = slave.config.place();
        if (!is_misplaced(slaves, slave, &SlaveImage::outputs, fixed.outputs_bit, 0) &&
            !is_misplaced(slaves, slave, &SlaveImage::inputs, fixed.inputs_bit, inputs))
            continue;
        Error error = fault(Errc::invalid_argument, slave);
        error.detail = static_cast<std::uint32_t>(Argument::image_place);
        return error;
    }
    return Result<>();
}

Result<> place_all(std::span<Slave> slaves, std::uint8_t group, const GroupConfiguration& wanted,
                   std::span<std::byte> image, const Halves& halves) {
    const std::uint64_t room = std::min<std::uint64_t>(std::uint64_t{image.size()} * 8, kMostImageBits);
    const auto too_large = [&] {
        Error error{.code = Errc::image_too_large, .step = Step::map_process_data};
        error.expected = static_cast<std::uint32_t>(std::min<std::uint64_t>(halves.inputs.end / 8, 0xFFFF'FFFF));
        error.actual = static_cast<std::uint32_t>(room / 8);
        return error;
    };
    Layer layer(wanted, halves.inputs.begin);
    for (Slave& slave : slaves) {
        if (slave.image.group != group) continue;
        const auto place = layer.place(slave);
        if (std::max(place.outputs.end, place.inputs.end) > room) return too_large();
        slave.image.outputs = part(place.outputs, image);
        slave.image.inputs = part(place.inputs, image);
        SlaveImageAccess::mapped_check(slave.image) = check_of_process_data(slave);
    }
    for (Slave& slave : slaves) {
        if (slave.image.group != group || !wants_mailbox_status(slave)) continue;
        const std::uint64_t bit = layer.place_mailbox_status(slave);
        if (bit >= room) return too_large();
        slave.image.mailbox_status_bit = static_cast<std::uint32_t>(bit);
    }
    return Result<>();
}

// Collects the FMMUs that a slave needs. Two that are adjacent in both address spaces are merged.
class FmmuList {
  public:
    struct Entry {
        FmmuUse use = FmmuUse::unused;
        std::uint64_t begin_bits = 0;  // in logical address space
        std::uint64_t end_bits = 0;
        std::uint16_t physical = 0;
        std::uint8_t physical_bit = 0;
    };
    void add(const Entry& entry) {
        if (count_ > 0) {
            Entry& last = entries_[count_ - 1];
            const std::uint64_t length = last.end_bits - last.begin_bits;
            if (last.use == entry.use && last.end_bits == entry.begin_bits && length % 8 == 0 &&
                last.physical + length / 8 == entry.physical) {
                last.end_bits = entry.end_bits;
                return;
            }
        }
        entries_[count_++] = entry;
    }
    [[nodiscard]] std::span<const Entry> entries() const { return std::span(entries_).first(count_); }

  private:
    std::array<Entry, SlaveConfiguration::kProcessSms + 1> entries_{};
    std::size_t count_ = 0;
};

wire::Fmmu to_fmmu(const FmmuList::Entry& e, LogicalAddress start) {
    const auto first = static_cast<std::uint32_t>(e.begin_bits / 8);
    const auto last = static_cast<std::uint32_t>((e.end_bits - 1) / 8);
    return {.logical_start = {start.value + first},
            .length_bytes = static_cast<std::uint16_t>(last - first + 1),
            .logical_start_bit = static_cast<std::uint8_t>(e.begin_bits % 8),
            .logical_end_bit = static_cast<std::uint8_t>((e.end_bits - 1) % 8),
            .physical_start = e.physical,
            .physical_start_bit = e.physical_bit,
            .read = e.use != FmmuUse::outputs,
            .write = e.use == FmmuUse::outputs,
            .active = true};
}

FmmuList needed_fmmus(const Slave& slave, const ImageLayout& layout) {
    FmmuList list;
    const bool octets = whole_octets(slave, layout.packing);
    const std::uint64_t input_shift = std::uint64_t{layout.input_shift_bytes()} * 8;
    for (const Direction direction : {Direction::outputs, Direction::inputs}) {
        const bool out = direction == Direction::outputs;
        const ImagePart& p = out ? slave.image.outputs : slave.image.inputs;
        walk(slave, layout.packing, direction, p.offset_bits, [&](const ProcessSm& sm, std::uint64_t bit) {
            const std::uint64_t begin = bit - (out ? 0 : input_shift);
            list.add({out ? FmmuUse::outputs : FmmuUse::inputs, begin,
                      octets ? up_to_octet(begin + sm.bits) : begin + sm.bits, sm.start, 0});
        });
    }
    if (slave.image.mailbox_status_bit != SlaveImage::kNone) {
        const std::uint64_t bit = slave.image.mailbox_status_bit - input_shift;
        const bool alone = maps_bits(slave);
        constexpr auto kStatus =
            static_cast<std::uint16_t>(wire::reg::sync_manager(1).address + wire::SyncManagerLayout::status::offset);
        list.add(alone ? FmmuList::Entry{FmmuUse::mailbox_status, bit, bit + 1, kStatus, kMailboxFullBit}
                       : FmmuList::Entry{FmmuUse::mailbox_status, bit / 8 * 8, bit / 8 * 8 + 8, kStatus, 0});
    }
    return list;
}

// Selects the number of the FMMU for a use: one that the SII describes for it, otherwise one that the SII describes as
// unused, otherwise any.
std::size_t pick(const Slave& slave, const SlaveFmmus& taken, std::size_t available, FmmuUse use) {
    const auto described = [&](std::size_t n) { return n < slave.fmmu_count ? slave.fmmu_use[n] : FmmuUse::unused; };
    for (const FmmuUse wanted : {use, FmmuUse::unused})
        for (std::size_t n = 0; n < available; ++n)
            if (!taken.at[n].active && described(n) == wanted) return n;
    std::size_t n = 0;
    while (taken.at[n].active) ++n;
    return n;
}

// Builds the FMMUs directly in the result, because a second copy would need the most stack of all objects here.
Result<SlaveFmmus> number_fmmus(const Slave& slave, const FmmuList& list, std::size_t available, LogicalAddress start) {
    Result<SlaveFmmus> fmmus;
    for (const auto& entry : list.entries())
        fmmus->at[pick(slave, *fmmus, available, entry.use)] = to_fmmu(entry, start);
    fmmus->count = static_cast<std::uint8_t>(list.entries().size());
    return fmmus;
}

}  // namespace

Result<> check_found(Slave& slave) {
    const auto checked = check_sync_managers(slave);
    if (!checked) forget_described(slave);
    return checked;
}

Result<ImageLayout> lay_out(std::span<Slave> slaves, std::uint8_t group, const GroupConfiguration& wanted,
                            std::span<std::byte> image) {
    Result<> done;
    for (Slave& slave : slaves) {
        if (slave.config.group != group) continue;
        slave.image = {};
        slave.image.group = group;
        if (done && !slave.pdos_failed) done = check_sync_managers(slave);
    }
    const auto halves = measure(slaves, group, wanted);
    if (done) done = place_all(slaves, group, wanted, image, halves);
    if (done) done = check_places(slaves, group, halves);
    if (!done) {
        for (Slave& slave : slaves)
            if (slave.image.group == group) slave.image = {};
        return done.error();
    }
    return ImageLayout{.start = wanted.start,
                       .packing = wanted.packing,
                       .overlapped = wanted.overlapped,
                       .output_bytes = static_cast<std::uint32_t>(halves.outputs.end / 8),
                       .input_bytes = static_cast<std::uint32_t>((halves.inputs.end - halves.inputs.begin) / 8),
                       .status_bytes = static_cast<std::uint32_t>(halves.status_bits / 8)};
}

bool is_as_mapped(const Slave& slave) {
    return SlaveImageAccess::mapped_check(slave.image) == check_of_process_data(slave);
}

SlaveFmmus exchanged_ranges(const Slave& slave, const ImageLayout& layout) {
    SlaveFmmus ranges;
    const SlaveImage& image = slave.image;
    const std::uint64_t shift = std::uint64_t{layout.input_shift_bytes()} * 8;
    const auto add = [&](FmmuUse use, std::uint64_t begin, std::uint64_t bits) {
        if (bits != 0) ranges.at[ranges.count++] = to_fmmu({use, begin, begin + bits, 0, 0}, layout.start);
    };
    add(FmmuUse::outputs, image.outputs.offset_bits, image.outputs.bits);
    add(FmmuUse::inputs, image.inputs.offset_bits - (image.inputs.bits != 0 ? shift : 0), image.inputs.bits);
    const std::uint32_t status = image.mailbox_status_bit;
    if (status != SlaveImage::kNone) add(FmmuUse::mailbox_status, status - shift, 1);
    return ranges;
}

Result<SlaveFmmus> make_fmmus(const Slave& slave, const ImageLayout& layout) {
    if (!is_as_mapped(slave)) return fault(Errc::remapping_needed, slave);
    const FmmuList list = needed_fmmus(slave, layout);
    const std::size_t available =
        not_asked(slave) ? SlaveFmmus::kMost : std::min<std::size_t>(slave.dl.fmmus, SlaveFmmus::kMost);
    if (list.entries().size() <= available) return number_fmmus(slave, list, available, layout.start);
    Error error = fault(Errc::fmmu_shortage, slave);
    error.expected = static_cast<std::uint32_t>(list.entries().size());
    error.actual = static_cast<std::uint32_t>(available);
    return error;
}

Result<> check_place(const Slave& slave, const ImageLayout& layout, bool lrw) {
    const bool no_bits = layout.packing == Packing::bits && !maps_bits(slave);
    const bool no_lrw = lrw && (slave.dl.features & wire::features::kLrwNotSupported) != 0;
    const bool exchanges = slave.image.outputs.bits != 0 || slave.image.inputs.bits != 0;
    if (exchanges && (no_bits || no_lrw)) return fault(Errc::unsupported, slave);
    return check_sync_managers(slave);
}

wire::SyncManager make_sync_manager(const ProcessSm& sm) {
    return {.physical_start = sm.start,
            .length_bytes = static_cast<std::uint16_t>(sm.bytes()),
            .control = sm.control,
            .activate = sm.bits == 0 ? std::uint8_t{0} : wire::sm_activate::kEnable};
}

std::uint32_t sm_offset_bits(const Slave& slave, Packing packing, std::size_t n) {
    const ProcessSm& wanted = slave.config.sms[n];
    const ImagePart& p = wanted.direction == Direction::outputs ? slave.image.outputs : slave.image.inputs;
    std::uint64_t found = p.offset_bits;
    walk(slave, packing, wanted.direction, p.offset_bits, [&](const ProcessSm& sm, std::uint64_t bit) {
        if (&sm == &wanted) found = bit;
    });
    return static_cast<std::uint32_t>(found);
}

}  // namespace margay
