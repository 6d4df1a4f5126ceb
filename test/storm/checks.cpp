// Rules for process data: the image contains no input that the slave never had, a device applies no output that the
// application never wrote, and no cycle succeeds when one of its slaves is missing.
#include "storm/world.hpp"

namespace margay::storm {
namespace {

[[nodiscard]] Value bits_of(std::span<const std::byte> image, const ImagePart& part) {
    Value value((part.bits + 7) / 8);
    for (std::uint32_t n = 0; n < part.bits; ++n) {
        const std::uint32_t at = part.offset_bits + n;
        if (at / 8 >= image.size()) break;
        if ((std::to_integer<unsigned>(image[at / 8]) >> (at % 8) & 1) != 0)
            value[n / 8] |= static_cast<std::byte>(1U << (n % 8));
    }
    return value;
}

void set_bits(std::span<std::byte> image, const ImagePart& part, const Value& value) {
    for (std::uint32_t n = 0; n < part.bits; ++n) {
        const std::uint32_t at = part.offset_bits + n;
        if (at / 8 >= image.size()) break;
        const auto bit = static_cast<std::byte>(1U << (at % 8));
        const bool on = (std::to_integer<unsigned>(value[n / 8]) >> (n % 8) & 1) != 0;
        image[at / 8] = on ? image[at / 8] | bit : image[at / 8] & ~bit;
    }
}

// 64 values in rotation, different for each number.
[[nodiscard]] std::byte pattern(std::uint32_t number, std::uint32_t turn, std::size_t octet) {
    Chance chance(number * 1000003ULL + turn % 64 * 101ULL + octet * 7919ULL);
    return static_cast<std::byte>(chance.next());
}

// True when the data of a direction are in one SyncManager. Then the image and the slave have the same octets.
[[nodiscard]] bool in_one_piece(const SlaveConfiguration& config, Direction direction) {
    unsigned count = 0;
    for (unsigned n = 0; n < config.sm_count; ++n)
        if (config.sms[n].direction == direction && config.sms[n].bits != 0) ++count;
    return count == 1;
}

// Returns whether the image of the group contains the slave's data. The configuration can have changed since the
// mapping.
[[nodiscard]] bool carries(const Group& group, const Slave& slave) {
    const auto& bytes = slave.image.inputs.bits != 0 ? slave.image.inputs.bytes : slave.image.outputs.bytes;
    return !bytes.empty() && !group.image.empty() && bytes.data() >= group.image.data() &&
           bytes.data() < group.image.data() + group.image.size();
}

[[nodiscard]] bool zero(const Value& value) {
    return std::ranges::all_of(value, [](std::byte b) { return b == std::byte{0}; });
}

std::string hex(const Value& value) {
    std::string text;
    for (const auto b : value) {
        constexpr char kDigits[] = "0123456789abcdef";
        text += kDigits[std::to_integer<unsigned>(b) >> 4];
        text += kDigits[std::to_integer<unsigned>(b) & 15];
        if (text.size() > 40) return text + "…";
    }
    return text;
}

}  // namespace

void World::look_around() {
    std::fill(reachable_.begin(), reachable_.end(), false);
    for (const auto n : segment_.order()) reachable_[n] = segment_.powered(n);
    for (std::uint32_t n = 0; n < segment_.size(); ++n) station_[n] = segment_.slave(n).station();
}

std::vector<std::uint32_t> World::devices_at(std::uint16_t number) {
    std::vector<std::uint32_t> found;
    const auto address = ctx_->slave(number).station_address.value;
    for (std::uint32_t n = 0; n < station_.size(); ++n)
        if (reachable_[n] && station_[n] == address) found.push_back(n);
    return found;
}

std::string World::place(std::uint16_t number) {
    std::string text = "slave " + std::to_string(number);
    for (const auto n : devices_at(number)) text += ", device " + std::to_string(ids_[n]) + " " + plan_.devices[n].name;
    return text;
}

// The slaves that were reachable when the frames of a cycle passed.
std::string World::there(const Cycle& cycle) const {
    std::string text =
        ", sent at " + std::to_string(std::chrono::duration<double>(cycle.sent.time_since_epoch()).count());
    for (std::uint32_t n = 0; n < cycle.station.size(); ++n)
        text += "; device " + std::to_string(ids_[n]) + (cycle.reachable[n] ? " at " : " away, at ") +
                std::to_string(cycle.station[n]);
    return text;
}

// The working counters of the last cycle of a group, and what the master knows of the slaves of the group.
std::string World::counted(std::uint8_t number) {
    const Group& group = ctx_->group(number);
    std::string text = ", group " + std::to_string(number);
    for (const DatagramStatus& d : group.datagrams)
        text += ": expected " + std::to_string(d.expected) + ", got " + std::to_string(d.got) + ", accepted " +
                std::to_string(d.accepted) + ", full " + std::to_string(d.full);
    for (const Slave& slave : ctx_->slaves()) {
        if (slave.config.group != number) continue;
        text += "; slave " + std::to_string(slave.number) + " " + std::string(to_text(slave.al.state));
        if (slave.takes_part) text += ", takes part";
        if (slave.unplaced) text += ", unplaced";
    }
    return text + story();
}

// Devices show new inputs before each cycle. Drives show their own measurements.
void World::show_inputs() {
    for (std::uint32_t n = 0; n < segment_.size(); ++n) {
        if (!segment_.powered(n) || halted_[n] || plan_.devices[n].name.find("drive") != std::string::npos) continue;
        auto* const program = segment_.slave(n).process_data();
        if (program == nullptr) continue;
        const auto inputs = program->inputs();
        for (std::size_t i = 0; i < inputs.size(); ++i) inputs[i] = pattern(n, counter_, i);
        if (!inputs.empty()) program->poke();
    }
}

void World::set_outputs(std::uint8_t group) {
    SharedImage* const shared = ctx_->group(group).config.shared;
    const auto image = shared != nullptr ? shared->outputs() : ctx_->group(group).image;
    for (const Slave& slave : ctx_->slaves()) {
        const auto& part = slave.image.outputs;
        if (part.bits == 0 || !carries(ctx_->group(group), slave)) continue;
        // Drives get zeros, because their reaction to commands is not tested here.
        const bool quiet = slave.name().find("rive") != std::string_view::npos;
        Value value((part.bits + 7) / 8);
        for (std::size_t i = 0; i < value.size(); ++i)
            value[i] = quiet ? std::byte{0} : pattern(1000U + slave.number, counter_, i);
        set_bits(image, part, value);
    }
    if (shared != nullptr) shared->publish_outputs();
}

// A thread that uses the shared image has the inputs of the last complete cycle, and no other inputs.
void World::check_shared(std::uint8_t group) {
    const Group& of = ctx_->group(group);
    if (of.config.shared == nullptr || !of.mapped || !of.config.shared->refresh_inputs()) return;
    if (!std::ranges::equal(of.config.shared->inputs(), of.image.subspan(of.output_bytes)))
        fail("the shared image has other inputs than the image", "group " + std::to_string(group));
}

void World::check_copies(std::uint8_t group) {
    if (!ctx_->group(group).mapped) return;
    const auto image = ctx_->group(group).image;
    for (const SlaveToSlave& copy : ctx_->group(group).config.copies) {
        // Old inputs are not copied, but the inputs of the last cycle before a loss are still copied.
        if (!ctx_->slave(copy.from_slave).takes_part || !inputs_fresh(*ctx_, copy.from_slave)) continue;
        const auto part = [&](const ImagePart& of, std::uint32_t bit) {
            return bits_of(image, {.offset_bits = of.offset_bits + bit, .bits = copy.bits, .bytes = {}});
        };
        if (part(ctx_->slave(copy.from_slave).image.inputs, copy.from_bit) !=
            part(ctx_->slave(copy.to_slave).image.outputs, copy.to_bit))
            fail("a copy between slaves is not what was received", place(copy.to_slave));
    }
}

void World::note_outputs(std::uint8_t group) {
    const auto image = ctx_->group(group).image;
    for (const Slave& slave : ctx_->slaves()) {
        const auto& part = slave.image.outputs;
        if (part.bits == 0 || !carries(ctx_->group(group), slave)) continue;
        // A device reads the outputs of each SyncManager separately.
        ImagePart piece{.offset_bits = part.offset_bits, .bits = 0, .bytes = {}};
        for (const ProcessSm& sm : slave.config.used_sms()) {
            if (sm.direction != Direction::outputs || sm.bits == 0) continue;
            piece.bits = sm.bits;
            for (const auto n : devices_at(slave.number)) sent_[n][piece.bits].insert(bits_of(image, piece));
            piece.offset_bits += sm.bits;
        }
    }
}

void World::check_inputs(std::uint8_t group, bool right, const Cycle& cycle) {
    if (hostile_ || hostile_registers_ || !ctx_->group(group).mapped) return;
    const auto at = [&](const Slave& slave) {  // devices that had the slave's station address when the cycle passed
        std::vector<std::uint32_t> found;
        for (std::uint32_t n = 0; n < cycle.station.size(); ++n)
            if (cycle.reachable[n] && cycle.station[n] == slave.station_address.value) found.push_back(n);
        return found;
    };
    const auto image = ctx_->group(group).image;
    for (const Slave& slave : ctx_->slaves()) {
        const auto& part = slave.image.inputs;
        const bool wanted = !slave.config.optional && (slave.wanted == nullptr || !slave.wanted->optional) &&
                            slave.config.highest >= AlState::safeop;
        if (!carries(ctx_->group(group), slave)) continue;
        const auto devices = at(slave);
        if (right && wanted && part.bits + slave.image.outputs.bits != 0) {
            if (devices.empty())
                fail("the cycle is right without a slave", place(slave.number) + there(cycle) + counted(group));
            if (slave.number == wrong_) fail("the cycle is right with a wrong slave", place(slave.number));
        }
        if (part.bits == 0 || !in_one_piece(slave.config, Direction::inputs)) continue;
        const Value value = bits_of(image, part);
        if (right && wanted) {
            const auto has_shown = [&](std::uint32_t n) {
                return spies_[n] == nullptr || spies_[n]->has_shown(value, part.bits, cycle.sent);
            };
            Spy* const spy = spies_[devices[0]];
            if (spy != nullptr && std::ranges::none_of(devices, has_shown))
                fail(std::string(cycle.mapping ? "while a group is mapped: " : "") +
                         "an input is delivered as good that the slave did not have",
                     place(slave.number) + ": " + hex(value) + ", it has shown " +
                         (spy->shown().empty() ? "nothing" : hex(spy->shown().back().value)) +
                         ", sending said: " + std::string(to_text(cycle.send_error)));
        } else if (!zero(value)) {
            // Without such a device the image has the last received input, which cannot be checked. The same is true
            // while the slave does not take part, because another device may have its address then.
            const auto before = inputs_.find(slave.number);
            bool known = devices.empty() || (!slave.takes_part && before != inputs_.end() && before->second == value);
            for (std::uint32_t n = 0; n < spies_.size() && !known; ++n)
                known = spies_[n] != nullptr && cycle.station[n] == slave.station_address.value &&
                        spies_[n]->has_ever_shown(value, part.bits);
            bool watched = false;
            for (const auto n : devices) watched = watched || spies_[n] != nullptr;
            if (!known && watched)
                fail("an input is in the image that the slave never had", place(slave.number) + ": " + hex(value));
        }
        inputs_[slave.number] = value;
    }
}

void World::check_outputs() {
    for (std::uint32_t n = 0; n < spies_.size(); ++n) {
        if (spies_[n] == nullptr) continue;
        for (const Value& value : spies_[n]->take_applied()) {
            if (zero(value) || hostile_registers_) continue;
            const bool written = std::ranges::any_of(
                sent_[n], [&](const auto& one) { return one.second.contains(first_bits(value, one.first)); });
            if (!written)
                fail("a slave has outputs that the application did not write",
                     "device " + std::to_string(ids_[n]) + " " + plan_.devices[n].name + ": " + hex(value));
            if (wrong_ != 0 && segment_.slave(n).station() == ctx_->slave(wrong_).station_address.value)
                fail("a wrong slave has outputs", "device " + std::to_string(ids_[n]));
        }
    }
}

}  // namespace margay::storm
