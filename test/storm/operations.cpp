#include "storm/operation_of.hpp"

#include <algorithm>

namespace margay::storm {
namespace {

// Objects of devices in the library, and some objects that no device has.
constexpr std::array<std::uint32_t, 20> kObjects{0x100000, 0x100800, 0x100900, 0x101801, 0x101800, 0x1C0000, 0x1C1200,
                                                 0x1C1300, 0x160000, 0x1A0000, 0x160001, 0x200000, 0x200100, 0x200F00,
                                                 0x600001, 0x700001, 0x604100, 0x10F306, 0x7FFF00, 0x300001};
std::uint16_t object(std::uint32_t a) { return static_cast<std::uint16_t>(kObjects[a % kObjects.size()] >> 8); }
std::uint8_t subindex(std::uint32_t a) { return static_cast<std::uint8_t>(kObjects[a % kObjects.size()]); }

constexpr std::array kStates{AlState::init, AlState::preop, AlState::safeop, AlState::op, AlState::boot, AlState::none};
AlState state(std::uint32_t a) { return kStates[a % kStates.size()]; }

constexpr Set kNothing = [](Operation&, std::uint32_t, std::uint32_t, std::uint32_t) {};

constexpr Set kSiiRead = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& all = as<SiiReadRequest>(o);
    all.r.slave = slave_number(slave);
    all.r.word = a % 0x100;
    all.r.data = std::span(all.data).first(2 * (b % 40));
};
constexpr Set kSiiWrite = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& all = as<SiiWriteRequest>(o);
    all.r.slave = slave_number(slave);
    all.r.word = 0x200 + a % 0x40;  // behind the words that identify the slave
    all.r.data = std::span(all.data).first(2 * (b % 6));
};
constexpr Set kState = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& r = as<StateRequest>(o).r;
    r.slave = slave_number(slave);
    r.wanted = state(a);
    r.timeout = std::chrono::milliseconds(b % 4 * 100);
};
constexpr Set kWriteState = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t) {
    auto& r = as<WriteStateRequest>(o).r;
    r.slave = slave_number(slave);
    r.wanted = state(a);
};
constexpr Set kStateCheck = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& r = as<StateCheckRequest>(o).r;
    r.slave = slave_number(slave);
    r.wanted = state(a);
    r.timeout = std::chrono::milliseconds(b % 8 * 50);
};
constexpr Set kSupervise = [](Operation& o, std::uint32_t, std::uint32_t a, std::uint32_t b) {
    auto& all = as<SuperviseRequest>(o);
    all.r.target = a % 4 == 1 ? AlState::safeop : AlState::op;
    all.r.line_interval = b == 0 ? Duration{0} : Duration(std::chrono::milliseconds(b % 500));
    all.r.line_errors = b == 0 ? std::span<LineErrors>() : std::span<LineErrors>(all.lines);
};
constexpr Set kReconfig = [](Operation& o, std::uint32_t slave, std::uint32_t, std::uint32_t) {
    as<ReconfigRequest>(o).r.slave = slave_number(slave);
};
constexpr Set kSdoUpload = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& all = as<SdoUpload>(o);
    address_mail(all.r, slave, b);
    all.r.index = object(a);
    all.r.complete_access = (a >> 8) % 4 == 1;
    all.r.subindex = all.r.complete_access ? std::uint8_t{0} : subindex(a);
    all.r.data = std::span(all.data).first((a >> 10) % 8 == 1 ? 1 : all.data.size());
};
constexpr Set kSdoDownload = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& all = as<SdoDownload>(o);
    address_mail(all.r, slave, b);
    // objects that are no PDO mappings
    constexpr std::array<std::uint16_t, 4> kWritable{0x2000, 0x2001, 0x7000, 0x3FFF};
    all.r.index = kWritable[a % kWritable.size()];
    all.r.subindex = static_cast<std::uint8_t>((a >> 4) % 2);
    all.r.data = std::span<const std::byte>(all.data).first(1 + (a >> 5) % 1024);
};
constexpr Set kObjectList = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& r = as<ObjectListRequest>(o).r;
    address_mail(r, slave, b);
    r.list = static_cast<ObjectList>(a % 6);
    r.found = [](std::span<const std::uint16_t>, void*) {};
};
constexpr Set kObjectDescription = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& r = as<ObjectDescriptionRequest>(o).r;
    address_mail(r, slave, b);
    r.index = object(a);
};
constexpr Set kEntryDescription = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& r = as<EntryDescriptionRequest>(o).r;
    address_mail(r, slave, b);
    r.index = object(a);
    r.subindex = subindex(a);
    r.with_values = (a >> 8) % 2 == 1;
};
constexpr Set kPdoSend = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& all = as<MailPdoSend>(o);
    address_mail(all.r, slave, b);
    all.r.number = static_cast<std::uint16_t>(a % 512);
    all.r.data = std::span<const std::byte>(all.data).first(a % 32);
};
constexpr Set kPdoFetch = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& all = as<MailPdoFetch>(o);
    address_mail(all.r, slave, b);
    all.r.number = static_cast<std::uint16_t>(a % 512);
    all.r.data = all.data;
};
constexpr std::array<std::uint16_t, 8> kIdns{15, 16, 17, 47, 51, 99, 148, 4000};
constexpr Set kSoeRead = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& all = as<SoeRead>(o);
    address_mail(all.r, slave, b);
    all.r.drive = static_cast<std::uint8_t>((a >> 8) % 3);
    all.r.idn = {kIdns[a % kIdns.size()]};
    all.r.elements = static_cast<std::uint8_t>((a >> 12) % 2 == 0 ? soe_element::kValue : (a >> 13) & 0xFF);
    all.r.data = all.data;
};
constexpr Set kSoeWrite = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& all = as<SoeWrite>(o);
    address_mail(all.r, slave, b);
    all.r.drive = static_cast<std::uint8_t>((a >> 8) % 3);
    all.r.idn = {static_cast<std::uint16_t>(a % 2 == 0 ? 47 : 4000)};
    all.r.data = std::span<const std::byte>(all.data).first(4);
};
constexpr Set kSoeCommand = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& r = as<SoeCommand>(o).r;
    address_mail(r, slave, b);
    if (r.timeout == Duration{0}) r.timeout = 3s;  // without a timeout the request lasts until the drive ends it
    r.drive = static_cast<std::uint8_t>((a >> 8) % 3);
    r.idn = {static_cast<std::uint16_t>(a % 2 == 0 ? 99 : 148)};
};
constexpr Set kRegisterRead = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& all = as<RegisterReadRequest>(o);
    all.r.slave = slave_number(slave);
    all.r.address = static_cast<std::uint16_t>(a % 0x1000);
    all.r.data = std::span(all.data).first(1 + b % 64);
};
constexpr Set kRegisterWrite = [](Operation& o, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto& all = as<RegisterWriteRequest>(o);
    all.r.slave = slave_number(slave);
    all.r.address = static_cast<std::uint16_t>(0x0F80 + a % 0x40);  // the user RAM
    all.r.data = std::span<const std::byte>(all.data).first(1 + b % 32);
};

}  // namespace

const std::vector<KindInfo>& kinds() {
    static const std::vector<KindInfo> kAll = [] {
        std::vector<KindInfo> all{
            {"scan", make<ScanRequest>, kNothing, false, false, false},
            {"sii_read", make<SiiReadRequest>, kSiiRead, false, false, true},
            {"sii_write", make<SiiWriteRequest>, kSiiWrite, false, false, false},
            {"state", make<StateRequest>, kState, false, false, false},
            {"read_state", make<ReadStateRequest>, kNothing, false, false, true},
            {"write_state", make<WriteStateRequest>, kWriteState, false, false, false},
            {"state_check", make<StateCheckRequest>, kStateCheck, false, false, true},
            {"map", make<MapRequest>, kNothing, false, false, false},  // World sets the image
            {"supervise", make<SuperviseRequest>, kSupervise, false, true, false},
            {"reconfig", make<ReconfigRequest>, kReconfig, false, false, false},
            {"recover", make<RecoverRequest>, kNothing, false, false, false},
            {"sdo_upload", make<SdoUpload>, kSdoUpload, true, false, true},
            {"sdo_download", make<SdoDownload>, kSdoDownload, true, false, false},
            {"object_list", make<ObjectListRequest>, kObjectList, true, false, true},
            {"object_description", make<ObjectDescriptionRequest>, kObjectDescription, true, false, true},
            {"entry_description", make<EntryDescriptionRequest>, kEntryDescription, true, false, true},
            {"pdo_send", make<MailPdoSend>, kPdoSend, true, false, true},
            {"pdo_fetch", make<MailPdoFetch>, kPdoFetch, true, false, true},
            {"soe_read", make<SoeRead>, kSoeRead, true, false, true},
            {"soe_write", make<SoeWrite>, kSoeWrite, true, false, false},
            {"soe_command", make<SoeCommand>, kSoeCommand, true, false, false},
            {"register_read", make<RegisterReadRequest>, kRegisterRead, false, false, true},
            {"register_write", make<RegisterWriteRequest>, kRegisterWrite, false, false, true},
        };
        const auto later = later_kinds();
        all.insert(all.end(), later.begin(), later.end());
        return all;
    }();
    return kAll;
}

std::string_view kind_name(std::uint32_t kind) { return kind < kinds().size() ? kinds()[kind].name : "none"; }

std::optional<std::uint32_t> kind_by_name(std::string_view name) {
    for (std::uint32_t n = 0; n < kinds().size(); ++n)
        if (kinds()[n].name == name) return n;
    return std::nullopt;
}

std::unique_ptr<Operation> make_operation(std::uint32_t kind, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    auto operation = kinds()[kind].make();
    operation->kind_ = kind;
    set_operation(*operation, slave, a, b);
    return operation;
}

void set_operation(Operation& operation, std::uint32_t slave, std::uint32_t a, std::uint32_t b) {
    kinds()[operation.kind()].set(operation, slave, a, b);
}

}  // namespace margay::storm
