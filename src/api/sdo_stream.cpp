// The requests for SDO upload and download of values of any size.
#include "api/mail.hpp"
#include "mailbox/coe_stream.hpp"

#include <margay/margay.hpp>

namespace margay {

static Error check_stream(Network& network, const SdoStream& r, Step step, bool complete) {
    if (!complete) return invalid(Argument::sdo_stream, step, r.slave, r.index, r.subindex);
    if (r.complete_access && r.subindex > 1)
        return invalid(Argument::complete_access, step, r.slave, r.index, r.subindex);
    return check_coe(network, r.slave, step, r.index, r.subindex);
}

static Error check(Network& network, const SdoUploadStream& r) {
    return check_stream(network, r, Step::sdo_upload, r.sink != nullptr);
}
static Error check(Network& network, const SdoDownloadStream& r) {
    return check_stream(network, r, Step::sdo_download, r.source != nullptr && r.size <= UINT32_MAX);
}

static Task<Result<>> run(Network& network, SdoUploadStream& request) {
    co_return co_await sdo_upload_stream(channel_of(network, request), request, patience_of(request));
}
static Task<Result<>> run(Network& network, SdoDownloadStream& request) {
    const PdoWrite note(network, request.slave, decides_on_pdos(request.index));
    co_return co_await sdo_download_stream(channel_of(network, request), request, patience_of(request));
}

static constexpr OperationDescription kUploadStream =
    describe_mail<SdoUploadStream, check, run>(Operation::sdo_upload, Step::sdo_upload);
static constexpr OperationDescription kDownloadStream =
    describe_mail<SdoDownloadStream, check, run>(Operation::sdo_download, Step::sdo_download);
SdoUploadStream::SdoUploadStream() : SdoStream(kUploadStream) {}
SdoDownloadStream::SdoDownloadStream() : SdoStream(kDownloadStream) {}

static void set_object(SdoStream& request, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                       bool complete_access, Duration timeout) {
    request.slave = slave;
    request.index = index;
    request.subindex = subindex;
    request.complete_access = complete_access;
    request.timeout = timeout;
}

Result<std::size_t> SDOread(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                            bool complete_access, ByteSink& sink, Duration timeout) {
    SdoUploadStream request;
    set_object(request, slave, index, subindex, complete_access, timeout);
    request.sink = &sink;
    const auto read = submit_and_wait(ctx, request);
    return read ? Result<std::size_t>(request.bytes()) : Result<std::size_t>(read.error());
}

Result<> SDOwrite(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex, bool complete_access,
                  ByteSource& source, std::size_t size, Duration timeout) {
    SdoDownloadStream request;
    set_object(request, slave, index, subindex, complete_access, timeout);
    request.source = &source;
    request.size = size;
    return submit_and_wait(ctx, request);
}

}  // namespace margay
