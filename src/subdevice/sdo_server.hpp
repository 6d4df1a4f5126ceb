// Server for SDO transfers: upload and download, expedited, normal and segmented, of one subindex or of a whole object
// (ETG.1000.6 "SDO services").
#pragma once

#include "subdevice/mailbox_server.hpp"
#include "subdevice/object_values.hpp"

namespace margay::subdevice {

class SdoServer {
  public:
    // `staging` stores a value during a segmented transfer. A larger value is transferred directly from or to the
    // memory of the object if the object allows this; otherwise it is refused with Abort::out_of_memory.
    SdoServer(ObjectDictionary& dictionary, MutableBytes staging, bool complete_access)
        : dictionary_(dictionary), staging_(staging), complete_access_(complete_access) {}

    void start();
    void state_changed(AlState state) { state_ = state; }

    // `data` is the data of a CoE message of service SDO request. The outbox must have a free slot.
    std::optional<wire::MailboxErrorCode> receive(Bytes data, std::uint16_t address, Outbox& out, Time now);

    // True while a hook delays a request.
    [[nodiscard]] bool busy() const { return waiting_; }
    Time step(Outbox& out, Time now);

  private:
    enum class Transfer : std::uint8_t { none, upload, download };

    void upload(Outbox& out, Time now);
    void upload_now(Outbox& out, Time now);
    [[nodiscard]] bool source_stays() const;
    void upload_segment(std::uint8_t command, Outbox& out);
    void download(std::uint8_t command, Bytes data, Outbox& out, Time now);
    void download_segmented(std::size_t size, Bytes first, Outbox& out);
    void download_segment(std::uint8_t command, Bytes data, Outbox& out, Time now);
    void finish_download(Outbox& out, Time now);
    [[nodiscard]] HookAnswer store(Bytes data, Time now);
    [[nodiscard]] Abort find(std::uint8_t command, Bytes data, bool write);
    [[nodiscard]] Abort check_access(bool write) const;
    [[nodiscard]] Abort check_room(std::size_t size);
    [[nodiscard]] ObjectAccess access(Time now, bool write = false, std::size_t bytes = 0) const;
    [[nodiscard]] bool toggle_right(std::uint8_t command, Outbox& out);

    void confirm_download(Outbox& out);
    void abort(Abort code, Outbox& out);
    void answer(MutableBytes at, std::uint8_t command) const;
    void wait(Time again, Bytes data, Time now);

    ObjectDictionary& dictionary_;
    MutableBytes staging_;
    bool complete_access_;
    AlState state_ = AlState::init;

    // The current transfer.
    Transfer transfer_ = Transfer::none;
    const Object* object_ = nullptr;
    const Entry* entry_ = nullptr;  // of an access to a single subindex
    std::uint16_t index_ = 0;
    std::uint8_t subindex_ = 0;
    bool complete_ = false;
    bool toggle_ = false;       // toggle bit expected in the next segment
    bool by_segments_ = false;  // the download is confirmed as a segmented download
    bool waiting_ = false;
    bool retrying_ = false;
    bool any_time_ = false;  // the hook has returned no time; each step calls it
    Time again_ = kNever;
    Time patience_ends_{};
    std::uint16_t address_ = 0;
    Bytes source_{};           // upload: remaining octets to send
    MutableBytes target_{};    // download: memory that the segments are copied to
    std::size_t arrived_ = 0;  // octets in target_
    Scratch scratch_{};
};

}  // namespace margay::subdevice
