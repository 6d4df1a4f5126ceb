// A device whose ESC interrupts it at each point where step() does not hold the lock.
#pragma once

#include "bench_device.hpp"

#include <functional>

namespace margay::subdevice::testing {

namespace reg = wire::reg;

// An access to the ESC whose lock interrupts the device: `handler` executes at each point where an interrupt could
// occur, that is before a critical section begins and after it ends.
class Interruptible final : public EscAccess {
  public:
    explicit Interruptible(PlainEsc& esc) : esc_(esc) {}
    void read(std::uint16_t address, MutableBytes into) noexcept override {
        note_access(into.size());
        esc_.read(address, into);
    }
    void write(std::uint16_t address, Bytes data) noexcept override {
        note_access(data.size());
        esc_.write(address, data);
    }
    [[nodiscard]] Time now() noexcept override { return esc_.now(); }
    [[nodiscard]] std::uint32_t lock() noexcept override {
        if (depth_ == 0) point();
        return depth_++;
    }
    void unlock(std::uint32_t before) noexcept override {
        depth_ = before;
        if (depth_ == 0) point();
    }
    // A place where an interrupt may occur, for hooks.
    void point() {
        if (inside_ || !handler) return;
        ++points;
        if (points != strike && strike != kEverywhere) return;
        inside_ = true;
        handler();
        inside_ = false;
    }
    [[nodiscard]] bool locked() const { return depth_ != 0 && !inside_; }

    static constexpr unsigned kEverywhere = 0;
    std::function<void()> handler;
    unsigned strike = kEverywhere;
    unsigned points = 0;
    unsigned unlocked_accesses = 0;
    std::size_t longest_access = 0;

  private:
    void note_access(std::size_t bytes) {
        unlocked_accesses += depth_ == 0 ? 1 : 0;
        longest_access = std::max(longest_access, bytes);
    }
    PlainEsc& esc_;
    std::uint32_t depth_ = 0;
    bool inside_ = false;
};

// A device whose cycle() changes several values that belong together.
class CountingApplication final : public ReportingApplication<3, 4, 3> {
  public:
    CountingApplication(std::span<std::byte> image) : image_(image) {}
    [[nodiscard]] const DeviceDescription& description() const override { return description_value; }
    Verdict before(Transition, Time) override { return in_step(), Verdict::go(); }
    void after(Transition transition, Time) override {
        in_step();
        state = transition.to;
    }
    void cycle(Time, bool outputs_valid) override {
        EXPECT_FALSE(inside_) << "one update within another";
        inside_ = true;
        ++cycles;
        Values::big::store(image_, cycles * 0x0000000100000001u);
        std::fill_n(image_.begin() + Values::block, 300, static_cast<std::byte>(cycles));
        if (outputs_valid) {
            EXPECT_EQ(Values::out_b::load(image_), Values::out_a::load(image_)) << "outputs of one frame";
        }
        inside_ = false;
    }
    void safe_outputs(Time) override { ++safe; }
    void in_step() const {
        if (pdi != nullptr) {
            EXPECT_FALSE(pdi->locked()) << "a hook executes with the lock held";
            pdi->point();
        }
    }
    DeviceDescription description_value = table::kDevice;
    Interruptible* pdi = nullptr;
    std::uint64_t cycles = 0;
    unsigned safe = 0;
    AlState state = AlState::init;

  private:
    std::span<std::byte> image_;
    bool inside_ = false;
};

// A device in one of the run modes, over an ESC that interrupts it.
class Interrupted {
  public:
    explicit Interrupted(RunMode mode) : device(pdi, application, process_data, &mailbox, nullptr, mode) {
        application.description_value.boot_mailbox = {};
        device.start(esc.time);
        hand.configure(128);
        esc.configure(2, {0x1200, 4, 0x64, 1});
        esc.configure(3, {0x1300, 6, 0x20, 1});
        (void)request(2);
        application.pdi = &pdi;
    }
    AlStatus request(std::uint16_t control) {
        esc.al_control(control);
        run();
        return esc.al_status();
    }
    void put_outputs(int value) { (void)esc.ecat_write(0x1200, raw({value, value, 0, 1})); }
    [[nodiscard]] bool line() const { return (esc.events() & esc.get<std::uint32_t>(reg::kAlEventMask.address)) != 0; }
    // As on hardware, the handler is executed while the line is active, and step() after the handler.
    void run() {
        (void)device.step(esc.time);
        for (int i = 0; line(); ++i) {
            ASSERT_LT(i, 8) << "the interrupt line stays active: events " << std::hex << esc.events() << ", mask "
                            << esc.get<std::uint32_t>(reg::kAlEventMask.address);
            (void)device.interrupt(esc.time);
            (void)device.step(esc.time);
        }
    }
    // Exchanges mailbox messages until the reply has arrived.
    std::vector<std::byte> exchange(const std::vector<std::byte>& data) {
        EXPECT_TRUE(hand.put(hand.message(wire::MailboxType::coe, data)));
        run();
        auto reply = hand.fetch();
        run();
        if (reply.empty()) return reply;
        reply.resize(wire::kMailboxHeaderBytes + wire::load_mailbox_header(reply).length);
        reply.erase(reply.begin(), reply.begin() + wire::kMailboxHeaderBytes);
        return reply;
    }
    // Both halves of 0x2001 belong to one update, and so do all octets of 0x2003.
    void check_values() {
        const auto big = exchange(sdo_request(0x40, 0x2001, 0));
        ASSERT_EQ(big.size(), 18u);
        EXPECT_EQ(load_le<std::uint32_t>(big, 10), load_le<std::uint32_t>(big, 14)) << "a value of two updates";
        auto reply = exchange(sdo_request(0x40, 0x2003, 0));
        ASSERT_GT(reply.size(), 10u);
        std::vector<std::byte> block(reply.begin() + 10, reply.end());
        for (int toggle = 0; block.size() < 300; toggle ^= 0x10) {
            reply = exchange(sdo_request(0x60 | toggle, 0, 0));
            ASSERT_GT(reply.size(), 3u);
            block.insert(block.end(), reply.begin() + 3, reply.end());
        }
        EXPECT_EQ(block, std::vector<std::byte>(block.size(), block[0])) << "a value of two updates";
    }
    // From PREOP to OP and back, with mailbox services in each state.
    void session() {
        ASSERT_EQ(request(4), (AlStatus{AlState::safeop, false, 0}));
        check_values();
        put_outputs(3);
        run();
        ASSERT_EQ(request(8), (AlStatus{AlState::op, false, 0}));
        put_outputs(7);
        run();
        check_values();
        esc.ecat_set<std::uint8_t>(0x081E, 1);  // the event of a SyncManager whose settings do not change
        run();
        ASSERT_EQ(esc.al_status(), (AlStatus{AlState::op, false, 0}));
        ASSERT_EQ(request(4), (AlStatus{AlState::safeop, false, 0}));
        EXPECT_EQ(Values::out_a::load(image), 9) << "the initial value";
        ASSERT_EQ(request(2), (AlStatus{AlState::preop, false, 0}));
        const auto cycles = application.cycles;
        (void)device.interrupt(esc.time);
        EXPECT_EQ(application.cycles, cycles) << "no update below SAFEOP";
        EXPECT_EQ(application.safe, 1u);
    }

    PlainEsc esc;
    Interruptible pdi{esc};
    std::array<std::byte, Values::bytes> image{};
    CountingApplication application{image};
    ObjectDictionary dictionary{table::kObjects, image, &application};
    std::array<std::byte, 512> staging{};
    CoeServer coe{dictionary, staging, true, application.emergencies()};
    MailboxProtocol protocols[1] = {{wire::MailboxType::coe, &coe}};
    MailboxMemory<256, 4> memory;
    Mailbox mailbox{pdi, memory, protocols};
    ProcessDataMemory<16, 16, 8> process_memory;
    ProcessData process_data{pdi, application, dictionary, process_memory};
    Device device;
    MailHand hand{esc};
};

}  // namespace margay::subdevice::testing
