// Process data by name: an entry of a PDO as a typed value of the process image, found by its object or by its place
// in the PDOs.
//
//     margay::Output<std::uint16_t> control{1, 0x6040};      // slave 1, object 0x6040:0
//     margay::Input<std::int32_t> actual{1, 0x6064};
//     margay::Input<bool> limit{margay::EntryAddress::at(2, 3, 1, 2)};  // slave 2, SyncManager 3, PDO 1, entry 2
//     margay::EntryHandle* const entries[] = {&control, &actual, &limit};
//     ctx.group(0).config.entries = entries;                 // before config_map(), which finds and checks them all
//     …
//     control.write(0x000F);  if (actual.read() > 1000) …  // between cycles
//
// config_map() finds the entries in the first source that knows the PDOs of the slave: the lists of SlaveSetup::pdos,
// the slave's object dictionary, the SII. So entries of slaves without CoE are found too. The process data of an SoE
// drive consists of IDNs and has no entries.
//
// An entry may begin at any bit and has 1 to 64 bits. It is little-endian on the wire; Input and Output convert it to a
// value of the host.
#pragma once

#include <margay/configuration.hpp>
#include <margay/request.hpp>
#include <margay/result.hpp>

#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <type_traits>

namespace margay {

class Context;

// Names one entry of one slave: by its object, or by its place in the PDOs.
struct EntryAddress {
    std::uint16_t slave = 0;  // the first slave is 1
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    // By place, if `pdo` is not 0: the number of the PDO in the SyncManager and the number of the entry in the PDO.
    // Both start at 1, like the subindices of the assignment object and of the mapping object. Gaps count as entries.
    std::uint8_t sync_manager = 0;
    std::uint8_t pdo = 0;
    std::uint8_t entry = 0;

    // If an object is mapped more than once in one direction, this finds the first entry; use at() for the others.
    [[nodiscard]] static constexpr EntryAddress object(std::uint16_t slave, std::uint16_t index,
                                                       std::uint8_t subindex = 0) {
        return {.slave = slave, .index = index, .subindex = subindex};
    }
    [[nodiscard]] static constexpr EntryAddress at(std::uint16_t slave, std::uint8_t sync_manager, std::uint8_t pdo,
                                                   std::uint8_t entry) {
        return {.slave = slave, .sync_manager = sync_manager, .pdo = pdo, .entry = entry};
    }
    friend constexpr bool operator==(const EntryAddress&, const EntryAddress&) = default;
};

// Where an entry is located in the image of its group.
struct EntryPlace {
    std::uint16_t slave = 0;
    std::uint16_t index = 0;  // of the object
    std::uint8_t subindex = 0;
    std::uint8_t group = 0;
    Direction direction = Direction::outputs;
    // CoE data type as the SII describes an entry of this index, subindex and size; 0: unknown, no check of the type.
    // If the slave has CoE, config_map() sets it in handles; find_entry() does not set it.
    std::uint8_t data_type = 0;
    std::uint32_t offset_bits = 0;  // from the start of the group's image; bit 0 is the lowest bit of the first octet
    std::uint32_t bits = 0;
    std::uint32_t mapping = 0;  // Group::mappings when the entry was found; 0: it is not mapped
};

namespace detail {

// Loads or stores 1 to 64 bits that begin at bit `shift` (0 to 7) of the first octet. Does not access octets beyond
// them.
[[nodiscard]] std::uint64_t load_bits(const std::byte* from, unsigned shift, unsigned bits);
void store_bits(std::byte* to, unsigned shift, unsigned bits, std::uint64_t value);

template <std::size_t Bytes>
struct RawOf;
template <>
struct RawOf<1> {
    using Type = std::uint8_t;
};
template <>
struct RawOf<2> {
    using Type = std::uint16_t;
};
template <>
struct RawOf<4> {
    using Type = std::uint32_t;
};
template <>
struct RawOf<8> {
    using Type = std::uint64_t;
};

// Conversion between little-endian octets and an unsigned integer.
template <class Raw>
[[nodiscard]] inline Raw load_raw(const std::byte* from) {
    if constexpr (std::endian::native == std::endian::little) {
        Raw raw;
        std::memcpy(&raw, from, sizeof raw);
        return raw;
    } else {
        return static_cast<Raw>(load_bits(from, 0, 8 * sizeof(Raw)));
    }
}
template <class Raw>
inline void store_raw(std::byte* to, Raw raw) {
    if constexpr (std::endian::native == std::endian::little)
        std::memcpy(to, &raw, sizeof raw);
    else
        store_bits(to, 0, 8 * sizeof(Raw), raw);
}

}  // namespace detail

// The kind of the type by which an entry is read or written.
enum class EntryKind : std::uint8_t { any, boolean, unsigned_integer, signed_integer, real, octets };

// The base of Input and Output: the address of the entry, its type, and where config_map() found it. The handle must
// live as long as GroupConfiguration::entries contains it, and the list must not change while its group is mapped: a
// handle that was removed from the list is not updated at the next mapping, and then points into an image that may no
// longer exist.
class EntryHandle {
  public:
    EntryHandle(const EntryHandle&) = delete;
    EntryHandle& operator=(const EntryHandle&) = delete;

    // If true, config_map() does not fail when the entry is not mapped.
    bool optional = false;

    // False until config_map() has found the entry. Until then read() returns 0 and write() has no effect. Each
    // config_map() of the group finds the entry again; the entry of a slave that appears later is found when the slave
    // appears.
    [[nodiscard]] bool mapped() const { return place_.mapping != 0; }
    [[nodiscard]] const EntryPlace& place() const { return place_; }
    [[nodiscard]] const EntryAddress& address() const { return address_; }

  protected:
    constexpr EntryHandle(const EntryAddress& address, Direction direction, EntryKind kind, std::uint32_t type_bits)
        : address_(address), direction_(direction), kind_(kind), type_bits_(type_bits) {}
    ~EntryHandle() = default;

    // The first octet of the entry in `half`, the outputs or the inputs of another image of the same group; nullptr:
    // the entry is not mapped, or is outside of `half`.
    template <class Octet>
    [[nodiscard]] Octet* in(std::span<Octet> half) const {
        const std::size_t end = half_octet_ + (std::size_t{shift_} + place_.bits + 7) / 8;
        return mapped() && end <= half.size() ? half.data() + half_octet_ : nullptr;
    }

    std::array<std::byte, 8> own_{};   // used in place of the image while the entry is not mapped
    std::byte* octets_ = own_.data();  // first octet of the entry
    bool plain_ = true;                // the entry consists of whole octets of the type, or is a bool within one octet
    std::uint8_t shift_ = 0;           // number of its first bit in the first octet
    std::byte mask_{0xFF};             // its bits in the first octet
    std::uint8_t value_bits_ = 0;      // 1 to 64

  private:
    friend struct EntryAccess;
    // The entry that was found in the PDOs of the slave.
    struct Found {
        bool any = false;
        bool other_direction = false;
        std::uint8_t sync_manager = 0;
        std::uint8_t data_type = 0;
        std::uint16_t index = 0;
        std::uint8_t subindex = 0;
        std::uint32_t offset_bits = 0;  // from the start of the SyncManager's data
        std::uint32_t bits = 0;
    };

    EntryAddress address_;
    Direction direction_;
    EntryKind kind_;
    std::uint32_t type_bits_;
    std::uint32_t half_octet_ = 0;
    EntryPlace place_;
    Found found_;
};

// The types of values: bool, integers, enumerations, float and double. The integer type must be the smallest that holds
// the entry: std::uint16_t for 9 to 16 bits. A signed entry of fewer bits is sign-extended. bool is for 1 to 8 bits: it
// is true if any bit is set, and true is written as 1.
//
// config_map() and each access by EntryPlace check the type. They always compare the number of bits
// (entry_size). They compare real number against integer (entry_type) only when the data type of the entry is known,
// which EntryPlace::data_type says. Only the SII names data types: the PDO mapping of the object dictionary does not,
// and neither do the lists of SlaveSetup::pdos. For an entry of the dictionary or of a list, the type of the SII is
// used if the SII describes an entry of the same index, subindex and size. Where the SII does not, an Output<float> on
// an INTEGER32 is accepted: both have 32 bits. read_entry_description() asks the slave for the data type of an object.
template <class T>
concept EntryValue = (std::is_arithmetic_v<T> || std::is_enum_v<T>)&&sizeof(T) <= 8;

template <EntryValue T>
class TypedEntry : public EntryHandle {
    using Raw = typename detail::RawOf<sizeof(T)>::Type;

    static constexpr bool is_signed() {
        if constexpr (std::is_enum_v<T>)
            return std::is_signed_v<std::underlying_type_t<T>>;
        else
            return std::is_signed_v<T>;
    }
    static constexpr EntryKind kind() {
        if constexpr (std::is_same_v<T, bool>)
            return EntryKind::boolean;
        else if constexpr (std::is_floating_point_v<T>)
            return EntryKind::real;
        else
            return is_signed() ? EntryKind::signed_integer : EntryKind::unsigned_integer;
    }

  protected:
    constexpr TypedEntry(const EntryAddress& address, Direction direction)
        : EntryHandle(address, direction, kind(), 8 * sizeof(T)) {}
    ~TypedEntry() = default;

    [[nodiscard]] T load(const std::byte* at) const {
        if constexpr (std::is_same_v<T, bool>) {
            if (plain_) [[likely]]
                return (*at & mask_) != std::byte{0};
            return detail::load_bits(at, shift_, value_bits_) != 0;
        } else {
            if (plain_) [[likely]]
                return from_raw(detail::load_raw<Raw>(at));
            std::uint64_t bits = detail::load_bits(at, shift_, value_bits_);
            if constexpr (kind() == EntryKind::signed_integer) {
                const std::uint64_t sign = std::uint64_t{1} << (value_bits_ - 1);
                bits = (bits ^ sign) - sign;
            }
            return from_raw(static_cast<Raw>(bits));
        }
    }
    void store(std::byte* at, T value) const {
        if constexpr (std::is_same_v<T, bool>) {
            const auto one = static_cast<std::byte>(static_cast<unsigned>(value) << shift_);
            if (plain_) [[likely]]
                *at = (*at & ~mask_) | one;
            else
                detail::store_bits(at, shift_, value_bits_, value ? 1 : 0);
        } else {
            if (plain_) [[likely]]
                detail::store_raw<Raw>(at, to_raw(value));
            else
                detail::store_bits(at, shift_, value_bits_, to_raw(value));
        }
    }

  private:
    [[nodiscard]] static constexpr T from_raw(Raw raw) {
        if constexpr (std::is_floating_point_v<T>)
            return std::bit_cast<T>(raw);
        else
            return static_cast<T>(raw);
    }
    [[nodiscard]] static constexpr Raw to_raw(T value) {
        if constexpr (std::is_floating_point_v<T>)
            return std::bit_cast<Raw>(value);
        else
            return static_cast<Raw>(value);
    }
};

// An entry that the slave sends. read() repeats none of the checks of config_map(); if the entry uses all bits of the
// type, it costs one comparison more than reading the octets by a pointer. Call it between cycles, in the thread that
// receives the group's process data. The last value of a lost slave stays readable (GroupConfiguration::lost_inputs).
template <EntryValue T>
class Input : public TypedEntry<T> {
  public:
    constexpr Input(std::uint16_t slave, std::uint16_t index, std::uint8_t subindex = 0)
        : Input(EntryAddress::object(slave, index, subindex)) {}
    constexpr explicit Input(const EntryAddress& address) : TypedEntry<T>(address, Direction::inputs) {}

    [[nodiscard]] T read() const { return this->load(this->octets_); }
    // Reads from inputs that another thread has fetched: SharedImage::inputs().
    [[nodiscard]] T read(std::span<const std::byte> inputs) const {
        const std::byte* at = this->in(inputs);
        return at == nullptr ? T{} : this->load(at);
    }
};

// An entry that the slave receives. write() checks nothing: of a value with more bits than the entry it writes the
// lowest bits. Call it between cycles, in the thread that sends the group's process data. If several entries share an
// octet, one thread must write all of them.
template <EntryValue T>
class Output : public TypedEntry<T> {
  public:
    constexpr Output(std::uint16_t slave, std::uint16_t index, std::uint8_t subindex = 0)
        : Output(EntryAddress::object(slave, index, subindex)) {}
    constexpr explicit Output(const EntryAddress& address) : TypedEntry<T>(address, Direction::outputs) {}

    void write(T value) { this->store(this->octets_, value); }
    // The value that was written last.
    [[nodiscard]] T read() const { return this->load(this->octets_); }
    // Writes into outputs that another thread prepares: SharedImage::outputs().
    void write(std::span<std::byte> outputs, T value) const {
        if (std::byte* at = this->in(outputs); at != nullptr) this->store(at, value);
    }
};

// An entry of several octets: an array or a text (VISIBLE_STRING, OCTET_STRING). It may begin at any bit. config_map()
// refuses an entry of another size.
class OctetsEntry : public EntryHandle {
  public:
    [[nodiscard]] std::size_t size() const { return octets_count_; }
    // Copies the octets that fit into `into`, and returns their number. Returns 0 while the entry is not mapped.
    std::size_t read(std::span<std::byte> into) const;
    // The same as a text, without trailing zeros.
    [[nodiscard]] std::string_view read_text(std::span<char> into) const;

  protected:
    constexpr OctetsEntry(const EntryAddress& address, Direction direction, std::uint16_t octets)
        : EntryHandle(address, direction, EntryKind::octets, std::uint32_t{octets} * 8), octets_count_(octets) {}
    ~OctetsEntry() = default;
    void store(std::span<const std::byte> value);

  private:
    std::uint16_t octets_count_;
};

class InputOctets : public OctetsEntry {
  public:
    constexpr InputOctets(const EntryAddress& address, std::uint16_t octets)
        : OctetsEntry(address, Direction::inputs, octets) {}
};

class OutputOctets : public OctetsEntry {
  public:
    constexpr OutputOctets(const EntryAddress& address, std::uint16_t octets)
        : OctetsEntry(address, Direction::outputs, octets) {}
    // A value that is too short is filled with zeros; a value that is too long is cut.
    void write(std::span<const std::byte> value) { store(value); }
    void write_text(std::string_view text) { store(std::as_bytes(std::span(text))); }
};

// ------------------------------------------------------------------ without a list

// Finds an entry of a slave whose group is mapped. Reads the slave's object dictionary or SII again. Searches both
// directions, the outputs first; if `one_direction` is set, only the direction `wanted`. Errors: entry_not_mapped,
// unknown_slave, unknown_group (the group is not mapped), and the errors of reading.
struct EntryRequest : Request {
    EntryRequest();
    EntryAddress address;
    bool one_direction = false;
    Direction wanted = Direction::outputs;
    EntryPlace place;  // result
};

// Reads the name of an entry: from the object dictionary if the slave provides SDO information, else from the PDOs of
// the SII.
struct EntryNameRequest : MailRequest {
    EntryNameRequest();
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    std::span<char> into;
    std::size_t bytes = 0;  // result: length of the name in `into`; 0: no name was found
};

// Functions that wait for these requests; see wait().
Result<EntryPlace> find_entry(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                              Duration timeout = Duration{0});
Result<EntryPlace> find_entry(Context& ctx, const EntryAddress& address, Duration timeout = Duration{0});
// Errors: unsupported if no name was found. A name that is too long is cut.
Result<std::string_view> read_entry_name(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                                         std::span<char> into, Duration timeout = Duration{0});

// The octets of an entry, after the checks that each access by EntryPlace needs: the group is still mapped as it was
// when the entry was found (entry_stale), and the type is right (entry_direction, entry_size, entry_type). For programs
// that display values; a cycle uses Input and Output.
[[nodiscard]] Result<std::span<std::byte>> entry_octets(Context& ctx, const EntryPlace& place, EntryKind kind,
                                                        std::uint32_t type_bits, bool write);

namespace detail {

template <EntryValue T>
class PlacedEntry : public TypedEntry<T> {
  public:
    PlacedEntry(const EntryPlace& place, std::byte* first) : TypedEntry<T>({}, place.direction) {
        this->octets_ = first;
        this->plain_ = false;
        this->shift_ = static_cast<std::uint8_t>(place.offset_bits % 8);
        this->value_bits_ = static_cast<std::uint8_t>(place.bits);
    }
    [[nodiscard]] T read() const { return this->load(this->octets_); }
    void write(T value) { this->store(this->octets_, value); }
    [[nodiscard]] static constexpr EntryKind kind_of() {
        if constexpr (std::is_same_v<T, bool>)
            return EntryKind::boolean;
        else
            return std::is_floating_point_v<T> ? EntryKind::real : EntryKind::unsigned_integer;
    }
};

}  // namespace detail

// Callable from the cycle.
template <EntryValue T>
[[nodiscard]] Result<T> read_entry(Context& ctx, const EntryPlace& place) {
    using Placed = detail::PlacedEntry<T>;
    const auto octets = entry_octets(ctx, place, Placed::kind_of(), 8 * sizeof(T), false);
    if (!octets) return octets.error();
    return Placed(place, octets->data()).read();
}
template <EntryValue T>
Result<> write_entry(Context& ctx, const EntryPlace& place, T value) {
    using Placed = detail::PlacedEntry<T>;
    const auto octets = entry_octets(ctx, place, Placed::kind_of(), 8 * sizeof(T), true);
    if (!octets) return octets.error();
    Placed(place, octets->data()).write(value);
    return Result<>();
}

}  // namespace margay
