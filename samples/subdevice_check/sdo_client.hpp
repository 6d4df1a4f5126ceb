// SDO requests of the conformance check, one message at a time, which judge the form of each response.
#pragma once

#include "subdevice_check/mail.hpp"
#include "wire/coe.hpp"

#include <concepts>

namespace margay::samples::conformance {

namespace coe = wire::coe;
using coe::Abort;

// The response to one SDO message.
struct SdoReply {
    std::uint8_t command = 0;
    Abort abort = Abort::none;
    std::vector<std::byte> message{};  // from the CoE header on
    [[nodiscard]] bool ok() const { return abort == Abort::none; }
};

struct Upload {
    Abort abort = Abort::none;
    std::string fault{};  // the violation of the standard in the response; the value may then be wrong
    std::vector<std::byte> data{};
    bool expedited = false;
    bool size_indicated = true;
    std::size_t first_bytes = 0;  // octets in the first response
    std::size_t segments = 0;
    std::size_t announced = 0;
    [[nodiscard]] bool ok() const { return abort == Abort::none && fault.empty(); }
};

struct DictionaryEntry {
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    coe::DataType type{};
    std::uint16_t bits = 0;
    std::uint16_t access = 0;
};

// A value that is read in segments.
struct LargeValue {
    std::uint16_t index = 0;
    std::uint8_t subindex = 0;
    bool complete = false;  // by complete access
    std::size_t segments = 0;
};

class SdoClient {
  public:
    explicit SdoClient(MailBench& mail) : mail_(mail) {}

    [[nodiscard]] MailBench& mail() { return mail_; }
    [[nodiscard]] Bench& bench() { return mail_.bench(); }
    // Throws NotJudged when the slave has no CoE, or when an earlier check has found that it answers no SDO.
    void needs_sdo();
    void set_dead(std::string why) { dead_ = std::move(why); }

    // One message of an SDO, and the response to it.
    [[nodiscard]] SdoReply ask(Bytes message);
    [[nodiscard]] static std::vector<std::byte> initiate(std::uint8_t command, std::uint16_t index,
                                                         std::uint8_t subindex, std::uint32_t number = 0);
    [[nodiscard]] static std::vector<std::byte> segment_request(bool toggle);
    // A segment of a download. One of fewer than seven octets is padded.
    [[nodiscard]] static std::vector<std::byte> segment(bool toggle, Bytes data, bool last);

    [[nodiscard]] Upload upload(std::uint16_t index, std::uint8_t subindex, bool complete = false);
    [[nodiscard]] std::optional<std::uint32_t> number(std::uint16_t index, std::uint8_t subindex);
    // Expedited up to four octets, otherwise normal, in segments where one message is too small.
    [[nodiscard]] Abort download(std::uint16_t index, std::uint8_t subindex, Bytes data, bool complete = false);
    template <std::integral T>
    [[nodiscard]] Abort download(std::uint16_t index, std::uint8_t subindex, T value) {
        std::array<std::byte, sizeof(T)> octets{};
        store_le<T>(octets, 0, value);
        return download(index, subindex, Bytes(octets));
    }

    // All entries that the information service describes, as the check of the information service has read them.
    std::vector<DictionaryEntry> entries{};
    bool entries_complete = false;
    // Readable values that do not fit one message; found by the same check, the one with the most segments first.
    std::vector<LargeValue> large{};

  private:
    void read_segments(Upload& upload);
    void note_oddities(Bytes request, Bytes response);
    [[nodiscard]] Abort write_segments(Bytes data);

    MailBench& mail_;
    std::string dead_;
};

// The clause of the abort codes.
inline constexpr std::string_view kAbortCodes = "ETG.1000.6, table SDO Abort Codes";

// "abort 0x06090011 (subindex does not exist)"
[[nodiscard]] std::string abort_text(Abort abort);
// Why a transfer failed: the fault if there is one, else the abort.
[[nodiscard]] std::string reason_text(const std::string& fault, Abort abort);
[[nodiscard]] std::string object_text(std::uint16_t index, std::uint8_t subindex);

}  // namespace margay::samples::conformance
