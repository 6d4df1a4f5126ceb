// A device with CoE, EoE, FoE, SoE, VoE and AoE over plain memory, for harnesses that write anything to its mailbox.
// For any input, each reply must be a mailbox message that fits, and afterwards a correct request must get its correct
// reply.
#pragma once

#include "subdevice/mail_hand.hpp"

#include "subdevice/aoe_server.hpp"
#include "subdevice/coe_server.hpp"
#include "subdevice/device.hpp"
#include "subdevice/diagnosis.hpp"
#include "subdevice/eoe_server.hpp"
#include "subdevice/foe_server.hpp"
#include "subdevice/soe_server.hpp"
#include "subdevice/voe_server.hpp"

#include <cstdlib>

namespace margay::subdevice::fuzzing {

using namespace std::chrono_literals;

inline void require(bool holds) {
    if (!holds) std::abort();
}

inline constexpr DeviceDescription kDevice{
    .vendor_id = 1,
    .product_code = 2,
    .revision = 3,
    .serial = 4,
    .name = "Fuzzed",
    .protocols = {.aoe = true, .eoe = true, .coe = true, .foe = true, .soe = true, .voe = true},
    .mailbox = {{.start = 0x1000, .size_bytes = 64, .min_bytes = 16, .max_bytes = 256},
                {.start = 0x1100, .size_bytes = 64, .min_bytes = 16, .max_bytes = 256}},
    .boot_mailbox = {{.start = 0x1000, .size_bytes = 64, .min_bytes = 16, .max_bytes = 256},
                     {.start = 0x1100, .size_bytes = 64, .min_bytes = 16, .max_bytes = 256}},
    .outputs = {.sync_manager = 2, .start = 0x1200, .max_bytes = 8},
    .inputs = {.sync_manager = 3, .start = 0x1300, .max_bytes = 8},
};

HookAnswer slow(const ObjectAccess& access);
HookAnswer slow_write(const ObjectAccess& access, Bytes data);
MutableBytes vast(const ObjectAccess& access);

inline constexpr ObjectHooks kSlow{.before_read = slow, .before_write = slow_write};
inline constexpr ObjectHooks kVast{.memory = vast, .in_pieces = true};

struct Values {
    using word = Field<std::uint16_t, 0>;
    using dword = Field<std::uint32_t, 2>;
    using bit = Field<std::uint8_t, 6>;
    using rx_count = Field<std::uint8_t, 7>;
    using rx = Field<std::uint32_t, 8>;
    using assign_count = Field<std::uint8_t, 24>;
    using assign = Field<std::uint16_t, 25>;
    static constexpr std::size_t text = 29;
    static constexpr std::size_t bytes = text + 100;
};
inline constexpr Entry kType[] = {constant<std::uint32_t>(0, "Device type", 0x5A5A1234)};
inline constexpr auto kErrors = kErrorHistoryEntries<3>;
inline constexpr auto kDiagnosis = kDiagnosisEntries<2>;
inline constexpr auto kIdentity = identity_entries(kDevice);
inline constexpr Entry kRx[] = {
    value<Values::rx_count>(0, "SubIndex 000", od::kReadWritePreop, 1).within(kLimits<0, 4>),
    value<Values::rx>(1, "Mapping", od::kReadWritePreop, 0x20000010),
    octets(2, "Mapping", DataType::unsigned32, od::kReadWritePreop, Values::rx::offset + 4, 4).times(3)};
inline constexpr Entry kAssign[] = {
    value<Values::assign_count>(0, "SubIndex 000", od::kReadWritePreop, 1).within(kLimits<0, 2>),
    value<Values::assign>(1, "PDO", od::kReadWritePreop, 0x1600),
    octets(2, "PDO", DataType::unsigned16, od::kReadWritePreop, Values::assign::offset + 2, 2)};
inline constexpr Entry kWord[] = {
    value<Values::word>(0, "Word", od::kReadWrite | od::kRxMappable, 7).within(kLimits<0, 1000>)};
inline constexpr Entry kText[] = {
    octets(0, "Text", DataType::visible_string, od::kReadWrite, Values::text, 100, "abc")};
inline constexpr Entry kMixed[] = {entry_count(4), flag<Values::bit>(1, "Bit", od::kReadWrite), padding(2, 7),
                                   value<Values::dword>(3, "Number", od::kReadWrite),
                                   constant<std::uint16_t>(4, "Fixed", 0xBEEF)};
inline constexpr Entry kSlowEntry[] = {value<Values::dword>(0, "Slow", od::kReadWrite)};
inline constexpr Entry kVastEntry[] = {provided(0, "Vast", DataType::domain, 0, od::kReadWrite)};
inline constexpr Object kObjects[] = {
    variable(0x1000, "Device type", kType),
    array(0x1003, "Errors", kErrors, &kErrorHistoryHooks),
    record(0x1018, "Identity", kIdentity, nullptr, DataType::identity),
    record(0x10F3, "Diagnosis", kDiagnosis, &kDiagnosisHooks),
    record(0x1600, "RxPDO", kRx, &kPdoMappingHooks, DataType::pdo_mapping),
    array(0x1C12, "Assignment", kAssign, &kPdoAssignmentHooks),
    variable(0x2000, "Word", kWord),
    variable(0x2001, "Text", kText),
    record(0x2002, "Mixed", kMixed),
    variable(0x2003, "Slow", kSlowEntry, &kSlow),
    variable(0x2004, "Vast", kVastEntry, &kVast),
};

struct DriveValues {
    using speed = Field<std::int32_t, 0>;
    static constexpr std::size_t list = 4;
    static constexpr std::size_t label = list + soe_list_bytes(8);
    static constexpr std::size_t homing = label + soe_list_bytes(200);
    static constexpr std::size_t bytes = homing + kSoeCommandBytes;
};
inline constexpr SoeParameter kParameters[] = {
    soe_constant<std::uint16_t>(Idn::standard(1), "Cycle", 1000, "us"),
    soe_idn_list(Idn::standard(2), "List", DriveValues::list, 8),
    soe_all(Idn::standard(3), "All", SoeStorage::all_idns),
    soe_value<DriveValues::speed>(Idn::standard(4), "Speed", "inc").within(-100, 100),
    soe_procedure(Idn::standard(5), "Homing", DriveValues::homing),
    soe_list(Idn::standard(6), "Label", DriveValues::label, 200, 1, SoeType::text),
    soe_text(Idn::standard(7), "Version", "a text of more than one message, and more than two of short ones"),
};
static_assert(well_formed(kParameters, DriveValues::bytes));

// Every second command ends at once, and every third of these succeeds. Written values are checked against the bounds.
class Axis final : public SoeApplication {
  public:
    SoeError before_write(const SoeAccess& access, Bytes value) override {
        if (access.parameter.idn == Idn::standard(4))
            require(value.size() == 4 && std::abs(load_le<std::int32_t>(value)) <= 100);
        if (access.parameter.idn == Idn::standard(6)) require(value.size() <= soe_list_bytes(200));
        return SoeError::none;
    }
    SoeError start_command(const SoeAccess& access) override {
        if (++calls % 2 == 0) server->finish_command(access.drive, access.parameter.idn, calls % 3 == 0);
        return SoeError::none;
    }
    SoeServer* server = nullptr;
    unsigned calls = 0;
};

class Store final : public FoeStore {
  public:
    FoeAnswer open_to_read(const FoeFile& file, Time) override { return open(file); }
    FoeAnswer open_to_write(const FoeFile& file, Time) override {
        size_ = 0;
        return open(file);
    }
    FoeAnswer read(std::size_t offset, MutableBytes into, std::size_t& bytes, Time) override {
        require(offset <= size_);
        bytes = std::min(into.size(), size_ - offset);
        std::copy_n(content_.begin() + static_cast<std::ptrdiff_t>(offset), bytes, into.begin());
        return ++calls_ % 5 == 0 ? FoeAnswer::busy(1, 2, "slow") : FoeAnswer::go();
    }
    FoeAnswer write(std::size_t offset, Bytes data, Time) override {
        require(offset == size_);
        if (++calls_ % 4 == 0) return FoeAnswer::busy(1, 2);
        if (offset + data.size() > content_.size()) return FoeAnswer::error(FoeError::disk_full);
        std::copy(data.begin(), data.end(), content_.begin() + static_cast<std::ptrdiff_t>(offset));
        size_ += data.size();
        return FoeAnswer::go();
    }
    FoeAnswer finish_write(std::size_t bytes, Time) override {
        require(bytes == size_);
        return ++calls_ % 3 == 0 ? FoeAnswer::busy(0, 0) : FoeAnswer::go();
    }
    void give_up() override {}

  private:
    static FoeAnswer open(const FoeFile& file) {
        require(file.name.size() <= 64);
        if (file.name.size() == 1) return FoeAnswer::busy(3, 4);
        return file.name.empty() ? FoeAnswer::error(FoeError::not_found, "a file has a name") : FoeAnswer::go();
    }
    std::array<std::byte, 700> content_{};
    std::size_t size_ = 300;
    unsigned calls_ = 0;
};

// Sends each message back as often as the low three bits of its vendor type say. Only vendor 1 is known.
class Voice final : public VoeApplication {
  public:
    bool received(VoeServer& server, const VoeHeader& header, Bytes data, Time) override {
        for (unsigned n = 0; n < (header.vendor_type & 7U); ++n) (void)server.send(header, data);
        return header.vendor_id == 1;
    }
};

// Sends each frame back, and stores the IP parameters and the filter.
class Net final : public EoeApplication {
  public:
    void received(EoeServer& server, Bytes frame, Time) override {
        require(frame.size() >= wire::eoe::kLeastFrameBytes);
        (void)server.send(frame, 3);
    }
    EoeResult set_ip(const EoeIp& ip) override {
        ip_ = ip;
        return EoeResult::success;
    }
    EoeResult get_ip(EoeIp& ip) override {
        ip = ip_;
        return EoeResult::success;
    }
    EoeResult set_filter(const EoeFilter& filter) override {
        filter_ = filter;
        return filter.passes({1, 2, 3, 4, 5, 6}) ? EoeResult::success : EoeResult::unspecified;
    }
    EoeResult get_filter(EoeFilter& filter) override {
        filter = filter_;
        return EoeResult::success;
    }

  private:
    EoeIp ip_;
    EoeFilter filter_;
};

// Index group 1 has 64 octets. Each read of index group 2 returns another value.
class Cell final : public AoeDevice {
  public:
    AoeError read(AoeIndex index, MutableBytes into, std::size_t& bytes, Time) override {
        if (index.group == 2 && !into.empty()) into[0] = static_cast<std::byte>(++calls_);
        if (index.group == 2) bytes = into.size();
        if (index.group != 1) return index.group == 2 ? AoeError::none : AoeError::invalid_group;
        if (index.offset > octets_.size()) return AoeError::invalid_offset;
        bytes = std::min(into.size(), octets_.size() - index.offset);
        std::copy_n(octets_.begin() + index.offset, bytes, into.begin());
        return AoeError::none;
    }
    AoeError write(AoeIndex index, Bytes data, Time) override {
        if (index.offset > octets_.size() || data.size() > octets_.size() - index.offset)
            return AoeError::invalid_offset;
        std::copy(data.begin(), data.end(), octets_.begin() + index.offset);
        return AoeError::none;
    }
    AoeError read_write(AoeIndex index, Bytes written, MutableBytes into, std::size_t& bytes, Time now) override {
        const AoeError error = write(index, written, now);
        return error == AoeError::none ? read(index, into, bytes, now) : error;
    }
    AoeError write_control(AdsState, std::uint16_t, Bytes, Time) override { return AoeError::none; }

  private:
    std::array<std::byte, 64> octets_{};
    unsigned calls_ = 0;
};

class Author final : public testing::ReportingApplication<2, 3, 2> {
  public:
    const DeviceDescription& description() const override { return kDevice; }
    std::array<std::byte, 600> vast{};
};
inline HookAnswer slow(const ObjectAccess& access) {
    // Busy in every second millisecond.
    return (access.now.time_since_epoch().count() / 1'000'000) % 2 == 0 ? HookAnswer::later(access.now + 1ms)
                                                                        : HookAnswer(Abort::none);
}
inline HookAnswer slow_write(const ObjectAccess& access, Bytes) { return slow(access); }
inline MutableBytes vast(const ObjectAccess& access) { return static_cast<Author*>(access.application)->vast; }

// Reads the input octet by octet.
class Input {
  public:
    Input(const std::uint8_t* data, std::size_t size) : left_(std::as_bytes(std::span(data, size))) {}
    [[nodiscard]] bool done() const { return left_.empty(); }
    std::uint8_t octet() {
        if (left_.empty()) return 0;
        const auto first = std::to_integer<std::uint8_t>(left_[0]);
        left_ = left_.subspan(1);
        return first;
    }
    Bytes take(std::size_t most) {
        const auto taken = left_.first(std::min(most, left_.size()));
        left_ = left_.subspan(taken.size());
        return taken;
    }

  private:
    Bytes left_;
};

class MailDevice {
  public:
    // The octet `size` selects the size of both mailboxes: 16 to 256 octets.
    MailDevice(std::uint8_t size, bool boot) : bytes_(static_cast<std::uint16_t>(std::max(16, (size & 0x3F) * 4 + 4))) {
        axis_.server = &soe_;
        drives_[0].restore_defaults();
        device_.start(esc.time);
        bring_up(boot);
    }
    void bring_up(bool boot) {
        esc.al_control(0x11);
        step();
        hand_.configure(bytes_);
        step();
        esc.al_control(boot ? 3 : 2);
        step();
        require(esc.al_status() == AlStatus{boot ? AlState::boot : AlState::preop, false, 0});
    }
    void step() {
        (void)device_.step(esc.time);
        esc.time += 1ms;
    }
    // Writes a message to the receive mailbox without changes, cut to the size of the mailbox.
    bool put(Bytes message) { return hand_.put({message.begin(), message.end()}); }
    bool send(wire::MailboxType type, Bytes data) { return hand_.put(hand_.message(type, data)); }
    // Reads the send mailbox and checks the message; empty when there is no message.
    Bytes fetch() {
        reply_ = hand_.fetch();
        if (reply_.empty()) return {};
        const Bytes whole = reply_;
        const auto message = wire::load_mailbox_message(whole);
        require(message.has_value());
        require(message->header.counter >= 1 && message->header.counter <= 7);
        type_ = message->header.type;
        if (message->header.type == wire::MailboxType::error) {
            require(message->data.size() == wire::kMailboxErrorBytes);
            const auto detail = static_cast<unsigned>(wire::MailboxErrorLayout::detail::load(message->data));
            require(detail >= 1 && detail <= 9);
        } else {
            require(message->data.size() >= least_bytes(message->header.type));
        }
        step();
        return message->data;
    }
    // The same without AoE notifications, which the device sends until the master deletes them.
    Bytes fetch_reply() {
        for (int n = 0; n < 20; ++n) {
            const Bytes data = fetch();
            const bool notification = !data.empty() && type_ == wire::MailboxType::aoe &&
                                      wire::aoe::load_header(data).command == wire::aoe::Command::notification;
            if (!notification) return data;
        }
        return {};
    }
    // After any input, a correct request must get its reply, without a state change in between.
    void must_still_work() {
        const bool boot = esc.al_status().state == AlState::boot;
        for (int idle = 0, steps = 0; idle < 4; ++steps) {
            require(steps < 1000);
            step();
            idle = fetch_reply().empty() ? idle + 1 : 0;
        }
        // In BOOT the request reads a file that does not exist. In all other states it reads the device type.
        std::array<std::byte, 10> request{};
        if (boot) {
            request[0] = std::byte{1};
        } else {
            wire::coe::store_header(request, {0, wire::coe::Service::sdo_request});
            request[2] = std::byte{0x40};
            wire::coe::SdoLayout::index::store(request, 0x1000);
        }
        const std::uint8_t no_counter = 0;  // like a master that starts again
        const auto type = boot ? wire::MailboxType::foe : wire::MailboxType::coe;
        require(hand_.put(hand_.message(type, Bytes(request).first(boot ? 6 : 10), no_counter)));
        Bytes reply;
        for (int steps = 0; reply.empty() && steps < 20; ++steps) {  // notifications may precede the reply
            step();
            reply = fetch_reply();
        }
        if (boot) {
            require(!reply.empty() && reply[0] == std::byte{5});
        } else {
            require(reply.size() == 10 && reply[2] == std::byte{0x43} &&
                    load_le<std::uint32_t>(reply, 6) == 0x5A5A1234);
        }
    }

    testing::PlainEsc esc;

  private:
    static std::size_t least_bytes(wire::MailboxType type) {
        switch (type) {
            case wire::MailboxType::coe:
            case wire::MailboxType::foe: return wire::coe::kHeaderBytes;
            case wire::MailboxType::soe: return wire::soe::kHeaderBytes;
            case wire::MailboxType::voe: return wire::voe::kHeaderBytes;
            case wire::MailboxType::aoe: return wire::aoe::kHeaderBytes;
            case wire::MailboxType::eoe: return wire::eoe::kHeaderBytes;
            default: return SIZE_MAX;
        }
    }

    std::uint16_t bytes_;
    wire::MailboxType type_{};  // of the message that was fetched last
    testing::MailHand hand_{esc};
    Author author_;
    std::array<std::byte, Values::bytes> image_{};
    ObjectDictionary dictionary_{kObjects, image_, &author_};
    std::array<std::byte, 160> staging_{};
    CoeServer coe_{dictionary_, staging_, true, author_.emergencies()};
    Store store_;
    FoeServer foe_{store_};
    Axis axis_;
    std::array<std::byte, DriveValues::bytes> axis_image_{};
    std::array<SoeDrive, 1> drives_{{{kParameters, axis_image_, &axis_}}};
    std::array<std::byte, 150> soe_staging_{};
    SoeServer soe_{drives_, soe_staging_};
    Voice voice_;
    std::array<std::byte, 300> voe_memory_{};
    VoeServer voe_{voice_, voe_memory_};
    Net net_;
    std::array<std::byte, 400> frame_{};
    std::array<std::byte, 200> frames_{};
    EoeServer eoe_{net_, frame_, frames_};
    Cell own_cell_;
    Cell other_cell_;
    std::array<AoeRoute, 2> routes_{{{&own_cell_, 1}, {&other_cell_, 2, true, {{1, 1, 1, 1, 1, 1}}}}};
    std::array<AoeWatch, 2> watches_{};
    AoeServer aoe_{routes_, watches_};
    std::array<MailboxProtocol, 6> protocols_{{{wire::MailboxType::coe, &coe_},
                                               {wire::MailboxType::foe, &foe_, true},
                                               {wire::MailboxType::soe, &soe_},
                                               {wire::MailboxType::voe, &voe_},
                                               {wire::MailboxType::aoe, &aoe_},
                                               {wire::MailboxType::eoe, &eoe_}}};
    MailboxMemory<256, 3> memory_;
    ProcessDataMemory<8, 8, 8> process_memory_;
    ProcessData process_data_{esc, author_, dictionary_, process_memory_};
    Mailbox mailbox_{esc, memory_, protocols_};
    Device device_{esc, author_, process_data_, &mailbox_};
    std::vector<std::byte> reply_;
};

}  // namespace margay::subdevice::fuzzing
