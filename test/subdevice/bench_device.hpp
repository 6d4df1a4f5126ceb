// A device with every kind of object over PlainEsc, and helpers that act as the master at its mailbox. All mailbox
// messages can be recorded for tshark.
#pragma once

#include "subdevice/coe_server.hpp"
#include "subdevice/device.hpp"
#include "subdevice/diagnosis.hpp"
#include "subdevice/stored_values.hpp"
#include "subdevice/sync_objects.hpp"
#include "subdevice/timestamp.hpp"

#include "mail_hand.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace margay::subdevice::testing {

using namespace std::chrono_literals;

struct Values {
    using out_a = Field<std::uint8_t, 0>;
    using out_b = Field<std::int16_t, 1>;
    using bit_a = Field<std::uint8_t, 3>;
    using bit_b = Field<std::uint8_t, 4>;
    using in_a = Field<std::uint16_t, 5>;
    using in_b = Field<std::int32_t, 7>;
    using setting = Field<std::int16_t, 11>;
    using big = Field<std::uint64_t, 13>;
    using level = Field<std::uint8_t, 21>;
    using rx_count = Field<std::uint8_t, 22>;
    using rx_first = Field<std::uint32_t, 23>;  // eight of them
    using tx_count = Field<std::uint8_t, 55>;
    using tx_first = Field<std::uint32_t, 56>;
    using rx_assign_count = Field<std::uint8_t, 88>;
    using rx_assign = Field<std::uint16_t, 89>;  // four
    using tx_assign_count = Field<std::uint8_t, 97>;
    using tx_assign = Field<std::uint16_t, 98>;
    using mixed_a = Field<std::uint8_t, 106>;
    using mixed_b = Field<std::uint32_t, 107>;
    using slow = Field<std::uint32_t, 111>;
    static constexpr std::size_t label = 115;  // 20 octets
    static constexpr std::size_t block = 135;  // 300 octets
    static constexpr std::size_t sync = 435;
    using time = Field<std::uint64_t, sync + SyncValues<sync>::bytes>;
    static constexpr std::size_t bytes = time::end;
};

class BenchApplication;
HookAnswer slow_before(const ObjectAccess& access, Bytes data);
HookAnswer slow_before_read(const ObjectAccess& access);
void note_write(const ObjectAccess& access);
MutableBytes vast_memory(const ObjectAccess& access);

namespace table {

inline constexpr DeviceDescription kDevice{
    .vendor_id = 0x00004D47,
    .product_code = 0x10,
    .revision = 1,
    .serial = 7,
    .name = "Bench device",
    .protocols = {.coe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 128, .min_bytes = 24, .max_bytes = 256},
                {.start = 0x1100, .size_bytes = 128, .min_bytes = 24, .max_bytes = 256}},
    .outputs = {.sync_manager = 2, .start = 0x1200, .max_bytes = 16, .watchdog = true},
    .inputs = {.sync_manager = 3, .start = 0x1300, .max_bytes = 16},
    .dc = {.supported = true, .min_cycle = 100us},
    .local_error_reaction = 3,
    .output_times = {.shift = 50us, .min_delay = 2us, .max_delay = 7us},
    .input_times = {.shift = 11us, .max_delay = 1us},
};

inline constexpr ObjectHooks kSlowHooks{
    .before_read = slow_before_read, .before_write = slow_before, .after_write = note_write};
inline constexpr ObjectHooks kVastHooks{.after_write = note_write, .memory = vast_memory, .in_pieces = true};

inline constexpr Entry kType[] = {constant<std::uint32_t>(0, "Device type", 0x00000191)};
inline constexpr Entry kRegister[] = {constant<std::uint8_t>(0, "Error register", 0)};
inline constexpr Entry kName[] = {text(0, "Device name", "Bench device of many words")};
inline constexpr auto kIdentity = identity_entries(kDevice);
inline constexpr auto kSmTypes = sync_manager_type_entries(kDevice);
inline constexpr auto kErrors = kErrorHistoryEntries<4>;
inline constexpr auto kDiagnosis = kDiagnosisEntries<3>;
inline constexpr Entry kRx[] = {
    value<Values::rx_count>(0, "SubIndex 000", od::kReadWritePreop, 3).within(kLimits<0, 8>),
    value<Values::rx_first>(1, "Mapping", od::kReadWritePreop, 0x70000108),
    octets(2, "Mapping", DataType::unsigned32, od::kReadWritePreop, Values::rx_first::offset + 4, 4,
           std::string_view("\x10\x02\x00\x70", 4)),
    octets(3, "Mapping", DataType::unsigned32, od::kReadWritePreop, Values::rx_first::offset + 8, 4,
           std::string_view("\x01\x03\x00\x70", 4)),
    octets(4, "Mapping", DataType::unsigned32, od::kReadWritePreop, Values::rx_first::offset + 12, 4).times(5)};
inline constexpr Entry kTx[] = {
    value<Values::tx_count>(0, "SubIndex 000", od::kReadWritePreop, 2).within(kLimits<0, 8>),
    value<Values::tx_first>(1, "Mapping", od::kReadWritePreop, 0x60000110),
    octets(2, "Mapping", DataType::unsigned32, od::kReadWritePreop, Values::tx_first::offset + 4, 4,
           std::string_view("\x20\x02\x00\x60", 4)),
    octets(3, "Mapping", DataType::unsigned32, od::kReadWritePreop, Values::tx_first::offset + 8, 4).times(6)};
inline constexpr Entry kRxFixed[] = {entry_count(1), mapped(1, 0x7000, 4, 1)};
inline constexpr Entry kRxAssign[] = {
    value<Values::rx_assign_count>(0, "SubIndex 000", od::kReadWritePreop, 1).within(kLimits<0, 4>),
    value<Values::rx_assign>(1, "PDO", od::kReadWritePreop, 0x1600),
    octets(2, "PDO", DataType::unsigned16, od::kReadWritePreop, Values::rx_assign::offset + 2, 2).times(3)};
inline constexpr Entry kTxAssign[] = {
    value<Values::tx_assign_count>(0, "SubIndex 000", od::kReadWritePreop, 1).within(kLimits<0, 4>),
    value<Values::tx_assign>(1, "PDO", od::kReadWritePreop, 0x1A00),
    octets(2, "PDO", DataType::unsigned16, od::kReadWritePreop, Values::tx_assign::offset + 2, 2).times(3)};
inline constexpr Entry kSetting[] = {
    value<Values::setting>(0, "Setting", od::kReadWrite | od::kBackup | od::kSettings, 100).within(kLimits<-500, 500>)};
inline constexpr Entry kBig[] = {value<Values::big>(0, "Big", od::kReadWrite, 0x1122334455667788)};
inline constexpr Entry kLabel[] = {
    octets(0, "Label", DataType::visible_string, od::kReadWrite | od::kBackup, Values::label, 20, "none")};
inline constexpr Entry kBlock[] = {octets(0, "Block", DataType::octet_string, od::kReadWrite, Values::block, 300)};
inline constexpr Entry kLevel[] = {value<Values::level>(0, "Level", od::kRead | od::kWriteOp, 3).within(kLimits<1, 9>)};
inline constexpr Entry kSecret[] = {value<Values::level>(0, "Secret", od::kWrite)};
inline constexpr Entry kMixed[] = {entry_count(5),
                                   flag<Values::mixed_a>(1, "Flag", od::kReadWrite, 1, 1),
                                   padding(2, 7),
                                   value<Values::mixed_b>(3, "Number", od::kReadWrite, 0xA1B2C3D4),
                                   constant<std::uint16_t>(4, "Fixed", 0xBEEF),
                                   value<Values::level>(5, "Write only", od::kWrite)};
inline constexpr Entry kSlow[] = {value<Values::slow>(0, "Slow", od::kReadWrite, 5)};
inline constexpr Entry kVast[] = {provided(0, "Vast", DataType::domain, 0, od::kReadWrite)};
inline constexpr Entry kInputs[] = {entry_count(2), value<Values::in_a>(1, "In a", od::kRead | od::kTxMappable),
                                    value<Values::in_b>(2, "In b", od::kRead | od::kTxMappable)};
inline constexpr auto kSyncError = sync_error_entries<Values::sync>(kDevice);
inline constexpr auto kOutputSync = sync_output_entries<Values::sync>(kDevice);
inline constexpr auto kInputSync = sync_input_entries<Values::sync>(kDevice);
inline constexpr auto kTime = timestamp_entry<Values::time>();
inline constexpr Entry kOutputs[] = {entry_count(4),
                                     value<Values::out_a>(1, "Out a", od::kReadWrite | od::kRxMappable, 9),
                                     value<Values::out_b>(2, "Out b", od::kReadWrite | od::kRxMappable),
                                     flag<Values::bit_a>(3, "Bit a", od::kReadWrite | od::kRxMappable),
                                     flag<Values::bit_b>(4, "Bit b", od::kReadWrite | od::kRxMappable)};

inline constexpr Object kObjects[] = {
    variable(0x1000, "Device type", kType),
    variable(0x1001, "Error register", kRegister),
    array(0x1003, "Pre-defined error field", kErrors, &kErrorHistoryHooks),
    variable(0x1008, "Device name", kName),
    array(0x1010, "Store parameters", kStoreEntries, &kStoreHooks),
    array(0x1011, "Restore default parameters", kRestoreEntries, &kRestoreHooks),
    record(0x1018, "Identity", kIdentity, nullptr, DataType::identity),
    record(0x10F0, "Backup parameter handling", kBackupEntries, &kBackupHooks),
    record(0x10F1, "Sync error setting", kSyncError),
    record(0x10F3, "Diagnosis history", kDiagnosis, &kDiagnosisHooks),
    variable(0x10F8, "Timestamp", kTime, &kTimestampHooks),
    record(0x1600, "RxPDO", kRx, &kPdoMappingHooks, DataType::pdo_mapping),
    record(0x1601, "RxPDO fixed", kRxFixed, nullptr, DataType::pdo_mapping),
    record(0x1A00, "TxPDO", kTx, &kPdoMappingHooks, DataType::pdo_mapping),
    array(0x1C00, "Sync manager types", kSmTypes),
    array(0x1C12, "RxPDO assignment", kRxAssign, &kPdoAssignmentHooks),
    array(0x1C13, "TxPDO assignment", kTxAssign, &kPdoAssignmentHooks),
    record(0x1C32, "SM output parameter", kOutputSync, &kSyncParameterHooks),
    record(0x1C33, "SM input parameter", kInputSync, &kSyncParameterHooks),
    variable(0x2000, "Setting", kSetting),
    variable(0x2001, "Big", kBig),
    variable(0x2002, "Label", kLabel),
    variable(0x2003, "Block", kBlock),
    variable(0x2004, "Level", kLevel),
    variable(0x2005, "Secret", kSecret),
    record(0x2006, "Mixed", kMixed),
    variable(0x2007, "Slow", kSlow, &kSlowHooks),
    variable(0x2008, "Vast", kVast, &kVastHooks),
    record(0x6000, "Inputs", kInputs),
    record(0x7000, "Outputs", kOutputs),
};
static_assert(well_formed(kObjects, Values::bytes));

}  // namespace table

class BenchApplication final : public ReportingApplication<3, 4, 3> {
  public:
    [[nodiscard]] const DeviceDescription& description() const override { return description_value; }
    Verdict before(Transition t, Time now) override {
        return transition_hook ? transition_hook(t, now) : Verdict::go();
    }
    void cycle(Time, bool outputs_valid) override {
        spent = work;
        ++cycles;
        last_valid = outputs_valid;
        during_cycle();
    }
    void safe_outputs(Time) override {
        ++safe;
        during_safe();
    }
    void after(Transition, Time) override { during_after(); }
    void dropped(Transition) override { during_dropped(); }
    void sync1(Time) override { ++syncs1; }
    bool pack_inputs(MutableBytes) override {
        spent += copying;
        return false;
    }
    [[nodiscard]] Time clock(Time now) override { return now + spent; }
    [[nodiscard]] std::uint64_t timestamp_ns(Time now) override { return Application::timestamp_ns(now) + 1'000; }
    [[nodiscard]] StoredValues* stored_values() override { return stored; }

    DeviceDescription description_value = table::kDevice;
    std::function<Verdict(Transition, Time)> transition_hook;
    std::function<void()> during_cycle = [] {};
    std::function<void()> during_safe = [] {};
    std::function<void()> during_after = [] {};
    std::function<void()> during_dropped = [] {};
    Time slow_until = Time{} + 50ms;
    bool no_time = false;                        // the hooks answer later(kNever)
    std::function<void()> during_hook = [] {};   // called in before_read and before_write,
    std::function<void()> during_write = [] {};  // and in after_write
    std::vector<std::byte> vast = std::vector<std::byte>(70'000, std::byte{0x5A});
    std::size_t vast_bytes = 70'000;
    StoredValues* stored = nullptr;
    Duration work{};     // duration of the cyclic function,
    Duration copying{};  // and of a copy of the inputs
    Duration spent{};
    unsigned writes = 0;
    unsigned cycles = 0;
    unsigned safe = 0;
    unsigned syncs1 = 0;
    bool last_valid = false;
};

inline BenchApplication& bench_of(const ObjectAccess& access) {
    return static_cast<BenchApplication&>(*access.application);
}
inline HookAnswer slow_before(const ObjectAccess& access, Bytes) {
    bench_of(access).during_hook();
    if (bench_of(access).no_time) return HookAnswer::later(kNever);
    return access.now < bench_of(access).slow_until ? HookAnswer::later(bench_of(access).slow_until) : Abort::none;
}
inline HookAnswer slow_before_read(const ObjectAccess& access) { return slow_before(access, {}); }
inline void note_write(const ObjectAccess& access) {
    auto& bench = bench_of(access);
    ++bench.writes;
    bench.during_write();
    if (access.object.index == 0x2008) bench.vast_bytes = access.bytes;
}
inline MutableBytes vast_memory(const ObjectAccess& access) {
    auto& bench = bench_of(access);
    return MutableBytes(bench.vast).first(access.write ? bench.vast.size() : bench.vast_bytes);
}

// Mailbox messages of a test, recorded for tshark.
struct Recorded {
    bool from_slave = false;
    std::vector<std::byte> octets;
};
std::vector<Recorded>& recording();  // all messages of the tests of this program so far

class Bench {
  public:
    // A device with mailboxes of this size, in PREOP.
    explicit Bench(std::uint16_t mailbox_bytes = 128, std::size_t slots = 4) : send_memory_(256 * slots) {
        mailbox.emplace(esc, MutableBytes(receive_memory_), MutableBytes(send_memory_), protocols_);
        device.emplace(esc, application, process_data, &*mailbox);
        device->start(esc.time);
        configure(mailbox_bytes);
        request(2);
    }

    void configure(std::uint16_t mailbox_bytes) {
        hand_.configure(mailbox_bytes);
        esc.configure(2, {0x1200, 4, 0x64, 1});
        esc.configure(3, {0x1300, 6, 0x20, 1});
    }
    AlStatus request(std::uint16_t control) {
        esc.al_control(control);
        (void)step();
        return esc.al_status();
    }
    Time step() { return device->step(esc.time); }
    // Executes steps until there is no work left at this time.
    void settle() {
        for (int i = 0; i < 4; ++i) (void)step();
    }

    // Writes a complete message without changes. Returns false when the mailbox was full.
    bool put(const std::vector<std::byte>& message) {
        recording().push_back({false, message});
        return hand_.put(message);
    }
    // Sends data behind a mailbox header with the next counter.
    bool send(wire::MailboxType type, const std::vector<std::byte>& data) { return put(hand_.message(type, data)); }
    // Returns the message in SM1 with its header; empty: there is no message.
    std::vector<std::byte> fetch() {
        auto message = hand_.fetch();
        if (message.empty()) return message;
        message.resize(wire::kMailboxHeaderBytes + wire::load_mailbox_header(message).length);
        recording().push_back({true, message});
        (void)step();
        return message;
    }
    // The data of the next reply. The header is checked and removed.
    std::vector<std::byte> receive(wire::MailboxType type = wire::MailboxType::coe) {
        auto message = fetch();
        if (message.empty()) {
            ADD_FAILURE() << "no reply";
            return {};
        }
        EXPECT_EQ(wire::load_mailbox_header(message).type, type);
        message.erase(message.begin(), message.begin() + wire::kMailboxHeaderBytes);
        return message;
    }
    std::vector<std::byte> exchange(const std::vector<std::byte>& data) {
        EXPECT_TRUE(send(wire::MailboxType::coe, data));
        (void)step();
        return receive();
    }

    PlainEsc esc;
    BenchApplication application;
    std::array<std::byte, Values::bytes> image{};
    ObjectDictionary dictionary{table::kObjects, image, &application};
    std::array<std::byte, 512> staging{};
    CoeServer coe{dictionary, staging, true, application.emergencies()};
    ProcessDataMemory<16, 16, 8> process_memory;
    ProcessData process_data{esc, application, dictionary, process_memory};
    std::optional<Mailbox> mailbox;
    std::optional<Device> device;

  private:
    std::array<MailboxProtocol, 1> protocols_{{{wire::MailboxType::coe, &coe}}};
    std::array<std::byte, 256> receive_memory_{};
    std::vector<std::byte> send_memory_;
    MailHand hand_{esc};
};

// --- SDO as a client ---

inline std::vector<std::byte> sdo_request(int command, int index, int subindex, std::uint32_t tail = 0) {
    std::vector<std::byte> out(wire::coe::kSdoBytes);
    wire::coe::store_header(out, {0, wire::coe::Service::sdo_request});
    wire::coe::SdoLayout::command::store(out, static_cast<std::uint8_t>(command));
    wire::coe::SdoLayout::index::store(out, static_cast<std::uint16_t>(index));
    wire::coe::SdoLayout::subindex::store(out, static_cast<std::uint8_t>(subindex));
    wire::coe::SdoLayout::complete_size::store(out, tail);
    return out;
}

inline Abort abort_of(const std::vector<std::byte>& reply) {
    if (reply.size() != wire::coe::kSdoBytes || reply[2] != std::byte{0x80}) return Abort::none;
    return static_cast<Abort>(wire::coe::SdoLayout::complete_size::load(reply));
}

struct Transfer {
    Abort abort = Abort::none;
    std::vector<std::byte> data;
    unsigned segments = 0;
    [[nodiscard]] std::string text() const {
        std::string out;
        for (const auto b : data) out.push_back(static_cast<char>(b));
        return out;
    }
    [[nodiscard]] std::uint64_t number() const {
        std::uint64_t out = 0;
        for (std::size_t i = 0; i < data.size() && i < 8; ++i)
            out |= std::uint64_t{std::to_integer<std::uint8_t>(data[i])} << (8 * i);
        return out;
    }
};

Transfer upload(Bench& bench, int index, int subindex = 0, bool complete = false);
// `first_bytes` is the largest number of octets in the first message; default: as many as fit. Up to 4 octets are sent
// by an expedited transfer, unless `normal`.
Transfer download(Bench& bench, int index, int subindex, std::vector<std::byte> data, bool complete = false,
                  bool normal = false, std::size_t first_bytes = SIZE_MAX);
inline std::vector<std::byte> number(std::uint64_t value, std::size_t bytes) {
    std::vector<std::byte> out(bytes);
    for (std::size_t i = 0; i < bytes; ++i) out[i] = static_cast<std::byte>(value >> (8 * i));
    return out;
}

}  // namespace margay::subdevice::testing
