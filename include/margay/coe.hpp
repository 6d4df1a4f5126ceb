// CANopen over EtherCAT as the application sees it: the object dictionary of a slave, by requests that run beside the
// cycle and by calls that wait.
//
//     margay::SdoUpload request;                       // lives in the caller's memory, may be used again and again
//     request.slave = 3;
//     request.index = 0x6041;
//     request.data = buffer;
//     margay::submit(ctx, request);                    // from any thread
//     … the owner of the context goes on with poll() or its cycle …
//     if (request.state() == margay::RequestState::success) use(request.data.first(request.bytes));
//
//     auto status = margay::SDOread<std::uint16_t>(ctx, 3, 0x6041, 0);   // waits
#pragma once

#include <margay/emergency.hpp>
#include <margay/request.hpp>
#include <margay/result.hpp>
#include <margay/statistics.hpp>

#include <array>
#include <bit>
#include <cstring>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>

namespace margay {

class Context;

// ------------------------------------------------------------------ requests

// Reads an object, or with complete_access all subindices from subindex (0 or 1) on. What a slave refuses to give that
// way is read subindex by subindex, and laid out as a complete access is: subindex 0 in two octets, the others one
// behind the other.
struct SdoUpload : MailRequest {
    SdoUpload();
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    bool complete_access = false;
    std::span<std::byte> data;  // the value goes here; the memory is the caller's
    std::size_t bytes = 0;      // result: octets of the value
};

// Writes an object. Where a slave refuses complete access it is written subindex by subindex.
struct SdoDownload : MailRequest {
    SdoDownload();
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    bool complete_access = false;
    std::span<const std::byte> data;
};

// The lists of a dictionary (ETG.1000.6 "Get OD list"). `lengths` gives five numbers: how many objects each of the
// others has.
enum class ObjectList : std::uint16_t { lengths, all, rx_mappable, tx_mappable, backup, settings };

// Lists objects. They are handed over as they come, a few at a time: a dictionary may be of any size.
struct ObjectListRequest : MailRequest {
    ObjectListRequest();
    ObjectList list = ObjectList::all;
    // Called by poll() on the thread that polls; must neither wait nor call the library.
    void (*found)(std::span<const std::uint16_t> indices, void* user) = nullptr;
    void* user = nullptr;
    std::uint32_t count = 0;  // result: how many in all
};

struct ObjectDescription {
    static constexpr std::size_t kNameBytes = 64;
    std::uint16_t index = 0;
    std::uint16_t data_type = 0;  // index of the type: 0x0005 UNSIGNED8 …
    std::uint8_t max_subindex = 0;
    std::uint8_t object_code = 0;  // 7 VARIABLE, 8 ARRAY, 9 RECORD …
    std::array<char, kNameBytes> name_text{};
    std::uint8_t name_bytes = 0;  // a longer name is cut
    [[nodiscard]] std::string_view name() const { return {name_text.data(), name_bytes}; }
};

struct ObjectDescriptionRequest : MailRequest {
    ObjectDescriptionRequest();
    std::uint16_t index = 0;
    ObjectDescription description;  // result
};

struct EntryDescription {
    static constexpr std::size_t kNameBytes = 64;
    // A value of the entry's type, as it travels; empty where the slave does not tell it, or where it is longer.
    struct Value {
        std::array<std::byte, 8> octets{};
        std::uint8_t bytes = 0;
    };
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    std::uint16_t data_type = 0;
    std::uint16_t bit_length = 0;
    // Read in PREOP, SAFEOP, OP: bits 0–2; write: 3–5; RxPDO, TxPDO mappable: 6, 7; backup, settings: 8, 9.
    std::uint16_t access = 0;
    std::uint32_t unit = 0;  // 0: none told
    Value default_value;
    Value minimum;
    Value maximum;
    std::array<char, kNameBytes> name_text{};
    std::uint8_t name_bytes = 0;
    [[nodiscard]] std::string_view name() const { return {name_text.data(), name_bytes}; }
    [[nodiscard]] constexpr bool readable() const { return (access & 0x0007) != 0; }
    [[nodiscard]] constexpr bool writable() const { return (access & 0x0038) != 0; }
};

struct EntryDescriptionRequest : MailRequest {
    EntryDescriptionRequest();
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    bool with_values = false;      // unit, default, minimum and maximum are asked for too
    EntryDescription description;  // result
};

// Sends an RxPDO by mailbox (CoE service RxPDO); a slave does not answer it. For slaves that offer it.
struct MailPdoSend : MailRequest {
    MailPdoSend();
    std::uint16_t number = 0;  // of the PDO, 9 bits
    std::span<const std::byte> data;
};

// Asks for a TxPDO by mailbox (CoE service TxPDO remote request).
struct MailPdoFetch : MailRequest {
    MailPdoFetch();
    std::uint16_t number = 0;
    std::span<std::byte> data;
    std::size_t bytes = 0;  // result
};

// ------------------------------------------------------------------ calls that wait
//
// Each submits the request of its kind and waits for it: see wait() for what that means in which thread.

// Reads an object, returns the octets of its value. Errors: sdo_abort (detail: the abort code, which describe() puts in
// words), capacity (expected: the octets of the value), timeout, mailbox_error, protocol, unsupported, unknown_slave …
Result<std::size_t> SDOread(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                            bool complete_access, std::span<std::byte> into, Duration timeout = Duration{0});
// Writes an object. When the slave's answer is lost on the wire and the slave cannot repeat it, the value is written
// once more: an object that does something each time it is written may do it twice then. Errors as of reading.
Result<> SDOwrite(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex, bool complete_access,
                  std::span<const std::byte> value, Duration timeout = Duration{0});

Result<std::uint32_t> object_list(Context& ctx, std::uint16_t slave, ObjectList list,
                                  void (*found)(std::span<const std::uint16_t> indices, void* user), void* user,
                                  Duration timeout = Duration{0});
Result<ObjectDescription> object_description(Context& ctx, std::uint16_t slave, std::uint16_t index,
                                             Duration timeout = Duration{0});
Result<EntryDescription> entry_description(Context& ctx, std::uint16_t slave, std::uint16_t index,
                                           std::uint8_t subindex, bool with_values = false,
                                           Duration timeout = Duration{0});

// Values that a slave keeps as they are: integers, enumerations, bool (one octet), float and double.
template <class T>
concept SdoValue = std::is_arithmetic_v<T> || std::is_enum_v<T>;

namespace detail {
template <std::size_t N>
void reverse(std::array<std::byte, N>& octets) {
    for (std::size_t i = 0; i < N / 2; ++i) std::swap(octets[i], octets[N - 1 - i]);
}
}  // namespace detail

// As they travel: least significant octet first.
template <SdoValue T>
[[nodiscard]] std::array<std::byte, sizeof(T)> octets_of(T value) {
    std::array<std::byte, sizeof(T)> octets{};
    std::memcpy(octets.data(), &value, sizeof(T));
    if (std::endian::native == std::endian::big) detail::reverse(octets);
    return octets;
}
template <SdoValue T>
[[nodiscard]] T value_from_octets(std::array<std::byte, sizeof(T)> octets) {
    if (std::endian::native == std::endian::big) detail::reverse(octets);
    T value{};
    std::memcpy(&value, octets.data(), sizeof(T));
    return value;
}

// Reads a value of exactly that size: Errc::wrong_size, or capacity, when the slave's has another one.
//
//     const auto speed = margay::SDOread<std::int32_t>(ctx, 2, 0x606C, 0);
template <SdoValue T>
Result<T> SDOread(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                  Duration timeout = Duration{0}) {
    std::array<std::byte, sizeof(T)> octets{};
    const auto read = SDOread(ctx, slave, index, subindex, false, octets, timeout);
    if (!read) return read.error();
    if (*read != sizeof(T)) {
        Error error{
            .code = Errc::wrong_size, .step = Step::sdo_upload, .slave = slave, .index = index, .subindex = subindex};
        error.expected = static_cast<std::uint32_t>(sizeof(T));
        error.actual = static_cast<std::uint32_t>(*read);
        return error;
    }
    return value_from_octets<T>(octets);
}

template <SdoValue T>
Result<> SDOwrite(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex, T value,
                  Duration timeout = Duration{0}) {
    const auto octets = octets_of(value);
    return SDOwrite(ctx, slave, index, subindex, false, std::span<const std::byte>(octets), timeout);
}

// Reads a text (VISIBLE_STRING) into `into` and returns the part that was written, without zeros behind it.
Result<std::string_view> SDOread_text(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                                      std::span<char> into, Duration timeout = Duration{0});
Result<> SDOwrite_text(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                       std::string_view text, Duration timeout = Duration{0});

// An abort code in words, as of the standard's table. A static string, callable from anywhere.
[[nodiscard]] std::string_view sdo_abort_text(std::uint32_t code);

// ------------------------------------------------------------------ what slaves report on their own

// The emergencies of a slave. From any thread; take() is for one thread at a time. For a slave that does not exist: an
// empty ring.
[[nodiscard]] EmergencyRing& emergencies(Context& ctx, std::uint16_t slave);

// Has poll() look every so often, with one datagram for all slaves, for mail that nobody has asked for. Zero, as after
// init(): such mail is found when a request has to do with the slave, or in the cycle of a slave whose mailbox status
// is mapped (SlaveConfiguration::mailbox_status).
// Never waits. Errors: wrong_state before init(), not_owner, invalid_argument (a negative time).
Result<> watch_mailboxes(Context& ctx, Duration every);

// The counters of the mailbox of a slave since the slave was found. Never waits; callable from the cycle. Errors:
// wrong_state before init(), not_owner, unknown_slave.
[[nodiscard]] Result<MailboxStatistics> mailbox_statistics(Context& ctx, std::uint16_t slave);

}  // namespace margay
