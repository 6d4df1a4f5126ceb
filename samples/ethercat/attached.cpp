#include "ethercat/attached.hpp"

#include "common/counted.hpp"
#include "common/program.hpp"
#include "common/segment_look.hpp"
#include "common/slave_report.hpp"
#include "oshw/linux/interface.hpp"
#include "source/interface_nic.hpp"
#include "wire/esc.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <thread>

namespace margay::ethercat {
namespace {

using attach::Operation;

namespace reg = wire::reg;

// The name of an interface comes from another program: for a terminal and for JSON it has printable ASCII only.
std::string printable(std::string name) {
    std::ranges::replace_if(
        name, [](char c) { return c < ' ' || c > '~'; }, '?');
    return name;
}

// Octets per second. A counter that has become smaller has begun again, unless it is a counter modulo 2^32.
std::uint64_t rate(std::uint32_t before, std::uint32_t now, std::chrono::nanoseconds between) {
    const std::uint32_t moved = now - before;
    const std::uint64_t octets = moved <= UINT32_MAX / 2 ? moved : now;
    return octets * 1'000'000'000 / static_cast<std::uint64_t>(std::max<std::int64_t>(between.count(), 1));
}

// The interfaces of the application: its socket is on this machine. They are asked here and not by the application,
// whose cycle would wait for the driver. An application can give its source any name, and may run in another network
// namespace: then interfaces of the same names in this one are shown, or nothing.
std::vector<DeviceFacts> devices_of(const std::string& source) {
    std::vector<DeviceFacts> devices;
    for (const auto& name : hosted::interfaces_of(source)) {
        Interface interface;
        if (!interface.open(name)) return {};
        const auto up = interface.check();
        devices.push_back(
            {.name = name, .mac = interface.address(), .link = up && interface.link_state() != LinkState::down});
    }
    return devices;
}

// The time that a supervision of the application may take to bring slaves to another state.
constexpr std::chrono::seconds kToReach{10};

}  // namespace

// ------------------------------------------------------------------ exchanges

Answer<> AttachedSession::open() {
    if (connected_) return {};
    // Requests of a slave may take seconds. A program that is stopped, for example by a debugger, does not respond at
    // all.
    client_.when_silent([told = false, path = path_](std::chrono::seconds since) mutable {
        constexpr std::chrono::seconds kLong{5};
        if (since >= kLong && !std::exchange(told, true))
            samples::warn(
                fmt::format("{}: the application has not answered for {} s; still waiting", path, kLong.count()));
        return !samples::stop_asked();
    });
    const auto error = client_.connect(path_);
    if (!error.empty()) return Problem{samples::words_of_slave(error), samples::exit_code::kSystem};
    connected_ = true;
    return {};
}

Problem AttachedSession::problem_of(const Error& error, std::string_view slave_text) const {
    auto words = samples::sentence_without_slave(error);
    if (error.code == Errc::no_place || error.code == Errc::remapping_needed || error.code == Errc::place_unknown)
        words += " (the application lays the image out anew when it scans again)";
    if (!slave_text.empty()) words += fmt::format(" (the slave: \"{}\")", samples::words_of_slave(slave_text));
    if (error.slave == 0) return {words};
    // The list of expected slaves is counted from 0, as the positions are.
    const auto found = std::ranges::find(known_, error.slave, &attach::SlaveFacts::number);
    if (found == known_.end() || found->ring_position == 0)
        return {fmt::format("configured slave {}: {}", error.slave - 1, words)};
    return {.text = fmt::format("position {}: {}", found->ring_position - 1, words),
            .aborted = error.code == Errc::sdo_abort};
}

Answer<Octets> AttachedSession::ask(Operation operation, const attach::Arguments& arguments,
                                    const TransferProgress& progress) {
    const auto ready = open();
    if (!ready) return ready.problem();
    auto reply = client_.call(operation, arguments, progress);
    last_error_ = reply.error.code;
    if (reply.ok()) return std::move(reply.payload);
    // All texts come from another program, so their control characters are not written to a terminal.
    if (reply.status == attach::Status::refused)
        return Problem{.text = samples::words_of_slave(reply.text),
                       .code = reply.broken ? samples::exit_code::kSystem : samples::exit_code::kSegment,
                       .refused = !reply.broken};
    return problem_of(reply.error, reply.text);
}

Answer<Octets> AttachedSession::ask_slave(std::uint16_t position, Operation operation, attach::Arguments arguments,
                                          const TransferProgress& progress) {
    const auto slave = slave_at(position);
    if (!slave) return slave.problem();
    arguments.slave = slave->number;
    return ask(operation, arguments, progress);
}

Answer<Octets> AttachedSession::ask_whole(std::uint16_t position, Operation operation, attach::Arguments arguments) {
    const auto most = static_cast<std::uint32_t>(client_.transfer_bytes());
    for (std::uint32_t bytes = 1024;; bytes = std::min(bytes * 16, most)) {
        arguments.bytes = bytes;
        auto got = ask_slave(position, operation, arguments);
        if (got || last_error_ != Errc::capacity || bytes >= client_.transfer_bytes()) return got;
    }
}

// ------------------------------------------------------------------ facts

// If the table changes between the readings of two parts, it is read again.
Answer<std::vector<attach::SlaveFacts>> AttachedSession::table() {
    std::vector<attach::SlaveFacts> all;
    for (int again = 0; again < 8;) {
        const auto part = ask(Operation::slaves, {.from = static_cast<std::uint32_t>(all.size() + 1)});
        if (!part) return part.problem();
        attach::Reader from(*part);
        std::uint16_t count = 0;
        std::uint16_t some = 0;
        from(count, some);
        for (; some != 0 && from.ok(); --some) from(all.emplace_back());
        if (!from.complete()) return Problem{path_ + ": the answer is not complete", samples::exit_code::kSystem};
        if (all.size() == count) return known_ = std::move(all);
        if (all.size() < count && from.complete() && !all.empty() && all.back().number == all.size()) continue;
        all.clear();
        ++again;
    }
    return Problem{"the application scans the segment at present"};
}

Answer<attach::SlaveFacts> AttachedSession::slave_at(std::uint16_t position) {
    const auto find = [&] { return std::ranges::find(known_, position + 1, &attach::SlaveFacts::ring_position); };
    if (find() == known_.end()) {
        const auto all = table();
        if (!all) return all.problem();
    }
    if (find() == known_.end()) return Problem{fmt::format("there is no slave at position {}", position)};
    return *find();
}

Answer<MasterFacts> AttachedSession::master() {
    const auto all = slaves();
    if (!all) return all.problem();
    const auto facts = read<attach::MasterFacts>(ask(Operation::master, {}));
    if (!facts) return facts.problem();
    const auto source = client_.name().empty() ? path_ : samples::words_of_slave(client_.name());
    return MasterFacts{.source = source,
                       .active = true,
                       .slaves = static_cast<std::uint16_t>(all->size()),
                       .devices = devices_of(source),
                       .frames_sent = facts->link.frames_sent,
                       .frames_received = facts->link.frames_received,
                       .bytes_on_wire = facts->link.bytes_on_wire,
                       .frames_lost = facts->link.lost};
}

Answer<std::vector<SlaveFacts>> AttachedSession::slaves() {
    const auto table_now = table();
    if (!table_now) return table_now.problem();
    const auto position_of = [&](std::uint16_t number) {
        const auto found = std::ranges::find(*table_now, number, &attach::SlaveFacts::number);
        return found == table_now->end() ? std::uint16_t{0} : found->ring_position;  // the first is 1
    };
    std::vector<SlaveFacts> all;
    for (const auto& s : *table_now) {
        if (s.ring_position == 0) continue;
        SlaveFacts facts{.position = static_cast<std::uint16_t>(s.ring_position - 1),
                         .alias = s.alias,
                         .station_address = s.station_address,
                         .name = samples::words_of_slave(s.name()),
                         .identity = s.identity,
                         .al = s.al,
                         .problem = s.error.code == Errc::none ? std::string() : problem_of(s.error, {}).text,
                         .dl = s.dl,
                         .parent_port = s.parent_port,
                         .entry_port = s.entry_port,
                         .mailbox = s.mailbox,
                         .boot_mailbox = s.boot_mailbox,
                         .coe_details = s.coe_details,
                         .ebus_current_ma = s.ebus_current_ma};
        if (const auto parent = s.parent == 0 ? std::uint16_t{0} : position_of(s.parent); parent != 0)
            facts.parent = static_cast<std::uint16_t>(parent - 1);
        for (unsigned n = 0; n < facts.ports.size(); ++n) {
            const auto& port = s.ports[n];
            facts.signal[n] = (s.dl_status & wire::dl_status::communication(n)) != 0;
            facts.ports[n] = {.type = port.type, .link = port.link, .open = port.open};
            if (port.neighbour != 0) facts.ports[n].neighbour = position_of(port.neighbour);
        }
        all.push_back(std::move(facts));
    }
    std::ranges::sort(all, {}, &SlaveFacts::position);
    return all;
}

// The values that the application has measured. A new measurement would disturb its clocks.
Answer<ClockFacts> AttachedSession::clock(std::uint16_t position) {
    const auto all = table();
    if (!all) return all.problem();
    const auto slave = slave_at(position);
    if (!slave) return slave.problem();
    const auto master_facts = read<attach::MasterFacts>(ask(Operation::master, {}));
    if (!master_facts) return master_facts.problem();
    ClockFacts facts{.runs = slave->clock == ClockKind::bits32 || slave->clock == ClockKind::bits64,
                     .reference = master_facts->reference_clock == slave->number,
                     .measured = slave->clock != ClockKind::none && slave->clock != ClockKind::unknown,
                     .delay_ns = slave->delay_ns};
    if (!facts.measured) return facts;
    const auto times = read_registers(position, reg::kPortReceiveTime.address, reg::kPortReceiveTime.length);
    if (!times) return times.problem();
    for (std::size_t port = 0; port < facts.receive_ns.size(); ++port)
        facts.receive_ns[port] = load_le<std::uint32_t>(*times, 4 * port);
    return facts;
}

// ------------------------------------------------------------------ states

// The application says what it may be: its process data goes on in each case.
Answer<RescanFacts> AttachedSession::rescan() {
    const auto found = read<attach::RescanFacts>(ask(Operation::rescan, {}));
    if (!found) return found.problem();
    known_.clear();
    sii_.clear();
    if (found->missing != 0)
        notes_.push_back(
            samples::counted(found->missing, "expected slave does not answer", "expected slaves do not answer"));
    if (found->unused != 0)
        notes_.push_back(fmt::format("{} that the application does not use: it uses the slaves of its own scan",
                                     samples::counted(found->unused, "slave answers", "slaves answer")));
    return RescanFacts{
        .slaves = found->slaves, .whole = found->whole, .missing = found->missing, .unused = found->unused};
}

Answer<> AttachedSession::set_debug_level(unsigned level) {
    const auto done = ask(Operation::set_debug_level, {.from = level});
    if (!done) return done.problem();
    return {};
}

Answer<> AttachedSession::set_target(std::uint16_t position, AlState target) {
    const auto set = ask_slave(position, Operation::set_target, {.state = target});
    if (!set) return set.problem();
    return {};
}

// Checks at least once.
Answer<> AttachedSession::await_state(std::uint16_t position, AlState wanted,
                                      std::chrono::steady_clock::time_point deadline) {
    constexpr std::uint32_t kAlRegisters = 6;  // AL status and its code
    while (true) {
        const auto all = table();
        if (!all) return all.problem();
        const auto slave = slave_at(position);
        if (!slave) return slave.problem();
        if (slave->al.state == wanted && !slave->al.error) {
            // The table contains the last read value. The slave may not have responded since then.
            const auto now = read_registers(position, wire::reg::kAlStatus.address, kAlRegisters);
            if (!now) return now.problem();
            const auto al = samples::al_status_in(*now);
            if (al.state == wanted && !al.error) return {};
        }
        if (samples::stop_asked() || std::chrono::steady_clock::now() >= deadline) break;
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    const auto slave = slave_at(position);
    if (!slave) return slave.problem();
    auto text =
        fmt::format("position {}: is in {} and not in {}", position, samples::al_text(slave->al), to_text(wanted));
    if (slave->error.code != Errc::none) text += "; " + problem_of(slave->error, {}).text;
    return Problem{text};
}

Answer<> AttachedSession::reach(std::uint16_t position, AlState target, AlState wanted) {
    if (const auto set = set_target(position, target); !set) return set.problem();
    return await_state(position, wanted, std::chrono::steady_clock::now() + kToReach);
}

Answer<> AttachedSession::set_states(std::span<const std::uint16_t> positions, AlState state) {
    std::vector<std::string> problems;
    const auto note = [&problems](const Answer<>& done) {
        // The data about the application itself is the same for all slaves.
        if (!done && std::ranges::find(problems, done.problem().text) == problems.end())
            problems.push_back(done.problem().text);
        return static_cast<bool>(done);
    };
    std::vector<std::uint16_t> on_their_way;
    for (const auto position : positions)
        if (note(set_target(position, state))) on_their_way.push_back(position);
    const auto deadline = std::chrono::steady_clock::now() + kToReach;
    for (const auto position : on_their_way) (void)note(await_state(position, state, deadline));
    if (!problems.empty()) return Problem{fmt::format("{}", fmt::join(problems, "; "))};
    return {};
}

// ------------------------------------------------------------------ mailboxes

Answer<Octets> AttachedSession::upload(std::uint16_t position, std::uint16_t index, std::uint8_t subindex,
                                       bool complete_access) {
    return ask_whole(position, Operation::sdo_upload,
                     {.index = index, .subindex = subindex, .complete_access = complete_access});
}

Answer<> AttachedSession::download(std::uint16_t position, std::uint16_t index, std::uint8_t subindex,
                                   bool complete_access, std::span<const std::byte> value) {
    const auto done = ask_slave(position, Operation::sdo_download,
                                {.index = index,
                                 .subindex = subindex,
                                 .complete_access = complete_access,
                                 .data = Octets(value.begin(), value.end())});
    if (!done) return done.problem();
    return {};
}

Answer<DictionaryEntryFacts> AttachedSession::dictionary_entry(std::uint16_t position, std::uint16_t index,
                                                               std::uint8_t subindex) {
    const auto entry = read<attach::EntryFacts>(
        ask_slave(position, Operation::entry_description, {.index = index, .subindex = subindex}));
    if (!entry) return entry.problem();
    return DictionaryEntryFacts{.subindex = entry->subindex,
                                .access = entry->access,
                                .data_type = entry->data_type,
                                .bits = entry->bits,
                                .name = samples::words_of_slave(entry->name)};
}

Answer<std::vector<DictionaryObjectFacts>> AttachedSession::dictionary(std::uint16_t position, bool entries) {
    const auto list = ask_slave(position, Operation::object_list, {});
    if (!list) return list.problem();
    std::vector<DictionaryObjectFacts> objects;
    for (std::size_t at = 0; at + 1 < list->size(); at += 2) {
        const auto index = load_le<std::uint16_t>(*list, at);
        const auto described =
            read<attach::ObjectFacts>(ask_slave(position, Operation::object_description, {.index = index}));
        if (!described) return described.problem();
        auto& object = objects.emplace_back(DictionaryObjectFacts{.index = index,
                                                                  .name = samples::words_of_slave(described->name),
                                                                  .code = described->code,
                                                                  .max_subindex = described->max_subindex});
        for (unsigned n = 0; entries && n <= described->max_subindex; ++n) {
            const auto entry = dictionary_entry(position, index, static_cast<std::uint8_t>(n));
            if (!entry && last_error_ == Errc::sdo_abort) continue;  // the object has no such subindex
            if (!entry) return entry.problem();
            object.entries.push_back(*entry);
        }
    }
    return objects;
}

Answer<Octets> AttachedSession::soe_read(std::uint16_t position, std::uint8_t drive, Idn idn) {
    return ask_whole(position, Operation::soe_read,
                     {.index = idn.value, .subindex = drive, .elements = soe_element::kValue});
}

Answer<SoeAttribute> AttachedSession::soe_attribute(std::uint16_t position, std::uint8_t drive, Idn idn) {
    const auto bits = read<std::uint32_t>(
        ask_slave(position, Operation::soe_read,
                  {.index = idn.value, .subindex = drive, .elements = soe_element::kAttribute, .bytes = 4}));
    if (!bits) return bits.problem();
    return margay::soe_attribute(*bits);
}

Answer<> AttachedSession::soe_write(std::uint16_t position, std::uint8_t drive, Idn idn,
                                    std::span<const std::byte> value) {
    const auto done = ask_slave(position, Operation::soe_write,
                                {.index = idn.value,
                                 .subindex = drive,
                                 .elements = soe_element::kValue,
                                 .data = Octets(value.begin(), value.end())});
    if (!done) return done.problem();
    return {};
}

Answer<std::vector<attach::EoePortFacts>> AttachedSession::ports() {
    const auto answer = ask(Operation::eoe_ports, {});
    if (!answer) return answer.problem();
    attach::Reader from(*answer);
    std::uint32_t count = 0;
    std::uint16_t some = 0;
    from(count, some);
    std::vector<attach::EoePortFacts> all;
    for (; some != 0 && from.ok(); --some) from(all.emplace_back());
    if (!from.complete()) return Problem{path_ + ": the answer is not complete", samples::exit_code::kSystem};
    if (count > all.size()) notes_.push_back(fmt::format("{} of {} EoE ports are shown", all.size(), count));
    std::ranges::sort(all, {}, &attach::EoePortFacts::slave);
    return all;
}

// The ports of the application: what they have counted since they began, and the rates between two looks at them.
Answer<std::vector<EoeFacts>> AttachedSession::eoe(std::chrono::milliseconds during) {
    const auto before = ports();
    if (!before) return before.problem();
    const auto begun = std::chrono::steady_clock::now();
    if (!before->empty()) pause(during);
    const auto now = before->empty() ? before : ports();
    if (!now) return now.problem();
    const auto between = std::chrono::steady_clock::now() - begun;
    const auto slaves_now = table();
    if (!slaves_now) return slaves_now.problem();
    std::vector<EoeFacts> all;
    for (const auto& port : *now) {
        const auto& counted = port.counted;
        EoeFacts facts{.interface = printable(port.name()),
                       .open = port.open,
                       .sent_octets = counted.sent_octets,
                       .received_octets = counted.received_octets,
                       .sent_frames = counted.sent,
                       .received_frames = counted.received,
                       .dropped_frames = dropped_frames(counted)};
        const auto slave = std::ranges::find(*slaves_now, port.slave, &attach::SlaveFacts::number);
        if (slave != slaves_now->end() && slave->ring_position != 0)
            facts.position = static_cast<std::uint16_t>(slave->ring_position - 1);
        const auto earlier = std::ranges::find(*before, port.slave, &attach::EoePortFacts::slave);
        const EoeStatistics none;
        const auto& was = earlier == before->end() ? none : earlier->counted;
        facts.sent_rate = rate(was.sent_octets, counted.sent_octets, between);
        facts.received_rate = rate(was.received_octets, counted.received_octets, between);
        all.push_back(std::move(facts));
    }
    return all;
}

Answer<> AttachedSession::set_ip(std::uint16_t position, const EoeIp& ip) {
    Octets octets(128);
    attach::Writer into(octets);
    into(ip);
    octets.resize(into.written().size());
    const auto done = ask_slave(position, Operation::eoe_set_ip, {.data = std::move(octets)});
    if (!done) return done.problem();
    return {};
}

// ------------------------------------------------------------------ registers and SII

Answer<Octets> AttachedSession::read_registers(std::uint16_t position, std::uint16_t address, std::size_t bytes) {
    constexpr std::size_t kOnce = 1024;
    Octets octets;
    for (std::size_t at = 0; at < bytes; at += kOnce) {
        const auto part = ask_slave(position, Operation::read_registers,
                                    {.index = static_cast<std::uint16_t>(address + at),
                                     .bytes = static_cast<std::uint32_t>(std::min(kOnce, bytes - at))});
        if (!part) return part.problem();
        if (part->size() != std::min(kOnce, bytes - at))
            return Problem{path_ + ": the answer is not complete", samples::exit_code::kSystem};
        octets.insert(octets.end(), part->begin(), part->end());
    }
    return octets;
}

Answer<> AttachedSession::write_registers(std::uint16_t position, std::uint16_t address,
                                          std::span<const std::byte> value, bool urgent) {
    const auto done = ask_slave(position, Operation::write_registers,
                                {.index = address, .urgent = urgent, .data = Octets(value.begin(), value.end())});
    if (!done) return done.problem();
    return {};
}

Answer<> AttachedSession::read_sii(std::uint16_t position, std::uint32_t word, std::span<std::byte> into) {
    const auto got =
        ask_slave(position, Operation::read_sii, {.from = word, .bytes = static_cast<std::uint32_t>(into.size())});
    if (!got) return got.problem();
    if (got->size() != into.size()) return Problem{path_ + ": the answer is not complete", samples::exit_code::kSystem};
    std::ranges::copy(*got, into.begin());
    return {};
}

Answer<> AttachedSession::write_sii(std::uint16_t position, std::uint32_t word, std::span<const std::byte> value) {
    sii_.erase(position);
    const auto done =
        ask_slave(position, Operation::write_sii, {.from = word, .data = Octets(value.begin(), value.end())});
    if (!done) return done.problem();
    return {};
}

void AttachedSession::pause(std::chrono::milliseconds time) {
    const auto end = std::chrono::steady_clock::now() + time;
    while (std::chrono::steady_clock::now() < end && !samples::stop_asked())
        std::this_thread::sleep_for(
            std::min<std::chrono::nanoseconds>(std::chrono::milliseconds(50), end - std::chrono::steady_clock::now()));
}

std::vector<std::string> AttachedSession::messages() { return std::exchange(notes_, {}); }

}  // namespace margay::ethercat
