// Replies with random content for the FoE client. The input is a conversation: the request, then replies in sequence.
// For any answers, a transfer must not write beyond its packet or its buffer, must not count more octets than its
// buffer has, must not compose more than a mailbox holds, and must compose the same message twice.
#include "client_input.hpp"
#include "mailbox/foe_transfer.hpp"

#include <algorithm>
#include <cstdlib>
#include <span>
#include <string>
#include <vector>

using namespace margay;
using namespace margay::fuzzing;

namespace {

// A source that gives as many octets at a time as the input says.
class FuzzSource final : public ByteSource {
  public:
    FuzzSource(Input& input, std::size_t bytes) : input_(input), left_(bytes) {}
    Piece pull(MutableBytes into) override {
        require(!into.empty());
        const std::size_t most = input_.octet();
        if (most == 255) return {.failure = 1};
        const std::size_t bytes = std::min({most, left_, into.size()});
        std::fill_n(into.begin(), bytes, std::byte{7});
        left_ -= bytes;
        given += bytes;
        return {.bytes = bytes, .last = left_ == 0};
    }
    std::size_t given = 0;

  private:
    Input& input_;
    std::size_t left_;
};

void compose(FoeTransfer& transfer, std::size_t room) {
    std::vector<std::byte> data(room + kGuard, kMark);
    const std::size_t bytes = transfer.compose(MutableBytes(data).first(room));
    require(bytes <= room);
    require(untouched(data, room));
    std::vector<std::byte> again(room, kMark);
    require(transfer.compose(again) == bytes);
    require(std::equal(again.begin(), again.begin() + static_cast<std::ptrdiff_t>(bytes), data.begin()));
}

// Gives the transfer a reply. Half of the replies have the right packet number, so that the conversation continues.
void answer(FoeTransfer& transfer, Input& input, std::uint32_t number) {
    const std::size_t kind = input.octet();
    std::vector<std::byte> data(6);
    data[0] = static_cast<std::byte>(kind & 7);
    store_le<std::uint32_t>(data, 2, (kind & 8) != 0 ? static_cast<std::uint32_t>(input.octet()) : number);
    const Bytes body = input.take(input.octet());
    data.insert(data.end(), body.begin(), body.end());
    if ((kind & 16) != 0) data.resize(std::min(data.size(), input.octet()));
    if ((kind & 32) != 0) transfer.overhear(data);
    (void)transfer.accept(
        {{.length = static_cast<std::uint16_t>(data.size()), .type = wire::MailboxType::foe}, Bytes(data)});
    require(transfer.request().slave_text().size() <= FoeRequest::kTextBytes);
    for (const char c : transfer.request().slave_text()) require(c >= 0x20 && c < 0x7F);
}

// `late`: the number of late replies to earlier transfers that may arrive.
void converse(FoeTransfer& transfer, Input& input, std::size_t room, std::uint32_t first, unsigned late = 0) {
    std::uint32_t number = first;
    while (!input.empty() && !transfer.over()) {
        if (!transfer.prepare() || transfer.over()) continue;
        compose(transfer, room);
        if (!transfer.awaits_reply()) {  // this message ends the transfer in the slave
            // While the frame with this message is lost, replies may arrive.
            if (late != 0 && (input.octet() & 1) != 0) answer(transfer, input, number);
            if (!transfer.over()) transfer.finish();
            number = first;
            continue;
        }
        const std::size_t before = transfer.request().bytes();
        answer(transfer, input, number);
        if (late != 0) transfer.doubt(late);
        if (!transfer.is_busy()) ++number;
        require(transfer.request().bytes() >= before);
    }
    require(transfer.over() || transfer.error().code == Errc::none);
}

void read(Input& input, std::size_t room) {
    const std::size_t size = input.octet();
    std::vector<std::byte> into(size + kGuard, kMark);
    std::vector<std::byte> packet(room - 6 + kGuard, kMark);
    MemorySink sink(MutableBytes(into).first(size));
    FoeRead request;
    request.name = "f";
    FoeReadTransfer transfer(request, sink, MutableBytes(packet).first(room - 6));
    converse(transfer, input, room, 1, static_cast<unsigned>(input.octet() & 3));
    require(untouched(into, size));
    require(untouched(packet, room - 6));
    require(request.bytes() <= size);
}

void write(Input& input, std::size_t room, unsigned late) {
    const std::size_t bytes = input.octet();
    FuzzSource source(input, bytes);
    std::vector<std::byte> packet(room - 6 + kGuard, kMark);
    FoeWrite request;
    request.name = "f";
    request.source = &source;
    FoeWriteTransfer transfer(request, source, MutableBytes(packet).first(room - 6));
    converse(transfer, input, room, 0, late);
    require(untouched(packet, room - 6));
    require(request.bytes() <= source.given);
    if (transfer.over() && transfer.error().code == Errc::none) require(request.bytes() == bytes);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Input input(std::as_bytes(std::span(data, size)));
    const std::size_t what = input.octet();
    const std::size_t room = 7 + input.octet();
    if ((what & 1) == 0)
        read(input, room);
    else
        write(input, room, static_cast<unsigned>(what >> 1) & 3);
    return 0;
}
