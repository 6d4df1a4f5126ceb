// Server for SDO information: lists of objects, descriptions of objects and of entries, split into as many fragments as
// the mailbox size requires (ETG.1000.6 "SDO information services").
#pragma once

#include "subdevice/mailbox_server.hpp"
#include "subdevice/object_dictionary.hpp"

namespace margay::subdevice {

class SdoInformation {
  public:
    explicit SdoInformation(ObjectDictionary& dictionary) : dictionary_(dictionary) {}

    void start() { left_ = 0; }

    // `data` is the data of a CoE message of service SDO information. The outbox must have a free slot.
    std::optional<wire::MailboxErrorCode> receive(Bytes data, std::uint16_t address, Outbox& out);

    // True while fragments remain to be sent.
    [[nodiscard]] bool busy() const { return left_ != 0; }
    void step(Outbox& out);

  private:
    void list(std::uint16_t type, Outbox& out);
    void object(std::uint16_t index, Outbox& out);
    void entry(std::uint16_t index, std::uint8_t subindex, std::uint8_t value_info, Outbox& out);
    void begin(wire::coe::InfoOpcode opcode, std::size_t bytes, Outbox& out);
    bool send_fragment(Outbox& out);
    void fill(MutableBytes to);
    void fail(Abort why, Outbox& out);
    void append(std::uint64_t value, std::size_t bytes);
    [[nodiscard]] bool belongs(const Object& object, wire::coe::ListType type) const;
    [[nodiscard]] std::size_t count(wire::coe::ListType type) const;

    ObjectDictionary& dictionary_;
    // The current response: a header, followed by the indices of a list or by a text.
    std::array<std::byte, 40> head_{};
    std::size_t head_bytes_ = 0;
    std::size_t sent_ = 0;  // octets already sent
    std::size_t left_ = 0;  // octets still to send
    std::string_view text_{};
    std::array<char, 12> made_up_{};  // generated name of one of several equal entries
    wire::coe::ListType list_{};
    std::uint32_t next_index_ = 0;
    wire::coe::InfoOpcode opcode_{};
    std::uint16_t address_ = 0;
};

}  // namespace margay::subdevice
