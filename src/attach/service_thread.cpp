#include "attach/service_thread.hpp"

#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>

namespace margay::attach {

std::string ServiceThread::start(const char* name, std::function<void()> run) {
    wake_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (wake_ < 0) return std::string("no eventfd: ") + std::strerror(errno);
    // This thread receives no signals: the signals of the application are for its own threads.
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    std::string failed;
    try {
        thread_ = std::thread([name, run = std::move(run)] {
            const sched_param ordinary{};
            (void)pthread_setschedparam(pthread_self(), SCHED_OTHER, &ordinary);
            (void)pthread_setname_np(pthread_self(), name);
            run();
        });
    } catch (const std::system_error& error) {
        failed = std::string("no thread: ") + error.what();
    }
    pthread_sigmask(SIG_SETMASK, &before, nullptr);
    return failed;
}

void ServiceThread::stop() {
    stopping_ = true;
    if (wake_ >= 0) (void)::eventfd_write(wake_, 1);
    if (thread_.joinable()) thread_.join();
    if (wake_ >= 0) ::close(wake_);
    wake_ = -1;
}

}  // namespace margay::attach
