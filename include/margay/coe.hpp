// CANopen over EtherCAT (CoE) for the application: access to the object dictionary of a slave, by requests that run
// beside the cycle and by functions that wait.
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
//
// After a timeout, cancel(), a lost frame or a silence of the slave, the slave may still answer. The library sends the
// slave an abort. Before the next request for the same object, the library waits for the late answer for 5 ms after the
// slave has accepted the abort. If none comes, the library reads an object of its own choice (0x1000, 0x1001 or
// 0x1018): a slave answers in order, so no late answer can follow the answer to this reading. The timeout of the next
// request includes this waiting and this reading: the request ends with Errc::timeout, or with a mailbox_error of the
// slave, and is not sent. The library does not detect the late answer in these cases: a slave that answers out of
// order; a late TxPDO of the mailbox (MailPdoFetch), which looks like one that the slave sends on its own; a reply that
// is sent twice before the slave has incremented its mailbox counter (some slaves never do).
#pragma once

#include <margay/borrowed.hpp>
#include <margay/emergency.hpp>
#include <margay/mail_listener.hpp>
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

// Reads an object (ETG.1000.6 "SDO upload"); with complete_access all subindices, beginning with `subindex` (0 or 1).
// If the slave refuses complete access, the library reads the subindices one by one and arranges the result in the same
// way: subindex 0 in two octets, the others directly behind it. An object of one value has no subindices: its error is
// the slave's refusal (sdo_abort), or unsupported when the slave has refused complete access before. A value of
// one octet that is 0 looks like an empty list, and is returned as one. Errors: SDOread().
struct SdoUpload : MailRequest {
    SdoUpload();
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    bool complete_access = false;
    std::span<std::byte> data;  // destination of the value; the caller's memory
    std::size_t bytes = 0;      // result: size of the value in octets
    // The time for each answer of the slave, while `timeout` limits the whole request. Zero or less: `timeout`, and 3 s
    // without `timeout`.
    Duration answer_timeout{0};
};

// Writes an object (ETG.1000.6 "SDO download"). If the slave refuses complete access, the library writes the subindices
// one by one. `data` is the caller's memory. Errors: see SDOwrite().
struct SdoDownload : MailRequest {
    SdoDownload();
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    bool complete_access = false;
    Borrowed<std::byte> data;
    Duration answer_timeout{0};  // see SdoUpload
};

// The object lists of a dictionary (ETG.1000.6 "Get OD list"). `lengths` returns five numbers: the number of objects in
// each of the other lists.
enum class ObjectList : std::uint16_t { lengths, all, rx_mappable, tx_mappable, backup, settings };

// Reads a list of objects. The indices are passed to `found` as they arrive, a few at a time: a dictionary may be of
// any size.
struct ObjectListRequest : MailRequest {
    ObjectListRequest();
    ObjectList list = ObjectList::all;
    // poll() calls this function in the thread that polls; it must neither wait nor call the library.
    void (*found)(std::span<const std::uint16_t> indices, void* user) = nullptr;  // must not throw
    void* user = nullptr;
    std::uint32_t count = 0;     // result: number of all indices
    Duration answer_timeout{0};  // see SdoUpload
};

// An object of the dictionary (ETG.1000.6 "Get object description").
struct ObjectDescription {
    static constexpr std::size_t kNameBytes = 64;
    std::uint16_t index = 0;
    std::uint16_t data_type = 0;  // index of the data type: 0x0005 UNSIGNED8 …
    std::uint8_t max_subindex = 0;
    std::uint8_t object_code = 0;  // 7 VARIABLE, 8 ARRAY, 9 RECORD …
    std::array<char, kNameBytes> name_text{};
    std::uint8_t name_bytes = 0;  // a longer name is cut
    [[nodiscard]] std::string_view name() const { return {name_text.data(), name_bytes}; }
};

// Reads the description of an object.
struct ObjectDescriptionRequest : MailRequest {
    ObjectDescriptionRequest();
    std::uint16_t index = 0;
    ObjectDescription description;  // result
};

// An entry of an object: one subindex (ETG.1000.6 "Get entry description").
struct EntryDescription {
    static constexpr std::size_t kNameBytes = 64;
    // A value of the entry's type, in the order of the wire; empty if the slave does not report it, or if it is longer.
    struct Value {
        std::array<std::byte, 8> octets{};
        std::uint8_t bytes = 0;
    };
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    std::uint16_t data_type = 0;
    std::uint16_t bit_length = 0;
    // Bits 0–2: readable in PREOP, SAFEOP, OP; bits 3–5: writable in these states; bits 6, 7: can be mapped to an
    // RxPDO, a TxPDO; bits 8, 9: backup, settings.
    std::uint16_t access = 0;
    std::uint32_t unit = 0;  // 0: none reported
    Value default_value;
    Value minimum;
    Value maximum;
    std::array<char, kNameBytes> name_text{};
    std::uint8_t name_bytes = 0;
    [[nodiscard]] std::string_view name() const { return {name_text.data(), name_bytes}; }
    [[nodiscard]] constexpr bool readable() const { return (access & 0x0007) != 0; }
    [[nodiscard]] constexpr bool writable() const { return (access & 0x0038) != 0; }
};

// Reads the description of an entry.
struct EntryDescriptionRequest : MailRequest {
    EntryDescriptionRequest();
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    bool with_values = false;      // also read unit, default, minimum and maximum
    EntryDescription description;  // result
};

// Sends an RxPDO by mailbox (CoE service RxPDO), for slaves that support it. The slave sends no reply.
struct MailPdoSend : MailRequest {
    MailPdoSend();
    std::uint16_t number = 0;  // number of the PDO, 9 bits
    Borrowed<std::byte> data;
};

// Requests a TxPDO by mailbox (CoE service TxPDO remote request).
struct MailPdoFetch : MailRequest {
    MailPdoFetch();
    std::uint16_t number = 0;
    std::span<std::byte> data;
    std::size_t bytes = 0;  // result
};

// Receives the PDOs that a slave sends by mailbox on its own; see mail_listener.hpp.
class MailPdoListener : public MailListener {
  public:
    MailPdoListener() : MailListener(MailboxType::coe) {}

  protected:
    ~MailPdoListener() = default;
    // A TxPDO that no request waits for (CoE service TxPDO). The rules of MailListener::take() apply; `data` is
    // valid until the function returns.
    virtual void received(std::uint16_t slave, std::uint16_t number, std::span<const std::byte> data) = 0;
    // The slave asks for an RxPDO (CoE service RxPDO remote request); to answer, submit a MailPdoSend.
    virtual void wanted(std::uint16_t slave, std::uint16_t number) { (void)slave, (void)number; }

  private:
    // Inline, because a program with RTTI derives from this class, and the library has no RTTI.
    bool take(const UnaskedMail& mail) final { return tell(mail); }
    bool tell(const UnaskedMail& mail);
};

// ------------------------------------------------------------------ functions that wait
//
// Each function submits a request and waits for it: SDOread() an SdoUpload, SDOwrite() an SdoDownload,
// read_object_list() an ObjectListRequest, and so on. wait() describes how a function waits in each thread.

// Reads an object and returns the size of its value in octets. `timeout` zero: 3 s for each answer of the slave.
// Errors: sdo_abort (detail: the abort code; describe() puts it in words), capacity (expected: the size of the value in
// octets), timeout, mailbox_error, protocol, unsupported, unknown_slave …
Result<std::size_t> SDOread(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                            bool complete_access, std::span<std::byte> into, Duration timeout = Duration{0});
// Writes an object. If the slave's answer is lost on the wire and the slave cannot repeat it, the library writes the
// value a second time: an object with an effect at each write may then have the effect twice. Errors as of SDOread().
Result<> SDOwrite(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex, bool complete_access,
                  std::span<const std::byte> value, Duration timeout = Duration{0});

// Reads an object list, or the description of an object or of one of its entries (SDO information, ETG.1000.6). See the
// requests above.
Result<std::uint32_t> read_object_list(Context& ctx, std::uint16_t slave, ObjectList list,
                                       void (*found)(std::span<const std::uint16_t> indices, void* user), void* user,
                                       Duration timeout = Duration{0});
Result<ObjectDescription> read_object_description(Context& ctx, std::uint16_t slave, std::uint16_t index,
                                                  Duration timeout = Duration{0});
Result<EntryDescription> read_entry_description(Context& ctx, std::uint16_t slave, std::uint16_t index,
                                                std::uint8_t subindex, bool with_values = false,
                                                Duration timeout = Duration{0});

// Values that have the same bits in the slave and in the host: integers, enumerations, bool (one octet), float and
// double.
template <class T>
concept SdoValue = std::is_arithmetic_v<T> || std::is_enum_v<T>;

namespace detail {
template <std::size_t N>
void reverse(std::array<std::byte, N>& octets) {
    for (std::size_t i = 0; i < N / 2; ++i) std::swap(octets[i], octets[N - 1 - i]);
}
}  // namespace detail

// Conversion to and from the order of the wire: least significant octet first.
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

// Reads a value of exactly this size. Errors: wrong_size or capacity if the value of the slave has another size.
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

// Writes a value of the size of its type.
template <SdoValue T>
Result<> SDOwrite(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex, T value,
                  Duration timeout = Duration{0}) {
    const auto octets = octets_of(value);
    return SDOwrite(ctx, slave, index, subindex, false, std::span<const std::byte>(octets), timeout);
}

// Reads a text (VISIBLE_STRING) into `into` and returns the part of `into` that has the text, without trailing zeros.
Result<std::string_view> SDOread_text(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                                      std::span<char> into, Duration timeout = Duration{0});
// Writes a text (VISIBLE_STRING).
Result<> SDOwrite_text(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                       std::string_view text, Duration timeout = Duration{0});

// The text of an abort code (ETG.1000.6 table "SDO abort codes"). A static string, callable from anywhere.
[[nodiscard]] std::string_view sdo_abort_text(std::uint32_t code);

// ------------------------------------------------------------------ what slaves report on their own

// The emergencies of a slave. Callable from any thread; only one thread at a time may call take(). For a slave that
// does not exist: an empty ring.
[[nodiscard]] EmergencyRing& emergencies(Context& ctx, std::uint16_t slave);

// Makes poll() check the mailboxes of all slaves in this interval, with one datagram, for messages that no request
// asked for. Zero, the value after init(): such messages are found only when a request uses the mailbox of the slave,
// or in the cycle of a slave whose mailbox status is mapped (SlaveConfiguration::mailbox_status). Never waits. Errors:
// wrong_state before init(), not_owner, invalid_argument (a negative time).
Result<> watch_mailboxes(Context& ctx, Duration every);

// The counters of the mailbox of a slave, since the slave was found. Never waits; callable from the cycle. Errors:
// wrong_state before init(), not_owner, unknown_slave.
[[nodiscard]] Result<MailboxStatistics> mailbox_statistics(Context& ctx, std::uint16_t slave);

}  // namespace margay
