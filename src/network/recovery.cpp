#include "network/recovery.hpp"

#include "network/boot.hpp"
#include "network/configure.hpp"
#include "network/entries.hpp"
#include "network/expectation.hpp"
#include "network/hooks.hpp"
#include "network/mailbox_setup.hpp"
#include "network/members.hpp"
#include "network/newcomer.hpp"
#include "network/pdo_lists.hpp"
#include "network/pdos.hpp"
#include "network/preop.hpp"
#include "network/search.hpp"
#include "network/survey.hpp"
#include "network/transition.hpp"
#include "network/wanted.hpp"
#include "station/al_state.hpp"
#include "station/sii_access.hpp"

#include <algorithm>
#include <utility>

namespace margay {
namespace {

// Changes the state with everything that belongs to the transition, and reports it as an event.
Task<Result<AlStatus>> change(Network& network, Slave& slave, AlState state) {
    const ChangeReport report(network, slave);
    co_return co_await required(bring_to_state(network, slave, state));
}

// Brings the slave to INIT and clears its earlier configuration.
Task<Result<>> back_to_init(Network& network, Slave& slave) {
    co_await required(clear_fmmus(network, slave));
    co_await required(change(network, slave, AlState::init));
    co_return co_await required(clear_sync_managers(network, slave));
}

// Checks that the place that was reserved for the slave has the sizes of its process data.
Error compare_with_place(const Slave& slave, std::span<const ProcessSm> kept) {
    Error error{.code = Errc::pdo_size, .step = Step::configure_pdos, .slave = slave.number};
    const auto bits_of = [](std::span<const ProcessSm> sms, std::uint8_t number) {
        std::uint32_t bits = 0;
        for (const ProcessSm& sm : sms) bits += sm.number == number ? sm.bits : 0;
        return bits;
    };
    const auto own = slave.config.used_sms();
    for (std::uint8_t n = 0; n < Slave::kSyncManagers; ++n) {
        error.index = wire::reg::sync_manager(n).address;
        error.expected = bits_of(kept, n);
        error.actual = bits_of(own, n);
        if (error.expected != error.actual) return error;
    }
    return {};
}

// Exists while the process data of a slave that comes back is being found, and the configuration of the slave is
// incomplete. The constructor removes the values of a reserved place and of earlier firmware from the configuration. So
// the hook and the search for PDOs find an empty configuration, as at the first start-up. The values are put back
// unless accept() was called, or the application has set other values meanwhile.
class Finding {
  public:
    Finding(SlaveMarks& marks, Slave& slave)
        : marks_(marks),
          slave_(slave),
          sms_(slave.config.sms),
          content_(marks.pdo_content),
          kept_(slave.place_kept || (marks.pdos_in_doubt && !slave.unplaced)) {
        marks_.finding = true;
        count_ = kept_ ? slave.config.used_sms().size() : 0U;
        slave.place_kept = kept_;
        forget_kept_place(slave);
    }
    Finding(const Finding&) = delete;
    Finding& operator=(const Finding&) = delete;
    ~Finding() {
        marks_.finding = false;
        if (!kept_) return;
        marks_.pdo_content = content_;
        if (is_by_application(slave_.config)) return;
        slave_.config.sms = sms_;
        slave_.config.sm_count = static_cast<std::uint8_t>(count_);
        slave_.config.source = ConfigurationSource::none;
        slave_.place_kept = true;
    }
    [[nodiscard]] bool is_kept() const { return kept_; }
    [[nodiscard]] std::span<const ProcessSm> sms() const { return std::span(sms_).first(count_); }
    // Whether the dictionary has the same PDOs as when the image was laid out, as far as it was read then.
    [[nodiscard]] bool is_same_content() const { return content_ == 0 || content_ == marks_.pdo_content; }
    void accept() { kept_ = marks_.pdos_in_doubt = marks_.new_firmware = false; }

  private:
    SlaveMarks& marks_;
    Slave& slave_;
    std::array<ProcessSm, SlaveConfiguration::kProcessSms> sms_;
    std::size_t count_ = 0;
    std::uint32_t content_;
    bool kept_;
};

// Whether the slave can use its place in the image, and has the entries that the application has listed.
Error check_late_slave(Network& network, Slave& slave) {
    const auto sms = slave.config.used_sms();
    if (std::ranges::all_of(sms, [](const ProcessSm& sm) { return sm.bits == 0; })) forget_unplaced(network, slave);
    if (!has_place(slave)) return {.code = Errc::no_place, .step = Step::map_process_data, .slave = slave.number};
    if (!is_mapped(network, slave)) return {};
    ProcessGroup& group = network.process.groups[slave.image.group];
    const detail::EntryPart* const part = group.config.entries.part();
    const Error entries = part == nullptr ? Error{} : part->place(network, group, &slave);
    if (entries.code != Errc::none) return entries;  // the application would write outputs without effect
    const bool lrw =
        std::ranges::any_of(group.plans, [](const DatagramPlan& plan) { return plan.command == wire::Command::LRW; });
    return check_place(slave, group.layout, lrw).error();
}

// Finds the process data of a slave that could not be read when the image was laid out: from the application's values,
// or from the slave itself. The size of the process data may differ from the size of the reserved place.
Task<Result<>> discover_late_slave(Network& network, Slave& slave, Finding& finding) {
    auto discovered = co_await discover_pdos(network, slave);
    if (discovered) discovered = check_found(slave);
    Error error = discovered.error();
    if (discovered && finding.is_kept()) error = compare_with_place(slave, finding.sms());
    if (error.code == Errc::none && finding.is_kept() && !finding.is_same_content()) {
        // If the slave has refused to report its PDOs, the refusal is the error: the PDOs may be the same.
        error = {.code = Errc::remapping_needed, .step = Step::map_process_data, .slave = slave.number};
        if (network.marks(slave).pdo_content == 0 && network.marks(slave).pdos_refused) error = slave.error;
    }
    if (error.code == Errc::none) error = check_late_slave(network, slave);
    slave.pdos_failed = error.code != Errc::none && error.code != Errc::no_place;
    if (error.code != Errc::none) co_return error;
    finding.accept();
    co_return Nothing{};
}

// Calls the hook, and searches for the process data if it was not read yet.
Task<Result<>> find_process_data(Network& network, Slave& slave) {
    Finding finding(network.marks(slave), slave);
    Result<> hook;
    if (slave.hooks.preop_to_safeop) hook = co_await call_hook(slave.hooks.preop_to_safeop, network, slave);
    slave.hook_failed = !hook.ok();
    if (!hook) co_return hook;
    if (!is_mapped(network, slave)) co_return Nothing{};  // the hook may have changed the group
    if (slave.pdos_failed || finding.is_kept() || slave.unplaced || !network.marks(slave).pdos_compared)
        co_return co_await required(discover_late_slave(network, slave, finding));
    co_return Nothing{};
}

// From PREOP to SAFEOP.
Task<Result<>> back_to_safeop(Network& network, Slave& slave) {
    const bool new_firmware = network.marks(slave).new_firmware;
    const Time begun = network.engine.now();
    co_await required(find_process_data(network, slave));
    if (doubt_after_hook(network, slave, begun)) {
        co_await required(prove_before_request(network, slave, AlState::safeop));
    }
    // Some new firmware writes its identity into the EEPROM only after its start.
    if (new_firmware) {
        co_await required(prove(network, slave));
    }
    if (!is_mapped(network, slave) || wanted_state(network, slave) < AlState::safeop)
        co_return Nothing{};  // the hook may have changed the group, or the highest state
    if (needs_mapping(network, slave))
        co_return Error{.code = Errc::remapping_needed, .step = Step::map_process_data, .slave = slave.number};
    const ChangeReport report(network, slave);
    co_return co_await required(
        configure_process_data(network, slave, network.process.groups[slave.image.group].layout, true));
}

// Removes the slave from the exchange and brings it to PREOP or INIT.
Task<Result<>> lower(Network& network, Slave& slave, AlState state) {
    co_await required(clear_fmmus(network, slave));
    auto changed = co_await change(network, slave, state);
    co_return changed ? Result<>() : Result<>(changed.error());
}

bool is_configured(const Slave& slave) {
    return (slave.al.state == AlState::safeop || slave.al.state == AlState::op) &&
           (slave.takes_part || !exchanges(slave)) && slave.seen;
}

}  // namespace

Task<Result<>> read_missing_slave(Network& network, Slave& slave) {
    // A device of another revision is read again. A device of another product is another slave.
    if (!slave.other) co_await required(prove(network, slave));
    co_await required(sii_assign(network.station(slave), false));
    auto surveyed = co_await survey(network, slave, true);
    auto offered = co_await sii_assign(network.station(slave), true);
    if (!surveyed) co_return surveyed;
    slave.other = slave.wanted != nullptr && difference(slave, *slave.wanted).code != Errc::none;
    update_held(network);
    if (slave.other && slave.held) {  // the expected slave may still come
        slave.seen = false;
        co_return difference(slave, *slave.wanted);
    }
    co_return offered;
}

void note_change(Network& network, Slave& slave, const AlStatus& before) {
    if (!network.supervised && slave.al.state == AlState::none) return leave_exchange(network, slave);
    const AlStatus now = std::exchange(slave.al, before);
    if (now.state != AlState::none) return note_state(network, slave, now);
    if (before.state != AlState::none) note_lost(network, slave);
}

ChangeReport::~ChangeReport() { note_change(network_, slave_, before_); }

void end_work_upwards(Network& network, const Slave& slave) {
    const SlaveWork* work = find_work(network, slave);
    if (work == nullptr || work->since == kNever || work->upwards_to == AlState::none) return;
    if (goal(network, slave) < work->upwards_to) drop_work(network, slave);
}

bool is_first_silence(Network& network, const Slave& slave, const Error& error) {
    SlaveMarks& marks = network.marks(slave);
    if (!does_not_answer(error) || marks.unanswered) return false;
    return marks.unanswered = true;
}

// NONE is not stored here: note_lost() stores it.
void note_state(Network& network, Slave& slave, const AlStatus& now) {
    if (slave.al == now) note_reached(network, slave, now.state);
    if (slave.al == now || now.state == AlState::none) return;
    if (!network.marks(slave).repeating)
        network.report({.kind = EventKind::state, .slave = slave.number, .before = slave.al, .now = now});
    if (now.state == AlState::boot) note_boot(network, slave);
    const AlState before = std::exchange(slave.al, now).state;
    note_reached(network, slave, before);
    update_mailbox(network, slave);
}

void doubt_pdos(Network& network, const Slave& slave) {
    const SlaveConfiguration& config = slave.config;
    if (config.unchecked_pdos) return;
    const bool written = !config.fixed_pdos && std::ranges::all_of(config.used_sms(), [&](const ProcessSm& sm) {
        const SmPdos* const list = find_list(slave, sm.number);
        return list != nullptr && std::ranges::none_of(list->pdos, [](const Pdo& pdo) { return pdo.entries.empty(); });
    });
    // Lists of drives (SoE) are not written.
    const bool doubtful = config.source == ConfigurationSource::soe || !written;
    if (network.marks(slave).pdo_content != 0 && doubtful) network.marks(slave).pdos_in_doubt = true;
}

Task<Result<>> restart(Network& network, Slave& slave) {
    // Another slave may answer at this address, because the readings of the states may have missed that the slave was
    // away. A slave in BOOT is compared when it is in PREOP: its firmware may use the EEPROM.
    Result<> same;
    if (slave.al.state != AlState::boot) same = co_await prove(network, slave);
    if (same && !slave.seen) same = co_await read_missing_slave(network, slave);
    if (!same) co_return same;
    // In INIT, a device may start to use other modules or settings than at the mapping.
    doubt_pdos(network, slave);
    co_await required(back_to_init(network, slave));
    const ChangeReport report(network, slave);
    co_await required(sii_assign(network.station(slave), true));
    co_return co_await required(bring_to_preop(network, slave));
}

Task<Result<>> reconfigure(Network& network, Slave& slave) {
    if (!slave.seen) {
        co_await required(read_missing_slave(network, slave));
        if (!is_mapped(network, slave)) slave.pdos_failed = false;
    }
    if (slave.held && !slave.mailbox.present()) co_return co_await required(back_to_init(network, slave));
    auto preop = co_await restart(network, slave);
    if (!preop || slave.held || !is_mapped(network, slave) || wanted_state(network, slave) < AlState::safeop)
        co_return preop;
    co_return co_await required(back_to_safeop(network, slave));
}

Task<Result<>> bring_back(Network& network, Slave& slave) {
    const auto seen = co_await required(read_al_status(network.station(slave)));
    note_state(network, slave, seen);
    if (stays_in_boot(network, slave)) co_return Nothing{};
    co_await required(prove_before_request(network, slave, AlState::none));
    if (is_unread(slave)) {
        co_await required(read_missing_slave(network, slave));
    }
    const AlState to = goal(network, slave);
    const bool process = slave.al.state == AlState::safeop || slave.al.state == AlState::op;
    const bool to_be_asked = is_to_be_asked(network, slave);
    if (to == AlState::init || to == AlState::boot || (to == AlState::preop && process && !to_be_asked))
        co_return co_await required(lower(network, slave, to));
    const auto unfinished = [&] { return is_unfinished(network, slave); };
    bool configured = is_configured(slave) && !unfinished();
    if (configured && slave.al.error && network.clocks.is_near != nullptr)
        configured = co_await required(network.clocks.is_near(network, slave));
    if (configured && slave.al.error) {
        auto acknowledged = co_await change(network, slave, slave.al.state);
        configured = acknowledged.ok();
    }
    if (configured && slave.al.state != to) {
        auto changed = co_await change(network, slave, to);
        if (!changed && unfinished()) co_return changed.error();  // the next attempt starts the slave again
        configured = changed.ok();
    }
    if (configured && !to_be_asked) co_return Nothing{};
    // Whether the slave was brought to PREOP and has stayed there: then its mailboxes need not be configured again.
    const bool in_preop = !network.marks(slave).unproved && slave.seen && slave.al.state == AlState::preop &&
                          !slave.al.error && !unfinished();
    const bool settled = in_preop && network.marks(slave).settled == AlState::preop;
    const bool waits = settled && !slave.held && to >= AlState::safeop;
    const bool asks = in_preop && to_be_asked;
    // Nothing is left to do: only the identity was in doubt.
    const bool is_done = settled && to == AlState::preop && !to_be_asked;
    if (is_done) co_return Nothing{};
    Result<> again;
    if (asks) again = co_await clear_fmmus(network, slave);  // the FMMUs of an earlier mapping
    if ((waits || asks) && again) again = co_await back_to_safeop(network, slave);
    if (!asks && (!waits || !again)) again = co_await reconfigure(network, slave);
    if (!again || goal(network, slave) != AlState::op) co_return again;
    auto op = co_await change(network, slave, AlState::op);
    co_return op ? Result<>() : Result<>(op.error());
}

}  // namespace margay
