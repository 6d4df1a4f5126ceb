// The parts that the test programs of a hosted system give to the suite: output of lines, a second thread, a second
// clock, and a slave at the far end of a cable.
#pragma once

#include "port/suite/port_suite.hpp"

#include <margay/parts/osal/linux/linux_osal.hpp>
#include <margay/parts/oshw/linux/packet_nic.hpp>
#include <margay/parts/oshw/simulated/simulated_nic.hpp>
#include <margay/parts/sim/devices.hpp>

#include <atomic>
#include <chrono>
#include <string>
#include <thread>
#include <vector>

namespace margay::port {

// One slave, powered up.
inline void put_slave_into(sim::Segment& segment, Time now) {
    auto device = sim::make_device("digital_io_16");
    segment.add(std::move(*device).assemble());
    segment.connect_master({0, 0});
    segment.power_up(now);
}

class Host {
  public:
    std::vector<std::string> lines;

    // The description of a port with threads. `this` must outlive it.
    [[nodiscard]] Port port(Osal& osal, Nic* nic = nullptr) {
        Port port = without_threads(osal, nic);
        port.call_later = [](void* self, Duration delay, void (*function)(void*), void* argument) {
            static_cast<Host*>(self)->threads_.emplace_back([=] {
                std::this_thread::sleep_for(delay);
                function(argument);
            });
        };
        port.several_threads = true;
        port.calls_at_once = 2;
        port.second_clock = [](void*) -> Duration { return std::chrono::steady_clock::now().time_since_epoch(); };
        port.latest = std::chrono::milliseconds(50);  // the machine of the tests is busy
        return port;
    }
    [[nodiscard]] Port without_threads(Osal& osal, Nic* nic) {
        Port port;
        port.watched = {};  // only the checks themselves; in virtual time a test sets more
        port.osal = &osal;
        port.nic = nic;
        port.user = this;
        port.print = [](void* self, std::string_view line) { static_cast<Host*>(self)->lines.emplace_back(line); };
        return port;
    }

    [[nodiscard]] std::string text() const {
        std::string all;
        for (const auto& line : lines) all += line + "\n";
        return all;
    }
    // The name of the check that began last.
    [[nodiscard]] std::string begun() const {
        const auto names = names_after("run   ");
        return names.empty() ? std::string() : names.back();
    }
    // The names of the checks that have failed.
    [[nodiscard]] std::vector<std::string> failed() const { return names_after("FAIL  "); }
    [[nodiscard]] std::vector<std::string> skipped() const { return names_after("skip  "); }

  private:
    [[nodiscard]] std::vector<std::string> names_after(const std::string& word) const {
        std::vector<std::string> names;
        for (const auto& line : lines)
            if (line.starts_with(word)) names.push_back(line.substr(word.size(), line.find(": ") - word.size()));
        return names;
    }
    std::vector<std::jthread> threads_;
};

// A slave in its own thread, at the far end of a real cable.
class SlaveOnCable {
  public:
    explicit SlaveOnCable(PacketNic& nic) : nic_(nic) {
        put_slave_into(segment_, osal_.now());
        thread_ = std::jthread([this](const std::stop_token& stop) { serve(stop); });
    }

  private:
    void serve(const std::stop_token& stop) {
        std::array<std::byte, 1600> frame{};
        while (!stop.stop_requested()) {
            const auto length = nic_.receive(frame);
            if (length == 0) {
                osal_.wait(osal_.now() + std::chrono::milliseconds(20), nic_.wait_handle());
                continue;
            }
            const auto bytes = std::span(frame).first(length);
            if (!segment_.process(bytes, osal_.now(), 0, Duration{0}).returned) continue;
            while (nic_.send(bytes) == SendStatus::busy && !stop.stop_requested()) std::this_thread::yield();
        }
    }

    LinuxOsal osal_;
    sim::Segment segment_;
    PacketNic& nic_;
    std::jthread thread_;
};

}  // namespace margay::port
