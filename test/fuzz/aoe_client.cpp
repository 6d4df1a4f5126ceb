// The AoE client with any answers, and the listener for notifications with any mail. For any answer, a command must not
// write beyond its buffer, and must not report more octets than the buffer has.
#include "mailbox/aoe.hpp"
#include "unasked_mail.hpp"

#include <margay/aoe.hpp>

using namespace margay;
using fuzzing::Input;
using fuzzing::require;

namespace {

constexpr std::byte kMark{0xA5};
constexpr std::uint32_t kInvokeId = 0x01010101;

class Notes final : public AoeListener {
  public:
    std::size_t octets = 0;
    std::size_t samples = 0;

  private:
    void notified(std::uint16_t, const AoeNotification& n) override {
        ++samples;
        for (const std::byte octet : n.data) octets += octet == kMark ? 2U : 1U;
    }
};

void answer(Input& input, std::size_t what) {
    const std::size_t size = input.octet();
    const std::vector<std::byte> written(input.octet() & 0x3F, std::byte{7});
    std::vector<std::byte> into(size + 16, kMark);
    AoeCall call{.command = wire::aoe::Command::read, .head_bytes = wire::aoe::kIndexBytes};
    call.counted = (what & 2) != 0;
    call.data = written;
    call.into = MutableBytes(into).first(size);
    AoeClient client(call, kInvokeId);
    std::vector<std::byte> room(64 + input.octet(), kMark);
    const std::size_t composed = client.compose(MutableBytes(room).first(room.size() - 16));
    require(composed <= room.size() - 16);
    require(std::all_of(room.end() - 16, room.end(), [](std::byte octet) { return octet == kMark; }));
    while (!input.empty()) {
        const Bytes taken = input.take(input.octet());
        std::vector<std::byte> data(taken.begin(), taken.end());
        // Some answers get the right header.
        if ((what & 4) != 0 && data.size() >= wire::aoe::kHeaderBytes) {
            wire::aoe::Layout::command::store(data, call.command);
            wire::aoe::Layout::flags::store(data, 5);
            wire::aoe::Layout::invoke_id::store(data, kInvokeId);
            if ((what & 8) != 0)
                wire::aoe::Layout::data_bytes::store(data,
                                                     static_cast<std::uint32_t>(data.size() - wire::aoe::kHeaderBytes));
        }
        const auto result =
            client.accept({{.length = static_cast<std::uint16_t>(data.size()), .type = wire::MailboxType::aoe}, data});
        require(result != MailClient::Taken::more);
        if (result == MailClient::Taken::no) continue;
        require(std::all_of(into.begin() + static_cast<std::ptrdiff_t>(size), into.end(),
                            [](std::byte octet) { return octet == kMark; }));
        if (client.error().code == Errc::none) require(client.bytes() <= size);
        return;
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Input input(std::as_bytes(std::span(data, size)));
    const std::size_t what = input.octet();
    if ((what & 1) == 0) {
        answer(input, what);
        return 0;
    }
    Notes notes;
    fuzzing::Post post(notes);
    while (!input.empty()) {
        const Bytes mail = input.take(input.octet() | ((what & 2) != 0 ? 0x100U : 0U));
        notes.samples = notes.octets = 0;
        (void)post.deliver(MailboxType::aoe, mail);
        require(notes.samples <= mail.size() / wire::aoe::kSampleBytes && notes.octets <= 2 * mail.size());
    }
    return 0;
}
