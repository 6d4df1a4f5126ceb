// Repeats with our client the CoE conversations of a real drive with another master (soem-sdinfo-akd.pcapng). The
// client sends the same requests octet by octet, receives the recorded replies, and finds the values that tshark
// prints.
#include <places.hpp>
#include "mailbox/mailbox_bus.hpp"
#include "oshw/pcap/capture_file.hpp"
#include "wire/datagram.hpp"

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>

namespace margay {
namespace {

struct Conversation {
    std::uint64_t frame = 0;  // frame number of the reply, as in Wireshark
    Mail request;
    Mail reply;
};

// CoE messages that were written to and read from slaves: mailbox datagrams with working counter 1.
std::vector<Conversation> conversations(const CaptureFile& file) {
    std::vector<Conversation> all;
    Mail asked;
    for (const CapturedFrame& frame : file.frames()) {
        if (!frame.reply) continue;
        wire::DatagramReader reader(file.bytes(frame));
        while (const auto datagram = reader.next()) {
            const auto command = datagram->header.command;
            const bool write = command == wire::Command::FPWR;
            if ((!write && command != wire::Command::FPRD) || datagram->wkc != 1 || datagram->data.size() < 1024)
                continue;
            const auto mail = wire::load_mailbox_message(datagram->data);
            if (!mail || mail->header.type != wire::MailboxType::coe) continue;
            const auto whole = datagram->data.first(wire::kMailboxHeaderBytes + mail->data.size());
            if (write)
                asked.assign(whole.begin(), whole.end());
            else
                all.push_back({frame.number, asked, Mail(whole.begin(), whole.end())});
        }
    }
    return all;
}

struct Printed {
    std::uint64_t frame = 0;
    unsigned index = 0;
    unsigned subindex = 0;
    std::uint64_t value = 0;
};

// The SDO responses as Wireshark decodes them.
std::vector<Printed> printed(const std::string& path) {
    const std::string command =
        "tshark -n -r '" + path +
        "' -Y 'ecat_mailbox.coe.type == 3 && ecat.cnt == 1' -T fields -e frame.number -e ecat_mailbox.coe.sdoidx "
        "-e ecat_mailbox.coe.sdosub -e ecat_mailbox.coe.sdodata 2>/dev/null";
    std::vector<Printed> all;
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(::popen(command.c_str(), "r"), ::pclose);
    std::array<char, 256> line{};
    while (pipe != nullptr && std::fgets(line.data(), static_cast<int>(line.size()), pipe.get()) != nullptr) {
        Printed one;
        unsigned long long frame = 0;
        unsigned long long value = 0;
        if (std::sscanf(line.data(), "%llu %x %x %llx", &frame, &one.index, &one.subindex, &value) != 4) continue;
        one.frame = frame;
        one.value = value;
        all.push_back(one);
    }
    return all;
}

TEST(MailboxCapture, TheDrivesConversationsGiveTheValuesThatTsharkPrints) {
    const std::string path = std::string(MARGAY_CAPTURES_DIR) + "/soem-sdinfo-akd.pcapng";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "no captures";
    if (std::system("tshark -v > /dev/null 2>&1") != 0) GTEST_SKIP() << "no tshark";
    CaptureFile file;
    ASSERT_TRUE(file.load(path)) << file.problem();
    const auto all = conversations(file);
    const auto values = printed(path);
    ASSERT_GE(all.size(), 30U);
    ASSERT_EQ(values.size(), all.size());

    MailboxBus bus;
    auto& slave = bus.add_scripted(1024);
    bus.start();
    std::size_t n = 0;
    slave.on_mail = [&](const Mail& mail) {
        // The comparison begins with the CoE header, because the mailbox counter can differ.
        EXPECT_EQ(Mail(mail.begin() + 6, mail.end()), Mail(all[n].request.begin() + 6, all[n].request.end()))
            << "before frame " << all[n].frame;
        slave.put(all[n].reply);
    };
    for (n = 0; n < all.size(); ++n) {
        SCOPED_TRACE(testing::Message() << "frame " << all[n].frame);
        ASSERT_EQ(values[n].frame, all[n].frame);
        std::array<std::byte, 8> into{};
        const auto read = SDOread(*bus.ctx, 1, static_cast<std::uint16_t>(values[n].index),
                                  static_cast<std::uint8_t>(values[n].subindex), false, into);
        ASSERT_TRUE(read.ok()) << bus.words(read.error());
        EXPECT_EQ(load_le<std::uint64_t>(into), values[n].value);
    }
}

}  // namespace
}  // namespace margay
