#include "sim/sii_model.hpp"

#include <algorithm>
#include <array>

namespace margay::sim {

namespace sii = wire::sii;

namespace {

void add_pdos(SiiModel& model, Bytes content) {
    sii::Pdos pdos(content);
    while (const auto pdo = pdos.next()) {
        if (!pdo->assigned()) continue;
        std::uint32_t bits = 0;
        sii::PdoEntries entries(pdo->entries);
        while (const auto entry = entries.next()) bits += entry->bit_length;
        for (auto& area : model.areas)
            if (area.sync_manager == pdo->sync_manager) area.pdo_bits += bits;
    }
}

subdevice::MailboxPair mailboxes(const MailboxInfo& info) {
    return {{info.out_start, info.out_bytes, 0, 0}, {info.in_start, info.in_bytes, 0, 0}};
}

}  // namespace

SiiModel read_sii_model(Bytes image) {
    SiiModel model;
    model.fixed = sii::load_fixed_part(image).value;
    if (sii::is_blank(image) || sii::mailbox_fault(model.fixed.mailboxes.standard) != sii::Fault::none)
        model.fixed.mailboxes = {};
    Bytes strings;
    Bytes tx_pdos;
    Bytes rx_pdos;
    sii::CategoryWalker walker(image);
    while (const auto category = walker.next()) {
        switch (category->place.type) {
            case sii::category::kStrings: strings = category->content; break;
            case sii::category::kGeneral: model.general = sii::parse_general(category->content).value; break;
            case sii::category::kTxPdo: tx_pdos = category->content; break;
            case sii::category::kRxPdo: rx_pdos = category->content; break;
            case sii::category::kDc: model.has_dc = true; break;
            case sii::category::kFmmu: {
                sii::FmmuUses uses(category->content);
                for (unsigned n = 1; const auto use = uses.next(); ++n)
                    if (*use != FmmuUse::unused) model.fmmus = n;
                break;
            }
            case sii::category::kSyncManager: {
                sii::SyncManagers managers(category->content);
                while (const auto manager = managers.next()) {
                    const auto n = static_cast<std::uint8_t>(model.sync_managers++);
                    if (manager->type == SmType::outputs || manager->type == SmType::inputs)
                        model.areas.push_back({n, *manager, 0});
                }
                break;
            }
            default: break;
        }
    }
    add_pdos(model, tx_pdos);
    add_pdos(model, rx_pdos);
    if (const auto text = sii::string(strings, model.general.name); text.ok()) {
        std::array<char, 256> buffer{};
        model.name = sii::to_utf8(text.value, buffer);
    }
    return model;
}

subdevice::DeviceDescription SiiModel::description() const {
    subdevice::DeviceDescription device;
    device.vendor_id = fixed.identity.vendor;
    device.product_code = fixed.identity.product;
    device.revision = fixed.identity.revision;
    device.serial = fixed.identity.serial;
    device.mailbox = mailboxes(fixed.mailboxes.standard);
    device.boot_mailbox = mailboxes(fixed.mailboxes.boot);
    const auto protocols = fixed.mailboxes.standard.protocols;
    device.protocols.coe = (protocols & mailbox_protocol::kCoE) != 0;
    device.protocols.foe = (protocols & mailbox_protocol::kFoE) != 0;
    for (const auto& area : areas) {
        const bool outputs = area.info.type == SmType::outputs;
        auto& to = outputs ? device.outputs : device.inputs;
        if (to.present()) continue;  // the state machine checks one area per direction
        const auto bytes = std::max<std::uint32_t>(area.info.length_bytes, (area.pdo_bits + 7) / 8);
        to.sync_manager = area.sync_manager;
        to.start = area.info.start;
        to.max_bytes = static_cast<std::uint16_t>(std::clamp<std::uint32_t>(bytes, 1, 0xFFFF));
        to.three_buffers = (area.info.control & 0x03) == 0;
        to.watchdog = outputs && (area.info.control & 0x40) != 0;
    }
    device.dc.supported = has_dc;
    return device;
}

EscDescription SiiModel::chip() const {
    using Port = sii::PhysicalPort;
    std::array<Port, kMaxPorts> ports{};
    unsigned used = 0;
    for (unsigned p = 0; p < kMaxPorts; ++p) {
        ports[p] = sii::physical_port(general, p);
        if (ports[p] != Port::unused) ++used;
    }
    const bool ebus = ports[0] == Port::ebus;
    const bool small = sync_managers <= 4 && fmmus <= 3 && used <= 2;
    auto chip = ebus && small ? et1200() : used > 2 || sync_managers == 0 ? et1100() : ebus ? et1100() : ip_core();
    if (used >= 2) {
        using namespace std::chrono_literals;
        for (unsigned p = 0; p < kMaxPorts; ++p) {
            auto& port = chip.ports[p];
            if (ports[p] == Port::ebus)
                port = {wire::PortKind::ebus, 10ns};
            else if (ports[p] != Port::unused)
                port = {wire::PortKind::mii, 140ns};
            else if (port.kind >= wire::PortKind::ebus)
                port = {wire::PortKind::not_configured, 0ns};
        }
    }
    // Memory for all areas of the image; process data need three buffers.
    std::uint32_t end = wire::reg::kProcessRam;
    const auto reach = [&](std::uint32_t start, std::uint32_t length) { end = std::max(end, start + length); };
    for (const auto* box : {&fixed.mailboxes.standard, &fixed.mailboxes.boot}) {
        reach(box->out_start, box->out_bytes);
        reach(box->in_start, box->in_bytes);
    }
    for (const auto& area : areas)
        reach(area.info.start, 3 * std::max<std::uint32_t>(area.info.length_bytes, (area.pdo_bits + 7) / 8));
    const auto needed_kib = (end - wire::reg::kProcessRam + 1023) / 1024;
    chip.ram_kib = static_cast<std::uint8_t>(std::clamp<std::uint32_t>(needed_kib, chip.ram_kib, 60));
    return chip;
}

}  // namespace margay::sim
