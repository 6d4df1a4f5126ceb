// File access over EtherCAT: the server for mailbox type FoE (ETG.1000.6 "File access over EtherCAT").
#pragma once

#include "subdevice/mailbox_server.hpp"
#include "wire/foe.hpp"

#include <array>
#include <string_view>

namespace margay::subdevice {

using FoeError = wire::foe::ErrorCode;

// Answer of the author's file store: go; busy (the server asks again at the client's next try); or an error with an
// optional text.
class FoeAnswer {
  public:
    [[nodiscard]] static constexpr FoeAnswer go() { return {}; }
    // `done` of `entire` is the progress; 0 of 0: unknown.
    [[nodiscard]] static constexpr FoeAnswer busy(std::uint16_t done, std::uint16_t entire,
                                                  std::string_view text = {}) {
        FoeAnswer a;
        a.kind_ = Kind::busy;
        a.done_ = done;
        a.entire_ = entire;
        a.text_ = text;
        return a;
    }
    // Without a text, the server sends the text that its FoeTexts has for the code.
    [[nodiscard]] static constexpr FoeAnswer error(FoeError code, std::string_view text = {}) {
        FoeAnswer a;
        a.kind_ = Kind::error;
        a.code_ = code;
        a.text_ = text;
        return a;
    }

    [[nodiscard]] constexpr bool goes() const { return kind_ == Kind::go; }
    [[nodiscard]] constexpr bool is_busy() const { return kind_ == Kind::busy; }
    [[nodiscard]] constexpr FoeError code() const { return code_; }
    [[nodiscard]] constexpr std::uint16_t done() const { return done_; }
    [[nodiscard]] constexpr std::uint16_t entire() const { return entire_; }
    [[nodiscard]] constexpr std::string_view text() const { return text_; }

  private:
    enum class Kind : std::uint8_t { go, busy, error };
    Kind kind_ = Kind::go;
    FoeError code_ = FoeError::undefined;
    std::uint16_t done_ = 0;
    std::uint16_t entire_ = 0;
    std::string_view text_{};  // static, or valid until the next call
};

struct FoeFile {
    std::string_view name;  // valid during the call
    std::uint32_t password = 0;
    AlState state = AlState::none;
};

// The files of a device, implemented by its author. There is one transfer at a time, and offsets rise without gaps.
class FoeStore {
  public:
    // busy(): the server opens the file again at the client's next try, or calls give_up() when there is none.
    [[nodiscard]] virtual FoeAnswer open_to_read(const FoeFile& file, Time now) = 0;
    // Copies octets from `offset` on into `into` and their number into `bytes`. Fewer octets than into.size() mean end
    // of file. The server may request the same offset twice. busy(): also for the first octets, for example while the
    // file is loaded; the server asks for the same octets again and does not open the file again.
    [[nodiscard]] virtual FoeAnswer read(std::size_t offset, MutableBytes into, std::size_t& bytes, Time now) = 0;

    [[nodiscard]] virtual FoeAnswer open_to_write(const FoeFile& file, Time now) = 0;
    // busy(): no octet was written; the server passes the same data again.
    [[nodiscard]] virtual FoeAnswer write(std::size_t offset, Bytes data, Time now) = 0;
    // All `bytes` octets have been passed to write(). Return busy() while the file is checked and stored.
    [[nodiscard]] virtual FoeAnswer finish_write(std::size_t bytes, Time now) = 0;

    // The transfer ended early: an error on either side, a new request, or a change of the AL state (also when the new
    // state would allow the transfer: the client must send its request again).
    virtual void give_up() = 0;

  protected:
    ~FoeStore() = default;
};

// The texts of errors. wire::foe::to_text has the texts of the standard: a device that does not name this function does
// not contain these texts.
using FoeTexts = std::string_view (*)(FoeError code);

class FoeServer final : public MailboxServer {
  public:
    // `store` must outlive the server. `texts`: for errors without their own text; nullptr: such errors have no text.
    explicit FoeServer(FoeStore& store, FoeTexts texts = nullptr) : store_(store), texts_(texts) {}

    void start(AlState state, const MailboxRoom& room) override;
    void stop() override { end(); }
    void state_changed(AlState state) override;
    std::optional<wire::MailboxErrorCode> receive(const wire::MailboxMessage& message, Outbox& out, Time now) override;

  private:
    enum class Transfer : std::uint8_t { none, opening_to_read, opening_to_write, read, write };

    void open(bool write, Bytes data, Outbox& out, Time now);
    [[nodiscard]] bool is_request_of_transfer(std::string_view name, std::uint32_t password) const;
    void acknowledged(std::uint32_t packet, Outbox& out, Time now);
    void arrived(std::uint32_t packet, Bytes data, Outbox& out, Time now);
    void send_data(Outbox& out, Time now);
    void send_acknowledge(Outbox& out);
    void refuse(const FoeAnswer& answer, Outbox& out);
    void fail(FoeError code, Outbox& out) { refuse(FoeAnswer::error(code), out); }
    void commit(Outbox& out, std::size_t bytes) { out.commit(wire::MailboxType::foe, bytes, address_); }
    void end();

    static constexpr std::size_t kNameBytes = 64;

    FoeStore& store_;
    FoeTexts texts_;
    AlState state_ = AlState::init;
    Transfer transfer_ = Transfer::none;
    std::size_t receive_bytes_ = 0;  // data octets of a full packet from the client
    std::uint32_t packet_ = 0;       // number of the last packet sent or acknowledged
    std::size_t offset_ = 0;         // octets of the file already acknowledged or written
    std::size_t last_bytes_ = 0;     // data octets of the last packet sent
    bool sent_ = false;              // packet_ has been sent and is not acknowledged (false: the store was busy)
    bool last_ = false;              // packet_ is the last packet of the file
    bool finishing_ = false;         // all data are written, but the store is still busy
    bool written_ = false;           // the last transfer has written its file; its last packet may be repeated
    std::uint16_t address_ = 0;
    // The request that has begun the transfer.
    std::uint32_t password_ = 0;
    std::uint8_t name_bytes_ = 0;
    std::array<char, kNameBytes> name_{};
};

}  // namespace margay::subdevice
