// The requests for files of slaves (FoE).
#include "mailbox/foe.hpp"

#include "api/mail.hpp"
#include "wire/foe.hpp"

#include <margay/margay.hpp>

namespace margay {

static Error check_file(Network& network, const FoeRequest& request, Step step) {
    const Error refused = check_mailbox(network, mailbox_protocol::kFoE, {.step = step, .slave = request.slave});
    if (refused.code != Errc::none) return refused;
    if (request.answer_timeout > Duration{0} && request.busy_timeout > Duration{0}) return {};
    return invalid(Argument::file_time, step, request.slave);
}
static Error check(Network& network, const FoeRead& request) { return check_file(network, request, Step::foe_read); }
static Error check(Network& network, const FoeWrite& request) { return check_file(network, request, Step::foe_write); }

static Task<Result<>> run(Network& network, FoeRead& request) {
    co_return co_await required(foe_read(channel_of(network, request), request, patience_of_each(request)));
}

static Task<Result<>> run(Network& network, FoeWrite& request) {
    co_return co_await required(foe_write(channel_of(network, request), request, patience_of_each(request)));
}

static constexpr OperationDescription kRead = describe_mail<FoeRead, check, run>(Operation::foe_read, Step::foe_read);
static constexpr OperationDescription kWrite =
    describe_mail<FoeWrite, check, run>(Operation::foe_write, Step::foe_write);
FoeRead::FoeRead() : FoeRequest(kRead) {}
FoeWrite::FoeWrite() : FoeRequest(kWrite) {}

static void set_file(FoeRequest& request, std::uint16_t slave, std::string_view name, std::uint32_t password,
                     Duration timeout) {
    request.slave = slave;
    request.name = name;
    request.password = password;
    request.timeout = timeout;
}

static Result<std::size_t> read_and_wait(Context& ctx, FoeRead& request) {
    const auto read = submit_and_wait(ctx, request);
    return read ? Result<std::size_t>(request.bytes()) : Result<std::size_t>(read.error());
}

Result<std::size_t> FOEread(Context& ctx, std::uint16_t slave, std::string_view name, std::uint32_t password,
                            std::span<std::byte> into, Duration timeout) {
    FoeRead request;
    set_file(request, slave, name, password, timeout);
    request.data = into;
    return read_and_wait(ctx, request);
}

Result<std::size_t> FOEread(Context& ctx, std::uint16_t slave, std::string_view name, std::uint32_t password,
                            ByteSink& sink, Duration timeout) {
    FoeRead request;
    set_file(request, slave, name, password, timeout);
    request.sink = &sink;
    return read_and_wait(ctx, request);
}

Result<> FOEwrite(Context& ctx, std::uint16_t slave, std::string_view name, std::uint32_t password,
                  std::span<const std::byte> content, Duration timeout) {
    FoeWrite request;
    set_file(request, slave, name, password, timeout);
    request.data = content;
    return submit_and_wait(ctx, request);
}

Result<> FOEwrite(Context& ctx, std::uint16_t slave, std::string_view name, std::uint32_t password, ByteSource& source,
                  Duration timeout) {
    FoeWrite request;
    set_file(request, slave, name, password, timeout);
    request.source = &source;
    return submit_and_wait(ctx, request);
}

std::string_view foe_error_text(std::uint32_t code) { return to_text(static_cast<wire::foe::ErrorCode>(code)); }

}  // namespace margay
