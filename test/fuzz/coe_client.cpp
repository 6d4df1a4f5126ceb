// Replies with random content for the CoE client. The input is a conversation: the request, then replies in sequence.
// For any answers, a transfer must not write beyond its buffer, must not report more octets than its buffer has, must
// not compose more than a mailbox holds, and must end after as many replies as its size allows.
#include "mailbox/coe_information.hpp"
#include "mailbox/coe_transfer.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <span>
#include <vector>

using namespace margay;

namespace {

void require(bool holds) {
    if (!holds) std::abort();
}

// Reads the input from front to back.
class Input {
  public:
    explicit Input(Bytes data) : left_(data) {}
    [[nodiscard]] bool empty() const { return left_.empty(); }
    std::size_t octet() {
        if (left_.empty()) return 0;
        const auto value = std::to_integer<std::size_t>(left_.front());
        left_ = left_.subspan(1);
        return value;
    }
    Bytes take(std::size_t bytes) {
        const Bytes taken = left_.first(std::min(bytes, left_.size()));
        left_ = left_.subspan(taken.size());
        return taken;
    }

  private:
    Bytes left_;
};

constexpr std::size_t kGuard = 16;
constexpr std::byte kMark{0xA5};

// Composes into a mailbox of `room` octets of data, and checks the marks after these octets.
void compose(MailClient& client, std::size_t room) {
    std::vector<std::byte> data(room + kGuard, kMark);
    const std::size_t bytes = client.compose(MutableBytes(data).first(room));
    require(bytes <= room);
    require(std::all_of(data.begin() + static_cast<std::ptrdiff_t>(room), data.end(),
                        [](std::byte b) { return b == kMark; }));
    std::vector<std::byte> again(room, kMark);
    require(client.compose(again) == bytes);
    require(std::equal(again.begin(), again.begin() + static_cast<std::ptrdiff_t>(bytes), data.begin()));
}

// Passes replies to the client until it is finished or the input ends. Returns the number of replies.
template <class Client>
std::size_t converse(Client& client, Input& input, std::size_t room) {
    std::size_t taken = 0;
    while (!input.empty() && !client.over()) {
        compose(client, room);
        const std::size_t length = input.octet();
        const Bytes data = input.take(length);
        if (client.accept({{.length = static_cast<std::uint16_t>(data.size()), .type = wire::MailboxType::coe},
                           data}) != MailClient::Taken::no)
            ++taken;
    }
    return taken;
}

void upload(Input& input, std::size_t room, const SdoObject& object) {
    const std::size_t size = input.octet();
    std::vector<std::byte> into(size + kGuard, kMark);
    SdoUploadTransfer transfer(object, MutableBytes(into).first(size));
    const std::size_t taken = converse(transfer, input, room);
    require(taken <= size + 2);  // each segment must contain data
    require(transfer.bytes() <= size);
    require(std::all_of(into.begin() + static_cast<std::ptrdiff_t>(size), into.end(),
                        [](std::byte b) { return b == kMark; }));
    require(!transfer.over() || transfer.error().code != Errc::none || !transfer.must_abort());
    require(!transfer.must_abort() || transfer.abort_message()[2] == std::byte{0x80});
}

void download(Input& input, std::size_t room, const SdoObject& object) {
    const std::vector<std::byte> value(input.octet());
    SdoDownloadTransfer transfer(object, value);
    const std::size_t taken = converse(transfer, input, room);
    require(taken <= value.size() + 2);
    require(transfer.bytes() <= value.size());
    require(!transfer.over() || transfer.error().code != Errc::none || transfer.bytes() == value.size());
}

void information(Input& input, std::size_t room, unsigned kind) {
    static std::size_t indices;
    indices = 0;
    if (kind == 0) {
        ObjectListQuery query(
            static_cast<ObjectList>(input.octet() % 6),
            [](std::span<const std::uint16_t> some, void*) { indices += some.size(); }, nullptr);
        (void)converse(query, input, room);
        require(indices <= 0x10000 && (query.error().code != Errc::none || indices == query.count()));
    } else if (kind == 1) {
        ObjectQuery query(0x1018);
        (void)converse(query, input, room);
        require(query.description.name().size() <= ObjectDescription::kNameBytes);
    } else {
        EntryQuery query(0x1018, 1, true);
        (void)converse(query, input, room);
        const EntryDescription& d = query.description;
        require(d.name().size() <= EntryDescription::kNameBytes);
        require(d.default_value.bytes <= 8 && d.minimum.bytes <= 8 && d.maximum.bytes <= 8);
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Input input(std::as_bytes(std::span(data, size)));
    const std::size_t what = input.octet();
    const std::size_t room = 18 + input.octet();  // of a mailbox of 24 octets or more
    const SdoObject object{0x1018, static_cast<std::uint8_t>(what >> 7), ((what >> 6) & 1) != 0};
    switch (what % 5) {
        case 0: upload(input, room, object); break;
        case 1: download(input, room, object); break;
        default: information(input, room, static_cast<unsigned>(what % 5 - 2));
    }
    return 0;
}
