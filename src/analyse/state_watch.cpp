#include "analyse/state_watch.hpp"

#include "wire/esc.hpp"

namespace margay::analyse {

using wire::Command;
namespace reg = wire::reg;
namespace al = wire::al;

namespace {

AlStatus status_of(std::uint16_t word) {
    return {.state = static_cast<AlState>(word & al::kStateMask), .error = (word & al::kErrorIndication) != 0};
}

// The value of a register of two octets. A master may read or write only the first octet.
std::optional<std::uint16_t> word_at(const Exchanged& e, Bytes data, std::uint16_t address) {
    if (const auto both = octets_at(e, data, address, 2)) return load_le<std::uint16_t>(*both);
    if (const auto first = octets_at(e, data, address, 1)) return load_le<std::uint8_t>(*first);
    return std::nullopt;
}

}  // namespace

StateWatch::Known& StateWatch::known(std::size_t slave) {
    if (known_.size() <= slave) known_.resize(slave + 1);
    return known_[slave];
}

void StateWatch::look(const Exchanged& e, SlaveTrack* slave) {
    const bool sent = !e.answered || e.wkc != 0;  // a request without a reply may have arrived
    if (writes_registers(e.header.command) && sent)
        if (const auto control = word_at(e, e.sent, reg::kAlControl.address)) {
            if (slave != nullptr)
                requested(e, slave->number, *control);
            else if (e.header.command == Command::BWR)
                requested(e, std::nullopt, *control);
        }
    if (!e.answered || e.wkc == 0 || !reads_registers(e.header.command)) return;
    const auto status = word_at(e, e.received, reg::kAlStatus.address);
    std::optional<std::uint16_t> code;
    if (const auto at = octets_at(e, e.received, reg::kAlStatusCode.address, 2)) code = load_le<std::uint16_t>(*at);
    if (slave == nullptr) {
        if (e.header.command == Command::BRD && status && e.passed == e.wkc) all_reported(e, *status);
        return;
    }
    if (status)
        reported(e, slave->number, *status, code);
    else if (code)
        code_reported(slave->number, *code);
}

void StateWatch::requested(const Exchanged& e, std::optional<std::size_t> slave, std::uint16_t control) {
    auto& before = slave ? known(*slave).control : all_control_;
    if (before == control) return;
    before = control;
    if (!slave)
        for (auto& one : known_) one.control = control;
    else
        all_control_.reset();
    const StateEvent event{.when = e.sent_at,
                           .slave = slave,
                           .requested = true,
                           .status = {.state = static_cast<AlState>(control & al::kStateMask)},
                           .acknowledge = (control & al::kErrorAcknowledge) != 0};
    analysis_.states.add(event, kMostEvents);
}

void StateWatch::reported(const Exchanged& e, std::size_t slave, std::uint16_t word,
                          std::optional<std::uint16_t> code) {
    auto status = status_of(word);
    if (status.error) status.code = code.value_or(0);
    auto& now = analysis_.slaves[slave].state;
    const bool same = now && now->state == status.state && now->error == status.error;
    if (same && (!status.error || !code || now->code == status.code)) return;
    if (same && now->code == 0) return code_reported(slave, status.code);
    now = status;
    known(slave).event = analysis_.states.items.size();
    analysis_.states.add({.when = e.at, .slave = slave, .status = status}, kMostEvents);
}

void StateWatch::code_reported(std::size_t slave, std::uint16_t code) {
    auto& now = analysis_.slaves[slave].state;
    if (!now || !now->error || now->code != 0) return;
    now->code = code;
    const auto& event = known(slave).event;
    if (event && *event < analysis_.states.items.size()) analysis_.states.items[*event].status.code = code;
}

// The states of all slaves, combined by OR. If exactly one bit is set, all slaves are in this state.
void StateWatch::all_reported(const Exchanged& e, std::uint16_t word) {
    const auto state = word & al::kStateMask;
    if (state != 1 && state != 2 && state != 4 && state != 8) return;
    if ((word & al::kErrorIndication) != 0) return;  // the error indication of any slave
    for (const auto& track : slaves_.all())
        if (!track.joined_to) reported(e, track.number, word, std::nullopt);
}

}  // namespace margay::analyse
