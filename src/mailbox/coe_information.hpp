// SDO information (ETG.1000.6 "SDO information services"): lists of objects, descriptions of objects and entries. Each
// fragment is processed when it arrives, so the memory does not grow with the dictionary.
#pragma once

#include "mailbox/coe_sdo.hpp"

#include <margay/coe.hpp>

namespace margay {

// One request of the information service and all fragments of its answer; independent of the bus.
class InfoQuery : public MailClient {
  public:
    std::size_t compose(MutableBytes data) final;
    Taken accept(const wire::MailboxMessage& mail) final;

    // Starts again with the first fragment.
    void restart() {
        begun_ = false;
        forget_fragments();
    }
    // Whether the last fragment was received, or an error ended the query.
    [[nodiscard]] bool over() const { return over_; }
    [[nodiscard]] const Error& error() const { return error_; }

  protected:
    InfoQuery(wire::coe::InfoOpcode request, wire::coe::InfoOpcode response) : request_(request), response_(response) {}
    ~InfoQuery() = default;

    // Writes the request behind the information header.
    virtual std::size_t compose_request(MutableBytes data) const = 0;
    // Processes the payload of a fragment. False: the fragment answers another request of the same kind.
    virtual bool read_fragment(Bytes payload, bool first, bool last) = 0;
    virtual void forget_fragments() = 0;
    void fail(Errc code, std::size_t expected = 0, std::size_t actual = 0);

  private:
    [[nodiscard]] bool is_ours(Bytes data);

    wire::coe::InfoOpcode request_;
    wire::coe::InfoOpcode response_;
    bool begun_ = false;
    bool over_ = false;
    Error error_;
};

class ObjectListQuery final : public InfoQuery {
  public:
    using Found = void (*)(std::span<const std::uint16_t> indices, void* user);
    ObjectListQuery(ObjectList list, Found found, void* user)
        : InfoQuery(wire::coe::InfoOpcode::list_request, wire::coe::InfoOpcode::list_response),
          list_(list),
          found_(found),
          user_(user) {}
    [[nodiscard]] std::uint32_t count() const { return count_; }

  private:
    std::size_t compose_request(MutableBytes data) const override;
    bool read_fragment(Bytes payload, bool first, bool last) override;
    void forget_fragments() override { came_ = 0; }

    ObjectList list_;
    Found found_;
    void* user_;
    std::uint32_t count_ = 0;  // passed to found_
    std::uint32_t came_ = 0;   // received; less than count_ while a list is sent for the second time
};

// A query whose answer is assembled before it is decoded. Names that are too long are cut.
class DescriptionQuery : public InfoQuery {
  protected:
    DescriptionQuery(wire::coe::InfoOpcode request, wire::coe::InfoOpcode response) : InfoQuery(request, response) {}
    ~DescriptionQuery() = default;
    bool read_fragment(Bytes payload, bool first, bool last) final;
    void forget_fragments() final { kept_ = came_ = 0; }
    virtual bool matches(Bytes first) const = 0;
    virtual void decode(Bytes all) = 0;

  private:
    static constexpr std::size_t kMost = 128;
    std::array<std::byte, kMost> all_{};
    std::size_t kept_ = 0;
    std::size_t came_ = 0;
};

class ObjectQuery final : public DescriptionQuery {
  public:
    explicit ObjectQuery(std::uint16_t index)
        : DescriptionQuery(wire::coe::InfoOpcode::object_request, wire::coe::InfoOpcode::object_response),
          index_(index) {}
    ObjectDescription description;

  private:
    std::size_t compose_request(MutableBytes data) const override;
    bool matches(Bytes first) const override;
    void decode(Bytes all) override;
    std::uint16_t index_;
};

class EntryQuery final : public DescriptionQuery {
  public:
    EntryQuery(std::uint16_t index, std::uint8_t subindex, bool with_values)
        : DescriptionQuery(wire::coe::InfoOpcode::entry_request, wire::coe::InfoOpcode::entry_response),
          index_(index),
          subindex_(subindex),
          with_values_(with_values) {}
    EntryDescription description;

  private:
    std::size_t compose_request(MutableBytes data) const override;
    bool matches(Bytes first) const override;
    void decode(Bytes all) override;
    std::uint16_t index_;
    std::uint8_t subindex_;
    bool with_values_;
};

// Executes a query. `index` and `subindex` of `about` are copied to the error.
[[nodiscard]] Task<Result<>> ask_information(MailboxChannel& channel, InfoQuery& query, SdoObject about,
                                             const MailPatience& patience);

}  // namespace margay
