// Words for the values of an analysis.
#include "ethercat/analysis_output.hpp"

#include <margay/idn.hpp>

#include <fmt/format.h>

#include <array>
#include <utility>

namespace margay::ethercat {

using analyse::Action;
using analyse::Directions;
using analyse::Outcome;

std::string_view words_of(Directions directions) {
    switch (directions) {
        case Directions::none: return "no EtherCAT frames";
        case Directions::marked: return "requests and replies; the first slave has marked the replies";
        case Directions::same_address:
            return "requests and replies with the same source address; the second frame with the same datagrams counts "
                   "as the reply";
        case Directions::replies_only: return "replies only";
        case Directions::requests_only: return "requests only: no slave has answered, or the replies were not recorded";
    }
    return "?";
}

std::string lost_words(const analyse::Analysis& analysis, std::uint64_t lost) {
    return analysis.losses_known ? fmt::format("{} lost", lost) : std::string("losses not known");
}

bool late_known(const analyse::Analysis& analysis) {
    return analysis.directions != analyse::Directions::requests_only &&
           analysis.directions != analyse::Directions::replies_only;
}

std::string late_words(const analyse::Analysis& analysis, std::uint64_t late) {
    return late_known(analysis) ? fmt::format("{} late", late) : std::string("late replies not known");
}

std::string state_words(const AlStatus& status) {
    auto text = std::string(to_text(status.state));
    if (status.state == AlState::none) text = "no state";
    if (text.empty()) text = fmt::format("state {}", static_cast<unsigned>(status.state));
    return text + (status.error ? " + ERROR" : "");
}

std::string_view words_of(Outcome outcome) {
    switch (outcome) {
        case Outcome::done: return "done";
        case Outcome::refused: return "refused";
        case Outcome::unanswered: return "unanswered";
        case Outcome::unfinished: return "unfinished";
    }
    return "?";
}

std::string_view key_of(Action action) {
    switch (action) {
        case Action::sdo_upload: return "sdo_upload";
        case Action::sdo_download: return "sdo_download";
        case Action::object_list: return "object_list";
        case Action::object_description: return "object_description";
        case Action::entry_description: return "entry_description";
        case Action::foe_read: return "foe_read";
        case Action::foe_write: return "foe_write";
        case Action::soe_read: return "soe_read";
        case Action::soe_write: return "soe_write";
    }
    return "?";
}

// What of a parameter is read or written, where it is not the value alone.
static std::string elements_words(std::uint8_t elements) {
    constexpr std::array<std::pair<std::uint8_t, std::string_view>, 8> kNames{
        {{soe_element::kDataState, "the state"},
         {soe_element::kName, "the name"},
         {soe_element::kAttribute, "the attribute"},
         {soe_element::kUnit, "the unit"},
         {soe_element::kMinimum, "the minimum"},
         {soe_element::kMaximum, "the maximum"},
         {soe_element::kValue, "the value"},
         {soe_element::kDefault, "the default"}}};
    if (elements == soe_element::kValue) return {};
    if (elements == 0) return "no element of ";
    std::string text;
    for (const auto& [bit, name] : kNames)
        if ((elements & bit) != 0) text += (text.empty() ? "" : " and ") + std::string(name);
    return text + " of ";
}

std::string words_of(const analyse::Conversation& c) {
    const auto entry = [&] {
        return c.complete ? fmt::format("0x{:04x} (complete access from subindex {})", c.index, c.subindex)
                          : fmt::format("0x{:04x}:{:02x}", c.index, c.subindex);
    };
    const auto idn = [&] {
        std::array<char, 32> text{};
        return fmt::format("{}{} of drive {}", elements_words(c.elements),
                           c.index_known ? to_text(Idn{c.index}, text) : "an IDN that is not known", c.subindex);
    };
    const auto named = c.name.empty() ? std::string() : fmt::format(" \"{}\"", c.name);
    switch (c.action) {
        case Action::sdo_upload: return "SDO upload " + entry();
        case Action::sdo_download: return "SDO download " + entry();
        case Action::object_list: return fmt::format("SDO information: list of objects, type {}", c.index);
        case Action::object_description: return fmt::format("SDO information: object 0x{:04x}{}", c.index, named);
        case Action::entry_description: return "SDO information: entry " + entry() + named;
        case Action::foe_read: return "FoE read" + named;
        case Action::foe_write: return "FoE write" + named;
        case Action::soe_read: return "SoE read " + idn();
        case Action::soe_write: return "SoE write " + idn();
    }
    return "?";
}

std::string octet_list(const std::vector<std::byte>& octets) {
    std::string text;
    for (const auto b : octets) text += fmt::format("{}{:02x}", text.empty() ? "" : " ", std::to_integer<unsigned>(b));
    return text;
}

}  // namespace margay::ethercat
