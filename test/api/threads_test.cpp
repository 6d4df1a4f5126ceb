// Requests of several real threads: no request that a thread submits, cancels or destroys is lost. These tests use real
// time. No result depends on durations: a lost request stays busy until the limit of a test.
#include "api/real_line.hpp"
#include "real_osal.hpp"

#include <margay/detail/writable_ring.hpp>

#include <algorithm>
#include <atomic>
#include <barrier>
#include <memory>
#include <random>
#include <thread>
#include <vector>

namespace margay {
namespace {

using namespace std::chrono_literals;

constexpr Duration kLost = 5s;  // a request that is still busy after this time counts as lost

class Threads : public RealLine<RealOsal> {
  protected:
    void SetUp() override {
        RealLine::SetUp();
        ASSERT_TRUE(config_init(ctx));
    }
    // Never polls earlier than poll() requires, so a lost wake-up makes a request late.
    void poll_until_stopped(Duration longest = 4 * kLost) { RealLine::poll_until_stopped(longest); }
    [[nodiscard]] bool ends(const Request& request) {
        const Time limit = osal.now() + kLost;
        while (request.busy()) {
            if (osal.now() > limit) return false;
            std::this_thread::yield();
        }
        return true;
    }
};

// One thread submits and cancels requests at once, while another thread submits one request.
TEST_F(Threads, ARequestBesideCancelledOnesOfAnotherThreadBegins) {
    constexpr int kRounds = 1'500;
    std::barrier together(2);
    std::atomic<int> lost{0};
    std::thread cancels([&] {
        for (int n = 0; n < kRounds && lost == 0; ++n) {
            together.arrive_and_wait();
            std::array<ReadStateRequest, 8> requests;
            for (auto& request : requests) (void)submit(ctx, request);
            for (auto& request : requests) request.cancel();
            for (auto& request : requests) lost += ends(request) ? 0 : 1;
            together.arrive_and_wait();
        }
        together.arrive_and_drop();
    });
    std::thread submits([&] {
        for (int n = 0; n < kRounds && lost == 0; ++n) {
            together.arrive_and_wait();
            ReadStateRequest request;
            (void)submit(ctx, request);
            lost += ends(request) ? 0 : 1;
            osal.wake();  // so that a lost request can be destroyed
            together.arrive_and_wait();
        }
        together.arrive_and_drop();
        stop_owner();
    });
    poll_until_stopped();
    cancels.join();
    submits.join();
    EXPECT_EQ(lost, 0);
}

TEST_F(Threads, ACancelBesideCancelledRequestsOfAnotherThreadIsNotLost) {
    ASSERT_TRUE(config_map(ctx, image));
    std::atomic<bool> done{false};
    std::atomic<int> lost{0};
    std::thread cancels([&] {
        while (!done) {
            std::array<ReadStateRequest, 8> requests;
            for (auto& request : requests) (void)submit(ctx, request);
            for (auto& request : requests) request.cancel();
            for (auto& request : requests) lost += ends(request) ? 0 : 1;
        }
        stop_owner();
    });
    std::thread supervises([&] {
        for (int n = 0; n < 1'000 && lost == 0; ++n) {
            SuperviseRequest request;
            request.interval = 1ms;
            (void)submit(ctx, request);
            request.cancel();
            lost += ends(request) ? 0 : 1;
        }
        done = true;
    });
    poll_until_stopped();
    cancels.join();
    supervises.join();
    EXPECT_EQ(lost, 0);
}

// When cancel() returns outside of poll(), the owner's own request is over.
TEST_F(Threads, TheOwnerDestroysItsRequestsWhileAnotherThreadCancels) {
    std::thread other([&] {
        while (!stop) {
            ReadStateRequest request;
            (void)submit(ctx, request);
            request.cancel();
            while (request.busy() && !stop) std::this_thread::yield();
        }
    });
    int busy = 0;
    for (int n = 0; n < 30'000 && busy == 0; ++n) {
        auto request = std::make_unique<ReadStateRequest>();
        (void)submit(ctx, *request);
        request->cancel();
        busy += request->busy() ? 1 : 0;
        request.reset();
        if (n % 64 == 0) (void)poll(ctx, osal.now());
    }
    stop = true;
    std::atomic<bool> joined{false};
    std::thread joins([&] {
        other.join();
        joined = true;
    });
    while (!joined) (void)poll(ctx, osal.now());
    joins.join();
    EXPECT_EQ(busy, 0);
}

// One thread cancels a request at any moment while another thread submits it.
TEST_F(Threads, ARequestMayBeCancelledWhileItIsSubmitted) {
    std::atomic<Request*> shared{nullptr};
    std::atomic<unsigned> turns{0};
    std::atomic<int> lost{0};
    std::thread cancels([&] {
        while (!stop) {
            if (Request* request = shared.load()) request->cancel();
            ++turns;
        }
    });
    std::thread submits([&] {
        for (int n = 0; n < 3'000; ++n) {
            auto request = std::make_unique<ReadStateRequest>();
            shared = request.get();
            for (std::atomic<int> k = n % 300; k > 0;) --k;
            (void)submit(ctx, *request);
            shared = nullptr;
            for (const unsigned before = turns; turns - before < 2;) std::this_thread::yield();
            lost += ends(*request) ? 0 : 1;
        }
        stop_owner();
    });
    poll_until_stopped();
    cancels.join();
    submits.join();
    EXPECT_EQ(lost, 0);
}

TEST_F(Threads, AnotherThreadRecoversASlaveWhileASecondOneScans) {
    ASSERT_TRUE(config_map(ctx, image));
    std::atomic<int> left{2};
    const auto leave = [&] {
        if (--left == 0) stop_owner();
    };
    std::thread recovers([&] {
        for (int n = 0; n < 150; ++n) (void)recover_slave(ctx, 1);
        leave();
    });
    std::thread scans([&] {
        for (int n = 0; n < 100; ++n) (void)readstate(ctx);
        for (int n = 0; n < 3; ++n) EXPECT_TRUE(config_init(ctx));
        leave();
    });
    poll_until_stopped(1ms);
    recovers.join();
    scans.join();
}

// ------------------------------------------------------------------ a mixture, with a change of the owner

// A thread that submits, cancels, waits for and destroys random requests.
class Worker {
  public:
    Worker(Context& ctx, Osal& osal, unsigned seed) : ctx_(ctx), osal_(osal), numbers_(seed) {}

    void one() {
        std::array<std::byte, 64> memory{};
        const auto slave = static_cast<std::uint16_t>(1 + below(2));
        switch (below(12)) {
            case 0: {
                ScanRequest scan;
                return use(scan);
            }
            case 1:
            case 2: {
                ReadStateRequest read;
                return use(read);
            }
            case 3:
            case 4: {
                SiiReadRequest read;
                read.slave = slave;
                read.word = 8;
                read.data = std::span(memory).first(16);
                return use(read);
            }
            case 5:
            case 6: {
                ReconfigRequest reconfiguration;
                reconfiguration.slave = slave;
                return use(reconfiguration);
            }
            case 7:
            case 8: {
                StateRequest state;
                state.slave = slave;
                state.wanted = below(2) == 0 ? AlState::preop : AlState::init;
                return use(state);
            }
            default: {
                SdoUpload upload;
                upload.slave = slave;
                upload.index = 0x1008;
                upload.data = memory;
                upload.timeout = 50ms;  // the slave may be in INIT, where it does not answer
                return use(upload);
            }
        }
    }
    [[nodiscard]] bool lost() const { return lost_; }

  private:
    unsigned below(unsigned end) { return static_cast<unsigned>(numbers_() % end); }
    void hesitate() {
        for (unsigned n = below(20); n > 0; --n) std::this_thread::yield();
    }
    void use(Request& request) {
        request.priority = static_cast<std::uint8_t>(below(4));
        if (below(4) == 0) request.timeout = std::chrono::microseconds(below(3'000));
        if (!submit(ctx_, request)) return;
        switch (below(4)) {
            case 0: request.cancel(); break;
            case 1:
                hesitate();
                request.cancel();
                (void)wait(ctx_, request);
                break;
            case 2: (void)wait(ctx_, request); break;
            default: return hesitate();  // the destructor ends the request
        }
        const Time limit = osal_.now() + kLost;
        while (request.busy() && osal_.now() < limit) std::this_thread::yield();
        lost_ |= request.busy();
    }

    Context& ctx_;
    Osal& osal_;
    std::minstd_rand numbers_;
    bool lost_ = false;
};

TEST_F(Threads, RequestsOfAllKindsEndWhileTheOwnerChanges) {
    ASSERT_TRUE(config_map(ctx, image));
    std::atomic<int> left{3};
    std::atomic<int> lost{0};
    const auto work = [&](unsigned seed) {
        Worker worker(ctx, osal, seed);
        for (int n = 0; n < 150 && !worker.lost(); ++n) worker.one();
        lost += worker.lost() ? 1 : 0;
        --left;
        osal.wake();
    };
    std::thread first(work, 1);
    std::thread second(work, 2);
    std::thread third(work, 3);
    std::atomic<int> turn{0};
    const auto owns = [&](int me) {
        while (left > 0) {
            if (turn != me) {
                std::this_thread::yield();
                continue;
            }
            EXPECT_TRUE(take_ownership(ctx));
            for (int n = 0; n < 5; ++n)
                osal.wait(std::min(poll(ctx, osal.now()), osal.now() + 1ms), wire.wait_handle());
            turn = 1 - me;
        }
    };
    std::thread other_owner(owns, 1);
    owns(0);
    other_owner.join();
    first.join();
    second.join();
    third.join();
    ASSERT_TRUE(take_ownership(ctx));
    EXPECT_EQ(lost, 0);
    EXPECT_TRUE(config_init(ctx));
}

// ------------------------------------------------------------------ the ring between two threads

TEST(ThreadsRing, AReaderSeesRisingValuesAndNoneThatWasCleared) {
    for (const std::size_t size : {1U, 2U, 3U, 7U, 64U}) {
        std::vector<std::uint64_t> memory(size);
        WritableRing<std::uint64_t> ring{std::span(memory)};
        std::atomic<bool> stop{false};
        std::atomic<std::uint64_t> first_left{0};
        std::atomic<int> wrong{0};
        std::thread reader([&] {
            std::uint64_t last = 0;
            while (!stop) {
                const std::uint64_t low = first_left.load();
                const auto value = ring.take();
                if (!value) continue;
                wrong += *value <= last || *value < low ? 1 : 0;
                last = *value;
            }
        });
        for (std::uint64_t value = 1; value <= 20'000; ++value) {
            (void)ring.add(value);
            if (value % 5 == 0) {
                ring.clear();
                first_left = value + 1;
            }
            if (value % 64 == 0) std::this_thread::yield();
        }
        stop = true;
        reader.join();
        ring.clear();
        EXPECT_FALSE(ring.take());
        EXPECT_EQ(wrong, 0) << "size " << size;
        for (std::size_t n = 0; n < size; ++n) EXPECT_TRUE(ring.add(n)) << size;
        EXPECT_FALSE(ring.add(0)) << "the ring has " << size << " places";
    }
}

}  // namespace
}  // namespace margay
