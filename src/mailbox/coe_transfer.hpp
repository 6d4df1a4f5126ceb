// SDO transfers of the client, independent of the bus: the next message, and the meaning of a reply (ETG.1000.6 "SDO
// services": expedited, normal and segmented; one subindex or a whole object).
//
// Mail that does not belong to the transfer is ignored (an emergency, a late reply to another request). Mail that
// belongs to the transfer and breaks its rules ends it. A transfer ends after as many messages as its size allows,
// whatever the slave answers.
#pragma once

#include "mailbox/exchange.hpp"
#include "wire/coe.hpp"

#include <array>

namespace margay {

struct SdoObject {
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;  // complete access: the first subindex, 0 or 1
    bool complete = false;
    friend constexpr bool operator==(const SdoObject&, const SdoObject&) = default;
};

class SdoTransfer : public MailClient {
  public:
    static constexpr std::size_t kAbortBytes = wire::coe::kSdoBytes;

    Taken accept(const wire::MailboxMessage& mail) final;

    // Prepares the next message, or passes on the octets of the last reply. False: the application is not ready, try
    // again later. May end the transfer.
    [[nodiscard]] virtual bool prepare() { return true; }
    // Starts again with the first message. False: octets have gone to the application, or come from it.
    [[nodiscard]] virtual bool restart();
    [[nodiscard]] bool over() const { return phase_ == Phase::over; }
    // The error without slave and step; code none on success.
    [[nodiscard]] const Error& error() const { return error_; }
    // Octets transferred.
    [[nodiscard]] std::size_t bytes() const { return done_; }
    // Whether the slave is in a transfer that this client gives up: an abort must be sent to the slave.
    [[nodiscard]] bool must_abort() const { return slave_open_; }
    // Whether the first message may have been sent, and the slave has not answered it.
    [[nodiscard]] bool is_unanswered() const { return asked_; }
    [[nodiscard]] std::array<std::byte, kAbortBytes> abort_message() const;
    [[nodiscard]] const SdoObject& object() const { return object_; }
    // The next message is the first one of the transfer.
    [[nodiscard]] bool begins() const { return phase_ == Phase::initiate; }
    // Distinguishes exchanges of different objects; see MailExchange::Options. Segments have the same key, because the
    // reply to a segment may be an abort, which contains the object.
    [[nodiscard]] std::uint64_t key() const {
        return mail_key::of(mail_key::Kind::sdo, object_.index, object_.subindex);
    }

  protected:
    enum class Phase : std::uint8_t { initiate, segments, over };

    SdoTransfer(const SdoObject& object, std::uint8_t initiated, std::uint8_t segment)
        : object_(object), initiated_(initiated), segment_(segment) {}
    ~SdoTransfer() = default;

    virtual void read_initiated(std::uint8_t command, Bytes data) = 0;
    virtual void read_segment(std::uint8_t command, Bytes data) = 0;

    void fail(Errc code, std::size_t expected = 0, std::size_t actual = 0,
              wire::coe::Abort reason = wire::coe::Abort::general) {
        fail({.code = code,
              .expected = static_cast<std::uint32_t>(expected),
              .actual = static_cast<std::uint32_t>(actual)},
             reason);
    }
    void fail(const Error& error, wire::coe::Abort reason);
    void finish();
    void write_initiate(MutableBytes data, std::uint8_t command) const;

    SdoObject object_;
    Phase phase_ = Phase::initiate;
    bool toggle_ = false;      // of the next segment
    bool asked_ = false;       // the slave owes the reply to the first message
    bool slave_open_ = false;  // the slave has started a segmented transfer that has not ended
    std::size_t size_ = 0;     // of the whole value
    std::size_t done_ = 0;

  private:
    [[nodiscard]] bool is_ours(Bytes data);
    [[nodiscard]] bool read_abort(Bytes data);

    std::uint8_t initiated_;  // command specifier of the reply to the first message
    std::uint8_t segment_;
    wire::coe::Abort abort_code_ = wire::coe::Abort::timeout;
    Error error_;
};

// The messages of an upload, for any destination of the value. A value larger than `room` ends the transfer with
// Errc::capacity; the rest of the value is not requested.
class SdoUploading : public SdoTransfer {
  public:
    std::size_t compose(MutableBytes data) final;

  protected:
    SdoUploading(const SdoObject& object, std::size_t room)
        : SdoTransfer(object, wire::coe::response::kUpload, wire::coe::response::kUploadSegment), room_(room) {}
    ~SdoUploading() = default;

    // Keeps the octets of the value from done_ on.
    virtual void store(Bytes part) = 0;

  private:
    void read_initiated(std::uint8_t command, Bytes data) final;
    void read_segment(std::uint8_t command, Bytes data) final;
    void keep(Bytes part);

    std::size_t room_;
};

// The messages of a download of `size` octets, for any source of the value.
class SdoDownloading : public SdoTransfer {
  public:
    std::size_t compose(MutableBytes data) final;

  protected:
    SdoDownloading(const SdoObject& object, std::size_t size)
        : SdoTransfer(object, wire::coe::response::kDownload, wire::coe::response::kDownloadSegment) {
        size_ = size;
    }
    ~SdoDownloading() = default;

    // Copies octets of the value, from done_ on.
    virtual void load(MutableBytes part) const = 0;
    // How many octets of the value the next message has, if it may have `room` octets behind the mailbox header.
    [[nodiscard]] std::size_t next_part(std::size_t room) const;

  private:
    void read_initiated(std::uint8_t command, Bytes data) final;
    void read_segment(std::uint8_t command, Bytes data) final;
    void acknowledge();
    [[nodiscard]] std::size_t compose_segment(MutableBytes data);

    std::size_t under_way_ = 0;  // octets in the message that is not acknowledged yet
};

// Transfers to memory and from memory. The memory outlives the transfer.
class SdoUploadTransfer final : public SdoUploading {
  public:
    SdoUploadTransfer(const SdoObject& object, MutableBytes into) : SdoUploading(object, into.size()), into_(into) {}

  private:
    void store(Bytes part) override;
    MutableBytes into_;
};
class SdoDownloadTransfer final : public SdoDownloading {
  public:
    SdoDownloadTransfer(const SdoObject& object, Bytes value) : SdoDownloading(object, value.size()), value_(value) {}

  private:
    void load(MutableBytes part) const override;
    Bytes value_;
};

}  // namespace margay
