// The threads of the interrupts of a NIC. The test makes folders like /proc and /sys, in which threads of the test have
// the names of interrupt threads.
#include "osal/linux/irq_threads.hpp"
#include "osal/linux/cyclic_runner.hpp"

#include <gtest/gtest.h>
#include <linux/capability.h>
#include <sched.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <condition_variable>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <string>
#include <thread>

namespace margay {
namespace {

namespace fs = std::filesystem;

// Sleeps until the end of the test.
class Sleeper {
  public:
    Sleeper()
        : thread_([this] {
              std::unique_lock lock(mutex_);
              id_ = static_cast<int>(::gettid());
              changed_.notify_all();
              changed_.wait(lock, [this] { return ended_; });
          }) {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return id_ != 0; });
    }
    ~Sleeper() {
        {
            const std::lock_guard lock(mutex_);
            ended_ = true;
        }
        changed_.notify_all();
        thread_.join();
    }
    [[nodiscard]] int id() const { return id_; }
    [[nodiscard]] std::pair<int, int> scheduling() const {
        sched_param now{};
        (void)::sched_getparam(id_, &now);
        return {::sched_getscheduler(id_), now.sched_priority};
    }
    void set(int policy, int priority) const {
        const sched_param wanted{.sched_priority = priority};
        ASSERT_EQ(::sched_setscheduler(id_, policy, &wanted), 0);
    }

  private:
    std::mutex mutex_;
    std::condition_variable changed_;
    int id_ = 0;
    bool ended_ = false;
    std::thread thread_;
};

using Scheduling = std::pair<int, int>;

struct IrqThreadsTest : testing::Test {
    fs::path folder;
    std::string proc, sys;
    Sleeper first, second, other;
    IrqThreads threads;

    void SetUp() override {
        std::string name = fs::temp_directory_path() / "margay-irq-XXXXXX";
        ASSERT_NE(::mkdtemp(name.data()), nullptr);
        folder = name;
        proc = folder / "proc";
        sys = folder / "sys";
        fs::create_directories(sys);
        fs::create_directories(fs::path(proc) / "sys");
        add(other, "irq/30-nvme0q1");
    }
    void TearDown() override { fs::remove_all(folder); }
    void add(const Sleeper& thread, const std::string& name) const {
        const auto own = fs::path(proc) / std::to_string(thread.id());
        fs::create_directories(own);
        std::ofstream(own / "comm") << name << "\n";
    }
    [[nodiscard]] IrqThreads::Places places() const { return {proc.c_str(), sys.c_str()}; }
    // Whether this process may set real-time priorities.
    [[nodiscard]] bool may() const {
        const sched_param wanted{.sched_priority = 1};
        const sched_param none{};
        const bool set = ::sched_setscheduler(other.id(), SCHED_FIFO, &wanted) == 0;
        (void)::sched_setscheduler(other.id(), SCHED_OTHER, &none);
        return set;
    }
};

TEST_F(IrqThreadsTest, AreFoundByTheNameOfTheInterface) {
    EXPECT_FALSE(threads.find("eth0", places()));
    add(first, "irq/24-eth0");
    add(second, "irq/125-eth0-Tx");
    EXPECT_TRUE(threads.find("eth0", places()));
    ASSERT_EQ(threads.all().size(), 2U);
    unsigned sum = 0;
    for (const IrqThread& thread : threads.all()) sum += thread.irq;
    EXPECT_EQ(sum, 24U + 125U);
    add(first, "irq/24-eth01");
    add(second, "irq/25-s-eth0");
    EXPECT_TRUE(threads.find("eth0", places()));
    ASSERT_EQ(threads.all().size(), 1U) << "eth01 is another interface; s- is the thread of a shared interrupt";
    EXPECT_EQ(threads.all()[0].irq, 25U);
    EXPECT_EQ(threads.all()[0].id, second.id());
    EXPECT_EQ(std::string(threads.all()[0].name.data()), "irq/25-s-eth0");
    for (const char* odd : {"irq/x-eth0", "irq/24", "irq/-eth0", "irq/24x-eth0", "", "eth0", "irq/24-"}) {
        add(second, odd);
        EXPECT_FALSE(threads.find("eth0", places())) << odd;
    }
    EXPECT_FALSE(threads.find("", places()));
    EXPECT_FALSE(threads.find("eth0", {"/nowhere", "/nowhere"}));
    EXPECT_FALSE(threads.find(std::string(1000, 'x'), places()));
}

TEST_F(IrqThreadsTest, AreFoundByTheInterruptsOfTheDevice) {
    add(first, "irq/24-mlx5_comp0@");
    add(second, "irq/40-virtio1-inp");
    const auto device = fs::path(sys) / "devices/pci0/0000:01:00.0";
    fs::create_directories(device / "msi_irqs");
    std::ofstream(device / "msi_irqs/24") << "msix\n";
    fs::create_directories(device / "virtio1");
    fs::create_directories(fs::path(sys) / "class/net/eth0");
    fs::create_directories(fs::path(sys) / "class/net/eth1");
    fs::create_symlink(device, fs::path(sys) / "class/net/eth0/device");
    fs::create_symlink(device / "virtio1", fs::path(sys) / "class/net/eth1/device");
    ASSERT_TRUE(threads.find("eth0", places()));
    ASSERT_EQ(threads.all().size(), 1U);
    EXPECT_EQ(threads.all()[0].id, first.id());
    // A virtio device has the interrupts of the device above it. The device above any other device is a bridge, and its
    // interrupts are not those of the NIC.
    std::ofstream(device / "msi_irqs/40") << "msix\n";
    fs::remove(device / "msi_irqs/24");
    ASSERT_TRUE(threads.find("eth1", places()));
    ASSERT_EQ(threads.all().size(), 1U);
    EXPECT_EQ(threads.all()[0].id, second.id());
    std::ofstream(fs::path(sys) / "devices/pci0/24") << "";
    fs::create_directories(fs::path(sys) / "devices/pci0/msi_irqs");
    std::ofstream(fs::path(sys) / "devices/pci0/msi_irqs/24") << "msix\n";
    fs::remove(device / "msi_irqs/40");
    EXPECT_FALSE(threads.find("eth0", places()));
}

TEST_F(IrqThreadsTest, TheirPriorityIsSetAndRestored) {
    if (!may()) GTEST_SKIP() << "no real-time priorities without CAP_SYS_NICE";
    add(first, "irq/24-eth0");
    add(second, "irq/25-eth0");
    first.set(SCHED_FIFO, 50);
    ASSERT_TRUE(threads.find("eth0", places()));
    EXPECT_EQ(threads.set_priority(81), 0);
    EXPECT_EQ(first.scheduling(), Scheduling(SCHED_FIFO, 81));
    EXPECT_EQ(second.scheduling(), Scheduling(SCHED_FIFO, 81));
    EXPECT_EQ(threads.restore(), 0);
    EXPECT_EQ(first.scheduling(), Scheduling(SCHED_FIFO, 50));
    EXPECT_EQ(second.scheduling(), Scheduling(SCHED_OTHER, 0));
    EXPECT_EQ(threads.set_priority(81), 0);
    first.set(SCHED_RR, 7);
    EXPECT_EQ(threads.restore(), 0);
    EXPECT_EQ(first.scheduling(), Scheduling(SCHED_RR, 7)) << "another program has changed it since";
    EXPECT_EQ(threads.set_priority(81), 0);
    first.set(SCHED_FIFO, 33);
    EXPECT_EQ(threads.restore(), 0);
    EXPECT_EQ(first.scheduling(), Scheduling(SCHED_FIFO, 33)) << "the same";
    EXPECT_EQ(threads.set_priority(100), EINVAL);
    EXPECT_EQ(second.scheduling(), Scheduling(SCHED_OTHER, 0));
    EXPECT_EQ(other.scheduling(), Scheduling(SCHED_OTHER, 0)) << "not of this interface";
}

TEST_F(IrqThreadsTest, ARefusedPriorityDoesNotPreventTheRestoring) {
    if (!may()) GTEST_SKIP() << "no real-time priorities without CAP_SYS_NICE";
    add(first, "irq/24-eth0");
    ASSERT_TRUE(threads.find("eth0", places()));
    EXPECT_EQ(threads.set_priority(81), 0);
    EXPECT_EQ(threads.set_priority(100), EINVAL);
    EXPECT_EQ(first.scheduling(), Scheduling(SCHED_FIFO, 81));
    EXPECT_EQ(threads.restore(), 0);
    EXPECT_EQ(first.scheduling(), Scheduling(SCHED_OTHER, 0));
}

TEST_F(IrqThreadsTest, TheRunnerTellsThemAndTouchesThemOnlyWhenAsked) {
    if (!may()) GTEST_SKIP() << "no real-time priorities without CAP_SYS_NICE";
    add(first, "irq/24-eth0");
    first.set(SCHED_FIFO, 50);
    CyclicOptions options{.lock_memory = false, .hold_latency = false, .interface = "eth0", .places = places()};
    {
        CyclicRunner runner(options);
        EXPECT_TRUE(runner.prepare().empty());
        ASSERT_EQ(runner.irq_threads().size(), 1U);
        EXPECT_EQ(runner.irq_threads()[0].priority, 50);
        EXPECT_EQ(first.scheduling(), Scheduling(SCHED_FIFO, 50));
    }
    options.irq_priority = 82;
    {
        CyclicRunner runner(options);
        EXPECT_TRUE(runner.prepare().empty());
        EXPECT_EQ(first.scheduling(), Scheduling(SCHED_FIFO, 82));
        EXPECT_TRUE(runner.prepare().empty());
        EXPECT_EQ(runner.irq_threads()[0].priority, 50) << "prepared again, it does not take its own for theirs";
    }
    EXPECT_EQ(first.scheduling(), Scheduling(SCHED_FIFO, 50));
    CyclicRunner runner(options);
    EXPECT_TRUE(runner.prepare().empty());
    EXPECT_TRUE(runner.finish().empty());
    EXPECT_EQ(first.scheduling(), Scheduling(SCHED_FIFO, 50));
}

TEST_F(IrqThreadsTest, TheRunnerSaysInWordsWhatWasRefused) {
    CyclicOptions options{
        .lock_memory = false, .hold_latency = false, .interface = "eth0", .irq_priority = 82, .places = places()};
    CyclicRunner none(options);
    const auto refusals = none.prepare();
    ASSERT_EQ(refusals.size(), 1U);
    EXPECT_EQ(refusals[0].error, ENOENT);
    EXPECT_NE(std::string(refusals[0].what).find("this kernel handles them without threads"), std::string::npos);
    add(first, "irq/24-eth0");
    std::thread([&] {  // this thread gives up its capabilities
        __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
        __user_cap_data_struct no_capabilities[2]{};
        ASSERT_EQ(::syscall(SYS_capset, &header, no_capabilities), 0);
        CyclicRunner runner(options);
        const auto said = runner.prepare();
        ASSERT_EQ(said.size(), 1U);
        EXPECT_EQ(said[0].error, EPERM);
        EXPECT_EQ(std::string(said[0].what), "the interrupts of the NIC keep their priority (needs CAP_SYS_NICE)");
    })
        .join();
    options.irq_priority = 100;
    CyclicRunner wrong(options);
    ASSERT_EQ(wrong.prepare().size(), 1U);
    EXPECT_EQ(first.scheduling(), Scheduling(SCHED_OTHER, 0));
}

TEST_F(IrqThreadsTest, AreDescribedAgainstThePriorityOfTheCycle) {
    IrqThread thread{.id = 50, .irq = 24, .policy = SCHED_FIFO, .priority = 50, .name = {"irq/24-eth0"}};
    std::array<char, 256> text{};
    EXPECT_TRUE(is_above(thread, 49));
    EXPECT_EQ(std::string(describe(thread, 49, text)),
              "irq/24-eth0 (thread 50) has the priority 50, above that of the cycle");
    EXPECT_FALSE(is_above(thread, 50));
    EXPECT_EQ(std::string(describe(thread, 80, text)),
              "irq/24-eth0 (thread 50) has the priority 50, not above that of the cycle (80): replies wait while a "
              "thread of that priority uses its processor; mend it with: chrt -f -p 81 50");
    EXPECT_EQ(std::string(describe(thread, 99, text)),
              "irq/24-eth0 (thread 50) has the priority 50, not above that of the cycle (99): replies wait while a "
              "thread of that priority uses its processor; give the cycle a lower priority: no thread can be above 99");
    thread.policy = SCHED_OTHER;
    EXPECT_FALSE(is_above(thread, 0)) << "without a real-time policy";
}

}  // namespace
}  // namespace margay
