#include "analyse/mail_watch.hpp"
#include "wire/coe.hpp"

#include <algorithm>
#include <optional>

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

// The octets of an upload response or a download request, and the announced number of octets.
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

bool is_sdo(const OpenConversation& conversation) {
    return conversation.facts.action == Action::sdo_upload || conversation.facts.action == Action::sdo_download;
}

// Whether the answer contains the object of the conversation. Some slaves send an abort with index 0.
bool is_of(Bytes answer, const OpenConversation& conversation, bool abort) {
    const auto index = coe::SdoLayout::index::load(answer);
    const auto subindex = coe::SdoLayout::subindex::load(answer);
    if (abort && index == 0 && subindex == 0) return !conversation.superseded;
    const auto& facts = conversation.facts;
    return index == facts.index && (facts.complete || subindex == facts.subindex);
}

std::optional<Action> action_of(coe::InfoOpcode opcode) {
    switch (opcode) {
        case coe::InfoOpcode::list_response: return Action::object_list;
        case coe::InfoOpcode::object_response: return Action::object_description;
        case coe::InfoOpcode::entry_response: return Action::entry_description;
        default: return {};
    }
}

// Whether the first fragment of an information response belongs to the request of the conversation.
bool describes(Bytes payload, const OpenConversation& conversation) {
    const auto& facts = conversation.facts;
    if (payload.size() < 2 || load_le<std::uint16_t>(payload) != facts.index) return false;
    return facts.action != Action::entry_description ||
           (payload.size() >= 3 && load_le<std::uint8_t>(payload, 2) == facts.subindex);
}

}  // namespace

template <class Belongs>
OpenConversation* MailWatch::open(const Mail& mail, Belongs belongs) {
    const auto found = open_.find({mail.slave.number, mail.header.type});
    if (found == open_.end()) return nullptr;
    auto& all = found->second;
    const auto youngest = std::find_if(all.rbegin(), all.rend(), belongs);
    return youngest == all.rend() ? nullptr : &*youngest;
}

void MailWatch::take_coe(const Mail& mail) {
    if (mail.data.size() < coe::kHeaderBytes + 1) return;
    switch (coe::load_header(mail.data).service) {
        case coe::Service::emergency: return take_emergency(mail);
        // Some slaves send an abort as a request, so the direction of the mail is used.
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
        if (auto* conversation = open(mail); conversation != nullptr && is_sdo(*conversation))
            end(mail, *conversation, Outcome::refused, code,
                "by the master: " + std::string(coe::to_text(static_cast<coe::Abort>(code))));
    }
}

void MailWatch::take_sdo_response(const Mail& mail) {
    const auto command = coe::SdoLayout::command::load(mail.data);
    const auto specifier = coe::sdo::specifier(command);
    const bool segment = specifier == coe::response::kUploadSegment || specifier == coe::response::kDownloadSegment;
    if (!segment && mail.data.size() < coe::kSdoBytes) return;
    if (specifier == coe::kAbortSpecifier) {
        auto* refused =
            open(mail, [&](const OpenConversation& one) { return is_sdo(one) && is_of(mail.data, one, true); });
        const auto code = coe::SdoLayout::complete_size::load(mail.data);
        if (refused != nullptr)
            end(mail, *refused, Outcome::refused, code, std::string(coe::to_text(static_cast<coe::Abort>(code))));
        return;
    }
    const bool upload = specifier == coe::response::kUpload || specifier == coe::response::kUploadSegment;
    if (!upload && specifier != coe::response::kDownload && specifier != coe::response::kDownloadSegment) return;
    auto* conversation = open(mail, [&](const OpenConversation& one) {
        if (one.facts.action != (upload ? Action::sdo_upload : Action::sdo_download)) return false;
        return segment ? one.begun : !one.begun && is_of(mail.data, one, false);
    });
    if (conversation == nullptr) return;
    conversation->begun = true;
    if (!upload) {
        if (conversation->last_sent) end(mail, *conversation, Outcome::done);
    } else if (segment) {
        append(*conversation, segment_of(mail.data, command));
        if ((command & coe::sdo::kLastSegment) != 0) end(mail, *conversation, Outcome::done);
    } else {
        const auto first = first_octets(mail.data, command);
        append(*conversation, first.data);
        conversation->announced = first.announced;
        if (first.data.size() >= first.announced) end(mail, *conversation, Outcome::done);
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
        conversation.facts.index = load_le<std::uint16_t>(payload);  // for a list: the type of the list
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
                if (auto* refused = open(mail); refused != nullptr && !is_sdo(*refused))
                    end(mail, *refused, Outcome::refused, static_cast<std::uint32_t>(code),
                        std::string(coe::to_text(code)));
            }
            return;
        default: break;
    }
    auto* conversation = open(mail, [&](const OpenConversation& one) {
        return one.facts.action == action_of(opcode) && (one.begun || describes(payload, one));
    });
    if (conversation == nullptr) return;
    conversation->begun = true;
    append(*conversation, payload);
    if ((octet & coe::kInfoIncomplete) != 0) return;
    take_description(mail, *conversation);
    end(mail, *conversation, Outcome::done);
}

// Reads the name in the complete response, whose first fragment begins with the index.
void MailWatch::take_description(const Mail& mail, OpenConversation& conversation) {
    constexpr std::size_t kObjectName = coe::kObjectResponseBytes - coe::kInfoHeaderBytes;
    constexpr std::size_t kEntryHead = coe::kEntryResponseBytes - coe::kInfoHeaderBytes;
    const Bytes all = conversation.data;
    auto& facts = conversation.facts;
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
