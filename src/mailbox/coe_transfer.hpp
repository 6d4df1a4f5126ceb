// SDO transfers of the client, independent of the bus: which message is next, and what a reply means (ETG.1000.6 "SDO
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

    // Starts again with the first message.
    void restart();
    [[nodiscard]] bool over() const { return phase_ == Phase::over; }
    // The error without slave and step; code none on success.
    [[nodiscard]] const Error& error() const { return error_; }
    // Octets transferred.
    [[nodiscard]] std::size_t bytes() const { return done_; }
    // Whether the slave is in a transfer that this client gives up: an abort must be sent to the slave.
    [[nodiscard]] bool must_abort() const { return slave_open_; }
    [[nodiscard]] std::array<std::byte, kAbortBytes> abort_message() const;
    [[nodiscard]] const SdoObject& object() const { return object_; }
    // Distinguishes exchanges of different objects; see MailExchange::Options.
    [[nodiscard]] std::uint64_t key() const {
        return phase_ == Phase::segments
                   ? 0
                   : (std::uint64_t{1} << 32) | (std::uint64_t{object_.index} << 8) | object_.subindex;
    }

  protected:
    enum class Phase : std::uint8_t { initiate, segments, over };

    SdoTransfer(const SdoObject& object, std::uint8_t initiated, std::uint8_t segment)
        : object_(object), initiated_(initiated), segment_(segment) {}
    ~SdoTransfer() = default;

    virtual void read_initiated(std::uint8_t command, Bytes data) = 0;
    virtual void read_segment(std::uint8_t command, Bytes data) = 0;

    void fail(Errc code, std::size_t expected = 0, std::size_t actual = 0,
              wire::coe::Abort reason = wire::coe::Abort::general);
    void finish();
    void write_initiate(MutableBytes data, std::uint8_t command) const;

    SdoObject object_;
    Phase phase_ = Phase::initiate;
    bool toggle_ = false;      // of the next segment
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

class SdoUploadTransfer final : public SdoTransfer {
  public:
    // `into` outlives the transfer. A value larger than `into` ends the transfer with Errc::capacity; its rest is not
    // requested.
    SdoUploadTransfer(const SdoObject& object, MutableBytes into)
        : SdoTransfer(object, wire::coe::response::kUpload, wire::coe::response::kUploadSegment), into_(into) {}
    std::size_t compose(MutableBytes data) override;

  private:
    void read_initiated(std::uint8_t command, Bytes data) override;
    void read_segment(std::uint8_t command, Bytes data) override;
    void store(Bytes part);

    MutableBytes into_;
};

class SdoDownloadTransfer final : public SdoTransfer {
  public:
    // `value` outlives the transfer.
    SdoDownloadTransfer(const SdoObject& object, Bytes value)
        : SdoTransfer(object, wire::coe::response::kDownload, wire::coe::response::kDownloadSegment), value_(value) {
        size_ = value.size();
    }
    std::size_t compose(MutableBytes data) override;

  private:
    void read_initiated(std::uint8_t command, Bytes data) override;
    void read_segment(std::uint8_t command, Bytes data) override;
    void acknowledge();
    [[nodiscard]] std::size_t compose_segment(MutableBytes data);

    Bytes value_;
    std::size_t under_way_ = 0;  // octets in the message that is not acknowledged yet
};

}  // namespace margay
