// The thread that polls before activation: it scans the segment, scans it again when slaves come or go, and serves the
// requests of other threads.
#include "compat/ecrt/bus.hpp"
#include "compat/ecrt/log.hpp"
#include "compat/ecrt/requests.hpp"

#include <algorithm>
#include <chrono>

namespace margay::compat::ecrt {

using namespace std::chrono_literals;

bool Bus::await_scan() const {
    for (int n = 0; n < 3000 && !active && scan_busy; ++n) std::this_thread::sleep_for(1ms);
    return !scan_busy;
}

// Requests the context from the thread that polls. A thread that became the owner here could take the context away from
// activation.
void Bus::ask_for_scan() {
    wanted.fetch_add(1);
    const std::lock_guard lock(turn);
    wanted.fetch_sub(1);
    if (!polling) return;
    scan_again();
    source->osal().wake();
}

void Bus::start_idle() {
    if (idle.joinable()) return;
    stop = false;
    std::unique_lock lock(turn);
    polling = true;
    idle = std::thread([this] { idle_loop(); });
    hand_back(lock);
}

// Returns when the thread that polls owns the context. `lock` holds `turn`.
void Bus::hand_back(std::unique_lock<std::mutex>& lock) {
    if (!polling) return;
    handed_over = false;
    source->osal().wake();
    taken_over.wait(lock, [this] { return handed_over; });
}

// For the thread that polls, which holds `turn`.
void Bus::take_over() {
    (void)take_ownership(*ctx);
    handed_over = true;
    taken_over.notify_all();
}

void Bus::stop_idle() {
    if (!idle.joinable()) return;
    stop = true;
    source->osal().wake();
    idle.join();
    (void)take_ownership(*ctx);
}

// A scan ends transfers. Those that are under way have 1 s to end by themselves.
bool Bus::spares_transfers(Time now) {
    if (search.spare_until == Time{}) search.spare_until = now + 1s;
    if (now < search.spare_until) {
        const std::unique_lock lock(config_mutex, std::try_to_lock);
        if (!lock.owns_lock() || are_under_way(*this)) return true;
    }
    search.spare_until = now;
    return false;
}

void Bus::step_search(Time now) {
    if (search.scanning) {
        if (search.scan.busy()) return;
        search.scanning = false;
        old_operations.clear();
        old_configs.clear();
        refresh_at = now;
        if (search.scan.state() == RequestState::error && search.scan.slaves == 0) {
            search.retry = now + 500ms;
        } else {
            search.watch.target = AlState::preop;
            search.watch.interval = 20ms;
            measure_ports();
            if (const auto begun = submit(*ctx, search.watch); !begun) search.retry = now + 500ms;
        }
        {
            const std::lock_guard lock(known_mutex);
            known_pdos.clear();
            pdos_written = false;
            known_objects.clear();
        }
        // A program that reads that the scan has ended reads its result too.
        dirty = true;
        while (dirty) refresh_facts(now);
        scan_busy = search.again;  // the next one follows
        const std::lock_guard lock(facts_mutex);
        first_scan_over = true;
        scanned.notify_all();
        return;
    }
    if (search.watch.busy()) {
        if (!search.again || spares_transfers(now)) return;
        search.watch.cancel();
    } else if (now < search.retry) {
        return;
    }
    if (spares_transfers(now)) return;
    search.again = false;
    if (!submit(*ctx, search.scan)) {
        search.retry = now + 500ms;
        return;
    }
    search.spare_until = {};
    search.scanning = true;
    scan_busy = true;
}

void Bus::idle_loop() {
    std::unique_lock lock(turn);
    take_over();
    Osal& osal = source->osal();
    while (!stop) {
        Time now = osal.now();
        Time next = poll(*ctx, now);
        step_search(now);
        if (dirty || now >= refresh_at) refresh_facts(now);
        begin_waiting(*this);
        next = std::min({next, source->next_arrival(), now + 50ms});
        lock.unlock();
        osal.wait(next, source->wait_handles());
        while (wanted.load() != 0 && !stop) std::this_thread::yield();
        lock.lock();
        take_over();
    }
    polling = false;
}

}  // namespace margay::compat::ecrt
