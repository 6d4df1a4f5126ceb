// The FoE server: reading, writing, busy with progress, errors with text, and clients that violate the protocol.
#include "subdevice/foe_server.hpp"

#include "bench_device.hpp"

#include <algorithm>
#include <functional>
#include <map>

namespace margay::subdevice {
namespace {

using namespace testing;
namespace foe = wire::foe;
using foe::Opcode;

class Store final : public FoeStore {
  public:
    FoeAnswer open_to_read(const FoeFile& file, Time) override {
        last = {std::string(file.name), file.password, file.state};
        ++opens;
        const auto found = files.find(last.name);
        if (found == files.end()) return FoeAnswer::error(FoeError::not_found, "no such file here");
        if (password != 0 && file.password != password) return FoeAnswer::error(FoeError::no_rights);
        if (busy_opens > 0) return --busy_opens, FoeAnswer::busy(0, 0);
        content = found->second;
        return FoeAnswer::go();
    }
    FoeAnswer read(std::size_t offset, MutableBytes into, std::size_t& bytes, Time) override {
        if (busy_reads > 0) return --busy_reads, FoeAnswer::busy(1, 2, "reading");
        bytes = std::min(into.size(), content.size() - offset);
        std::copy_n(content.begin() + static_cast<std::ptrdiff_t>(offset), bytes, into.begin());
        return FoeAnswer::go();
    }
    FoeAnswer open_to_write(const FoeFile& file, Time) override {
        last = {std::string(file.name), file.password, file.state};
        if (busy_opens > 0) return --busy_opens, FoeAnswer::busy(0, 0);
        if (last.name == "firmware" && file.state != AlState::boot) return FoeAnswer::error(FoeError::bootstrap_only);
        content.clear();
        return FoeAnswer::go();
    }
    FoeAnswer write(std::size_t offset, Bytes data, Time) override {
        if (busy_writes > 0)
            return --busy_writes, FoeAnswer::busy(static_cast<std::uint16_t>(10 - busy_writes), 10, "erasing");
        if (offset != content.size()) return FoeAnswer::error(FoeError::program_error);
        if (offset + data.size() > limit) return FoeAnswer::error(FoeError::disk_full, "full up");
        content.insert(content.end(), data.begin(), data.end());
        return FoeAnswer::go();
    }
    FoeAnswer finish_write(std::size_t bytes, Time) override {
        during_finish();
        if (busy_finishes > 0) return --busy_finishes, FoeAnswer::busy(50, 100);
        EXPECT_EQ(bytes, content.size());
        if (reject) return FoeAnswer::error(FoeError::wrong_checksum);
        files[last.name] = content;
        return FoeAnswer::go();
    }
    void give_up() override { ++given_up; }

    struct {
        std::string name;
        std::uint32_t password = 0;
        AlState state = AlState::none;
    } last;
    std::map<std::string, std::vector<std::byte>> files;
    std::vector<std::byte> content;
    std::uint32_t password = 0;
    std::size_t limit = 100'000;
    int busy_opens = 0;
    int busy_reads = 0;
    int busy_writes = 0;
    int busy_finishes = 0;
    bool reject = false;
    int given_up = 0;
    int opens = 0;  // to read
    std::function<void()> during_finish = [] {};
};

std::vector<std::byte> packet(Opcode opcode, std::uint32_t number, const std::vector<std::byte>& data = {}) {
    std::vector<std::byte> out(foe::kHeaderBytes + data.size());
    foe::Layout::opcode::store(out, opcode);
    foe::Layout::packet_number::store(out, number);
    std::copy(data.begin(), data.end(), out.begin() + foe::kHeaderBytes);
    return out;
}
std::vector<std::byte> letters(std::string_view text) {
    std::vector<std::byte> out;
    for (const char c : text) out.push_back(static_cast<std::byte>(c));
    return out;
}
std::vector<std::byte> pattern(std::size_t bytes) {
    std::vector<std::byte> out(bytes);
    for (std::size_t i = 0; i < bytes; ++i) out[i] = static_cast<std::byte>(i % 251);
    return out;
}

class FoeTest : public ::testing::Test {
  protected:
    FoeTest() : protocols_{{{wire::MailboxType::coe, &bench.coe}, {wire::MailboxType::foe, &*server, true}}} {
        bench.application.description_value.boot_mailbox = bench.application.description_value.mailbox;
        bench.mailbox.emplace(bench.esc, MutableBytes(receive_), MutableBytes(send_), protocols_);
        bench.device.emplace(bench.esc, bench.application, bench.process_data, &*bench.mailbox);
        bench.device->start(bench.esc.time);
        bench.configure(kMailbox);
        (void)bench.request(2);
    }
    std::vector<std::byte> exchange(const std::vector<std::byte>& data) {
        EXPECT_TRUE(bench.send(wire::MailboxType::foe, data));
        (void)bench.step();
        return bench.receive(wire::MailboxType::foe);
    }
    void silent(const std::vector<std::byte>& data) {
        EXPECT_TRUE(bench.send(wire::MailboxType::foe, data));
        bench.settle();
        EXPECT_TRUE(bench.fetch().empty());
    }
    static void expect(const std::vector<std::byte>& reply, Opcode opcode, std::uint32_t number) {
        ASSERT_GE(reply.size(), foe::kHeaderBytes);
        EXPECT_EQ(foe::Layout::opcode::load(reply), opcode);
        EXPECT_EQ(foe::Layout::packet_number::load(reply), number);
    }
    static void expect_error(const std::vector<std::byte>& reply, FoeError code) {
        expect(reply, Opcode::error, static_cast<std::uint32_t>(code));
    }
    static std::string text_of(const std::vector<std::byte>& reply) {
        std::string out;
        for (std::size_t i = foe::kHeaderBytes; i < reply.size(); ++i) out.push_back(static_cast<char>(reply[i]));
        return out;
    }
    std::vector<std::byte> read_file(std::string_view name, std::uint32_t password = 0) {
        std::vector<std::byte> out;
        auto reply = exchange(packet(Opcode::read, password, letters(name)));
        for (std::uint32_t number = 1;; ++number) {
            expect(reply, Opcode::data, number);
            if (reply.size() < foe::kHeaderBytes || foe::Layout::opcode::load(reply) != Opcode::data) return out;
            out.insert(out.end(), reply.begin() + foe::kHeaderBytes, reply.end());
            if (reply.size() < kRoom + foe::kHeaderBytes) break;
            reply = exchange(packet(Opcode::acknowledge, number));
        }
        silent(packet(Opcode::acknowledge, static_cast<std::uint32_t>(out.size() / kRoom + 1)));
        return out;
    }
    void write_file(std::string_view name, const std::vector<std::byte>& content) {
        expect(exchange(packet(Opcode::write, 0, letters(name))), Opcode::acknowledge, 0);
        std::uint32_t number = 1;
        for (std::size_t at = 0;; at += kRoom, ++number) {
            const auto bytes = std::min(kRoom, content.size() - at);
            const std::vector<std::byte> part(content.begin() + static_cast<std::ptrdiff_t>(at),
                                              content.begin() + static_cast<std::ptrdiff_t>(at + bytes));
            expect(exchange(packet(Opcode::data, number, part)), Opcode::acknowledge, number);
            if (bytes < kRoom) return;
        }
    }

    static constexpr std::uint16_t kMailbox = 64;
    static constexpr std::size_t kRoom = kMailbox - 12;
    Bench bench;
    Store store;
    std::optional<FoeServer> server{std::in_place, store, wire::foe::to_text};

  private:
    std::array<std::byte, 256> receive_{};
    std::array<std::byte, 1024> send_{};
    std::array<MailboxProtocol, 2> protocols_;
};

TEST_F(FoeTest, FilesOfEveryLengthGoThereAndBack) {
    for (const std::size_t bytes :
         {std::size_t{0}, std::size_t{1}, kRoom - 1, kRoom, kRoom + 1, 3 * kRoom, std::size_t{5000}}) {
        write_file("data.bin", pattern(bytes));
        EXPECT_EQ(store.files["data.bin"], pattern(bytes)) << bytes;
        EXPECT_EQ(read_file("data.bin"), pattern(bytes)) << bytes;
    }
    EXPECT_EQ(store.given_up, 0);
}

TEST_F(FoeTest, TheStoreMayEndTheMailbox) {
    store.during_finish = [this] { bench.device->fall_back(AlState::init, AlStatusCode::unspecified, bench.esc.time); };
    expect(exchange(packet(Opcode::write, 0, letters("data.bin"))), Opcode::acknowledge, 0);
    const auto sent = bench.mailbox->counters().sent;
    ASSERT_TRUE(bench.send(wire::MailboxType::foe, packet(Opcode::data, 1, pattern(3))));
    bench.settle();
    EXPECT_EQ(bench.device->state(), AlState::init);
    EXPECT_EQ(bench.mailbox->counters().sent, sent) << "the reply is dropped";
    store.during_finish = [] {};
    bench.configure(kMailbox);
    EXPECT_EQ(bench.request(0x12).state, AlState::preop);
    write_file("data.bin", pattern(100));
    EXPECT_EQ(store.files["data.bin"], pattern(100));
}

TEST_F(FoeTest, NameAndPasswordReachTheStore) {
    store.files["settings"] = pattern(3);
    store.password = 0x12345678;
    EXPECT_EQ(read_file("settings", 0x12345678), pattern(3));
    EXPECT_EQ(store.last.state, AlState::preop);
    auto reply = exchange(packet(Opcode::read, 1, letters("settings")));
    expect_error(reply, FoeError::no_rights);
    EXPECT_EQ(text_of(reply), "no access rights") << "words where the store has none";
    reply = exchange(packet(Opcode::read, 1, letters("other")));
    expect_error(reply, FoeError::not_found);
    EXPECT_EQ(text_of(reply), "no such file here");
    (void)exchange(packet(Opcode::write, 9, raw({'a', 'b', 0, 'c'})));
    EXPECT_EQ(store.last.name, "ab") << "a terminator ends the name";
    expect_error(exchange(packet(Opcode::read, 0, letters(std::string(52, 'x')))), FoeError::not_found);
}

TEST_F(FoeTest, WithoutTextsOnlyThoseOfTheStoreAreSent) {
    (void)bench.request(1);
    server.emplace(store);
    bench.configure(kMailbox);
    (void)bench.request(2);
    store.files["settings"] = pattern(3);
    store.password = 7;
    auto reply = exchange(packet(Opcode::read, 1, letters("settings")));
    expect_error(reply, FoeError::no_rights);
    EXPECT_EQ(text_of(reply), "");
    reply = exchange(packet(Opcode::read, 1, letters("other")));
    expect_error(reply, FoeError::not_found);
    EXPECT_EQ(text_of(reply), "no such file here");
}

TEST_F(FoeTest, FirmwareIsTakenInBoot) {
    expect_error(exchange(packet(Opcode::write, 0, letters("firmware"))), FoeError::bootstrap_only);
    (void)bench.request(1);
    bench.configure(kMailbox);
    ASSERT_EQ(bench.request(3), (AlStatus{AlState::boot, false, 0}));
    write_file("firmware", pattern(1000));
    EXPECT_EQ(store.files["firmware"], pattern(1000));
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x40, 0x1000, 0)));
    (void)bench.step();
    EXPECT_EQ(wire::MailboxErrorLayout::detail::load(bench.receive(wire::MailboxType::error)),
              wire::MailboxErrorCode::unsupported_protocol)
        << "CoE's line in the table does not say BOOT";
}

TEST_F(FoeTest, BusyTellsProgressAndTakesTheSameDataAgain) {
    expect(exchange(packet(Opcode::write, 0, letters("x"))), Opcode::acknowledge, 0);
    store.busy_writes = 3;
    for (const int done : {8, 9, 10}) {
        const auto reply = exchange(packet(Opcode::data, 1, pattern(kRoom)));
        ASSERT_EQ(foe::Layout::opcode::load(reply), Opcode::busy);
        EXPECT_EQ(foe::Layout::done::load(reply), done);
        EXPECT_EQ(foe::Layout::entire::load(reply), 10);
        EXPECT_EQ(text_of(reply), "erasing");
    }
    expect(exchange(packet(Opcode::data, 1, pattern(kRoom))), Opcode::acknowledge, 1);
    store.busy_finishes = 2;
    for (int i = 0; i < 2; ++i)
        EXPECT_EQ(foe::Layout::opcode::load(exchange(packet(Opcode::data, 2, pattern(5)))), Opcode::busy);
    expect(exchange(packet(Opcode::data, 2, pattern(5))), Opcode::acknowledge, 2);
    EXPECT_EQ(store.files["x"].size(), kRoom + 5) << "nothing was written twice";
}

TEST_F(FoeTest, BusyWhileReading) {
    store.files["f"] = pattern(kRoom + 1);
    store.busy_opens = 1;
    EXPECT_EQ(foe::Layout::opcode::load(exchange(packet(Opcode::read, 0, letters("f")))), Opcode::busy);
    expect(exchange(packet(Opcode::read, 0, letters("f"))), Opcode::data, 1);
    store.busy_reads = 1;
    EXPECT_EQ(foe::Layout::opcode::load(exchange(packet(Opcode::acknowledge, 1))), Opcode::busy);
    expect(exchange(packet(Opcode::acknowledge, 1)), Opcode::data, 2);
    expect(exchange(packet(Opcode::busy, 0)), Opcode::data, 2);
    silent(packet(Opcode::acknowledge, 2));
}

// A store that is busy with the file gets a call when the client gives up the transfer.
TEST_F(FoeTest, ABusyOpenIsGivenUp) {
    store.files["f"] = pattern(1);
    for (const auto opcode : {Opcode::read, Opcode::write}) {
        const auto opened = [&] { return foe::Layout::opcode::load(exchange(packet(opcode, 7, letters("f")))); };
        store.given_up = 0;
        store.busy_opens = 2;
        EXPECT_EQ(opened(), Opcode::busy);
        EXPECT_EQ(opened(), Opcode::busy);
        EXPECT_EQ(store.given_up, 0) << "the same request again";
        expect_error(exchange(packet(Opcode::read, 0, letters("none"))), FoeError::not_found);
        EXPECT_EQ(store.given_up, 1) << "another request";
        store.busy_opens = 1;
        EXPECT_EQ(opened(), Opcode::busy);
        silent(packet(Opcode::error, 0));
        EXPECT_EQ(store.given_up, 2) << "the client ends it";
        store.busy_opens = 1;
        EXPECT_EQ(opened(), Opcode::busy);
        server->state_changed(AlState::safeop);
        EXPECT_EQ(store.given_up, 3) << "another state";
        server->state_changed(AlState::boot);
        EXPECT_NE(opened(), Opcode::busy);
        server->stop();
        EXPECT_EQ(store.given_up, 4);
    }
}

// The store loads the file after open_to_read(). The client repeats its request, and the file is not opened again.
TEST_F(FoeTest, BusyWithTheFirstPacketAsLongAsTheStoreWants) {
    store.files["f"] = pattern(kRoom + 1);
    store.busy_reads = 5;
    for (int n = 0; n < 5; ++n)
        EXPECT_EQ(foe::Layout::opcode::load(exchange(packet(Opcode::read, 7, letters("f")))), Opcode::busy);
    store.password = 7;  // only the first request is checked
    EXPECT_EQ(store.opens, 1);
    EXPECT_EQ(store.given_up, 0);
    expect(exchange(packet(Opcode::read, 7, letters("f"))), Opcode::data, 1);
    expect(exchange(packet(Opcode::acknowledge, 1)), Opcode::data, 2);
    silent(packet(Opcode::acknowledge, 2));
    // A request with another file or another password, or a write, is another request.
    store.files["g"] = pattern(1);
    store.busy_reads = 1;
    EXPECT_EQ(foe::Layout::opcode::load(exchange(packet(Opcode::read, 7, letters("f")))), Opcode::busy);
    expect(exchange(packet(Opcode::read, 7, letters("g"))), Opcode::data, 1);
    EXPECT_EQ(store.given_up, 1);
    store.busy_reads = 1;
    EXPECT_EQ(foe::Layout::opcode::load(exchange(packet(Opcode::read, 7, letters("f")))), Opcode::busy);
    expect_error(exchange(packet(Opcode::read, 8, letters("f"))), FoeError::no_rights);
    store.busy_reads = 1;
    EXPECT_EQ(foe::Layout::opcode::load(exchange(packet(Opcode::read, 7, letters("f")))), Opcode::busy);
    expect(exchange(packet(Opcode::write, 7, letters("f"))), Opcode::acknowledge, 0);
    // Some clients acknowledge packet 0 in place of the request.
    store.busy_reads = 1;
    EXPECT_EQ(foe::Layout::opcode::load(exchange(packet(Opcode::read, 7, letters("g")))), Opcode::busy);
    expect(exchange(packet(Opcode::acknowledge, 0)), Opcode::data, 1);
}

TEST_F(FoeTest, ALostAcknowledgeIsSaidAgain) {
    expect(exchange(packet(Opcode::write, 0, letters("x"))), Opcode::acknowledge, 0);
    expect(exchange(packet(Opcode::data, 1, pattern(kRoom))), Opcode::acknowledge, 1);
    expect(exchange(packet(Opcode::data, 1, pattern(kRoom))), Opcode::acknowledge, 1);
    expect(exchange(packet(Opcode::data, 2, pattern(1))), Opcode::acknowledge, 2);
    EXPECT_EQ(store.files["x"].size(), kRoom + 1);
}

TEST_F(FoeTest, TheLastAcknowledgeIsSaidAgainToo) {
    expect(exchange(packet(Opcode::write, 0, letters("x"))), Opcode::acknowledge, 0);
    expect(exchange(packet(Opcode::data, 1, pattern(kRoom))), Opcode::acknowledge, 1);
    expect(exchange(packet(Opcode::data, 2, pattern(1))), Opcode::acknowledge, 2);
    expect(exchange(packet(Opcode::data, 2, pattern(1))), Opcode::acknowledge, 2);
    EXPECT_EQ(store.files["x"].size(), kRoom + 1);
    expect_error(exchange(packet(Opcode::data, 3, pattern(1))), FoeError::illegal);
    expect_error(exchange(packet(Opcode::data, 2, pattern(1))), FoeError::illegal);
}

TEST_F(FoeTest, ALostPacketIsSentAgain) {
    store.files["f"] = pattern(2 * kRoom + 1);
    expect(exchange(packet(Opcode::read, 0, letters("f"))), Opcode::data, 1);
    const auto second = exchange(packet(Opcode::acknowledge, 1));
    expect(second, Opcode::data, 2);
    EXPECT_EQ(exchange(packet(Opcode::acknowledge, 1)), second);
    expect(exchange(packet(Opcode::acknowledge, 2)), Opcode::data, 3);
    silent(packet(Opcode::acknowledge, 3));
}

TEST_F(FoeTest, ErrorsOfTheStoreEndTheTransfer) {
    store.limit = kRoom;
    expect(exchange(packet(Opcode::write, 0, letters("x"))), Opcode::acknowledge, 0);
    expect(exchange(packet(Opcode::data, 1, pattern(kRoom))), Opcode::acknowledge, 1);
    const auto reply = exchange(packet(Opcode::data, 2, pattern(1)));
    expect_error(reply, FoeError::disk_full);
    EXPECT_EQ(text_of(reply), "full up");
    EXPECT_EQ(store.given_up, 1);
    expect_error(exchange(packet(Opcode::data, 2, pattern(1))), FoeError::illegal);
    store.reject = true;
    expect(exchange(packet(Opcode::write, 0, letters("y"))), Opcode::acknowledge, 0);
    expect_error(exchange(packet(Opcode::data, 1, pattern(1))), FoeError::wrong_checksum);
    EXPECT_EQ(store.files.count("y"), 0u);
}

TEST_F(FoeTest, EveryChangeOfTheStateEndsATransferAtOnce) {
    const auto open = [&] { expect(exchange(packet(Opcode::write, 0, letters("x"))), Opcode::acknowledge, 0); };
    open();
    ASSERT_EQ(bench.request(4).state, AlState::safeop);
    EXPECT_EQ(store.given_up, 1) << "PREOP to SAFEOP";
    expect_error(exchange(packet(Opcode::data, 1, pattern(3))), FoeError::illegal);
    open();
    ASSERT_TRUE(bench.esc.ecat_write(0x1200, raw({1, 2, 0, 1})));
    ASSERT_EQ(bench.request(8).state, AlState::op);
    EXPECT_EQ(store.given_up, 2) << "SAFEOP to OP";
    open();
    ASSERT_EQ(bench.request(1).state, AlState::init);
    EXPECT_EQ(store.given_up, 3) << "INIT, without waiting for the next PREOP";
    bench.configure(kMailbox);
    ASSERT_EQ(bench.request(2).state, AlState::preop);
    EXPECT_EQ(store.given_up, 3);
}

TEST_F(FoeTest, AnSdoHookDelaysNoFile) {
    store.files["f"] = pattern(3);
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x40, 0x2007, 0)));
    (void)bench.step();
    ASSERT_TRUE(bench.send(wire::MailboxType::coe, sdo_request(0x40, 0x1000, 0)));  // waits for the SDO before it
    bench.settle();
    EXPECT_EQ(read_file("f"), pattern(3));
    bench.esc.time = bench.application.slow_until;
    bench.settle();
    EXPECT_EQ(wire::coe::SdoLayout::index::load(bench.receive()), 0x2007);
    EXPECT_EQ(wire::coe::SdoLayout::index::load(bench.receive()), 0x1000);
}

TEST_F(FoeTest, ClientsOutOfStep) {
    expect_error(exchange(packet(Opcode::acknowledge, 0)), FoeError::illegal);
    expect_error(exchange(packet(Opcode::data, 1, pattern(3))), FoeError::illegal);
    expect_error(exchange(packet(Opcode::busy, 0)), FoeError::illegal);
    for (const int opcode : {0, 7, 255})
        expect_error(exchange(packet(static_cast<Opcode>(opcode), 0)), FoeError::illegal);
    store.files["f"] = pattern(500);
    (void)exchange(packet(Opcode::read, 0, letters("f")));
    expect_error(exchange(packet(Opcode::acknowledge, 2)), FoeError::wrong_packet_number);
    EXPECT_EQ(store.given_up, 1);
    (void)exchange(packet(Opcode::write, 0, letters("f")));
    expect_error(exchange(packet(Opcode::data, 2, pattern(3))), FoeError::wrong_packet_number);
    EXPECT_EQ(store.given_up, 2);
    (void)exchange(packet(Opcode::read, 0, letters("f")));
    silent(packet(Opcode::error, 0x8000, letters("enough")));
    EXPECT_EQ(store.given_up, 3);
    (void)exchange(packet(Opcode::read, 0, letters("f")));
    (void)exchange(packet(Opcode::read, 0, letters("f")));
    EXPECT_EQ(store.given_up, 4) << "another request ends the first";
    (void)bench.request(1);
    (void)bench.request(2);
    EXPECT_EQ(store.given_up, 5) << "and so does another state";
    ASSERT_TRUE(bench.send(wire::MailboxType::foe, raw({1, 0, 0, 0, 0})));
    (void)bench.step();
    EXPECT_EQ(wire::MailboxErrorLayout::detail::load(bench.receive(wire::MailboxType::error)),
              wire::MailboxErrorCode::size_too_short);
}

}  // namespace
}  // namespace margay::subdevice
