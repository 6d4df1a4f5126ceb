#include "network/pdos.hpp"

#include "mailbox/coe_list.hpp"
#include "mailbox/coe_pdo.hpp"
#include "mailbox/coe_pdo_write.hpp"
#include "mailbox/soe_pdo.hpp"
#include "network/entries.hpp"
#include "network/pdo_lists.hpp"
#include "network/pdo_sii.hpp"
#include "network/settings.hpp"
#include "network/transition.hpp"
#include "util/check_value.hpp"

#include <margay/features.hpp>

#include <algorithm>

namespace margay {

// The process data that was found in the source that is used (`source`), and in the SII.
struct PdoFindings {
    FoundSms counts{};
    FoundSms sii{};
    UndescribedPdos undescribed{};
    ConfigurationSource source = ConfigurationSource::sii;
    bool sii_read = false;
    Feature not_asked = Feature::none;  // the context does not have the feature that could ask the slave
    CheckValue by_soe;
    bool notes_refusals = true;  // false: the marks and the error of the slave are not changed
};

struct CoeFeature {
    Task<Result<>> (*ask)(Network& network, Slave& slave, PdoFindings& found, bool compare, EntrySink* entries);
};

namespace {

// True also for a mailbox that is closed because the slave has fallen to INIT: the sizes of its process data must not
// be guessed from the SII.
bool has_mailbox(Network& network, const Slave& slave) {
    return network.has_mailbox(slave) && network.mailbox(slave).was_open();
}

bool has_dictionary(Network& network, const Slave& slave) {
    return has_mailbox(network, slave) && (slave.mailbox.protocols & mailbox_protocol::kCoE) != 0;
}

bool has_drives(Network& network, const Slave& slave) {
    return has_mailbox(network, slave) && (slave.mailbox.protocols & mailbox_protocol::kSoE) != 0;
}

// Reports a difference as a warning. It is not an error of the slave.
void report_difference(Network& network, const Slave& slave, std::uint8_t number, ConfigurationSource counts,
                       std::uint32_t bits, ConfigurationSource other, std::uint32_t other_bits) {
    if (bits == other_bits) return;
    Error warning{.code = Errc::sizes_differ, .step = Step::discover_pdos, .slave = slave.number};
    warning.index = wire::reg::sync_manager(number).address;
    warning.detail = static_cast<std::uint32_t>(counts) << 8 | static_cast<std::uint32_t>(other);
    warning.expected = bits;
    warning.actual = other_bits;
    network.note(warning);
}

void compare_types(Network& network, const Slave& slave, const SmTypes& types) {
    for (std::uint8_t n = 0; n < slave.sm_count; ++n) {
        const SmType sii = slave.sync_managers[n].type;
        if (types[n] == sii || types[n] == SmType::unused || sii == SmType::unused) continue;
        Error warning{.code = Errc::types_differ, .step = Step::discover_pdos, .slave = slave.number};
        warning.index = wire::reg::sync_manager(n).address;
        warning.expected = static_cast<std::uint32_t>(types[n]);
        warning.actual = static_cast<std::uint32_t>(sii);
        network.note(warning);
    }
}

// CoeFeature::ask for a slave with a dictionary.
Task<Result<>> ask_dictionary(Network& network, Slave& slave, PdoFindings& found, bool compare, EntrySink* entries) {
    MailboxChannel& channel = network.mailbox(slave);
    SmTypes types{};
    const auto said = co_await required(read_sm_types(channel, types, startup_patience(slave)));
    if (said && compare) compare_types(network, slave, types);
    auto known = co_await find_sms_by_coe(channel, slave, types, found.counts, found.undescribed,
                                          startup_patience(slave), entries);
    if (known && *known) found.source = ConfigurationSource::coe;
    co_return known ? Result<>() : Result<>(known.error());
}

// Notes that the slave refuses to report its PDOs. When the slave comes back, this refusal is the newest cause of its
// failure.
void note_refusal(Network& network, Slave& slave, const PdoFindings& found, const Error& refusal) {
    if (!found.notes_refusals) return;
    network.marks(slave).pdos_refused = true;
    if (network.marks(slave).finding) slave.error = {};
    network.note(slave, refusal);
}

// Reads the object dictionary (CoE); if the slave has none, the parameters of its drives (SoE). A refusal is not an
// error, because the SII may contain the process data. A missing or invalid answer is an error: it does not show that
// the slave has no process data.
Task<Result<>> ask_by_mail(Network& network, Slave& slave, PdoFindings& found, bool compare, EntrySink* entries) {
    const bool by_dictionary = has_dictionary(network, slave);
    const SoeFeature* const soe = network.mailboxes.soe;
    if (soe == nullptr && has_drives(network, slave)) found.not_asked = Feature::soe;
    if (network.coe == nullptr && by_dictionary) found.not_asked = Feature::coe;
    if (network.coe != nullptr && by_dictionary) {
        auto by_coe = co_await network.coe->ask(network, slave, found, compare, entries);
        if (!by_coe && !is_refusal(by_coe.error())) co_return by_coe;
        if (!by_coe) note_refusal(network, slave, found, by_coe.error());
    }
    if (found.source != ConfigurationSource::sii || !has_mailbox(network, slave)) co_return Nothing{};
    if (soe == nullptr) co_return Nothing{};
    auto by_soe = co_await soe->find_sms(network.mailbox(slave), slave, found.counts, found.by_soe);
    if (!by_soe && !is_refusal(by_soe.error()) && by_soe.error().code != Errc::soe_error) co_return by_soe.error();
    if (!by_soe) note_refusal(network, slave, found, by_soe.error());
    if (by_soe && *by_soe) found.source = ConfigurationSource::soe;
    co_return Nothing{};
}

// Reads the process data of the SII. If the SII is the source that is used, the matcher gets the entries of the SII;
// otherwise it gets only their data types.
Task<Result<>> read_sii(Network& network, Slave& slave, PdoFindings& found, EntrySink* sink) {
    if (sink != nullptr && found.source != ConfigurationSource::sii) {
        EntryTypes types(*sink);
        auto compared = co_await find_sms_by_sii(network.station(slave), slave, found.sii, &types);
        found.sii_read = compared.ok() && slave.sii_read;
        co_return compared;
    }
    auto read = co_await find_sms_by_sii(network.station(slave), slave, found.sii, sink);
    found.sii_read = read.ok() && slave.sii_read;
    if (!read || sink == nullptr) co_return read;
    if (pdo_part(slave) == nullptr) co_return Nothing{};
    co_return co_await required(pdo_part(slave)->walk(network, slave, *sink));
}

// The bits of a list: the sum of the listed entries, plus the sizes of the PDOs without listed entries, which the slave
// has reported.
Result<std::uint32_t> bits_of(const Slave& slave, const SmPdos& list, const PdoFindings& found) {
    const ListedBits listed = listed_bits(list);
    const FoundSm& slaves = found.counts[list.sync_manager];
    if (listed.open == 0) return listed.bits;
    const bool described = found.undescribed[list.sync_manager] == 0;
    if (found.source == ConfigurationSource::coe && slaves.any && described) return slaves.bits;
    const FoundSm& sii = found.sii[list.sync_manager];
    const bool by_sii = found.source == ConfigurationSource::sii || !described;
    if (by_sii && sii.any && sii.pdos == listed.open) return listed.bits + sii.bits;
    Error error{.code = Errc::pdo_unknown, .step = Step::configure_pdos, .slave = slave.number};
    for (const Pdo& pdo : list.pdos)
        if (pdo.entries.empty() && error.index == 0) error.index = pdo.index;
    return error;
}

// Fills slave.config.sms from the lists, otherwise from what was found.
Result<> fill_process_sms(Network& network, Slave& slave, const PdoFindings& found) {
    SlaveConfiguration& config = slave.config;
    for (std::uint8_t n = 0; n < slave.sm_count; ++n) {
        FoundSm sm = found.counts[n];
        if (const SmPdos* list = find_list(slave, n); list != nullptr) {
            const auto bits = bits_of(slave, *list, found);
            if (!bits) return bits.error();
            if (sm.any && found.source == ConfigurationSource::coe)
                report_difference(network, slave, n, ConfigurationSource::application, *bits, ConfigurationSource::coe,
                                  sm.bits);
            sm = {.any = true, .direction = direction_of(slave, *list), .bits = *bits};
        }
        if (sm.any)
            (void)config.add({n, sm.direction, slave.sync_managers[n].control, slave.sync_managers[n].start, sm.bits});
    }
    config.source = found.source;
    return Result<>();
}
static_assert(Slave::kSyncManagers <= SlaveConfiguration::kProcessSms);

// Reports where the slave's own values differ from the values of the application.
void compare_with_application(Network& network, const Slave& slave, const PdoFindings& found) {
    const auto bits_of = [&](std::uint8_t n) {
        std::uint32_t bits = 0;
        for (const ProcessSm& sm : slave.config.used_sms()) bits += sm.number == n ? sm.bits : 0;
        return bits;
    };
    const auto source =
        slave.config.source == ConfigurationSource::file ? ConfigurationSource::file : ConfigurationSource::application;
    for (std::uint8_t n = 0; n < slave.sm_count; ++n)
        report_difference(network, slave, n, source, bits_of(n), found.source, found.counts[n].bits);
}

// The dictionary has precedence; the SII contains the maker's default. Where the application selects PDOs, by a list or
// a hook, the default does not apply.
void compare_with_sii(Network& network, const Slave& slave, const PdoFindings& found) {
    if (slave.hooks.preop_to_safeop || found.source != ConfigurationSource::coe) return;
    for (std::uint8_t n = 0; n < slave.sm_count; ++n)
        if (find_list(slave, n) == nullptr)
            report_difference(network, slave, n, found.source, found.counts[n].bits, ConfigurationSource::sii,
                              found.sii[n].bits);
}

// An assigned PDO that the dictionary does not describe may be in the SII. If the SII does not describe the PDO either,
// the size of the process data is not known, which is an error. Otherwise the size in the SII is used, and one error in
// errors() reports this.
Result<> settle_undescribed(Network& network, const Slave& slave, PdoFindings& found, bool compare) {
    if (found.source == ConfigurationSource::soe) return Result<>();
    for (std::uint8_t n = 0; n < slave.sm_count; ++n) {
        if (found.undescribed[n] == 0 || find_list(slave, n) != nullptr) continue;
        FoundSm& used = found.counts[n];
        if (found.sii[n].bits != 0) used = found.sii[n];
        Error error{.code = Errc::pdo_unknown, .step = Step::discover_pdos, .slave = slave.number};
        error.index = found.undescribed[n];
        error.expected = used.bits / 8 + (used.bits % 8 != 0 ? 1 : 0);
        if (error.expected == 0) return error;
        if (compare) network.note(error);
    }
    return Result<>();
}

// The slave can report its PDOs, but the context does not have the feature that reads them. The SII may have other
// PDOs: one warning reports this. If the SII has no PDOs, it is not known whether the slave has any.
Result<> settle_not_asked(Network& network, const Slave& slave, const PdoFindings& found, bool compare) {
    if (found.not_asked == Feature::none || found.source != ConfigurationSource::sii) return Result<>();
    std::uint32_t octets = 0;
    bool needed = false;
    for (std::uint8_t n = 0; n < slave.sm_count; ++n) {
        const SmType type = slave.sync_managers[n].type;
        if (type == SmType::mailbox_out || type == SmType::mailbox_in || find_list(slave, n) != nullptr) continue;
        needed = true;
        octets += (found.sii[n].bits + 7) / 8;  // the length of a SyncManager is in octets
    }
    if (!needed) return Result<>();
    Error error{.code = Errc::unsupported, .step = Step::discover_pdos, .slave = slave.number};
    error.detail = static_cast<std::uint32_t>(found.not_asked);
    error.expected = octets;
    if (octets == 0) return error;
    if (compare && !network.marks(slave).repeating) (void)network.warnings.add(error);
    return Result<>();
}

// Selects the source that is used, and reports differences to the other sources. `read`: the result of reading the SII.
Result<> select_source(Network& network, Slave& slave, PdoFindings& found, const Result<>& read, bool compare) {
    const bool by_slave = found.source != ConfigurationSource::sii;
    if (!by_slave) found.counts = found.sii;
    if (is_by_application(slave.config)) {
        if (compare && (by_slave || found.sii_read)) compare_with_application(network, slave, found);
        return Result<>();
    }
    if (!read && !by_slave) return read;
    if (!read) network.note(read.error());
    auto settled = settle_undescribed(network, slave, found, compare);
    if (settled) settled = settle_not_asked(network, slave, found, compare);
    if (!settled) {
        slave.config.sm_count = 0;
        return settled;
    }
    const auto taken = fill_process_sms(network, slave, found);
    if (!taken) slave.config.sm_count = 0;
    if (taken && compare && found.sii_read) compare_with_sii(network, slave, found);
    return taken;
}

}  // namespace

MailPatience startup_patience(const Slave& slave) {
    MailPatience patience;
    const Duration own = slave.config.times().mailbox;
    if (own > Duration{0}) patience.each = own;
    return patience;
}

Task<Result<>> write_pdos(Network& network, Slave& slave) {
    if (slave.config.fixed_pdos || !has_dictionary(network, slave)) co_return Nothing{};
    // PDOs can be written only in PREOP.
    if (!slave.config.pdos().empty() && (slave.al.state == AlState::safeop || slave.al.state == AlState::op)) {
        co_await required(bring_to_state(network, slave, AlState::preop));
    }
    for (const SmPdos& list : slave.config.pdos()) {
        auto written = co_await write_sm_pdos(network.mailbox(slave), list, startup_patience(slave));
        if (written) continue;
        Error error = written.error();
        if (error.step == Step::sdo_download) error.step = Step::configure_pdos;
        co_return error;
    }
    co_return Nothing{};
}

namespace {

// The entries of the PDOs that the lists name without their entries.
Task<Result<>> walk_lists(Network& network, const Slave& slave, EntrySink& entries) {
    for (const SmPdos& list : slave.config.pdos()) {
        if (listed_bits(list).open == 0) continue;
        co_await required(walk_list_by_sii(network.station(slave), slave, list, entries));
    }
    co_return Nothing{};
}

}  // namespace

constinit const detail::PdoPart detail::kPdoPart{
    .check = check_pdo_lists, .place = place_by_lists, .write = write_pdos, .walk = walk_lists, .add_to = add_lists};

namespace {

// Computes a check value of all entries, and passes them on.
class PdoContent final : public EntrySink {
  public:
    explicit PdoContent(EntrySink* next) : next_(next) {}
    void add(const FoundEntry& entry) override {
        value_.add_word(std::uint32_t{entry.sync_manager} << 16 | entry.pdo);
        value_.add_word(std::uint32_t{entry.index} << 16 | std::uint32_t{entry.subindex} << 8 | (entry.bits & 0xFFU));
        if (next_ != nullptr) next_->add(entry);
    }
    void note_type(const FoundEntry& by_sii) override {
        if (next_ != nullptr) next_->note_type(by_sii);
    }
    void forget() override {
        if (next_ != nullptr) next_->forget();
    }
    // The check value; never 0.
    [[nodiscard]] std::uint32_t value() const { return std::max<std::uint32_t>(value_.get(), 1); }

  private:
    EntrySink* next_;
    CheckValue value_;
};

Task<Result<>> discover(Network& network, Slave& slave, EntrySink* sink) {
    SlaveConfiguration& config = slave.config;
    const bool compare = !network.marks(slave).pdos_compared;
    network.marks(slave).pdos_compared = true;
    const bool said = is_by_application(config);
    // The SII does not change, so it need not be read again.
    const bool known = config.source == ConfigurationSource::sii && config.pdos().empty() && sink == nullptr &&
                       !network.marks(slave).pdos_in_doubt;
    const detail::PdoPart* const lists = pdo_part(slave);
    Error wrong = invalid_setting(slave);
    if (wrong.code == Errc::none && lists != nullptr) wrong = lists->check(slave);
    if (!said && !known) config.sm_count = 0;
    if (wrong.code != Errc::none) co_return wrong;
    Result<> written;
    if (lists != nullptr) written = co_await lists->write(network, slave);
    if (!written || known || (said && !compare && sink == nullptr)) co_return written;
    PdoFindings found;
    PdoContent content(sink);
    network.marks(slave).pdos_refused = false;
    auto asked = co_await ask_by_mail(network, slave, found, compare, &content);
    std::uint32_t& noted = network.marks(slave).pdo_content;
    noted = 0;
    if (asked && found.source == ConfigurationSource::coe) noted = content.value();
    if (asked && found.source == ConfigurationSource::soe) noted = std::max<std::uint32_t>(found.by_soe.get(), 1);
    if (!asked) {
        if (sink != nullptr) sink->forget();
        if (!said) co_return asked;
        network.note(slave, asked.error());  // the values of the application have precedence
        co_return Nothing{};
    }
    Result<> read;
    const bool described = std::ranges::all_of(found.undescribed, [](std::uint16_t pdo) { return pdo == 0; });
    if (found.source == ConfigurationSource::sii || compare || sink != nullptr || !described)
        read = co_await read_sii(network, slave, found, sink);
    co_return select_source(network, slave, found, read, compare);
}

// The same as discover(), and finds the entries that the application has listed.
Task<Result<>> discover_with_entries(Network& network, Slave& slave) {
    EntryMatcher entries(entries_of(network, slave), slave);
    co_return co_await required(discover(network, slave, entries.wanted() ? &entries : nullptr));
}

}  // namespace

const CoeFeature kCoeFeature{.ask = ask_dictionary};

constinit const detail::EntryPart detail::kEntryPart{.discover = discover_with_entries, .place = place_entries};

Task<Result<>> discover_pdos(Network& network, Slave& slave) {
    const ProcessGroup* group = group_of_entries(network, slave);
    const auto* part = group == nullptr ? nullptr : group->config.entries.part();
    return part == nullptr ? discover(network, slave, nullptr) : part->discover(network, slave);
}

Task<Result<>> find_entries(Network& network, Slave& slave, EntryMatcher& entries) {
    PdoFindings found;
    found.notes_refusals = false;
    auto asked = co_await ask_by_mail(network, slave, found, false, &entries);
    // The data types of the SII are not read here, because the master would take the EEPROM away from a slave in
    // operation.
    if (!asked || found.source != ConfigurationSource::sii) co_return asked;
    auto read = co_await read_sii(network, slave, found, &entries);
    co_return read;
}

}  // namespace margay
