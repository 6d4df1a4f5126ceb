// Late replies that are parts: of an answer in several mails, of a file, or of the answers to several requests.
#include "mailbox/slow_slave.hpp"

namespace margay {
namespace {

struct LateBus {
    MailboxBus bus;
    SlowSlave slave{bus};

    // A slave that queues messages from PREOP on.
    void start(std::function<SlowSlave::Answer(MailboxType, const Mail&)> answers, bool queues = true) {
        slave.answers = std::move(answers);
        bus.start();
        slave.idle(200ms);
        slave.queues = queues;
    }
    Error finish(Request& request) {
        const auto begun = submit(*bus.ctx, request);
        EXPECT_TRUE(begun.ok()) << bus.words(begun.error());
        slave.run(request);
        return request.error();
    }
    void times_out(Request&& request, Duration most) {
        request.timeout = most;
        const Error error = finish(request);
        EXPECT_EQ(error.code, Errc::timeout) << bus.words(error);
    }
    void is_refused(unsigned value, std::uint16_t object) {
        Write write(value, object);
        const Error error = finish(write);
        EXPECT_EQ(error.code, Errc::sdo_abort) << bus.words(error);
    }

    static Bytes content_of(const Mail& mail) { return Bytes(mail).subspan(wire::kMailboxHeaderBytes); }
    static unsigned octet(Bytes data, std::size_t n) { return std::to_integer<unsigned>(data[n]); }
    // SDO: objects from 0x2000 on accept values below 90 after `accept`, and refuse other values at once. All other
    // objects answer at once.
    static SlowSlave::Answer sdo(const Mail& mail, Duration accept) {
        const Bytes data = content_of(mail);
        if (octet(data, 2) == 0x80) return {};
        const unsigned index = octet(data, 3);
        if (octet(data, 4) != 0x20)
            return {1ms, {mail_bytes({0, 0x30, 0x43, index, octet(data, 4), octet(data, 5), 1, 2, 3, 4})}};
        if (octet(data, 6) < 90) return {accept, {mail_bytes({0, 0x30, 0x60, index, 0x20, 0, 0, 0, 0, 0})}};
        return {1ms, {mail_bytes({0, 0x20, 0x80, index, 0x20, 0, 0x30, 0, 9, 6})}};  // out of range
    }
};

class LateParts : public testing::Test, protected LateBus {};

struct Voe : VoeSend {
    Voe() {
        slave = 1;
        data = octets;
    }
    std::array<std::byte, 4> octets{};
};
struct Description : ObjectDescriptionRequest {
    explicit Description(std::uint16_t object) {
        slave = 1;
        index = object;
    }
};
struct ReadValue : SoeRead {
    ReadValue() {
        slave = 1;
        idn = Idn::standard(17);
        data = octets;
    }
    std::array<std::byte, 300> octets{};
};
struct ReadFile : FoeRead {
    explicit ReadFile(std::string_view file) {
        slave = 1;
        name = file;
        data = octets;
    }
    std::array<std::byte, 400> octets{};
};
struct WriteFile : FoeWrite {
    explicit WriteFile(Bytes content) {
        slave = 1;
        name = "fw";
        data = content;
    }
};

// ------------------------------------------------------------------ what several requests are owed

TEST_F(LateParts, TheAnswerToAQuestionIsNoneOfTheRepliesThatAreOwed) {
    start([](MailboxType type, const Mail& mail) -> SlowSlave::Answer {
        return type == MailboxType::coe ? sdo(mail, octet(content_of(mail), 3) == 0 ? 180ms : 500ms)
                                        : SlowSlave::Answer{};
    });
    times_out(Write(1, 0x2000), 50ms);
    times_out(Write(2, 0x2000), 50ms);  // first sends a question, which is not answered in time
    times_out(Write(1, 0x2001), 50ms);
    slave.idle(50ms);
    is_refused(99, 0x2001);
}

TEST_F(LateParts, TheAnswerToAQuestionIsFetchedBeforeOtherMail) {
    start([](MailboxType type, const Mail& mail) -> SlowSlave::Answer {
        return type == MailboxType::coe ? sdo(mail, 500ms) : SlowSlave::Answer{};
    });
    times_out(Write(1, 0x2000), 50ms);
    times_out(Write(2, 0x2000), 50ms);
    times_out(Write(1, 0x2001), 50ms);
    slave.idle(380ms);
    Voe send;
    EXPECT_EQ(finish(send).code, Errc::none);
    slave.idle(20ms);
    is_refused(99, 0x2001);
}

TEST_F(LateParts, AMessageWithoutReplyIsRefusedLate) {
    start([](MailboxType type, const Mail& mail) -> SlowSlave::Answer {
        if (type == MailboxType::voe) return {200ms, {mail_bytes({1, 0, 2, 0})}, MailboxType::error};
        return type == MailboxType::coe ? sdo(mail, 300ms) : SlowSlave::Answer{};
    });
    Voe send;
    EXPECT_EQ(finish(send).code, Errc::none);
    slave.idle(110ms);
    Write write(1);
    (void)finish(write);  // the error names no message, so it may belong to this request
    is_refused(99, 0x2000);
}

// An error of SDO information does not name its object.
TEST_F(LateParts, AnErrorOfSdoInformationIsThatOfAnotherObject) {
    start([](MailboxType type, const Mail& mail) -> SlowSlave::Answer {
        if (type != MailboxType::coe) return {};
        const Bytes data = content_of(mail);
        if (octet(data, 1) != 0x80) return sdo(mail, 1ms);
        if (octet(data, 6) == 0x30) return {200ms, {mail_bytes({0, 0x80, 7, 0, 0, 0, 0, 0, 2, 6})}};
        return {1ms, {mail_bytes({0, 0x80, 4, 0, 0, 0, octet(data, 6), octet(data, 7), 7, 0, 0, 7, 'o', 'k'})}};
    });
    times_out(Description(0x3030), 100ms);
    Description exists(0x2000);
    const Error error = finish(exists);
    EXPECT_EQ(error.code, Errc::none) << bus.words(error);
    EXPECT_EQ(exists.description.name(), "ok");
}

// ------------------------------------------------------------------ answers of several mails

TEST_F(LateParts, SoeOfSeveralMails) {
    for (const bool queues : {false, true}) {
        SCOPED_TRACE(queues);
        LateBus one;
        unsigned asked = 0;
        one.start(
            [&asked](MailboxType type, const Mail&) -> SlowSlave::Answer {
                if (type != MailboxType::soe) return {};
                ++asked;
                SlowSlave::Answer answer{.after = 60ms, .mails = {}};
                for (unsigned left = 3; left-- > 0;) {
                    Mail part = left != 0 ? mail_bytes({0x0A, 0x40, left, 0}) : mail_bytes({0x02, 0x40, 17, 0});
                    part.insert(part.end(), 8, static_cast<std::byte>(asked));
                    answer.mails.push_back(std::move(part));
                }
                return answer;
            },
            queues);
        one.times_out(ReadValue(), 50ms);
        one.slave.idle(150ms);
        ReadValue again;
        EXPECT_EQ(one.finish(again).code, Errc::none);
        EXPECT_EQ(again.bytes, 24U);
        EXPECT_TRUE(
            std::ranges::all_of(again.octets | std::views::take(24), [](std::byte o) { return o == std::byte{2}; }));
    }
}

// The frame with one of the three mails is lost on its way to the master.
TEST(LostParts, AnObjectListIsComplete) {
    enum class Manner { repeats, does_not_repeat, has_nothing_to_repeat };
    for (const auto manner : {Manner::repeats, Manner::does_not_repeat, Manner::has_nothing_to_repeat})
        for (std::size_t lost = 1; lost <= 3; ++lost) {
            SCOPED_TRACE(testing::Message() << static_cast<int>(manner) << ", mail " << lost);
            MailboxBus bus;
            ScriptedSlave& slave = bus.add_scripted(64);
            bus.start();
            slave.repeats = manner != Manner::does_not_repeat;
            slave.forgets = manner == Manner::has_nothing_to_repeat;
            std::uint8_t counter = 0;
            slave.on_mail = [&](const Mail& mail) {
                const auto header = wire::load_mailbox_header(mail);
                if (std::exchange(counter, header.counter) == header.counter) return;
                const auto data = Bytes(mail).subspan(wire::kMailboxHeaderBytes);
                if (data[2] == std::byte{0x40}) {
                    Mail answer = mail_bytes({0, 0x30, 0x43});
                    answer.insert(answer.end(), data.begin() + 3, data.begin() + 6);
                    answer.resize(10);
                    slave.reply(answer);
                }
                for (unsigned left = data[1] == std::byte{0x80} ? 3 : 0; left-- > 0;) {
                    Mail part = mail_bytes({0, 0x80, left != 0 ? 0x82U : 2U, 0, left, 0});
                    if (left == 2) part.insert(part.end(), {std::byte{1}, std::byte{0}});
                    for (unsigned n = 0; n < 10; ++n)
                        part.insert(part.end(), {static_cast<std::byte>((2 - left) * 16 + n), std::byte{0x20}});
                    slave.reply(part);
                }
            };
            std::vector<std::uint16_t> found;
            ObjectListRequest list;
            list.slave = 1;
            list.user = &found;
            list.found = [](std::span<const std::uint16_t> objects, void* user) {
                auto& all = *static_cast<std::vector<std::uint16_t>*>(user);
                all.insert(all.end(), objects.begin(), objects.end());
            };
            bus.nic->keeps_mail = true;
            ASSERT_TRUE(submit(*bus.ctx, list).ok());
            const auto fetched = [&] { return bus.nic->mail.size(); };
            while (list.busy() && fetched() < lost) bus.step();
            bus.nic->lose_mail_from = 1;
            while (list.busy() && fetched() <= lost) bus.step();
            bus.nic->lose_mail_from = 0;
            for (const Time end = bus.osal.now() + 20s; list.busy() && bus.osal.now() < end;) bus.step();
            if (list.error().code != Errc::none) continue;
            EXPECT_EQ(found.size(), 30U);
        }
}

// A drive with a value of 260 octets in five mails. Each octet is the number of its mail.
struct DriveInParts {
    MailboxBus bus;
    ScriptedSlave& slave = bus.add_scripted(64);
    unsigned asked = 0;
    unsigned left_out = 0;  // the mail of the first answer with this number is not sent
    std::uint8_t counter = 0;

    DriveInParts() {
        bus.start();
        slave.on_mail = [this](const Mail& mail) { answer(wire::load_mailbox_header(mail)); };
    }
    void answer(const wire::MailboxHeader& header) {
        if (header.type != MailboxType::soe || std::exchange(counter, header.counter) == header.counter) return;
        ++asked;
        for (unsigned n = 1; n <= 5; ++n) {
            Mail part = n != 5 ? mail_bytes({0x0A, 0x40, 5 - n, 0}) : mail_bytes({0x02, 0x40, 17, 0});
            part.insert(part.end(), n == 5 ? 44 : 54, static_cast<std::byte>(n));
            if (asked != 1 || n != left_out) slave.reply(part, MailboxType::soe);
        }
    }
    static bool is_whole(const ReadValue& read) {
        return read.bytes == 260 &&
               std::ranges::all_of(read.octets | std::views::take(54), [](std::byte o) { return o == std::byte{1}; });
    }
};

// The frame with one of the mails is lost on its way to the master. One of the drives has mail without counters.
TEST(LostParts, AValueOfADriveIsComplete) {
    enum class Manner { repeats, does_not_repeat, has_nothing_to_repeat, does_not_count };
    for (const auto manner :
         {Manner::repeats, Manner::does_not_repeat, Manner::has_nothing_to_repeat, Manner::does_not_count})
        for (unsigned lost = 0; lost < 40; ++lost) {
            SCOPED_TRACE(testing::Message() << static_cast<int>(manner) << ", frame " << lost);
            DriveInParts drive;
            drive.slave.repeats = manner != Manner::does_not_repeat;
            drive.slave.forgets = manner == Manner::has_nothing_to_repeat;
            drive.slave.counts = manner != Manner::does_not_count;
            drive.bus.idle(200ms);
            ReadValue read;
            drive.bus.nic->lose_in.insert(drive.bus.nic->sent + lost);
            ASSERT_TRUE(submit(*drive.bus.ctx, read).ok());
            drive.bus.run(read);
            ASSERT_EQ(read.error().code, Errc::none) << drive.bus.words(read.error());
            EXPECT_TRUE(DriveInParts::is_whole(read)) << read.bytes;
        }
}

// The drive leaves out a mail, against the protocol. The rest of its answer is not the answer to the next request.
TEST(LostParts, ADriveThatLeavesOutAMail) {
    for (const unsigned n : {2U, 3U, 4U}) {
        SCOPED_TRACE(n);
        DriveInParts drive;
        drive.left_out = n;
        ReadValue first;
        ASSERT_TRUE(submit(*drive.bus.ctx, first).ok());
        drive.bus.run(first);
        EXPECT_EQ(first.error().code, Errc::protocol) << drive.bus.words(first.error());
        ReadValue second;
        ASSERT_TRUE(submit(*drive.bus.ctx, second).ok());
        drive.bus.run(second);
        ASSERT_EQ(second.error().code, Errc::none) << drive.bus.words(second.error());
        EXPECT_TRUE(DriveInParts::is_whole(second)) << second.bytes;
    }
}

// ------------------------------------------------------------------ files

// The slave stops once, for longer than the library waits for a late packet. Two first packets arrive one after the
// other, while the sink of the application has no room, or while another protocol is used.
TEST_F(LateParts, TheFirstPacketOfAFileThatComesTwiceEndsIt) {
    struct SlowSink final : ByteSink {
        Taken push(Bytes octets) override { return {.bytes = std::min<std::size_t>(octets.size(), 20)}; }
    };
    for (const Duration stall : {250ms, 500ms, 1000ms})
        for (const bool from_queue : {false, true}) {
            SCOPED_TRACE(testing::Message() << stall.count() << from_queue);
            LateBus one;
            std::string content;
            unsigned packet = 0;
            bool stalled = false;
            one.start(
                [&](MailboxType type, const Mail& mail) -> SlowSlave::Answer {
                    if (type != MailboxType::foe) return {};
                    const FoeAsked asked(mail);
                    Duration after = 1ms;
                    if (asked.opcode == foe::Opcode::read) {
                        content = std::string(200, text_of(asked.body)[0]);
                        packet = 0;
                        if (!std::exchange(stalled, true)) after = stall;
                    } else if (asked.opcode != foe::Opcode::acknowledge || packet == 4 || asked.word != packet) {
                        return {};
                    }
                    const auto part = content.substr(packet * 52, 52);
                    return {after, {foe_message(foe::Opcode::data, ++packet, std::as_bytes(std::span(part)))}};
                },
                from_queue);
            std::vector<std::byte> memory(4096);
            VoeInbox inbox(memory);
            inbox.look_every = 1ms;
            ASSERT_TRUE(listen(*one.bus.ctx, inbox).ok());
            one.times_out(ReadFile("a"), 50ms);
            ReadFile b("b");
            SlowSink sink;
            b.sink = &sink;
            const Error error = one.finish(b);
            EXPECT_EQ(error.code, from_queue ? Errc::protocol : Errc::none) << one.bus.words(error);
        }
}

// A write and a read are given up in the middle. Both late packets arrive before the next file.
TEST_F(LateParts, FilesThatWereGivenUpInTheirMiddle) {
    for (const std::size_t size : {40U, 150U}) {
        SCOPED_TRACE(size);
        LateBus one;
        std::string content;
        unsigned packet = 0;
        constexpr std::size_t kPacket = 52;
        one.start([&](MailboxType type, const Mail& mail) -> SlowSlave::Answer {
            if (type != MailboxType::foe) return {};
            const FoeAsked asked(mail);
            const auto part = [&] {
                const auto text = content.substr(std::min((packet - 1) * kPacket, content.size()), kPacket);
                return foe_message(foe::Opcode::data, packet, std::as_bytes(std::span(text)));
            };
            switch (asked.opcode) {
                case foe::Opcode::write: return {1ms, {foe_message(foe::Opcode::acknowledge, 0)}};
                case foe::Opcode::data:  // erases its flash
                    return {asked.word == 2 ? 300ms : 1ms, {foe_message(foe::Opcode::acknowledge, asked.word)}};
                case foe::Opcode::read:
                    content = std::string(size, text_of(asked.body)[0]);
                    packet = 1;
                    return {5ms, {part()}};
                case foe::Opcode::acknowledge:
                    if (asked.word != packet || packet * kPacket > content.size()) return {};
                    ++packet;
                    return {1ms, {part()}};
                default: return {};
            }
        });
        const auto firmware = pattern(200);
        one.times_out(WriteFile(firmware), 100ms);
        one.slave.idle(90ms);
        one.times_out(ReadFile("a"), 100ms);
        ReadFile b("b");
        if (one.finish(b).code != Errc::none) continue;
        EXPECT_EQ(text_of(Bytes(b.octets).first(b.bytes())), std::string(size, 'b'));
    }
}

// A slave with a queue answers reads that were given up. A later read of several packets fails or returns its own
// content.
TEST(LateFiles, OfSeveralPacketsAreNotMixed) {
    constexpr std::size_t kPacket = 52;
    constexpr std::size_t kOctets = 130;
    for (const Duration work : {150ms, 300ms, 500ms})
        for (unsigned given_up = 1; given_up <= 3; ++given_up) {
            SCOPED_TRACE(testing::Message() << work.count() << ", " << given_up);
            LateBus one;
            std::string content;
            std::size_t packet = 0;
            const auto part = [&] {
                const std::string text = content.substr(std::min(packet++ * kPacket, content.size()), kPacket);
                return foe_message(foe::Opcode::data, static_cast<std::uint32_t>(packet),
                                   std::as_bytes(std::span(text)));
            };
            one.start([&](MailboxType type, const Mail& mail) -> SlowSlave::Answer {
                if (type != MailboxType::foe) return {};
                const FoeAsked asked(mail);
                if (asked.opcode == foe::Opcode::error) content.clear();
                if (asked.opcode == foe::Opcode::acknowledge && asked.word == packet && packet * kPacket <= kOctets &&
                    !content.empty())
                    return {1ms, {part()}};
                if (asked.opcode != foe::Opcode::read) return {};
                content = std::string(kOctets, text_of(asked.body)[0]);
                packet = 0;
                return {work, {part()}};
            });
            for (unsigned n = 0; n < given_up; ++n) one.times_out(ReadFile("a"), 50ms);
            bool read_well = false;
            for (const std::string name : {"b", "c", "d", "e", "f", "g"}) {
                ReadFile file(name);
                read_well = one.finish(file).code == Errc::none;
                if (!read_well) continue;
                EXPECT_EQ(text_of(Bytes(file.octets).first(file.bytes())), std::string(kOctets, name[0]));
            }
            EXPECT_TRUE(read_well);
        }
}

// The slave has a queue. When a file is written, acknowledgements of an earlier file are still on their way.
TEST(LateFiles, AWriteIsNotConfirmedByAnEarlierOne) {
    for (const char content : {'c', 'd'}) {
        SCOPED_TRACE(content);
        LateBus one;
        std::string stored;
        one.start([&](MailboxType type, const Mail& mail) -> SlowSlave::Answer {
            if (type != MailboxType::foe) return {};
            const FoeAsked asked(mail);
            if (asked.opcode == foe::Opcode::write) return {400ms, {foe_message(foe::Opcode::acknowledge, 0)}};
            if (asked.opcode != foe::Opcode::data) return {};
            if (asked.body[0] == std::byte{'c'}) return {1ms, {foe_error(0x8003)}};  // the disk is full
            stored = text_of(asked.body);
            return {1ms, {foe_message(foe::Opcode::acknowledge, asked.word)}};
        });
        const std::string first(20, 'a');
        one.times_out(WriteFile(std::as_bytes(std::span(first))), 50ms);
        const std::string second(20, 'b');
        one.times_out(WriteFile(std::as_bytes(std::span(second))), 400ms);
        const std::string third(20, content);
        WriteFile file(std::as_bytes(std::span(third)));
        const Error error = one.finish(file);
        EXPECT_EQ(error.code, content == 'c' ? Errc::foe_error : Errc::none) << one.bus.words(error);
        EXPECT_EQ(stored == third, content == 'd') << stored;
    }
}

// The acknowledgement of the first packet shows that the slave has processed all earlier requests, also if it has not
// answered the write that was given up.
TEST(LateFiles, AWriteOfOnePacketEndsTheDoubt) {
    for (const bool answers_late : {false, true}) {
        SCOPED_TRACE(answers_late);
        LateBus one;
        unsigned requests = 0;
        one.start([&](MailboxType type, const Mail& mail) -> SlowSlave::Answer {
            if (type != MailboxType::foe) return {};
            const FoeAsked asked(mail);
            if (asked.opcode == foe::Opcode::data) return {1ms, {foe_message(foe::Opcode::acknowledge, asked.word)}};
            if (asked.opcode != foe::Opcode::write) return {};
            if (++requests == 1 && !answers_late) return {};
            return {requests == 1 ? 400ms : 1ms, {foe_message(foe::Opcode::acknowledge, 0)}};
        });
        const std::string content(20, 'a');
        one.times_out(WriteFile(std::as_bytes(std::span(content))), 50ms);
        for (const unsigned sent : {2U, 1U, 1U}) {
            requests = std::min(requests, 1U);
            const unsigned before = requests;
            WriteFile file(std::as_bytes(std::span(content)));
            EXPECT_EQ(one.finish(file).code, Errc::none);
            EXPECT_EQ(requests - before, sent);
            one.slave.idle(300ms);
        }
    }
}

}  // namespace
}  // namespace margay
