#include "far_end.hpp"

#include "oshw/linux/packet_nic.hpp"

#include <poll.h>
#include <sched.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <thread>

namespace margay::bench {

bool make_cable(std::string& why) {
    if (::unshare(CLONE_NEWNET) != 0) {
        why = std::string("no network namespace of its own: ") + std::strerror(errno);
        return false;
    }
    const std::string make = std::string("ip link add ") + kNear +
                             " type veth peer name far 2>/dev/null && ip link set " + kNear +
                             " up && ip link set far up";
    if (std::system(make.c_str()) == 0) return true;
    why = "no veth pair could be made";
    return false;
}

namespace {

class ThreadEcho final : public FarEnd {
  public:
    explicit ThreadEcho(const Answer& answer) : answer_(answer) {}
    ~ThreadEcho() override {
        stop_.store(true);
        if (thread_.joinable()) thread_.join();
    }
    [[nodiscard]] bool start(std::string& why) {
        if (!nic_.open("far", PacketNic::Side::segment)) {
            why = nic_.problem();
            return false;
        }
        thread_ = std::thread([this] { run(); });
        return true;
    }
    [[nodiscard]] std::string name() const override {
        return "a thread at the far end of a veth pair, on a core of its own";
    }

  private:
    void run() {
        std::array<std::byte, 1518> frame{};
        while (!stop_.load(std::memory_order_relaxed)) {
            const std::size_t length = nic_.receive(frame);
            if (length < answer_.frame_bytes) continue;
            frame[6] |= std::byte{2};
            frame[answer_.wkc_at] = static_cast<std::byte>(answer_.wkc);
            frame[answer_.wkc_at + 1] = static_cast<std::byte>(answer_.wkc >> 8);
            (void)nic_.send(std::span(frame).first(length));
        }
    }

    Answer answer_;
    PacketNic nic_;
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

}  // namespace

std::unique_ptr<FarEnd> echo_by_thread(const Answer& answer, std::string& why) {
    auto echo = std::make_unique<ThreadEcho>(answer);
    if (!echo->start(why)) return nullptr;
    return echo;
}

}  // namespace margay::bench
