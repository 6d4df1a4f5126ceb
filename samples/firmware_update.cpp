// firmware_update: writes the firmware of a slave by FoE in BOOT, or reads it.
#include "common/counted.hpp"
#include "common/firmware_file.hpp"
#include "common/program.hpp"
#include "common/progress_line.hpp"
#include "common/segment_look.hpp"
#include "common/slave_report.hpp"
#include "common/source_arguments.hpp"
#include "wire/foe.hpp"

#include <margay/host_context.hpp>
#include <margay/margay.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <vector>

namespace {

using namespace margay;
using namespace margay::samples;
using namespace std::chrono_literals;

struct Options {
    SourceArguments source;
    std::uint16_t number = 0;
    std::string file;
    std::string name;
    std::uint32_t password = 0;
    bool read = false;
    bool read_back = false;
    unsigned restart_s = 30;
};

// The identification of a device. The revision is read from the dictionary, if the device has one, because it is the
// revision of the running firmware.
struct Known {
    Identity identity;
    std::string version;  // object 0x100A
    friend bool operator==(const Known&, const Known&) = default;
};

std::string words(const Known& known) {
    return fmt::format("vendor 0x{:08x}, product 0x{:08x}, revision 0x{:08x}{}{}", known.identity.vendor,
                       known.identity.product, known.identity.revision, known.version.empty() ? "" : ", software ",
                       known.version);
}

// Errors by which a transfer ends before the slave has changed anything: the slave refuses the request, or there is no
// way to send it.
bool refuses_all(Errc code) {
    return code == Errc::foe_error || code == Errc::mailbox_error || code == Errc::unsupported ||
           code == Errc::invalid_argument || code == Errc::wrong_state;
}

// Whether the device refuses this file, so that another attempt would fail too.
bool refuses_file(const Error& error) {
    using enum wire::foe::ErrorCode;
    if (error.code != Errc::foe_error) return false;
    const auto code = static_cast<wire::foe::ErrorCode>(error.detail);
    return code == disk_full || code == wrong_checksum || code == firmware_does_not_fit || code == no_file_header ||
           code == file_incompatible;
}

class Update {
  public:
    Update(Source& source, const Options& options) : source_(source), options_(options), number_(options.number) {}

    int run(FirmwareFile* file, FirmwareCopy* copy);

  private:
    [[nodiscard]] std::string scan();
    [[nodiscard]] const Slave& slave() { return ctx_.slave(number_); }
    [[nodiscard]] std::string other_segment();
    [[nodiscard]] Known look();
    [[nodiscard]] std::string why_not();
    [[nodiscard]] Result<> bring(AlState state);
    [[nodiscard]] Result<> transfer(FoeRequest& request);
    [[nodiscard]] std::string told(const FoeRequest& request, const std::string& own);
    int write(FirmwareFile& file);
    int read(FirmwareCopy& copy);
    [[nodiscard]] std::string read_back(FirmwareFile& file);
    [[nodiscard]] bool is_in_boot();
    int leave_after_failure(bool begun, const Error& error);
    int leave_after_read(const std::string& error, bool of_system);
    int restart(const Known& before, const std::string& not_verified);
    void show(const FoeProgress& progress, std::string_view what);

    Source& source_;
    const Options& options_;
    std::uint16_t number_;
    HostContext ctx_{source_.limits({.slaves = 2048})};
    std::vector<Identity> segment_;  // all slaves, as they were at the start
    ProgressLine line_;
    std::string what_;
    std::size_t total_ = 0;
    bool sent_ = false;   // a request was sent to the device
    bool begun_ = false;  // the device has accepted the request, and may have changed its memory
    bool was_in_boot_ = false;
};

// Scans the segment. Errors of single slaves are ignored: a device without a valid firmware stays in INIT.
std::string Update::scan() {
    const auto found = config_init(ctx_);
    return !found && found.error().slave == 0 ? sentence(found.error()) : std::string();
}

// An earlier run may have left the device in BOOT. The scan, which follows, puts every slave to INIT.
bool Update::is_in_boot() {
    const auto states = look_at_states(source_.nic(), source_.osal(), source_.second());
    return number_ <= states.size() && states[number_ - 1U].state == AlState::boot;
}

// While the device restarts, other slaves may have its number. Returns what differs from the segment at the start; the
// device itself may have another product or revision.
std::string Update::other_segment() {
    const auto slaves = ctx_.slaves();
    if (slaves.size() != segment_.size())
        return fmt::format("there {}, and there were {} before",
                           slaves.size() == 1 ? "is 1 slave" : fmt::format("are {} slaves", slaves.size()),
                           segment_.size());
    for (const Slave& one : slaves) {
        const Identity& before = segment_[one.number - 1U];
        const bool same = one.number == number_ ? one.identity.vendor == before.vendor : one.identity == before;
        if (!same)
            return fmt::format("slave {} is another device than before: {}", one.number, words({one.identity, {}}));
    }
    return {};
}

Known Update::look() {
    Known known{slave().identity, {}};
    if (slave().al.state != AlState::preop || (slave().mailbox.protocols & mailbox_protocol::kCoE) == 0) return known;
    if (const auto revision = SDOread<std::uint32_t>(ctx_, number_, 0x1018, 3)) known.identity.revision = *revision;
    std::array<char, 64> text{};
    if (const auto version = SDOread_text(ctx_, number_, 0x100A, 0, text)) known.version = *version;
    return known;
}

// The reason why firmware cannot be written to the slave by this method.
std::string Update::why_not() {
    const Error& error = slave().error;
    const bool unread = !slave().seen || error.step == Step::read_sii || error.step == Step::parse_sii;
    if (unread && error.code != Errc::none && !slave().boot_mailbox.present()) return sentence(error);
    if ((slave().mailbox.protocols & mailbox_protocol::kFoE) == 0)
        return fmt::format("slave {} ({}) has no FoE", number_, slave().name());
    if (!slave().boot_mailbox.present())
        return fmt::format("slave {} ({}) has no state BOOT: its SII describes no bootstrap mailbox", number_,
                           slave().name());
    return {};
}

Result<> Update::bring(AlState state) {
    StateRequest request;
    request.slave = number_;
    request.wanted = state;
    if (const auto submitted = submit(ctx_, request); !submitted) return submitted;
    return wait(ctx_, request);
}

void Update::show(const FoeProgress& progress, std::string_view what) {
    const std::size_t total = progress.total != 0 ? progress.total : total_;
    std::string text = fmt::format("{} ", what);
    if (total != 0) {
        constexpr std::size_t kWidth = 30;
        const std::size_t done = std::min(progress.bytes, total);
        const std::size_t part = done * kWidth / total;
        text += fmt::format("[{:#<{}}{:<{}}] {:3} % ", "", part, "", kWidth - part, done * 100 / total);
    }
    text += counted(progress.bytes, "octet");
    if (progress.busy) text += fmt::format("  {}", progress.busy_text.empty() ? "busy" : progress.busy_text);
    if (progress.busy && progress.busy_entire != 0)
        text += fmt::format(" {} %", progress.busy_done * 100 / progress.busy_entire);
    line_.show(text);
}

// Ctrl-C cancels the transfer, and the device gets an error message.
Result<> Update::transfer(FoeRequest& request) {
    request.slave = number_;
    request.name = options_.name;
    request.password = options_.password;
    request.user = this;
    request.progressed = [](const FoeProgress& progress, void* user) {
        auto& self = *static_cast<Update*>(user);
        self.begun_ = self.begun_ || progress.bytes != 0 || progress.busy;
        self.show(progress, self.what_);
    };
    begun_ = false;
    sent_ = false;
    if (const auto submitted = submit(ctx_, request); !submitted) return submitted;
    sent_ = true;
    Osal& osal = source_.osal();
    while (request.busy()) {
        if (stop_asked()) request.cancel();
        const Time next = poll(ctx_, osal.now());
        if (request.busy()) osal.wait(std::min(next, osal.now() + 100ms), source_.wait_handles());
    }
    line_.clear();
    // The message that ends a transfer early is sent after it.
    for (int n = 0; n < 20 && request.state() != RequestState::success; ++n) {
        const Time next = poll(ctx_, osal.now());
        osal.wait(std::min(next, osal.now() + 1ms), source_.wait_handles());
    }
    return request.state() == RequestState::success ? Result<>() : Result<>(request.error());
}

// The error in words; `own`: the error of the file, if it has one.
std::string Update::told(const FoeRequest& request, const std::string& own) {
    if (request.error().code == Errc::stream_failed && !own.empty()) return own;
    if (request.error().code == Errc::canceled) return "stopped after " + counted(request.bytes(), "octet");
    const std::string text = sentence(request.error());
    return request.slave_text().empty() ? text : fmt::format("{}; the device says: {}", text, request.slave_text());
}

int Update::leave_after_failure(bool begun, const Error& error) {
    (void)readstate(ctx_);
    if (begun && slave().al.state == AlState::none) {
        warn(fmt::format(
            "slave {} does not answer any more, and has no complete firmware. When it answers again, execute "
            "the same command again to write the whole file",
            number_));
        return exit_code::kSegment;
    }
    if (begun) {
        const auto* const again = refuses_file(error) ? "Execute the command again with a file that the device accepts"
                                                      : "Execute the same command again to write the whole file";
        warn(fmt::format(
            "slave {} is left in BOOT without a complete firmware. Do not switch it off. {}; other slaves are in PREOP",
            number_, again));
        return exit_code::kSegment;
    }
    const auto init = bring(AlState::init);
    const auto preop = init ? bring(AlState::preop) : init;
    warn(preop ? fmt::format("nothing was written, slave {} is back in PREOP", number_)
               : fmt::format("nothing was written by this program, but slave {} does not go back to PREOP: {}", number_,
                             sentence(preop.error())));
    return exit_code::kSegment;
}

int Update::write(FirmwareFile& file) {
    FoeWrite request;
    request.source = &file;
    request.total = file.bytes();
    what_ = "writing";
    const auto written = transfer(request);
    if (!written) {
        const bool of_file = written.error().code == Errc::stream_failed;
        begun_ = begun_ || file.asked();  // the device has acknowledged the request
        const bool refused = !begun_ && refuses_all(written.error().code);
        fail(sent_ ? told(request, file.error()) : sentence(written.error()));
        const int status = leave_after_failure(sent_ && !refused, written.error());
        return of_file ? exit_code::kSystem : status;
    }
    print_out("slave {}: {} written as '{}'\n", number_, counted(request.bytes(), "octet"), options_.name);
    return exit_code::kWell;
}

// Returns why the file could not be verified; empty when it is equal.
std::string Update::read_back(FirmwareFile& file) {
    FirmwareComparison comparison(file);
    FoeRead request;
    request.sink = &comparison;
    total_ = file.bytes();
    what_ = "reading back";
    const auto read = transfer(request);
    if (!read && read.error().code == Errc::foe_error)
        return fmt::format("slave {} does not offer to read '{}' back: {}", number_, options_.name,
                           told(request, file.error()));
    if (!read) return told(request, file.error());
    const auto difference = comparison.difference();
    if (!difference.empty()) return fmt::format("slave {}: {}", number_, difference);
    print_out("slave {}: {} read back, equal\n", number_, counted(request.bytes(), "octet"));
    return {};
}

int Update::read(FirmwareCopy& copy) {
    FoeRead request;
    request.sink = &copy;
    what_ = "reading";
    const auto done = transfer(request);
    const bool of_file = !done && done.error().code == Errc::stream_failed;
    std::string error = done ? copy.complete() : told(request, copy.error());
    const bool of_system = of_file || (done && !error.empty());
    if (!error.empty()) fail(error);
    if (error.empty())
        print_out("slave {}: {} of '{}' read into {}\n", number_, counted(request.bytes(), "octet"), options_.name,
                  options_.file);
    return leave_after_read(error, of_system);
}

int Update::leave_after_read(const std::string& error, bool of_system) {
    Result<> left;
    if (was_in_boot_) {
        warn(fmt::format("slave {} was in BOOT before, and is left there: its firmware may be incomplete", number_));
    } else {
        left = bring(AlState::init);
        if (left) left = bring(AlState::preop);
        if (!left) warn(sentence(left.error()));
    }
    if (of_system) return exit_code::kSystem;
    return error.empty() && left ? exit_code::kWell : exit_code::kSegment;
}

// Brings the device to INIT, which starts the new firmware, then waits until the device responds again.
int Update::restart(const Known& before, const std::string& not_verified) {
    Osal& osal = source_.osal();
    if (const auto init = bring(AlState::init); !init) warn(sentence(init.error()));
    const Time give_up = osal.now() + std::chrono::seconds(options_.restart_s);
    std::string error;
    do {
        line_.show("waiting for the device");
        const Time until = osal.now() + 500ms;
        while (osal.now() < until) {
            const Time next = poll(ctx_, osal.now());
            osal.wait(std::min(next, until), source_.wait_handles());
        }
        error = scan();
        if (error.empty()) error = other_segment();
        if (error.empty() && slave().al.state != AlState::preop)
            error = slave().error.code != Errc::none ? sentence(slave().error)
                                                     : fmt::format("slave {} is not in PREOP", number_);
    } while (!error.empty() && osal.now() < give_up && !stop_asked());
    line_.clear();
    if (!error.empty())
        return fail(
            fmt::format("slave {} has not come back with the new firmware: {}. The file was written as a whole; "
                        "check that it is for this device, and execute the command again",
                        number_, error));
    const Known after = look();
    if (after == before)
        print_out("slave {} is back in PREOP, with the same identity and revision: {}\n", number_, words(after));
    else
        print_out("slave {} is back in PREOP\n  before: {}\n  now:    {}\n", number_, words(before), words(after));
    return not_verified.empty() ? exit_code::kWell : fail("not verified: " + not_verified);
}

int Update::run(FirmwareFile* file, FirmwareCopy* copy) {
    was_in_boot_ = copy != nullptr && !source_.virtual_time() && is_in_boot();
    if (const auto ready = source_.begin(ctx_); !ready) return fail(sentence(ready.error()));
    if (const auto error = scan(); !error.empty()) return fail(error);
    if (const std::size_t count = ctx_.slaves().size(); number_ > count)
        return fail(count == 1 ? std::string("NUMBER: there is 1 slave, the first is 1")
                               : fmt::format("NUMBER: there are slaves 1 to {}", count),
                    exit_code::kUsage);
    if (const auto reason = why_not(); !reason.empty()) return fail(reason);
    for (const Slave& one : ctx_.slaves()) segment_.push_back(one.identity);
    const Known before = look();
    print_out("slave {}: {}, {}\n", number_, slave().name(), words(before));
    if (stop_asked()) return fail("stopped before anything was changed");
    if (const auto boot = bring(AlState::boot); !boot) {
        fail(sentence(boot.error()));
        return leave_after_failure(false, boot.error());
    }
    if (copy != nullptr) return read(*copy);
    if (const int status = write(*file); status != exit_code::kWell) return status;
    const std::string not_verified = options_.read_back ? read_back(*file) : std::string();
    return restart(before, not_verified);
}

int update(Options& options) {
    if (options.number == 0) return fail("NUMBER of the slave is 0; 1 is the first slave", exit_code::kUsage);
    if (options.read && options.read_back) return fail("--read and --read-back exclude each other", exit_code::kUsage);
    if (options.name.empty()) options.name = std::filesystem::path(options.file).stem().string();
    stop_at_signals();
    std::optional<FirmwareFile> file;
    std::optional<FirmwareCopy> copy;
    if (options.read)
        copy.emplace(options.file);
    else
        file.emplace(options.file);
    const std::string& error = options.read ? copy->error() : file->error();
    if (!error.empty()) return fail(error, exit_code::kSystem);
    return run_on_source(options.source, [&](Source& source) {
        return Update(source, options).run(file ? &*file : nullptr, copy ? &*copy : nullptr);
    });
}

}  // namespace

int main(int argc, char** argv) {
    Options options;
    Arguments arguments(
        "firmware_update",
        "Writes the firmware of a slave by FoE: brings the slave to BOOT, writes FILE, brings the slave "
        "back, and waits until it has restarted. Puts the segment to PREOP. Do not use it while another "
        "master is running.");
    add_source_arguments(arguments, options.source);
    arguments.positional("NUMBER", options.number, "the slave, 1 is the first", Arguments::Presence::required);
    arguments.positional("FILE", options.file, "the firmware");
    arguments.option("--name", options.name,
                     "name of the file in the device; without it that of FILE, less its extension");
    arguments.option("--password", options.password, "password of the file, a number");
    arguments.flag("--read-back", options.read_back, "read the file back and compare it, where the device offers this");
    arguments.flag("--read", options.read, "read the firmware of the slave into FILE, and write nothing to the slave");
    arguments.option("--restart", options.restart_s, "how long the device may take to restart, in seconds",
                     Bounds{1, 3600});
    return arguments.run(argc, argv, [&] { return update(options); });
}
