// The CoE server compared with replies of real devices. With a dictionary of their values, the server must give the
// same replies to the same requests, octet by octet.
#include "subdevice/coe_server.hpp"
#include <places.hpp>
#include "oshw/pcap/capture_file.hpp"
#include "wire/datagram.hpp"

#include <gtest/gtest.h>

#include <deque>
#include <filesystem>
#include <map>

namespace margay {
namespace {

namespace coe = wire::coe;
using coe::SdoLayout;
using wire::Command;

struct Dialogue {
    std::vector<std::byte> request;  // mailbox data, with the length in the mailbox header
    std::vector<std::byte> reply;
};

// SDO requests that arrived, and the next reply of the same device. Only frames on their way back are read.
std::vector<Dialogue> dialogues_of(const std::string& name) {
    std::vector<Dialogue> found;
    std::map<std::uint16_t, std::vector<std::byte>> open;  // by station address
    CaptureFile capture;
    EXPECT_TRUE(capture.load(std::string(MARGAY_CAPTURES_DIR) + "/" + name).ok()) << capture.problem();
    for (const auto& frame : capture.frames()) {
        const auto bytes = capture.bytes(frame);
        if ((bytes[6] & std::byte{2}) == std::byte{0}) continue;
        wire::DatagramReader reader(bytes);
        while (const auto datagram = reader.next()) {
            const auto command = datagram->header.command;
            if (datagram->wkc != 1 || (command != Command::FPWR && command != Command::FPRD)) continue;
            if (datagram->header.address.ado() < 0x1000) continue;
            const auto message = wire::load_mailbox_message(datagram->data);
            if (!message || message->header.type != wire::MailboxType::coe || message->data.size() < coe::kSdoBytes)
                continue;
            const auto station = datagram->header.address.adp();
            const std::vector<std::byte> data(message->data.begin(), message->data.end());
            const auto service = coe::load_header(data).service;
            if (command == Command::FPWR && service == coe::Service::sdo_request) {
                open[station] = data;
            } else if (command == Command::FPRD && open.count(station) != 0) {
                found.push_back({open[station], data});
                open.erase(station);
            }
        }
    }
    return found;
}

// A dictionary with all values in the replies.
class Told {
  public:
    explicit Told(const std::vector<Dialogue>& dialogues) {
        std::map<std::uint16_t, std::map<std::uint8_t, std::vector<std::byte>>> values;
        for (const auto& [request, reply] : dialogues) {
            const auto command = std::to_integer<unsigned>(reply[2]);
            if ((command & 0xE0) != 0x40) continue;  // upload responses; the devices sent no others
            const bool expedited = (command & 2) != 0;
            const std::vector<std::byte> data(
                reply.begin() + (expedited ? 6 : 10),
                expedited ? reply.begin() + 10 - static_cast<std::ptrdiff_t>(command >> 2 & 3) : reply.end());
            auto& object = values[SdoLayout::index::load(reply)];
            if ((command & 0x10) == 0) {
                object[SdoLayout::subindex::load(reply)] = data;
                continue;
            }
            // Complete access: subindex 0 in 16 bits, then that number of values of equal size.
            const auto count = std::to_integer<std::size_t>(data.at(0));
            EXPECT_EQ((data.size() - 2) % count, 0u);
            const auto size = static_cast<std::ptrdiff_t>((data.size() - 2) / count);
            object[0] = {data[0]};
            for (std::size_t n = 1; n <= count; ++n) {
                const auto from = data.begin() + 2 + static_cast<std::ptrdiff_t>(n - 1) * size;
                object[static_cast<std::uint8_t>(n)] = {from, from + size};
            }
        }
        for (const auto& [index, subindices] : values) {
            auto& entries = entries_.emplace_back();
            for (const auto& [subindex, data] : subindices) {
                entries.push_back(subdevice::octets(subindex, "told", subdevice::DataType::octet_string,
                                                    subdevice::od::kReadOnly, image_.size(), data.size()));
                image_.insert(image_.end(), data.begin(), data.end());
            }
            objects_.push_back(subindices.size() == 1 && subindices.begin()->first == 0
                                   ? subdevice::variable(index, "told", entries)
                                   : subdevice::record(index, "told", entries));
        }
        const auto content = image_;
        dictionary_.emplace(objects_, image_);
        image_ = content;
    }
    subdevice::ObjectDictionary& dictionary() { return *dictionary_; }

  private:
    std::vector<std::byte> image_;
    std::deque<std::vector<subdevice::Entry>> entries_;
    std::vector<subdevice::Object> objects_;
    std::optional<subdevice::ObjectDictionary> dictionary_;
};

class Letterbox final : public subdevice::Outbox {
  public:
    MutableBytes open() override { return slot_; }
    void commit(wire::MailboxType type, std::size_t bytes, std::uint16_t) override {
        EXPECT_EQ(type, wire::MailboxType::coe);
        replies.emplace_back(slot_.begin(), slot_.begin() + static_cast<std::ptrdiff_t>(bytes));
    }
    std::vector<std::vector<std::byte>> replies;

  private:
    std::array<std::byte, 1018> slot_{};
};

struct CoeServerReplay : testing::TestWithParam<std::pair<const char*, std::size_t>> {};

TEST_P(CoeServerReplay, AnswersAsTheDeviceDid) {
    const auto [name, count] = GetParam();
    if (!std::filesystem::exists(std::string(MARGAY_CAPTURES_DIR) + "/" + name)) GTEST_SKIP() << "no captures";
    const auto dialogues = dialogues_of(name);
    ASSERT_EQ(dialogues.size(), count);
    Told told(dialogues);
    std::array<std::byte, 512> staging{};
    subdevice::CoeServer server(told.dictionary(), staging, true);
    server.start(AlState::preop, {1018, 1018});
    for (const auto& [request, reply] : dialogues) {
        Letterbox out;
        EXPECT_FALSE(server.receive({{.type = wire::MailboxType::coe}, request}, out, Time{}));
        ASSERT_EQ(out.replies.size(), 1u);
        EXPECT_EQ(out.replies[0], reply) << "object 0x" << std::hex << SdoLayout::index::load(request);
    }
}

INSTANTIATE_TEST_SUITE_P(Captures, CoeServerReplay,
                         testing::Values(std::pair<const char*, std::size_t>{"soem-sdinfo-akd.pcapng", 35},
                                         std::pair<const char*, std::size_t>{"soem-single-lan9252.pcapng", 6},
                                         std::pair<const char*, std::size_t>{"soem-dual-lan9252.pcapng", 12}));

}  // namespace
}  // namespace margay
