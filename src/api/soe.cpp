// The requests for parameters of drives (SoE).
#include "mailbox/soe.hpp"

#include "api/mail.hpp"

#include <margay/margay.hpp>

#include <algorithm>

namespace margay {
namespace {

template <class R>
SoeTarget target_of(const R& request, std::uint8_t elements) {
    return {.idn = request.idn, .drive = request.drive, .elements = elements};
}

}  // namespace

// ------------------------------------------------------------------ the sequences of the requests

static Error check(Network& network, const SoeRead& r) {
    return check_soe(network, r.slave, Step::soe_read, r.drive, r.idn);
}
static Error check(Network& network, const SoeWrite& r) {
    return check_soe(network, r.slave, Step::soe_write, r.drive, r.idn);
}
static Error check(Network& network, const SoeCommand& r) {
    return check_soe(network, r.slave, Step::soe_command, r.drive, r.idn);
}

static Task<Result<>> run(Network& network, SoeRead& r) {
    auto read = co_await soe_read(channel_of(network, r), target_of(r, r.elements), r.data, patience_of(r));
    r.bytes = read ? *read : std::size_t{0};
    co_return read ? Result<>() : Result<>(read.error());
}

static Task<Result<>> run(Network& network, SoeWrite& r) {
    PdoWrite note(network, r.slave, decides_on_telegram(r.idn));
    auto written = co_await soe_write(channel_of(network, r), target_of(r, r.elements), r.data, patience_of(r));
    if (written.error().code == Errc::soe_error) note.refused();
    co_return written;
}

static Task<Result<>> run(Network& network, SoeCommand& r) {
    MailPatience patience = patience_of(r);
    patience.each = MailPatience{}.each;  // the timeout of the request limits the whole command, not a single message
    co_return co_await soe_execute(channel_of(network, r), target_of(r, soe_element::kValue), patience);
}

static constexpr OperationDescription kRead = describe_mail<SoeRead, check, run>(Operation::soe_read, Step::soe_read);
SoeRead::SoeRead() : SlaveRequest(kRead) {}

static constexpr OperationDescription kWrite =
    describe_mail<SoeWrite, check, run>(Operation::soe_write, Step::soe_write);
SoeWrite::SoeWrite() : SlaveRequest(kWrite) {}

static constexpr OperationDescription kCommand =
    describe_mail<SoeCommand, check, run>(Operation::soe_command, Step::soe_command);
SoeCommand::SoeCommand() : SlaveRequest(kCommand) {}

// ------------------------------------------------------------------ functions that wait

Result<std::size_t> SoEread(Context& ctx, std::uint16_t slave, std::uint8_t drive, Idn idn, std::uint8_t elements,
                            std::span<std::byte> into, Duration timeout) {
    SoeRead request;
    request.slave = slave;
    request.timeout = timeout;
    request.drive = drive;
    request.idn = idn;
    request.elements = elements;
    request.data = into;
    return submit_and_wait(ctx, request, request.bytes);
}

Result<> SoEwrite(Context& ctx, std::uint16_t slave, std::uint8_t drive, Idn idn, std::uint8_t elements,
                  std::span<const std::byte> value, Duration timeout) {
    SoeWrite request;
    request.slave = slave;
    request.timeout = timeout;
    request.drive = drive;
    request.idn = idn;
    request.elements = elements;
    request.data = value;
    return submit_and_wait(ctx, request);
}

Result<> SoEcommand(Context& ctx, std::uint16_t slave, std::uint8_t drive, Idn idn, Duration timeout) {
    SoeCommand request;
    request.slave = slave;
    request.timeout = timeout;
    request.drive = drive;
    request.idn = idn;
    return submit_and_wait(ctx, request);
}

Result<SoeAttribute> SoEattribute(Context& ctx, std::uint16_t slave, std::uint8_t drive, Idn idn, Duration timeout) {
    std::array<std::byte, wire::soe::kAttributeBytes> octets{};
    const auto read = SoEread(ctx, slave, drive, idn, soe_element::kAttribute, octets, timeout);
    if (!read) return read.error();
    if (*read == octets.size()) return soe_attribute(load_le<std::uint32_t>(octets));
    Error error{
        .code = Errc::wrong_size, .step = Step::soe_read, .slave = slave, .index = idn.value, .subindex = drive};
    error.expected = wire::soe::kAttributeBytes;
    error.actual = static_cast<std::uint32_t>(*read);
    return error;
}

Result<std::string_view> SoEread_text(Context& ctx, std::uint16_t slave, std::uint8_t drive, Idn idn,
                                      std::uint8_t element, std::span<char> into, Duration timeout) {
    constexpr std::size_t kHead = wire::soe::kListHeadBytes;
    const auto bytes = std::as_writable_bytes(into);
    const auto read = SoEread(ctx, slave, drive, idn, element, bytes, timeout);
    if (!read) return read.error();
    if (*read <= kHead) return std::string_view{};
    const std::size_t length = wire::soe::ListLayout::current_bytes::load(bytes);
    std::string_view text(into.data() + kHead, std::min(length, *read - kHead));
    return text.substr(0, std::min(text.size(), text.find('\0')));
}

std::string_view soe_error_text(std::uint16_t code) {
    return wire::soe::to_text(static_cast<wire::soe::ErrorCode>(code));
}

}  // namespace margay
