// The requests for SDO upload and download.
#include "api/mail.hpp"
#include "mailbox/coe_sdo.hpp"

#include <margay/margay.hpp>

#include <algorithm>

namespace margay {
namespace {

// Checks the parameters. Complete access begins at subindex 0 or 1 (ETG.1000.6, "Complete access").
Error check_sdo(Network& network, std::uint16_t slave, Step step, std::uint16_t index, std::uint8_t subindex,
                bool complete) {
    if (complete && subindex > 1) return invalid(Argument::complete_access, step, slave, index, subindex);
    return check_coe(network, slave, step, index, subindex);
}

}  // namespace

static Error check(Network& network, const SdoUpload& r) {
    return check_sdo(network, r.slave, Step::sdo_upload, r.index, r.subindex, r.complete_access);
}
static Error check(Network& network, const SdoDownload& r) {
    return check_sdo(network, r.slave, Step::sdo_download, r.index, r.subindex, r.complete_access);
}

static Task<Result<>> run(Network& network, SdoUpload& request) {
    const SdoObject object{request.index, request.subindex, request.complete_access};
    auto read = co_await sdo_upload(channel_of(network, request), object, request.data, patience_of_each(request));
    request.bytes = read ? *read : std::size_t{0};
    co_return read ? Result<>() : Result<>(read.error());
}

static Task<Result<>> run(Network& network, SdoDownload& request) {
    const SdoObject object{request.index, request.subindex, request.complete_access};
    PdoWrite note(network, request.slave, decides_on_pdos(object.index));
    auto written = co_await sdo_download(channel_of(network, request), object, request.data, patience_of_each(request));
    if (!object.complete && written.error().code == Errc::sdo_abort) note.refused();
    co_return written;
}

static constexpr OperationDescription kUpload =
    describe_mail<SdoUpload, check, run>(Operation::sdo_upload, Step::sdo_upload);
SdoUpload::SdoUpload() : SlaveRequest(kUpload) {}

static constexpr OperationDescription kDownload =
    describe_mail<SdoDownload, check, run>(Operation::sdo_download, Step::sdo_download);
SdoDownload::SdoDownload() : SlaveRequest(kDownload) {}

Result<std::size_t> SDOread(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                            bool complete_access, std::span<std::byte> into, Duration timeout) {
    SdoUpload request;
    request.slave = slave;
    request.timeout = timeout;
    request.index = index;
    request.subindex = subindex;
    request.complete_access = complete_access;
    request.data = into;
    return submit_and_wait(ctx, request, request.bytes);
}

Result<> SDOwrite(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex, bool complete_access,
                  std::span<const std::byte> value, Duration timeout) {
    SdoDownload request;
    request.slave = slave;
    request.timeout = timeout;
    request.index = index;
    request.subindex = subindex;
    request.complete_access = complete_access;
    request.data = value;
    return submit_and_wait(ctx, request);
}

Result<std::string_view> SDOread_text(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                                      std::span<char> into, Duration timeout) {
    const auto read = SDOread(ctx, slave, index, subindex, false, std::as_writable_bytes(into), timeout);
    if (!read) return read.error();
    const std::string_view text(into.data(), *read);
    return text.substr(0, std::min(text.size(), text.find('\0')));
}

Result<> SDOwrite_text(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                       std::string_view text, Duration timeout) {
    return SDOwrite(ctx, slave, index, subindex, false, std::as_bytes(std::span(text)), timeout);
}

std::string_view sdo_abort_text(std::uint32_t code) { return wire::coe::to_text(static_cast<wire::coe::Abort>(code)); }

}  // namespace margay
