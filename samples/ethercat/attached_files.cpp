// Files to and from the slaves of an application; see attached.hpp.
#include "common/program.hpp"
#include "common/slave_report.hpp"
#include "ethercat/attached.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <thread>

namespace margay::ethercat {
namespace {

using attach::Operation;

std::string identity_text(const Identity& identity) {
    return fmt::format("{:#010x}:{:#010x}, revision {:#010x}", identity.vendor, identity.product, identity.revision);
}

}  // namespace

// From BOOT the slave goes back to the target that it had.
Answer<Octets> AttachedSession::foe_read(std::uint16_t position, const FileTransfer& file) {
    const auto before = slave_at(position);
    if (!before) return before.problem();
    if (file.boot) {
        const auto ready = reach(position, AlState::boot, AlState::boot);
        if (!ready) return ready.problem();
    }
    auto content = ask_slave(
        position, Operation::foe_read,
        {.from = file.password, .bytes = static_cast<std::uint32_t>(client_.transfer_bytes()), .name = file.name},
        file.progress);
    if (!file.boot) return content;
    const auto back = reach(position, before->target, before->al.state);
    return content && !back ? Answer<Octets>(back.problem()) : std::move(content);
}

Answer<> AttachedSession::foe_write(std::uint16_t position, const FileTransfer& file,
                                    std::span<const std::byte> content) {
    const auto before = slave_at(position);
    if (!before) return before.problem();
    if (file.boot) {
        const auto ready = reach(position, AlState::boot, AlState::boot);
        if (!ready) return ready.problem();
    }
    const auto done = ask_slave(
        position, Operation::foe_write,
        {.from = file.password, .name = file.name, .data = Octets(content.begin(), content.end())}, file.progress);
    if (done) return file.boot ? back_from_boot(*before) : Answer<>();
    auto problem = done.problem();
    if (file.boot) problem.text += "; the slave stays in BOOT";
    return problem;
}

// A slave with new firmware restarts. It does not respond for some time, and may then have another identity. The
// application keeps such a slave below SAFEOP. The slave contains the file in each case.
Answer<> AttachedSession::back_from_boot(const attach::SlaveFacts& before) {
    const auto written = [&](const std::string& text) {
        return Problem{
            fmt::format("the file was written, but the slave of position {} {}", before.ring_position - 1, text)};
    };
    const auto set = ask(Operation::set_target, {.slave = before.number, .state = before.target});
    attach::SlaveFacts now;
    for (int n = 0; n < 1000 && !samples::stop_asked(); ++n) {
        const auto all = table();
        if (!all) return written("is not known: " + all.problem().text);
        const auto found = std::ranges::find(*all, before.number, &attach::SlaveFacts::number);
        now = found == all->end() ? attach::SlaveFacts{} : *found;
        const bool there = now.ring_position != 0;
        if (there && now.identity != before.identity && now.error.code != Errc::none) break;
        if (there && now.al.state == before.al.state && !now.al.error) return {};
        if (there && !set) return written("was not taken back from BOOT: " + set.problem().text);
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    if (now.ring_position == 0) return written("did not come back: it is not there");
    const auto why = now.error.code == Errc::none ? std::string() : "; " + problem_of(now.error, {}).text;
    if (now.identity != before.identity)
        return written(fmt::format("came back as another one: {}; it was {}{}", identity_text(now.identity),
                                   identity_text(before.identity), why));
    return written(fmt::format("is in {} and not in {}{}", samples::al_text(now.al), to_text(before.al.state), why));
}

}  // namespace margay::ethercat
