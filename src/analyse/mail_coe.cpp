#include "analyse/mail_watch.hpp"
#include "wire/coe.hpp"

#include <algorithm>

namespace margay::analyse {

namespace coe = wire::coe;

namespace {

// The octets of a segment.
Bytes segment_of(Bytes data, std::uint8_t command) {
    auto part = data.subspan(coe::kSegmentHeaderBytes);
    if (part.size() <= coe::kMinSegmentDataBytes)
        part =
            part.first(part.size() - std::min<std::size_t>(part.size(), command >> coe::sdo::kSegmentUnusedShift & 7U));
    return part;
}

// The octets of an upload response or a download request, and how many there will be.
struct FirstOctets {
    Bytes data{};
    std::uint64_t announced = 0;
};
FirstOctets first_octets(Bytes data, std::uint8_t command) {
    if ((command & coe::sdo::kExpedited) != 0) {
        const std::size_t unused =
            (command & coe::sdo::kSizeIndicated) != 0 ? command >> coe::sdo::kExpeditedUnusedShift & 3U : 0U;
        const auto value = data.subspan(coe::SdoLayout::expedited_data, coe::kExpeditedBytes - unused);
        return {value, value.size()};
    }
    const std::uint64_t announced = coe::SdoLayout::complete_size::load(data);
    const auto value = data.subspan(coe::SdoLayout::normal_data);
    return {value.first(static_cast<std::size_t>(std::min<std::uint64_t>(announced, value.size()))), announced};
}

}  // namespace

void MailWatch::take_coe(const Mail& mail) {
    if (mail.data.size() < coe::kHeaderBytes + 1) return;
    switch (coe::load_header(mail.data).service) {
        case coe::Service::emergency: return take_emergency(mail);
        // Some slaves send an abort as a request, so the direction counts.
        case coe::Service::sdo_request:
        case coe::Service::sdo_response: return mail.sent ? take_sdo_request(mail) : take_sdo_response(mail);
        case coe::Service::sdo_information: return take_sdo_information(mail);
        default: return;
    }
}

void MailWatch::take_sdo_request(const Mail& mail) {
    const auto command = coe::SdoLayout::command::load(mail.data);
    const auto specifier = coe::sdo::specifier(command);
    if (specifier == coe::request::kDownloadSegment) {
        auto* conversation = open(mail);
        if (conversation == nullptr || conversation->facts.action != Action::sdo_download) return;
        append(*conversation, segment_of(mail.data, command));
        conversation->last_sent = (command & coe::sdo::kLastSegment) != 0;
        return;
    }
    if (mail.data.size() < coe::kSdoBytes) return;
    const bool upload = specifier == coe::request::kUpload;
    if (upload || specifier == coe::request::kDownload) {
        auto& conversation = begin(mail, upload ? Action::sdo_upload : Action::sdo_download);
        conversation.facts.index = coe::SdoLayout::index::load(mail.data);
        conversation.facts.subindex = coe::SdoLayout::subindex::load(mail.data);
        conversation.facts.complete = (command & coe::sdo::kCompleteAccess) != 0;
        if (upload) return;
        const auto first = first_octets(mail.data, command);
        append(conversation, first.data);
        conversation.last_sent = first.data.size() >= first.announced;
    } else if (specifier == coe::kAbortSpecifier) {
        const auto code = coe::SdoLayout::complete_size::load(mail.data);
        end(mail, Outcome::refused, code, "by the master: " + std::string(coe::to_text(static_cast<coe::Abort>(code))));
    }
}

void MailWatch::take_sdo_response(const Mail& mail) {
    auto* conversation = open(mail);
    if (conversation == nullptr) return;
    const auto command = coe::SdoLayout::command::load(mail.data);
    const auto specifier = coe::sdo::specifier(command);
    if (specifier == coe::kAbortSpecifier && mail.data.size() >= coe::kSdoBytes) {
        const auto code = coe::SdoLayout::complete_size::load(mail.data);
        return end(mail, Outcome::refused, code, std::string(coe::to_text(static_cast<coe::Abort>(code))));
    }
    const auto action = conversation->facts.action;
    if (action == Action::sdo_upload && specifier == coe::response::kUpload && mail.data.size() >= coe::kSdoBytes) {
        const auto first = first_octets(mail.data, command);
        append(*conversation, first.data);
        conversation->announced = first.announced;
        if (first.data.size() >= first.announced) end(mail, Outcome::done);
    } else if (action == Action::sdo_upload && specifier == coe::response::kUploadSegment) {
        append(*conversation, segment_of(mail.data, command));
        if ((command & coe::sdo::kLastSegment) != 0) end(mail, Outcome::done);
    } else if (action == Action::sdo_download &&
               (specifier == coe::response::kDownload || specifier == coe::response::kDownloadSegment)) {
        if (conversation->last_sent) end(mail, Outcome::done);
    }
}

void MailWatch::take_sdo_information(const Mail& mail) {
    if (mail.data.size() < coe::kInfoHeaderBytes) return;
    const auto octet = coe::InfoLayout::opcode::load(mail.data);
    const auto opcode = static_cast<coe::InfoOpcode>(octet & ~coe::kInfoIncomplete);
    const auto payload = mail.data.subspan(coe::kInfoHeaderBytes);
    const auto ask = [&](Action action) {
        if (payload.size() < 2) return;
        auto& conversation = begin(mail, action);
        conversation.facts.index = load_le<std::uint16_t>(payload);  // of a list: its type
        if (action == Action::entry_description) conversation.facts.subindex = load_le<std::uint8_t>(payload, 2);
    };
    switch (opcode) {
        case coe::InfoOpcode::list_request: return ask(Action::object_list);
        case coe::InfoOpcode::object_request: return ask(Action::object_description);
        case coe::InfoOpcode::entry_request:
            if (payload.size() >= 3) ask(Action::entry_description);
            return;
        case coe::InfoOpcode::error:
            if (mail.data.size() >= coe::kInfoErrorBytes) {
                const auto code = coe::InfoLayout::abort::load(mail.data);
                end(mail, Outcome::refused, static_cast<std::uint32_t>(code), std::string(coe::to_text(code)));
            }
            return;
        default: break;
    }
    auto* conversation = open(mail);
    if (conversation == nullptr) return;
    append(*conversation, payload);
    if ((octet & coe::kInfoIncomplete) != 0) return;
    take_description(mail);
    end(mail, Outcome::done);
}

// The name in the whole response, of which the first fragment begins with the index.
void MailWatch::take_description(const Mail& mail) {
    constexpr std::size_t kObjectName = coe::kObjectResponseBytes - coe::kInfoHeaderBytes;
    constexpr std::size_t kEntryHead = coe::kEntryResponseBytes - coe::kInfoHeaderBytes;
    auto* conversation = open(mail);
    const Bytes all = conversation->data;
    auto& facts = conversation->facts;
    std::size_t at = all.size();
    if (facts.action == Action::object_description) {
        at = kObjectName;
    } else if (facts.action == Action::entry_description && all.size() >= kEntryHead) {
        const auto contents = load_le<std::uint8_t>(all, 3);
        const std::size_t octets = (load_le<std::uint16_t>(all, 6) + std::size_t{7}) / 8;
        at = kEntryHead + ((contents & coe::value_info::kUnit) != 0 ? 4 : 0);
        for (const auto bit : {coe::value_info::kDefault, coe::value_info::kMinimum, coe::value_info::kMaximum})
            if ((contents & bit) != 0) at += octets;
    }
    if (at >= all.size()) return;
    facts.name = printable(all.subspan(at));
    constexpr std::size_t kMostNames = 16'384;
    auto& names = mail.slave.names;
    const auto sub = facts.action == Action::object_description ? 0xFFFU : std::uint32_t{facts.subindex};
    if (names.size() < kMostNames) names[std::uint32_t{facts.index} << 12 | sub] = facts.name;
}

void MailWatch::take_emergency(const Mail& mail) {
    if (mail.sent || mail.data.size() < coe::kEmergencyBytes) return;
    Emergency emergency{.when = mail.when,
                        .slave = mail.slave.number,
                        .code = coe::EmergencyLayout::error_code::load(mail.data),
                        .error_register = coe::EmergencyLayout::error_register::load(mail.data)};
    std::ranges::copy(mail.data.subspan(coe::EmergencyLayout::data, coe::kEmergencyDataBytes), emergency.data.begin());
    analysis_.emergencies.add(emergency, kMostEvents);
}

}  // namespace margay::analyse
