// SDO transfers from the server's side: upload and download, expedited, normal and segmented, of one subindex
// or of a whole object (ETG.1000.6 "SDO services").
#pragma once

#include "subdevice/mailbox_server.hpp"
#include "subdevice/object_values.hpp"

namespace margay::subdevice {

class SdoServer {
  public:
    // `staging` holds a value while it travels in segments: what is larger goes straight from and to the
    // object's memory where that is possible, and is refused with Abort::out_of_memory where it is not.
    SdoServer(ObjectDictionary& dictionary, MutableBytes staging, bool complete_access)
        : dictionary_(dictionary), staging_(staging), complete_access_(complete_access) {}

    void start();
    void state_changed(AlState state) { state_ = state; }

    // The data of a CoE message of service SDO request. The outbox has a free slot.
    std::optional<wire::MailboxErrorCode> receive(Bytes data, std::uint16_t address, Outbox& out, Time now);

    // A hook keeps a request waiting.
    [[nodiscard]] bool busy() const { return waiting_; }
    Time step(Outbox& out, Time now);

  private:
    enum class Transfer : std::uint8_t { none, upload, download };

    void upload(Outbox& out, Time now);
    void upload_now(Outbox& out, Time now);
    void upload_segment(std::uint8_t command, Outbox& out);
    void download(std::uint8_t command, Bytes data, Outbox& out, Time now);
    void download_segmented(std::size_t size, Bytes first, Outbox& out);
    void download_segment(std::uint8_t command, Bytes data, Outbox& out, Time now);
    void finish_download(Outbox& out, Time now);
    [[nodiscard]] HookAnswer store(Bytes data, Time now);
    [[nodiscard]] Abort find(std::uint8_t command, Bytes data, bool write);
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

    // The transfer in hand.
    Transfer transfer_ = Transfer::none;
    const Object* object_ = nullptr;
    const Entry* entry_ = nullptr;  // of a single subindex
    std::uint16_t index_ = 0;
    std::uint8_t subindex_ = 0;
    bool complete_ = false;
    bool toggle_ = false;       // expected in the next segment
    bool by_segments_ = false;  // how a download is confirmed
    bool waiting_ = false;
    bool retrying_ = false;
    Time again_ = kNever;
    Time patience_ends_{};
    std::uint16_t address_ = 0;
    Bytes source_{};           // upload: what is left to send
    MutableBytes target_{};    // download: where segments are put
    std::size_t arrived_ = 0;  // octets in target_
    Scratch scratch_{};
};

}  // namespace margay::subdevice
