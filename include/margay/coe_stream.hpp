// Objects of any size: SDO upload to a sink and SDO download from a source, without the whole value in memory. The
// value may be larger than memory, and its octets may come or go later.
//
//     margay::SdoUploadStream request;                 // lives in the caller's memory, may be used again and again
//     request.slave = 3;
//     request.index = 0x2100;
//     request.sink = &sink;                            // see stream.hpp
//     margay::submit(ctx, request);                    // from any thread
//     … the owner of the context goes on with poll() or its cycle …
#pragma once

#include <margay/request.hpp>
#include <margay/result.hpp>
#include <margay/stream.hpp>

#include <atomic>

namespace margay {

class Context;

// The common members of SdoUploadStream and SdoDownloadStream. If the slave refuses complete access, the request ends
// with its abort. All other SDOs of the slave, also the SDOs of its start-up, wait until the transfer has ended. If an
// answer of the slave is lost on the wire and the slave cannot repeat it, the library starts the transfer again as long
// as no octet has gone to the sink, or none was acknowledged by the slave; later the request ends with
// Errc::reply_lost. If the slave starts again, the request ends with Errc::mailbox_closed. `timeout` zero: no limit for
// the whole transfer, and 3 s for each answer of the slave.
class SdoStream : public MailRequest {
  public:
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    bool complete_access = false;

    // Octets that the sink has accepted, or that the slave has acknowledged. From any thread, also while the request is
    // busy.
    [[nodiscard]] std::size_t bytes() const { return bytes_.load(std::memory_order_relaxed); }
    // Octets of the whole value; 0: not known yet. From any thread.
    [[nodiscard]] std::size_t total() const { return total_.load(std::memory_order_relaxed); }

  protected:
    using MailRequest::MailRequest;

  private:
    friend struct SdoStreamAccess;
    std::atomic<std::size_t> bytes_{0};
    std::atomic<std::size_t> total_{0};
};

// Reads an object into `sink`. Errors: as SDOread(), stream_failed (detail: the number that the sink has
// returned), invalid_argument (no sink).
struct SdoUploadStream : SdoStream {
    SdoUploadStream();
    ByteSink* sink = nullptr;
};

// Writes an object of `size` octets from `source`. CoE announces the size before the first octet; octets that the
// source would give beyond `size` are not asked for. Errors: as SDOwrite(), stream_failed (detail: the number
// that the source has returned), wrong_size (the source has ended early; expected: `size`, actual: octets that it
// gave), invalid_argument (no source, or a size of more than 4 294 967 295 octets).
struct SdoDownloadStream : SdoStream {
    SdoDownloadStream();
    ByteSource* source = nullptr;
    std::size_t size = 0;
};

// Functions that submit these requests and wait; wait() describes how they wait in each thread. SDOread() returns the
// number of octets.
Result<std::size_t> SDOread(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex,
                            bool complete_access, ByteSink& sink, Duration timeout = Duration{0});
Result<> SDOwrite(Context& ctx, std::uint16_t slave, std::uint16_t index, std::uint8_t subindex, bool complete_access,
                  ByteSource& source, std::size_t size, Duration timeout = Duration{0});

}  // namespace margay
