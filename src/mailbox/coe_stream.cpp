#include "mailbox/coe_stream.hpp"

#include "mailbox/arena_buffer.hpp"

#include <algorithm>

namespace margay {

struct SdoStreamAccess {
    static void set(SdoStream& request, std::size_t bytes, std::size_t total) {
        request.bytes_.store(bytes, std::memory_order_relaxed);
        request.total_.store(total, std::memory_order_relaxed);
    }
};

namespace {

class UploadToSink final : public SdoUploading {
  public:
    // `part`: memory for the octets of one message; it outlives the transfer.
    UploadToSink(const SdoObject& object, SdoUploadStream& request, MutableBytes part)
        : SdoUploading(object, UINT32_MAX), request_(request), part_(part) {}

    bool prepare() override {
        show();  // the size is known before the sink receives octets
        while (pushed_ < filled_) {
            const Bytes rest = Bytes(part_).subspan(pushed_, filled_ - pushed_);
            const ByteSink::Taken taken = request_.sink->push(rest);
            if (taken.failure != 0) {
                filled_ = 0;
                fail({.code = Errc::stream_failed, .detail = taken.failure}, wire::coe::Abort::out_of_memory);
                return true;
            }
            pushed_ += std::min(taken.bytes, rest.size());
            begun_ = true;
            if (taken.bytes < rest.size()) return false;
        }
        filled_ = pushed_ = 0;
        show();
        return true;
    }
    bool restart() override { return !begun_ && SdoTransfer::restart(); }

  private:
    void show() {
        // For an expedited value, the size was not shown before.
        SdoStreamAccess::set(request_, done_ - (filled_ - pushed_), over() ? done_ : size_);
    }
    void store(Bytes octets) override {
        filled_ = std::min(octets.size(), part_.size());
        std::ranges::copy(octets.first(filled_), part_.begin());
    }

    SdoUploadStream& request_;
    MutableBytes part_;
    std::size_t filled_ = 0;  // octets of the part
    std::size_t pushed_ = 0;  // octets of the part that the sink has accepted
    bool begun_ = false;
};

class DownloadFromSource final : public SdoDownloading {
  public:
    // `part`: memory for the octets of one message; it outlives the transfer.
    DownloadFromSource(const SdoObject& object, SdoDownloadStream& request, MutableBytes part)
        : SdoDownloading(object, request.size), request_(request), part_(part) {}

    bool prepare() override {
        SdoStreamAccess::set(request_, done_, size_);
        if (over()) return true;
        if (from_ != done_) {  // the last part has been acknowledged
            from_ = done_;
            filled_ = 0;
        }
        const std::size_t wanted = next_part(part_.size());
        while (filled_ < wanted) {
            const MutableBytes rest = part_.subspan(filled_, wanted - filled_);
            const ByteSource::Piece piece = request_.source->pull(rest);
            if (piece.failure != 0) {
                fail({.code = Errc::stream_failed, .detail = piece.failure}, wire::coe::Abort::general);
                return true;
            }
            filled_ += std::min(piece.bytes, rest.size());
            if (piece.last && done_ + filled_ < size_) {
                fail(Errc::wrong_size, size_, done_ + filled_, wire::coe::Abort::length_too_low);
                return true;
            }
            if (piece.bytes < rest.size()) return false;
        }
        return true;
    }
    // The octets of the first message are still in `part_`.
    bool restart() override { return done_ == 0 && SdoTransfer::restart(); }

  private:
    void load(MutableBytes octets) const override {
        std::ranges::copy(Bytes(part_).first(std::min(octets.size(), filled_)), octets.begin());
    }

    SdoDownloadStream& request_;
    MutableBytes part_;
    std::size_t filled_ = 0;  // octets of the part
    std::size_t from_ = 0;    // offset of the part in the value
};

SdoObject object_of(const SdoStream& request) { return {request.index, request.subindex, request.complete_access}; }

Error no_memory_for_part(const SdoStream& request, Step step) {
    return {.code = Errc::capacity,
            .step = step,
            .slave = request.slave,
            .index = request.index,
            .subindex = request.subindex,
            .detail = Error::kTasks};
}

}  // namespace

Task<Result<>> sdo_upload_stream(MailboxChannel& channel, SdoUploadStream& request, const MailPatience& patience) {
    ArenaBuffer part(channel.arena());
    if (!part.reserve(channel.receive_room())) co_return no_memory_for_part(request, Step::sdo_upload);
    UploadToSink transfer(object_of(request), request, part.bytes());
    co_return co_await required(run_transfer(channel, transfer, patience, Step::sdo_upload));
}

Task<Result<>> sdo_download_stream(MailboxChannel& channel, SdoDownloadStream& request, const MailPatience& patience) {
    ArenaBuffer part(channel.arena());
    if (!part.reserve(channel.send_room())) co_return no_memory_for_part(request, Step::sdo_download);
    DownloadFromSource transfer(object_of(request), request, part.bytes().first(channel.send_room()));
    co_return co_await required(run_transfer(channel, transfer, patience, Step::sdo_download));
}

}  // namespace margay
