#include "network/groups.hpp"

#include "network/coincidence.hpp"
#include "network/configure.hpp"
#include "network/entries.hpp"
#include "network/group_layout.hpp"
#include "network/hooks.hpp"
#include "network/members.hpp"
#include "network/newcomer.hpp"
#include "network/pdo_lists.hpp"
#include "network/pdos.hpp"
#include "network/recovery.hpp"
#include "network/search.hpp"
#include "network/settings.hpp"
#include "network/startup.hpp"
#include "network/transition.hpp"
#include "network/wanted.hpp"
#include "station/al_state.hpp"
#include "wire/al_status_code.hpp"

#include <algorithm>

namespace margay {
namespace {

// Calls the hook of a slave. The slave is brought back to PREOP first, in case the group was mapped before.
Task<Result<>> prepare_slave(Network& network, Slave& slave, FirstFault& faults) {
    slave.hook_failed = false;
    if (!slave.hooks.preop_to_safeop || slave.al.state == AlState::none || slave.al.state == AlState::init)
        co_return Nothing{};
    if (slave.al.state == AlState::safeop || slave.al.state == AlState::op) {
        // The result is not used: the configuration of the slave, which follows, finds an error again.
        co_await completion(bring_to_state(network, slave, AlState::preop));
    }
    Result<> done;
    if (slave.hooks.preop_to_safeop)  // the application may have removed the hook meanwhile
        done = co_await call_hook(slave.hooks.preop_to_safeop, network, slave);
    slave.hook_failed = !done.ok();
    if (!done) faults.note(network, slave, done.error());
    co_return done;
}

// Copies of the group that name the slave are not executed any more: the outputs of their destinations stay as they
// are.
void report_copies(Network& network, const Slave& slave, FirstFault& faults) {
    const ProcessGroup& group = network.process.groups[slave.image.group];
    const auto names = [&slave](const SlaveToSlave& copy) {
        return copy.from_slave == slave.number || copy.to_slave == slave.number;
    };
    if (!group.mapped || std::ranges::none_of(group.config.copies, names)) return;
    // This is no error of the slave: the slave is mapped in its new group.
    const Error error = invalid_mapping(Argument::copy, slave.number);
    network.note(error);
    faults.keep(error);
}

// The slave was in the earlier mapping of a group, and the application has assigned it to another group since. Its
// FMMUs must not answer at the addresses of the new mapping.
Task<Result<>> leave_group(Network& network, Slave& slave, FirstFault& faults) {
    report_copies(network, slave, faults);
    leave_counters(network, slave);
    if (network.has_mailbox(slave))
        network.mailbox(slave).forget_status_bit(network.process.groups[slave.image.group].image);
    if (slave.al.state != AlState::none) {
        co_await completion(clear_fmmus(network, slave));  // a slave that does not answer maps nothing
    }
    if (slave.al.state == AlState::safeop || slave.al.state == AlState::op) {
        auto back = co_await bring_to_state(network, slave, AlState::preop);
        if (!back) network.note(slave, back.error());
    }
    slave.image = {};
    co_return Nothing{};
}

// Whether the application has set other start-up commands since the slave left INIT, and some of them are for the
// transition from INIT to PREOP.
bool has_late_commands(const Network& network, const Slave& slave) {
    if (network.marks(slave).started_with == check_of_ip_commands(slave)) return false;
    constexpr Transition kIp = Transition::init_to_preop;
    return has_commands(slave, kIp, Moment::before) || has_commands(slave, kIp, Moment::after);
}

// Whether the slave can be read. In BOOT the slave executes its bootloader, whose mailbox has no process data.
bool is_there_to_map(const Slave& slave) { return slave.al.state != AlState::none && slave.al.state != AlState::boot; }

constexpr auto kNeedsInit = static_cast<std::uint16_t>(wire::AlStatusCode::needs_init);

// Starts a slave that was held, that is still in INIT or requires INIT, or whose commands were set after it had left
// INIT.
Task<Result<>> start_up(Network& network, Slave& slave, std::uint8_t number, FirstFault& faults) {
    const bool ours = slave.config.group == number || slave.image.group == number;
    if (ours && (slave.al.state != AlState::none || slave.seen)) {
        auto now = co_await read_anew(network, slave);  // nothing may have read the state for long
        if (!now && !does_not_answer(now.error())) faults.note(network, slave, now.error());
    }
    // A slave that is missing or held keeps its error. A slave that could not be read keeps its error until it is read
    // again.
    const bool stays = slave.held || slave.al.state == AlState::none || (slave.ring_position != 0 && !slave.seen);
    if (slave.config.group == number && !stays) slave.error = {};  // the error of an earlier attempt
    const bool leaves = slave.config.group != number && slave.image.group == number;
    const bool comes = slave.config.group == number && slave.image.group != number;
    if (slave.image.group != SlaveImage::kNoGroup && (leaves || comes)) {
        auto left = co_await leave_group(network, slave, faults);
        if (!left || leaves) co_return left;
    }
    // An earlier mapping ends here. The FMMUs of that mapping would read memory whose SyncManager is disabled, and
    // would still increment the working counter.
    if (slave.config.group == number && exchanges(slave) && slave.al.state != AlState::none) {
        co_await completion(clear_fmmus(network, slave));  // a slave that does not answer maps nothing
    }
    // Where only the identity is in question, the slave is compared, and not started again. New firmware may have
    // written its revision into the EEPROM since the slave reached PREOP.
    const bool in_question = network.marks(slave).unproved || network.marks(slave).new_firmware;
    const bool doubted = in_question && slave.seen && slave.config.group == number && !slave.held &&
                         is_there_to_map(slave) && slave.al.state != AlState::init;
    if (doubted) {
        const SlaveToken token(network.marks(slave));
        auto same = co_await prove(network, slave);
        if (!same) {
            faults.note(network, slave, same.error());
            co_return Nothing{};
        }
    }
    const bool readable = !slave.held || is_unread(slave);
    const bool unread = !slave.seen && readable && slave.config.group == number && is_there_to_map(slave);
    if (unread) {  // the scan has not found the slave, or could not read it
        auto known = co_await read_missing_slave(network, slave);
        if (!known) faults.note(network, slave, known.error());
        if (!known) co_return Nothing{};
    }
    const bool due = unread || (slave.al.error && slave.al.code == kNeedsInit) || network.marks(slave).unproved ||
                     network.marks(slave).from_boot || network.marks(slave).held_back ||
                     slave.al.state == AlState::init || has_late_commands(network, slave) ||
                     is_unfinished(network, slave);
    if (slave.config.group != number || slave.held || !due || !is_there_to_map(slave) ||
        wanted_state(network, slave) == AlState::init)
        co_return Nothing{};
    auto done = co_await restart(network, slave);
    if (!done) faults.note(network, slave, done.error());
    co_return Nothing{};
}

// Finds the process data of the slave. For a slave that cannot be read a place is reserved, if its sizes are known.
Task<Result<>> discover(Network& network, Slave& slave, std::uint8_t number, FirstFault& faults) {
    if (slave.config.group != number) co_return Nothing{};
    slave.unplaced = false;
    network.marks(slave).pdos_written = false;
    const Error wrong = invalid_setting(slave);
    slave.pdos_failed = wrong.code != Errc::none;
    if (slave.pdos_failed) {
        slave.unplaced = !keep_place(slave);
        faults.note(network, slave, wrong);
        co_return Nothing{};
    }
    if (slave.config.highest < AlState::safeop) co_return Nothing{};
    if (slave.held)
        forget_described(slave);  // the process data of the slave at this place, which is not the expected slave
    if (slave.held || !is_there_to_map(slave) || !slave.seen) {
        // Without a list of expected slaves, an unknown slave is one that the scan has found and could not read.
        const bool nobodys = (slave.held && slave.unexpected) ||
                             (slave.wanted == nullptr && !is_known(slave) && !network.expected.empty());
        slave.unplaced = !nobodys && !keep_place(slave);
        // The slave is read when it comes. It may have no process data.
        slave.pdos_failed = slave.unplaced && (!slave.held || is_unread(slave));
        if (slave.unplaced && !slave.held && missing_error(network, slave).code == Errc::none)
            network.note({.code = Errc::place_unknown, .step = Step::map_process_data, .slave = slave.number});
        co_return Nothing{};
    }
    forget_kept_place(slave);
    auto hook = co_await prepare_slave(network, slave, faults);
    (void)hook;                          // a place is reserved for the slave nevertheless
    if (slave.config.group != number) {  // the hook has assigned the slave to another group
        if (slave.image.group == number) co_return co_await required(leave_group(network, slave, faults));
        co_return Nothing{};
    }
    auto found = co_await discover_pdos(network, slave);
    if (found) found = check_found(slave);
    if (found) {
        network.marks(slave).pdos_in_doubt = network.marks(slave).new_firmware = false;
        co_return Nothing{};
    }
    slave.pdos_failed = true;
    slave.unplaced = !keep_place(slave);
    faults.note(network, slave, found.error());
    co_return Nothing{};
}

// Removes the slave from the exchange. If an earlier mapping has brought the slave to SAFEOP or OP, brings it back to
// PREOP.
Task<Result<>> leave_out(Network& network, Slave& slave) {
    if (slave.al.state == AlState::safeop || slave.al.state == AlState::op) {
        auto back = co_await bring_to_state(network, slave, AlState::preop);
        if (!back) network.note(slave, back.error());
    }
    if (slave.al.state != AlState::none) {
        co_await completion(clear_fmmus(network, slave));  // a slave that does not answer does not take part
    }
    set_takes_part(network, slave, false);
    co_return Nothing{};
}

// The error of a slave that has left PREOP by itself since its start-up.
Error fallen(const Slave& slave) {
    Error error{.code = Errc::other_state, .step = Step::map_process_data, .slave = slave.number};
    error.expected = static_cast<std::uint32_t>(AlState::safeop);
    error.actual = static_cast<std::uint32_t>(slave.al.state);
    return error;
}

constexpr unsigned kPasses = 4;

// One pass of map_group() over the group. `revised`: a slave has another revision than when its process data was read.
struct Pass {
    std::uint8_t number;
    bool last = false;
    bool revised = false;
};

// The identity is compared again before the slave is driven.
Task<Result<>> compare_placed(Network& network, Slave& slave, Pass& pass, FirstFault& faults) {
    auto same = co_await prove(network, slave);
    network.marks(slave).unproved |= !same.ok();
    if (!same) faults.note(network, slave, same.error());
    if (!same || slave.seen || slave.held) co_return Nothing{};
    pass.revised |= !slave.unplaced;
    if (!pass.last && !slave.unplaced) co_return Nothing{};  // the next pass reads it
    // The slave could not be read before the image was laid out, or it has another revision than then.
    const Errc late = slave.unplaced ? Errc::no_place : Errc::remapping_needed;
    faults.note(network, slave, {.code = late, .step = Step::map_process_data, .slave = slave.number});
    co_return Nothing{};
}

// Whether the slave has refused SAFEOP for a cause that INIT may remove. In INIT, the slave may lose values that the
// application has written to it. So the library uses INIT only if the slave requires it, or has had an error before.
bool may_need_init(const Error& refused, const AlStatus& before) {
    return refused.code == Errc::al_status && (before.error || refused.detail == kNeedsInit);
}

Task<Result<>> configure(Network& network, Slave& slave, Pass& pass, FirstFault& faults) {
    const std::uint8_t number = pass.number;
    if (slave.image.group != number) co_return Nothing{};
    // The last reading may be old, because the hooks of other slaves may have taken long.
    if (is_there_to_map(slave)) {
        co_await completion(read_anew(network, slave));
        if (is_there_to_map(slave)) {
            co_await required(compare_placed(network, slave, pass, faults));
        }
    }
    const bool unfinished = is_unfinished(network, slave);
    const bool ready =
        is_there_to_map(slave) && slave.seen && slave.al.state != AlState::init && !network.marks(slave).unproved;
    if (slave.held || slave.hook_failed || slave.pdos_failed || unfinished || !ready ||
        wanted_state(network, slave) < AlState::safeop) {
        const bool fell =
            slave.al.state == AlState::init && slave.seen && !slave.held && slave.error.code == Errc::none;
        if (fell && wanted_state(network, slave) >= AlState::safeop) faults.note(network, slave, fallen(slave));
        co_return co_await required(leave_out(network, slave));
    }
    const AlStatus before = slave.al;
    auto done = co_await configure_process_data(network, slave, network.process.groups[number].layout, false);
    if (done) set_takes_part(network, slave, exchanges(slave));
    if (!done && may_need_init(done.error(), before)) done = co_await reconfigure(network, slave);
    if (done) co_return Nothing{};
    faults.note(network, slave, done.error());
    co_await completion(clear_fmmus(network, slave));  // a slave that does not answer does not take part
    set_takes_part(network, slave, false);
    co_return Nothing{};
}

// Keeps the errors of all slaves that are missing, held or in a wrong state. Most of these errors were reported before.
void keep_others(Network& network, std::uint8_t number, FirstFault& faults) {
    for (Slave& slave : network.slaves()) {
        if (slave.config.group >= network.process.groups.size()) {
            Error error = unmapped_group(network, slave.config.group);
            error.slave = slave.number;
            faults.note(network, slave, error);
            continue;
        }
        if (slave.config.group != number) continue;
        const bool gone = slave.held && slave.unexpected && slave.al.state == AlState::none;
        if (!gone) faults.keep(held_error(slave, Step::identify));
        const Error missing = slave.al.state == AlState::none ? missing_error(network, slave) : Error{};
        if (missing.code != Errc::none && (slave.seen || slave.error.code == Errc::none))
            faults.note(network, slave,
                        missing);  // the slave was present at the scan, or its absence was tolerated then
        else
            faults.keep(missing);
        if (slave.al.state == AlState::boot) faults.keep(state_error(network, slave));
        Error hook = slave.error;
        hook.slave = slave.number;
        if (slave.hook_failed) faults.keep(hook);
    }
}

// Sets for the mailbox channels which bit of the image reports mail.
void use_status_bits(Network& network, std::uint8_t number) {
    const ProcessGroup& group = network.process.groups[number];
    for (const Slave& slave : network.slaves()) {
        if (slave.image.group != number || !network.has_mailbox(slave)) continue;
        const std::uint32_t bit = slave.image.mailbox_status_bit;
        if (bit != SlaveImage::kNone && bit / 8 < group.image.size())
            network.mailbox(slave).use_status_bit(&group.image[bit / 8], bit % 8);
    }
}

// The constructor ends the earlier mapping of the group. Until this object is destroyed, the supervision does not
// change the slaves of the group. If the group is not mapped after that, the application may free the memory of both
// images, because nothing points to it any more.
class Mapping {
  public:
    Mapping(Network& network, std::uint8_t number) : network_(network), group_(network.process.groups[number]) {
        const Bytes old = group_.image;
        for (Slave& slave : network.slaves())
            if (network.has_mailbox(slave)) network.mailbox(slave).forget_status_bit(old);
        unprepare(group_, network.engine.link(), network.engine.now());
        group_.mapping = true;
    }
    Mapping(const Mapping&) = delete;
    Mapping& operator=(const Mapping&) = delete;
    ~Mapping() {
        group_.mapping = false;
        if (group_.mapped) settle(group_);
        for (Slave& slave : network_.slaves()) {
            if (slave.image.group == group_.number) {
                if (slave.takes_part) note_joining(group_, slave);
                const bool should_be_there = missing_error(network_, slave).code != Errc::none;
                if (slave.al.state != AlState::none || should_be_there) await_slave(network_, slave);
            }
            if (!group_.mapped && slave.image.group == group_.number)
                slave.image.outputs.bytes = slave.image.inputs.bytes = {};
        }
    }

  private:
    Network& network_;
    ProcessGroup& group_;
};

MutableBytes memory_of_image(Network& network, std::uint8_t number, const ImageMemory& memory) {
    if (memory.provide == nullptr) return memory.image;
    // A layout without memory ends with the required size, or with an error that the real layout reports again.
    const auto measured = lay_out(network.slaves(), number, network.process.groups[number].config, {});
    const bool too_large = !measured && measured.error().code == Errc::image_too_large;
    return memory.provide(too_large ? measured.error().expected : 0, memory.user);
}

Task<Result<std::size_t>> map_once(Network& network, Pass& pass, const ImageMemory& memory) {
    const std::uint8_t number = pass.number;
    Mapping mapping(network, number);
    FirstFault faults;
    const auto start = [&network, number, &faults](Slave& s) { return start_up(network, s, number, faults); };
    co_await required(for_each_slave(network, start));
    const auto find = [&network, number, &faults](Slave& s) { return discover(network, s, number, faults); };
    co_await required(for_each_slave(network, find));
    const MutableBytes image = memory_of_image(network, number, memory);
    std::ranges::fill(image, std::byte{0});
    const auto laid_out = lay_out_group(network, number, image);
    if (!laid_out) {
        unprepare(network.process.groups[number], network.engine.link(), network.engine.now());
        for (Slave& slave : network.slaves()) {
            if (slave.image.group != number) continue;
            slave.image = {};
            slave.takes_part = false;
        }
        const std::uint16_t named = laid_out.error().slave;  // the caller notes errors of the group
        if (named != 0 && named <= network.count) network.note(network.slave(named), laid_out.error());
        if (named > network.count) network.note(laid_out.error());
        co_return laid_out.error();
    }
    ProcessGroup& group = network.process.groups[number];
    const detail::EntryPart* const part = group.config.entries.part();
    const Error entries = part == nullptr ? Error{} : part->place(network, group, nullptr);
    const auto set = [&network, &pass, &faults](Slave& s) { return configure(network, s, pass, faults); };
    co_await required(for_each_slave(network, set));
    network.states_read = network.engine.now();
    use_status_bits(network, number);
    keep_others(network, number, faults);
    faults.keep(entries);
    if (faults.error().code != Errc::none) co_return faults.error();
    co_return network.process.groups[number].image.size();
}

}  // namespace

// New firmware of a slave may write its revision into the EEPROM while the group is being mapped. Then the process data
// of the slave is read again in the next pass.
Task<Result<std::size_t>> map_group(Network& network, std::uint8_t number, const ImageMemory& memory) {
    if (network.count == 0) co_return Error{.code = Errc::wrong_state, .step = Step::map_process_data};
    if (number >= network.process.groups.size()) co_return unmapped_group(network, number);
    for (unsigned left = kPasses;; --left) {
        Pass pass{.number = number, .last = left == 1};
        auto mapped = co_await map_once(network, pass, memory);
        if (!pass.revised || pass.last) co_return mapped;
    }
}

}  // namespace margay
