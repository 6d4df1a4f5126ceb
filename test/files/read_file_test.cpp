// Which names read_file() accepts. It never waits for a program that writes.
#include <margay/files/text_place.hpp>

#include "replay/files.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <string>
#include <thread>

namespace margay::files {
namespace {

// Ends the wait of a reader that opens the FIFO, so that the test fails with a wrong text and does not hang.
class Waker {
  public:
    explicit Waker(const std::string& fifo)
        : thread_([this, fifo] {
              while (!stop_) {
                  if (const int fd = ::open(fifo.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC); fd >= 0) ::close(fd);
                  std::this_thread::sleep_for(std::chrono::milliseconds(1));
              }
          }) {}
    ~Waker() {
        stop_ = true;
        thread_.join();
    }
    Waker(const Waker&) = delete;
    Waker& operator=(const Waker&) = delete;

  private:
    std::atomic<bool> stop_ = false;
    std::thread thread_;
};

TEST(ReadFile, AFifoAndALinkToItAreNoFiles) {
    const TemporaryFolder folder;
    const auto fifo = folder.file("fifo");
    const auto link = folder.file("link");
    const auto far = folder.file("far");
    ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
    std::filesystem::create_symlink("fifo", link);
    std::filesystem::create_symlink(link, far);
    const Waker waker(fifo);
    for (const auto& path : {fifo, link, far}) EXPECT_EQ(read_file(path).error, path + ": is no file");
    // Of all names below /dev, only the names of open descriptors may be names of a pipe.
    const auto shared = "/dev/shm/margay-fifo-" + std::to_string(::getpid());
    std::error_code error;
    std::filesystem::create_symlink(fifo, shared, error);
    if (error) return;
    EXPECT_EQ(read_file(shared).error, shared + ": is no file");
    std::filesystem::remove(shared);
}

TEST(ReadFile, ALinkToAFileAndAPipeThatIsOpenAreRead) {
    const TemporaryFolder folder;
    folder.write("file", "octets");
    const auto link = folder.file("link");
    std::filesystem::create_symlink("file", link);
    EXPECT_EQ(read_file(link).octets, "octets") << read_file(link).error;
    const auto lost = folder.file("lost");
    std::filesystem::create_symlink("nowhere", lost);
    EXPECT_EQ(read_file(lost).error, lost + ": cannot be read: No such file or directory");
    for (const std::string of : {"/dev/fd/", "/proc/self/fd/", ""}) {
        int ends[2] = {-1, -1};
        ASSERT_EQ(::pipe2(ends, O_CLOEXEC), 0);
        ASSERT_EQ(::write(ends[1], "piped", 5), 5);
        ::close(ends[1]);
        auto path = of + std::to_string(ends[0]);
        if (of.empty()) {
            std::filesystem::create_symlink("/dev/fd/" + path, folder.file("pipe"));
            path = folder.file("pipe");
        }
        EXPECT_EQ(read_file(path).octets, "piped") << path << read_file(path).error;
        ::close(ends[0]);
    }
}

}  // namespace
}  // namespace margay::files
