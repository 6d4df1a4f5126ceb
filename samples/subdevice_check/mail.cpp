#include "subdevice_check/mail.hpp"

#include "wire/coe.hpp"
#include "wire/datagram.hpp"

#include <algorithm>

namespace margay::samples::conformance {
namespace {

using namespace std::chrono_literals;
using wire::MailboxType;
namespace coe = wire::coe;

constexpr std::size_t kMostMailbox = 1486;  // octets in one datagram
constexpr std::size_t kCounterOctet = 5;    // of the mailbox header
constexpr MailboxType kNoProtocol = static_cast<MailboxType>(0x0E);

std::uint16_t protocol_bit(MailboxType type) {
    switch (type) {
        case MailboxType::aoe: return mailbox_protocol::kAoE;
        case MailboxType::eoe: return mailbox_protocol::kEoE;
        case MailboxType::coe: return mailbox_protocol::kCoE;
        case MailboxType::foe: return mailbox_protocol::kFoE;
        case MailboxType::soe: return mailbox_protocol::kSoE;
        case MailboxType::voe: return mailbox_protocol::kVoE;
        default: return 0;
    }
}

std::size_t shortest(const Mail& mail) {
    switch (mail.header.type) {
        case MailboxType::error: return wire::kMailboxErrorBytes;
        case MailboxType::coe: return coe::kInfoHeaderBytes;
        case MailboxType::eoe:
        case MailboxType::soe: return 4;
        case MailboxType::foe: return 6;
        case MailboxType::aoe: return 32;
        default: return 1;
    }
}

// The length of a message whose content has a fixed or an announced size; nullopt: another message.
std::optional<std::size_t> longest(const Mail& mail) {
    if (mail.header.type == MailboxType::error) return wire::kMailboxErrorBytes;
    if (mail.header.type != MailboxType::coe || mail.data.size() < coe::kSdoBytes) return std::nullopt;
    const auto service = coe::load_header(mail.data).service;
    const auto command = coe::SdoLayout::command::load(mail.data);
    const auto specifier = coe::sdo::specifier(command);
    const bool abort = service == coe::Service::sdo_request && specifier == coe::kAbortSpecifier;
    if (abort) return coe::kSdoBytes;
    if (service != coe::Service::sdo_response) return std::nullopt;
    if (specifier == coe::response::kDownload || specifier == coe::response::kDownloadSegment) return coe::kSdoBytes;
    if (specifier != coe::response::kUpload) return std::nullopt;
    if ((command & coe::sdo::kExpedited) != 0) return coe::kSdoBytes;
    if ((command & coe::sdo::kSizeIndicated) == 0) return std::nullopt;
    return coe::kSdoBytes + std::size_t{coe::SdoLayout::complete_size::load(mail.data)};
}

bool is_coe(const Mail& mail, coe::Service service) {
    return mail.header.type == MailboxType::coe && mail.data.size() >= coe::kHeaderBytes &&
           coe::load_header(mail.data).service == service;
}

}  // namespace

std::string hex(Bytes octets, std::size_t most) {
    std::string text;
    for (std::size_t n = 0; n < std::min(octets.size(), most); ++n)
        text += fmt::format("{}{:02x}", n == 0 ? "" : " ", std::to_integer<unsigned>(octets[n]));
    return octets.size() > most ? text + " …" : text;
}

void MailBench::needs_mailbox() {
    if (!bench_.has_mailbox()) bench_.skip("the SII describes no mailbox");
    if (std::max(out_bytes(), in_bytes()) > kMostMailbox) bench_.skip("the mailboxes are larger than a frame carries");
    if (std::min(out_bytes(), in_bytes()) < wire::kMailboxHeaderBytes + coe::kSdoBytes)
        bench_.skip("the mailboxes are too small for a message");
    if (dead()) bench_.skip(dead_);
}

void MailBench::needs_protocol(std::uint16_t protocol, std::string_view name) {
    if (!bench_.has(protocol)) bench_.skip(fmt::format("the SII does not announce {}", name));
    needs_mailbox();
}

// Earlier emergencies are forgotten, because an emergency is sent again if its cause still exists.
void MailBench::restarted() {
    last_received_.reset();
    emergencies_.clear();
}

std::uint8_t MailBench::next_counter() { return counter_ = wire::next_mailbox_counter(counter_); }

bool MailBench::try_put(const wire::MailboxHeader& header, Bytes data) {
    std::vector<std::byte> whole(out_bytes());
    wire::store_mailbox_header(whole, header);
    std::copy_n(data.begin(), std::min(data.size(), whole.size() - wire::kMailboxHeaderBytes),
                whole.begin() + static_cast<std::ptrdiff_t>(wire::kMailboxHeaderBytes));
    return bench_.try_write(bench_.slave().mailbox.out_start, whole);
}

void MailBench::put(MailboxType type, Bytes data) {
    const wire::MailboxHeader header{
        .length = static_cast<std::uint16_t>(data.size()), .type = type, .counter = next_counter()};
    const Time begun = bench_.now();
    while (!try_put(header, data)) {
        if (bench_.now() - begun > kResponse) bench_.stuck("the slave does not empty its receive mailbox");
        bench_.wait(200us);
    }
}

std::optional<Mail> MailBench::take(Duration patience) {
    const Time begun = bench_.now();
    const Time until = begun + patience;
    while ((bench_.sync_manager_status(1) & wire::sm_status::kMailboxFull) == 0) {
        if (bench_.now() >= until) return std::nullopt;
        bench_.wait(bench_.now() - begun < 3ms ? 50us : 1ms);
    }
    Mail mail;
    mail.raw.resize(in_bytes());
    if (!bench_.try_read(bench_.slave().mailbox.in_start, mail.raw)) return std::nullopt;
    mail.header = wire::load_mailbox_header(mail.raw);
    if (mail.header.length <= mail.raw.size() - wire::kMailboxHeaderBytes) {
        const auto data = Bytes(mail.raw).subspan(wire::kMailboxHeaderBytes, mail.header.length);
        mail.data.assign(data.begin(), data.end());
    }
    judge(mail);
    return mail;
}

std::size_t MailBench::drain(Duration quiet) {
    std::size_t count = 0;
    while (const auto mail = take(quiet)) {
        unasked(*mail);
        if (++count == 100) bench_.skip("the slave sends messages without an end");
    }
    return count;
}

Mail MailBench::ask(MailboxType type, Bytes data, const std::function<bool(const Mail&)>& is_reply) {
    auto mail = ask_if(type, data, is_reply, kResponse);
    if (!mail) {
        bench_.fail(
            fmt::format("the request {} of protocol {} got {}", hex(data), wire::to_text(type), no_reply_text()));
        bench_.skip("a request got no reply");
    }
    return *std::move(mail);
}

std::optional<Mail> MailBench::ask_if(MailboxType type, Bytes data, const std::function<bool(const Mail&)>& is_reply,
                                      Duration patience) {
    (void)drain(0ns);
    other_.reset();
    put(type, data);
    const Time begun = bench_.now();
    for (int others = 0; others < 50; ++others) {
        const auto left = std::max<Duration>(Duration{0}, patience - (bench_.now() - begun));
        auto mail = take(left);
        if (!mail) return std::nullopt;
        if (mail->header.address == 0 && is_reply(*mail)) {
            ++replies_;
            slowest_reply_ = std::max(slowest_reply_, bench_.now() - begun);
            return mail;
        }
        unasked(*mail);
        if (!is_coe(*mail, coe::Service::emergency)) other_ = *std::move(mail);
    }
    return std::nullopt;
}

std::string MailBench::no_reply_text() const {
    if (!other_) return fmt::format("no reply within {} s", kResponse / 1s);
    const auto station =
        other_->header.address != 0 ? fmt::format(" with the address 0x{:04x}", other_->header.address) : std::string();
    return fmt::format("no valid reply, but a message of protocol {}{}, length {}: {}",
                       wire::to_text(other_->header.type), station, other_->header.length, hex(other_->data));
}

// ------------------------------------------------------------------ a request for every slave

MailBench::Ping MailBench::ping() const {
    if (bench_.has(mailbox_protocol::kCoE)) {
        std::vector<std::byte> data(coe::kSdoBytes);
        coe::store_header(data, {0, coe::Service::sdo_request});
        coe::SdoLayout::command::store(data, coe::sdo::command(coe::request::kUpload));
        coe::SdoLayout::index::store(data, 0x1000);
        return {MailboxType::coe, std::move(data)};
    }
    if (bench_.has(mailbox_protocol::kSoE))  // read the attribute of S-0-0017, the list of all parameters
        return {MailboxType::soe, {std::byte{0x01}, std::byte{0x04}, std::byte{17}, std::byte{0}}};
    return {kNoProtocol, std::vector<std::byte>(2)};  // the reply is an error
}

bool MailBench::answers_ping(const Mail& mail) const {
    const auto& data = mail.data;
    if (bench_.has(mailbox_protocol::kCoE))
        return (is_coe(mail, coe::Service::sdo_response) || is_coe(mail, coe::Service::sdo_request)) &&
               data.size() >= coe::kSdoBytes && coe::SdoLayout::index::load(data) == 0x1000;
    if (bench_.has(mailbox_protocol::kSoE))
        return mail.header.type == MailboxType::soe && data.size() >= 4 &&
               (std::to_integer<unsigned>(data[0]) & 7U) == 2 && load_le<std::uint16_t>(data, 2) == 17;
    return mail.header.type == MailboxType::error;
}

bool MailBench::ping_works(Duration patience) {
    const auto message = ping();
    return ask_if(
               message.type, message.data, [this](const Mail& mail) { return answers_ping(mail); }, patience)
        .has_value();
}

// ------------------------------------------------------------------ what is wrong with messages

void MailBench::note(Oddity oddity, std::string example) {
    auto& record = records_[static_cast<std::size_t>(oddity)];
    if (record.count++ == 0) record.example = std::move(example);
}

void MailBench::judge(const Mail& mail) {
    const auto& header = mail.header;
    ++messages_;
    if (header.counter == 0) {
        note(Oddity::counter_zero, fmt::format("a message of protocol {}", wire::to_text(header.type)));
    } else {
        if (last_received_ && header.counter != wire::next_mailbox_counter(*last_received_))
            note(Oddity::counter_order, fmt::format("counter {} after {}", header.counter, *last_received_));
        last_received_ = header.counter;
    }
    if (header.length > mail.raw.size() - wire::kMailboxHeaderBytes)
        note(Oddity::too_long, fmt::format("length {} in a mailbox of {} octets", header.length, mail.raw.size()));
    else if (header.length < shortest(mail))
        note(Oddity::too_short,
             fmt::format("length {} in a message of protocol {}", header.length, wire::to_text(header.type)));
    else if (const auto most = longest(mail); most && header.length > *most)
        note(Oddity::surplus, fmt::format("length {} in place of {}: {}", header.length, *most, hex(mail.data)));
    if (header.channel != 0)
        note(Oddity::channel,
             fmt::format("a message of protocol {} on channel {}", wire::to_text(header.type), header.channel));
    if (mail.raw.size() > kCounterOctet && (std::to_integer<unsigned>(mail.raw[kCounterOctet]) & 0x80) != 0)
        note(Oddity::reserved_bit, fmt::format("a message of protocol {}", wire::to_text(header.type)));
    if (header.type == MailboxType::coe && mail.data.size() >= coe::kHeaderBytes) {
        using enum coe::Service;
        const auto [number, service] = coe::load_header(mail.data);
        const bool none =
            service == emergency || service == sdo_request || service == sdo_response || service == sdo_information;
        if (none && number != 0) note(Oddity::coe_number, fmt::format("number {}: {}", number, hex(mail.data)));
    }
    const auto bit = protocol_bit(header.type);
    if (header.type != MailboxType::error && !bench_.has(bit))
        note(Oddity::protocol_unknown, fmt::format("a message of protocol {}", wire::to_text(header.type)));
}

void MailBench::unasked(const Mail& mail) {
    if (mail.data.size() < shortest(mail)) return;  // judge() has noted it
    if (mail.header.address != 0)
        note(Oddity::other_station, fmt::format("a message with the address 0x{:04x}", mail.header.address));
    if (is_coe(mail, coe::Service::emergency)) {
        ++emergency_count_;
        const bool reset = load_le<std::uint16_t>(mail.data, 2) == 0;  // all errors were reset, and may occur again
        if (reset) emergencies_.clear();
        if (!reset && !emergencies_.insert(hex(mail.data, mail.data.size())).second)
            note(Oddity::repeated_emergency, "emergency " + hex(mail.data));
    } else if (mail.header.type == MailboxType::error) {
        note(Oddity::unasked_reply, "a mailbox error, " + hex(mail.data));
    } else if (is_coe(mail, coe::Service::sdo_response) || is_coe(mail, coe::Service::sdo_request)) {
        note(Oddity::unasked_reply, "an SDO, " + hex(mail.data));
    } else if (is_coe(mail, coe::Service::sdo_information)) {
        note(Oddity::unasked_reply, "an SDO information response, " + hex(mail.data));
    }
}

}  // namespace margay::samples::conformance
