// Two threads count under the lock of the SOEM interfaces. The test builds this program with ThreadSanitizer, which
// must see no race when the kernel passes the lock on. Ends with 0 when everything is as expected.
#include "compat/soem/priority_lock.hpp"

#include <unistd.h>
#include <cstdio>
#include <mutex>
#include <thread>

int main() {
    constexpr unsigned kEach = 200;
    margay::soem::PriorityLock lock;
    unsigned count = 0;
    const auto work = [&] {
        for (unsigned n = 0; n < kEach; ++n) {
            const std::lock_guard hold(lock);
            ++count;
            usleep(10);  // the other thread waits in the kernel
        }
    };
    std::thread other(work);
    work();
    other.join();
    std::printf("%u\n", count);
    return count == 2 * kEach ? 0 : 1;
}
