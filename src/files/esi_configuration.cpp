// The configuration of a slave as its ESI file describes it.
#include <margay/files/esi.hpp>
#include <margay/host_configuration.hpp>

#include "files/esi_types.hpp"
#include "files/mail_commands.hpp"
#include "files/modules.hpp"
#include "files/xml.hpp"

#include <algorithm>
#include <deque>

namespace margay::files {
namespace {

constexpr std::size_t kMostPdos = 1024;

class Configurator {
  public:
    Configurator(const EsiFile& esi, const EsiDevice& device, const EsiChoice& choice)
        : esi_(esi), device_(device), choice_(choice) {}

    EsiConfiguration run(HostConfiguration& owner) {
        if (choice_.mode != 0 && choice_.mode >= device_.modes.size())
            return failed("operation mode " + std::to_string(choice_.mode) + " does not exist: the device has " +
                          std::to_string(device_.modes.size()));
        assign_pdos();
        if (!add_modules()) return std::move(result_);
        make_lists();
        if (device_.mailbox) add_commands(device_.mailbox->commands, 0);
        if (!result_.error.empty()) return std::move(result_);
        SlaveSetup setup{.times = times()};
        setup.pdos = PdoLists(Borrowed<SmPdos>(std::span<const SmPdos>(lists_)));
        setup.startup = StartupCommands(Borrowed<StartupCommand>(std::span<const StartupCommand>(commands_)));
        if (!device_.modes.empty()) setup.dc = sync_settings(device_.modes[choice_.mode], choice_.cycle);
        SlaveConfiguration config;
        config.block_lrw = device_.no_lrw;
        const unsigned details = device_.mailbox ? device_.mailbox->coe_details : 0U;
        config.fixed_pdos = (details & (coe_detail::kPdoAssignment | coe_detail::kPdoConfiguration)) == 0;
        config.no_complete_access = (details & coe_detail::kCompleteAccess) == 0;
        if (device_.process_data_watchdog) config.process_data_watchdog = watchdog();
        config.setup = &setup;
        result_.config = owner.keep(config);
        return std::move(result_);
    }

  private:
    EsiConfiguration failed(std::string error) {
        result_.error = std::move(error);
        return std::move(result_);
    }

    [[nodiscard]] Duration watchdog_unit() const {
        constexpr std::uint16_t kUsual = 2498;
        return std::chrono::nanoseconds(40) * (device_.watchdog_divider.value_or(kUsual) + 2);
    }
    [[nodiscard]] SlaveConfiguration::Watchdog watchdog() const {
        const Duration time = watchdog_unit() * *device_.process_data_watchdog;
        return SlaveConfiguration::Watchdog(static_cast<std::uint32_t>(time / std::chrono::microseconds(1)));
    }
    [[nodiscard]] SlaveTimes times() const {
        SlaveTimes times = device_.times;
        times.watchdog_divider = device_.watchdog_divider;
        if (device_.pdi_watchdog) times.pdi_watchdog = watchdog_unit() * *device_.pdi_watchdog;
        if (device_.mailbox) times.mailbox = device_.mailbox->response_timeout;
        return times;
    }

    // The PDOs of the device: from the operation mode if it names PDOs, otherwise the PDOs assigned by default.
    void assign_pdos() {
        static const EsiMode kNone;
        const EsiMode& mode = device_.modes.empty() ? kNone : device_.modes[choice_.mode];
        for (const EsiPdo& pdo : device_.pdos)
            if (pdo.sync_manager && !by_mode(mode, *pdo.sync_manager)) result_.pdos.push_back(pdo);
        for (const EsiModeSm& sm : mode.sync_managers)
            for (const std::uint16_t index : sm.pdos) {
                const EsiPdo* pdo = device_.find_pdo(index);
                if (pdo == nullptr) {
                    result_.error = "operation mode '" + mode.name + "' names PDO " + hex(index) +
                                    ", which the device does not have";
                    return;
                }
                if (too_many_pdos()) return;
                result_.pdos.push_back(*pdo);
                result_.pdos.back().sync_manager = sm.number;
            }
    }
    bool too_many_pdos() {
        if (result_.pdos.size() < kMostPdos) return false;
        result_.error = "more than " + std::to_string(kMostPdos) + " PDOs are assigned";
        return true;
    }
    static bool by_mode(const EsiMode& mode, std::uint8_t sm) {
        const auto found = std::ranges::find(mode.sync_managers, sm, &EsiModeSm::number);
        return found != mode.sync_managers.end() && !found->pdos.empty();
    }

    [[nodiscard]] std::optional<std::uint8_t> usual_sm(Direction direction) const {
        const SmType wanted = direction == Direction::outputs ? SmType::outputs : SmType::inputs;
        for (std::size_t n = 0; n < device_.sync_managers.size(); ++n)
            if (device_.sync_managers[n].type == wanted) return static_cast<std::uint8_t>(n);
        // The SyncManager has a name of the vendor, so its control octet shows its use.
        for (std::size_t n = 0; n < device_.sync_managers.size(); ++n)
            if (direction_by_control(device_.sync_managers[n]) == direction) return static_cast<std::uint8_t>(n);
        return std::nullopt;
    }

    // The ident of the module in a slot; 0: none. Without a default module, if only one module fits, it is used in the
    // number of instances of the slot that the file requires.
    std::uint32_t ident_in(std::uint32_t slot) {
        if (choice_.modules) return slot < choice_.modules->size() ? (*choice_.modules)[slot] : 0;
        const EsiSlot* described = device_.slots->slot(slot);
        const auto found = std::ranges::find_if(described->idents, &EsiModuleIdent::is_default);
        if (found != described->idents.end()) return found->ident;
        std::uint32_t instance = 0;
        while (instance < slot && device_.slots->slot(slot - instance - 1) == described) ++instance;
        return instance < described->least && described->idents.size() == 1 ? described->idents.front().ident : 0;
    }

    bool fits(const EsiSlot& slot, const EsiModule& module) {
        const bool by_ident =
            std::ranges::any_of(slot.idents, [&](const EsiModuleIdent& one) { return one.ident == module.ident; });
        return by_ident || std::ranges::find(slot.classes, module.module_class) != slot.classes.end();
    }

    bool add_modules() {
        if (!device_.slots) {
            if (!choice_.modules || choice_.modules->empty()) return result_.error.empty();
            result_.error = "modules are given, and " + device_.type + " has no slots";
            return false;
        }
        const std::uint32_t count = device_.slots->count();
        if (choice_.modules && choice_.modules->size() > count) {
            result_.error = std::to_string(choice_.modules->size()) + " modules are given, and " + device_.type +
                            " has " + std::to_string(count) + " slots";
            return false;
        }
        std::vector<std::uint32_t> idents;
        for (std::uint32_t slot = 0; slot < count; ++slot) idents.push_back(ident_in(slot));
        while (!idents.empty() && idents.back() == 0) idents.pop_back();
        if (device_.slots->download_ident_list && (choice_.modules || !idents.empty())) write_ident_list(idents);
        for (std::uint32_t slot = 0; slot < idents.size() && result_.error.empty(); ++slot)
            if (idents[slot] != 0) add_module(slot, idents[slot]);
        return result_.error.empty();
    }

    void add_module(std::uint32_t slot, std::uint32_t ident) {
        const EsiModule* module = esi_.find_module(ident);
        const std::string where = "slot " + std::to_string(slot) + ": module " + hex(ident, 8);
        if (module == nullptr) {
            result_.error = where + " is not described in this file";
            for (const std::string& file : esi_.further_files) result_.error += "; it may be in " + file;
            return;
        }
        if (!fits(*device_.slots->slot(slot), *module)) {
            result_.error = where + " (" + module->type + ") does not fit into this slot";
            return;
        }
        for (EsiPdo pdo : module->pdos) {
            if (pdo.depends_on_slot) pdo.index = moved(pdo.index, slot * std::uint64_t{device_.slots->pdo_increment});
            for (std::size_t n = 0; n < pdo.entries.size(); ++n)
                if (pdo.entries[n].index != 0 && pdo.entry_depends_on_slot[n])
                    pdo.entries[n].index =
                        moved(pdo.entries[n].index, slot * std::uint64_t{device_.slots->index_increment});
            if (!pdo.sync_manager) pdo.sync_manager = usual_sm(pdo.direction);
            std::erase_if(result_.pdos,
                          [&](const EsiPdo& one) { return one.overwritten_by_module && one.index == pdo.index; });
            if (too_many_pdos()) return;
            if (!pdo.sync_manager) {
                result_.error = where + ": PDO " + hex(pdo.index) + " has no SyncManager, and the device has none of " +
                                (pdo.direction == Direction::outputs ? "outputs" : "inputs");
                return;
            }
            result_.pdos.push_back(std::move(pdo));
        }
        add_commands(module->commands, slot);
    }

    std::uint16_t moved(std::uint16_t index, std::uint64_t by) {
        if (index + by > 0xFFFF) result_.error = "the index " + hex(index) + " of a module exceeds 0xffff in its slot";
        return static_cast<std::uint16_t>(index + by);
    }

    void write_ident_list(const std::vector<std::uint32_t>& idents) {
        // The command must be executed in PREOP before the PDOs are written, so it belongs to IP.
        constexpr Transition kWhen = Transition::init_to_preop;
        commands_.push_back(write_object(kWhen, kConfiguredModules, 0, std::uint8_t{0}));
        for (std::size_t n = 0; n < idents.size(); ++n)
            commands_.push_back(write_object(kWhen, kConfiguredModules, static_cast<std::uint8_t>(n + 1), idents[n]));
        if (!idents.empty())
            commands_.push_back(write_object(kWhen, kConfiguredModules, 0, static_cast<std::uint8_t>(idents.size())));
    }

    void add_message(const EsiCommand& one) {
        if (const char* const why = not_sent(one); why != nullptr) {
            result_.remarks.push_back(why);
            return;
        }
        if (one.protocol == mailbox_protocol::kAoE) {
            commands_.push_back(send_aoe(one.transitions, std::span<const std::byte>(one.data)));
            return;
        }
        messages_.push_back(*eoe_message(one.data, one.index));
        commands_.push_back(send_eoe(one.transitions, std::span<const std::byte>(messages_.back())));
    }

    void add_commands(const std::vector<EsiCommand>& list, std::uint32_t slot) {
        for (const EsiCommand& one : list) {
            if (one.protocol == mailbox_protocol::kAoE || one.protocol == mailbox_protocol::kEoE) {
                add_message(one);
                continue;
            }
            const std::uint64_t by =
                one.depends_on_slot && device_.slots ? slot * std::uint64_t{device_.slots->index_increment} : 0;
            const std::uint16_t index = moved(one.index, by);
            if (one.data.empty()) {
                result_.remarks.push_back("the start-up command for " + hex(index) + " has no data and is left out");
                continue;
            }
            StartupCommand command{.kind = StartupCommand::Kind::write_object,
                                   .complete_access = one.complete_access,
                                   .transitions = one.transitions,
                                   .index = index,
                                   .subindex = one.subindex,
                                   .data = Borrowed<std::byte>(std::span<const std::byte>(one.data))};
            if (one.protocol == mailbox_protocol::kSoE) {
                command.kind = StartupCommand::Kind::write_parameter;
                command.mail = &detail::kSoeStartup;
            }
            commands_.push_back(command);
        }
    }

    // The lists of PDOs for the library: pointers into vectors that no longer grow.
    void make_lists() {
        entries_.resize(result_.pdos.size());
        std::vector<std::uint8_t> sms;
        for (std::size_t n = 0; n < result_.pdos.size(); ++n) {
            const EsiPdo& pdo = result_.pdos[n];
            for (const EsiEntry& entry : pdo.entries) {
                if (entry.bits > 255) {
                    result_.error = "an entry of PDO " + hex(pdo.index) + " has " + std::to_string(entry.bits) +
                                    " bits; 255 are possible";
                    return;
                }
                entries_[n].push_back({entry.index, entry.index == 0 ? std::uint8_t{0} : entry.subindex,
                                       static_cast<std::uint8_t>(entry.bits)});
            }
            if (std::ranges::find(sms, *pdo.sync_manager) == sms.end()) sms.push_back(*pdo.sync_manager);
        }
        std::ranges::sort(sms);
        pdos_.resize(sms.size());
        for (std::size_t s = 0; s < sms.size(); ++s) {
            for (std::size_t n = 0; n < result_.pdos.size(); ++n)
                if (result_.pdos[n].sync_manager == sms[s])
                    pdos_[s].push_back({result_.pdos[n].index, std::span<const PdoEntry>(entries_[n])});
            lists_.push_back({sms[s], std::span<const Pdo>(pdos_[s])});
        }
    }

    const EsiFile& esi_;
    const EsiDevice& device_;
    const EsiChoice& choice_;
    EsiConfiguration result_;
    std::vector<StartupCommand> commands_;
    std::deque<std::vector<std::byte>> messages_;  // of EoE
    std::vector<std::vector<PdoEntry>> entries_;
    std::vector<std::vector<Pdo>> pdos_;
    std::vector<SmPdos> lists_;
};

}  // namespace

EsiConfiguration configure(const EsiFile& esi, const EsiDevice& device, const EsiChoice& choice,
                           HostConfiguration& owner) {
    return Configurator(esi, device, choice).run(owner);
}

}  // namespace margay::files
