#include "subdevice/stored_values.hpp"

#include "subdevice/application.hpp"

#include <algorithm>
#include <utility>

namespace margay::subdevice {
namespace {

// The head of a block. `layout` is a CRC of the table: values of another table are not loaded.
struct Head {
    using layout = Field<std::uint32_t, 0>;
    using size = Field<std::uint32_t, 4>;
    using values = Field<std::uint32_t, 8>;
    static constexpr std::size_t bytes = 12;
};

// CRC-32 (IEEE 802.3), bit by bit: no table in flash, and these blocks are small.
class Crc {
  public:
    void add(std::byte octet) {
        value_ ^= std::to_integer<std::uint32_t>(octet);
        for (int bit = 0; bit < 8; ++bit) value_ = (value_ >> 1) ^ ((value_ & 1) != 0 ? 0xEDB88320U : 0U);
    }
    void add(Bytes octets) {
        for (const std::byte octet : octets) add(octet);
    }
    void add(std::uint32_t number) {
        for (unsigned n = 0; n < 4; ++n) add(static_cast<std::byte>(number >> (8 * n)));
    }
    [[nodiscard]] std::uint32_t value() const { return ~value_; }

  private:
    std::uint32_t value_ = 0xFFFFFFFF;
};

// Visits the memory of all stored values: visit(object, entry, memory of all its subindices).
template <class Visit>
void for_each_stored(const ObjectDictionary& dictionary, Visit visit) {
    for (const Object& object : dictionary.objects())
        for (const Entry& entry : object.entries)
            if (is_stored(entry))
                visit(object, entry,
                      dictionary.image().subspan(entry.offset, std::size_t{entry.bytes()} * entry.count));
}

std::uint32_t layout_of(const ObjectDictionary& dictionary) {
    Crc crc;
    for_each_stored(dictionary, [&](const Object& object, const Entry& entry, Bytes) {
        crc.add(std::uint32_t{object.index} << 16 | std::uint32_t{entry.subindex} << 8 | entry.count);
        crc.add(entry.bits);
    });
    return crc.value();
}

std::uint32_t checksum_of(Bytes values) {
    Crc crc;
    crc.add(values);
    return crc.value();
}

}  // namespace

bool StoredValues::load() {
    const std::size_t size = stored_bytes(dictionary_.objects());
    if (buffer_.size() < size || store_.load(buffer_) != size) return false;
    const Bytes values = Bytes(buffer_).first(size).subspan(Head::bytes);
    if (Head::size::load(buffer_) != size || Head::layout::load(buffer_) != layout_of(dictionary_) ||
        Head::values::load(buffer_) != checksum_of(values))
        return false;
    std::size_t at = 0;
    for_each_stored(dictionary_, [&](const Object&, const Entry&, MutableBytes memory) {
        std::ranges::copy(values.subspan(at, memory.size()), memory.begin());
        at += memory.size();
    });
    return true;
}

std::uint32_t StoredValues::checksum() {
    const Guard guard(dictionary_.lock());
    Crc crc;
    for_each_stored(dictionary_, [&](const Object&, const Entry&, Bytes memory) { crc.add(memory); });
    return crc.value();
}

void StoredValues::collect() {
    const std::size_t size = stored_bytes(dictionary_.objects());
    {
        const Guard guard(dictionary_.lock());
        std::size_t at = Head::bytes;
        for_each_stored(dictionary_, [&](const Object&, const Entry&, Bytes memory) {
            std::ranges::copy(memory, buffer_.begin() + static_cast<std::ptrdiff_t>(at));
            at += memory.size();
        });
    }
    Head::layout::store(buffer_, layout_of(dictionary_));
    Head::size::store(buffer_, static_cast<std::uint32_t>(size));
    Head::values::store(buffer_, checksum_of(Bytes(buffer_).first(size).subspan(Head::bytes)));
}

HookAnswer StoredValues::save(Time now) {
    const std::size_t size = stored_bytes(dictionary_.objects());
    if (buffer_.size() < size) return Abort::out_of_memory;
    const bool continued = std::exchange(saving_, true);
    if (!continued) collect();
    HookAnswer answer = store_.save(Bytes(buffer_).first(size), now);
    const bool stored = !answer.waits() && answer.abort == Abort::none;
    // The block may be that of an earlier command, whose answer the master did not wait for.
    if (stored && continued && Head::values::load(buffer_) != checksum()) {
        collect();
        answer = store_.save(Bytes(buffer_).first(size), now);
    }
    saving_ = answer.waits();
    return answer;
}

HookAnswer StoredValues::restore(Time now) {
    saving_ = false;
    const HookAnswer answer = store_.save({}, now);
    if (answer.waits() || answer.abort != Abort::none) return answer;
    const Guard guard(dictionary_.lock());
    dictionary_.restore_defaults(od::kBackup);
    return answer;
}

MutableBytes StoredValues::show(std::uint32_t number) {
    store_le(MutableBytes(shown_), 0, number);
    return shown_;
}

namespace stored_values {

namespace {
StoredValues* of(const ObjectAccess& access) {
    return access.application == nullptr ? nullptr : access.application->stored_values();
}
std::uint32_t command_in(const ObjectAccess& access, Bytes data) {
    // A complete access begins with subindex 0, in 16 bits.
    const Bytes value =
        access.complete && access.subindex == 0 ? data.subspan(std::min<std::size_t>(2, data.size())) : data;
    return value.size() < 4 ? 0 : load_le<std::uint32_t>(value);
}
}  // namespace

bool exists(const ObjectAccess& access) { return of(access) != nullptr; }

HookAnswer before_save(const ObjectAccess& access, Bytes data) {
    return command_in(access, data) == kSave ? of(access)->save(access.now) : HookAnswer(Abort::cannot_store);
}

HookAnswer before_restore(const ObjectAccess& access, Bytes data) {
    return command_in(access, data) == kRestore ? of(access)->restore(access.now) : HookAnswer(Abort::cannot_store);
}

MutableBytes command(const ObjectAccess& access) { return of(access)->show(1); }

MutableBytes checksum(const ObjectAccess& access) { return of(access)->show(of(access)->checksum()); }

}  // namespace stored_values
}  // namespace margay::subdevice
