// Access to mailboxes, registers and the SII of slaves; see standalone.hpp.
#include "ethercat/standalone.hpp"

#include "common/eoe_lines.hpp"
#include "common/slave_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <utility>

namespace margay::ethercat {
namespace {

// Executes a request of the library to its end.
Answer<> execute(Context& ctx, Request& request) {
    const auto begun = submit(ctx, request);
    const auto done = begun ? wait(ctx, request) : begun;
    if (!done) return problem_of(ctx, done.error());
    return {};
}

// Calls `read` with growing memory until the value fits.
template <class Read>
Answer<Octets> read_whole(Context& ctx, const Read& read) {
    Octets buffer(1024);
    for (;;) {
        const auto bytes = read(std::span<std::byte>(buffer));
        if (bytes) {
            buffer.resize(*bytes);
            return buffer;
        }
        if (bytes.error().code != Errc::capacity || bytes.error().expected <= buffer.size())
            return problem_of(ctx, bytes.error());
        buffer.resize(bytes.error().expected);
    }
}

DictionaryEntryFacts facts_of(const EntryDescription& entry) {
    return {.subindex = entry.subindex,
            .access = entry.access,
            .data_type = entry.data_type,
            .bits = entry.bit_length,
            .name = samples::words_of_slave(entry.name())};
}

struct Sink final : ByteSink {
    Octets octets{};
    Taken push(std::span<const std::byte> more) override {
        octets.insert(octets.end(), more.begin(), more.end());
        return {.bytes = more.size()};
    }
};

void set_up(FoeRequest& request, std::uint16_t number, const Session::FileTransfer& file) {
    request.slave = number;
    request.name = file.name;
    request.password = file.password;
    if (!file.progress) return;
    request.user = const_cast<TransferProgress*>(&file.progress);
    request.progressed = [](const FoeProgress& progress, void* user) {
        (*static_cast<const TransferProgress*>(user))(progress.bytes, progress.total);
    };
}

Problem with_slave_text(const FoeRequest& request, Problem problem) {
    if (request.state() == RequestState::error && !request.slave_text().empty())
        problem.text += fmt::format(" (the slave: \"{}\")", samples::words_of_slave(request.slave_text()));
    return problem;
}

}  // namespace

// ------------------------------------------------------------------ CoE

Answer<std::vector<DictionaryObjectFacts>> StandaloneSession::dictionary(std::uint16_t position, bool entries) {
    const auto number = number_of(position);
    if (!number) return number.problem();
    std::vector<std::uint16_t> indices;
    const auto listed = read_object_list(
        *ctx_, *number, ObjectList::all,
        [](std::span<const std::uint16_t> some, void* user) {
            auto& all = *static_cast<std::vector<std::uint16_t>*>(user);
            all.insert(all.end(), some.begin(), some.end());
        },
        &indices);
    if (!listed) return problem_of(*ctx_, listed.error());
    std::vector<DictionaryObjectFacts> objects;
    for (const auto index : indices) {
        const auto described = read_object_description(*ctx_, *number, index);
        if (!described) return problem_of(*ctx_, described.error());
        auto& object = objects.emplace_back(DictionaryObjectFacts{.index = index,
                                                                  .name = samples::words_of_slave(described->name()),
                                                                  .code = described->object_code,
                                                                  .max_subindex = described->max_subindex});
        for (unsigned n = 0; entries && n <= described->max_subindex; ++n) {
            const auto entry = read_entry_description(*ctx_, *number, index, static_cast<std::uint8_t>(n));
            if (!entry && entry.error().code == Errc::sdo_abort) continue;  // the object has no such subindex
            if (!entry) return problem_of(*ctx_, entry.error());
            object.entries.push_back(facts_of(*entry));
        }
    }
    return objects;
}

Answer<DictionaryEntryFacts> StandaloneSession::dictionary_entry(std::uint16_t position, std::uint16_t index,
                                                                 std::uint8_t subindex) {
    const auto number = number_of(position);
    if (!number) return number.problem();
    const auto entry = read_entry_description(*ctx_, *number, index, subindex);
    if (!entry) return problem_of(*ctx_, entry.error());
    return facts_of(*entry);
}

Answer<Octets> StandaloneSession::upload(std::uint16_t position, std::uint16_t index, std::uint8_t subindex,
                                         bool complete_access) {
    const auto number = number_of(position);
    if (!number) return number.problem();
    return read_whole(*ctx_, [&](std::span<std::byte> into) {
        return SDOread(*ctx_, *number, index, subindex, complete_access, into);
    });
}

Answer<> StandaloneSession::download(std::uint16_t position, std::uint16_t index, std::uint8_t subindex,
                                     bool complete_access, std::span<const std::byte> value) {
    const auto number = number_of(position);
    if (!number) return number.problem();
    const auto done = SDOwrite(*ctx_, *number, index, subindex, complete_access, value);
    if (!done) return problem_of(*ctx_, done.error());
    return {};
}

// ------------------------------------------------------------------ FoE and SoE

Answer<> StandaloneSession::to_boot_and_back(std::uint16_t number, bool boot) {
    keep_states_ = true;
    StateRequest request;
    request.slave = number;
    request.wanted = boot ? AlState::boot : AlState::preop;
    return execute(*ctx_, request);
}

Answer<Octets> StandaloneSession::foe_read(std::uint16_t position, const FileTransfer& file) {
    const auto number = number_of(position);
    if (!number) return number.problem();
    if (file.boot) {
        const auto ready = to_boot_and_back(*number, true);
        if (!ready) return ready.problem();
    }
    Sink sink;
    FoeRead request;
    set_up(request, *number, file);
    request.sink = &sink;
    const auto done = execute(*ctx_, request);
    const auto back = file.boot ? to_boot_and_back(*number, false) : Answer<>();
    if (!done) return with_slave_text(request, done.problem());
    if (!back) return back.problem();
    return std::move(sink.octets);
}

Answer<> StandaloneSession::foe_write(std::uint16_t position, const FileTransfer& file,
                                      std::span<const std::byte> content) {
    const auto number = number_of(position);
    if (!number) return number.problem();
    if (file.boot) {
        const auto ready = to_boot_and_back(*number, true);
        if (!ready) return ready.problem();
    }
    FoeWrite request;
    set_up(request, *number, file);
    request.data = content;
    const auto done = execute(*ctx_, request);
    if (!done) {
        auto problem = with_slave_text(request, done.problem());
        // Its firmware may be incomplete, and in BOOT the slave accepts another transfer.
        if (file.boot) problem.text += "; the slave stays in BOOT";
        return problem;
    }
    return file.boot ? to_boot_and_back(*number, false) : Answer<>();
}

Answer<Octets> StandaloneSession::soe_read(std::uint16_t position, std::uint8_t drive, Idn idn) {
    const auto number = number_of(position);
    if (!number) return number.problem();
    return read_whole(*ctx_, [&](std::span<std::byte> into) {
        return SoEread(*ctx_, *number, drive, idn, soe_element::kValue, into);
    });
}

Answer<SoeAttribute> StandaloneSession::soe_attribute(std::uint16_t position, std::uint8_t drive, Idn idn) {
    const auto number = number_of(position);
    if (!number) return number.problem();
    const auto attribute = SoEattribute(*ctx_, *number, drive, idn);
    if (!attribute) return problem_of(*ctx_, attribute.error());
    return *attribute;
}

Answer<> StandaloneSession::soe_write(std::uint16_t position, std::uint8_t drive, Idn idn,
                                      std::span<const std::byte> value) {
    const auto number = number_of(position);
    if (!number) return number.problem();
    const auto done = SoEwrite(*ctx_, *number, drive, idn, soe_element::kValue, value);
    if (!done) return problem_of(*ctx_, done.error());
    return {};
}

// ------------------------------------------------------------------ EoE

Answer<std::vector<EoeFacts>> StandaloneSession::eoe(std::chrono::milliseconds during) {
    const auto all = slaves();
    if (!all) return all.problem();
    struct OnePort {
        EoePortMemory<8, 8> memory{};
        EoePort port{memory};
    };
    std::vector<std::pair<EoeFacts, std::unique_ptr<OnePort>>> ports;
    for (const SlaveFacts& slave : *all) {
        if (!slave.mailbox.present() || (slave.mailbox.protocols & mailbox_protocol::kEoE) == 0) continue;
        EoeFacts facts{.position = slave.position};
        facts.interface =
            samples::eoe_interface_name(settings_.index, ctx_->slave(*number_of(slave.position)), ctx_->slaves());
        auto one = std::make_unique<OnePort>();
        one->port.slave = *number_of(slave.position);
        const auto begun = submit(*ctx_, one->port);
        facts.open = begun.ok();
        if (!begun) note(problem_of(*ctx_, begun.error()).text);
        ports.emplace_back(std::move(facts), std::move(one));
    }
    // A full port would drop frames, so the received frames are removed each millisecond.
    Octets frame(kEoeFrameBytes);
    for (auto left = during; !ports.empty() && left.count() > 0 && !samples::stop_asked(); --left) {
        pause(std::chrono::milliseconds(1));
        for (auto& [facts, one] : ports)
            while (one->port.receive(frame)) {
            }
    }
    std::vector<EoeFacts> out;
    for (auto& [facts, one] : ports) {
        const auto counted = one->port.statistics();
        facts.open = one->port.busy();
        one->port.cancel();
        facts.sent_octets = counted.sent_octets;
        facts.received_octets = counted.received_octets;
        facts.sent_frames = counted.sent;
        facts.received_frames = counted.received;
        const auto rate = [&](std::uint32_t octets) {
            return std::uint64_t{octets} * 1000 / static_cast<std::uint64_t>(during.count());
        };
        facts.sent_rate = rate(counted.sent_octets);
        facts.received_rate = rate(counted.received_octets);
        facts.dropped_frames = dropped_frames(counted);
        out.push_back(std::move(facts));
    }
    return out;
}

Answer<> StandaloneSession::set_ip(std::uint16_t position, const EoeIp& ip) {
    const auto number = number_of(position);
    if (!number) return number.problem();
    const auto done = EOEset_ip(*ctx_, *number, ip);
    if (!done) return problem_of(*ctx_, done.error());
    return {};
}

// ------------------------------------------------------------------ registers and SII

Answer<Octets> StandaloneSession::read_registers(std::uint16_t position, std::uint16_t address, std::size_t bytes) {
    constexpr std::size_t kOnce = 1024;
    const auto number = number_of(position);
    if (!number) return number.problem();
    Octets octets(bytes);
    for (std::size_t at = 0; at < bytes; at += kOnce) {
        const auto part = std::span(octets).subspan(at, std::min(kOnce, bytes - at));
        const auto read = read_register(*ctx_, *number, static_cast<std::uint16_t>(address + at), part);
        if (!read) return problem_of(*ctx_, read.error());
    }
    return octets;
}

Answer<> StandaloneSession::write_registers(std::uint16_t position, std::uint16_t address,
                                            std::span<const std::byte> value, bool urgent) {
    const auto number = number_of(position);
    if (!number) return number.problem();
    RegisterWriteRequest request;
    request.slave = *number;
    request.address = address;
    request.data = value;
    request.priority = urgent ? 3 : 0;
    return execute(*ctx_, request);
}

Answer<> StandaloneSession::read_sii(std::uint16_t position, std::uint32_t word, std::span<std::byte> into) {
    const auto number = number_of(position);
    if (!number) return number.problem();
    SiiReadRequest request;
    request.slave = *number;
    request.word = word;
    request.data = into;
    request.beyond_end = true;
    return execute(*ctx_, request);
}

Answer<> StandaloneSession::write_sii(std::uint16_t position, std::uint32_t word, std::span<const std::byte> value) {
    const auto number = number_of(position);
    if (!number) return number.problem();
    sii_.erase(*number);
    SiiWriteRequest request;
    request.slave = *number;
    request.word = word;
    request.data = value;
    request.beyond_end = true;
    return execute(*ctx_, request);
}

Answer<Session::Description> StandaloneSession::describe(std::uint16_t position) {
    const auto number = number_of(position);
    if (!number) return number.problem();
    auto device = files::describe_slave(*ctx_, *number);
    if (!device) return Problem{fmt::format("position {}: {}", position, to_text(device.problem))};
    Description out{.device = std::move(*device)};
    for (const auto& remark : device.remarks) out.remarks.push_back(to_text(remark));
    return out;
}

}  // namespace margay::ethercat
