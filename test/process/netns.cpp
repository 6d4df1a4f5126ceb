#include "netns.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

namespace margay::process {
namespace {

std::string unique(const std::string& what) {
    static std::atomic<int> count = 0;
    return "margay-" + std::to_string(::getpid()) + "-" + std::to_string(count++) + "-" + what;
}

std::string read_file(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

bool enter(const std::string& name_space) {
    const int handle = ::open(("/run/netns/" + name_space).c_str(), O_RDONLY | O_CLOEXEC);
    if (handle < 0) return false;
    const bool entered = ::setns(handle, CLONE_NEWNET) == 0;
    ::close(handle);
    return entered;
}

constexpr auto kGlance = std::chrono::milliseconds(2);

}  // namespace

bool run(const std::string& command, std::string* said) {
    std::FILE* pipe = ::popen((command + " 2>&1").c_str(), "r");
    if (pipe == nullptr) return false;
    std::array<char, 256> line;
    while (std::fgets(line.data(), line.size(), pipe) != nullptr)
        if (said != nullptr) *said += line.data();
    return ::pclose(pipe) == 0;
}

Cable::Cable() : master_(unique("m")), segment_(unique("s")) {
    std::string said;
    const bool made =
        run("ip netns add " + master_, &said) && run("ip netns add " + segment_, &said) &&
        run("ip -n " + master_ + " link add " + kMaster + " type veth peer name " + kSegment + " netns " + segment_,
            &said) &&
        run("ip -n " + master_ + " link set " + kMaster + " up", &said) &&
        run("ip -n " + segment_ + " link set " + kSegment + " up", &said);
    if (!made) missing_ = "no network namespaces with a veth pair here: " + said;
}

Cable::~Cable() {
    // Removes everything that was created, in any state of the test. The interfaces are removed with their namespaces.
    for (const auto& name : {master_, segment_})
        if (std::filesystem::exists("/run/netns/" + name)) run("ip netns del " + name);
}

bool Cable::ip(const std::string& name_space, const std::string& arguments) const {
    std::string said;
    const bool done = run("ip -n " + name_space + " " + arguments, &said);
    EXPECT_TRUE(done) << "ip " << arguments << ": " << said;
    return done;
}

void Cable::inside(const std::string& name_space, const std::function<void()>& what) {
    const int home = ::open("/proc/thread-self/ns/net", O_RDONLY | O_CLOEXEC);
    ASSERT_GE(home, 0);
    ASSERT_TRUE(enter(name_space)) << std::strerror(errno);
    what();
    ASSERT_EQ(::setns(home, CLONE_NEWNET), 0) << std::strerror(errno);
    ::close(home);
}

Child::Child(const std::string& name_space, const std::vector<std::string>& arguments)
    : folder_(std::filesystem::temp_directory_path() / unique("child")) {
    std::filesystem::create_directories(folder_);
    const auto out = folder_ + "/out";
    const auto err = folder_ + "/err";
    std::vector<char*> raw;
    for (const auto& argument : arguments) raw.push_back(const_cast<char*>(argument.c_str()));
    raw.push_back(nullptr);
    id_ = ::fork();
    EXPECT_GE(id_, 0);
    if (id_ != 0) return;
    // The child process: only calls that are safe after fork().
    const int to_out = ::open(out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    const int to_err = ::open(err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    if (::dup2(to_out, 1) < 0 || ::dup2(to_err, 2) < 0 || !enter(name_space)) ::_exit(126);
    ::execv(raw[0], raw.data());
    ::_exit(127);
}

Child::~Child() {
    if (id_ > 0 && !ended()) {
        ::kill(id_, SIGKILL);
        ::waitpid(id_, nullptr, 0);
    }
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
}

bool Child::ended() {
    if (id_ <= 0) return true;
    int status = 0;
    if (::waitpid(id_, &status, WNOHANG) != id_) return false;
    id_ = -1;
    exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    return true;
}

int Child::wait(std::chrono::seconds limit) {
    const auto until = std::chrono::steady_clock::now() + limit;
    while (!ended()) {
        if (std::chrono::steady_clock::now() > until) {
            ::kill(id_, SIGKILL);
            ::waitpid(id_, nullptr, 0);
            id_ = -1;
            return -1;
        }
        std::this_thread::sleep_for(kGlance);
    }
    return exit_code_;
}

bool Child::says(const std::string& text, std::chrono::seconds limit) {
    const auto until = std::chrono::steady_clock::now() + limit;
    for (;;) {
        const bool over = ended();  // read first, so that the last output of the program is complete
        if (output().find(text) != std::string::npos) return true;
        if (over || std::chrono::steady_clock::now() > until) return false;
        std::this_thread::sleep_for(kGlance);
    }
}

void Child::send(int signal) const {
    if (id_ > 0) (void)::kill(id_, signal);
}

void Child::terminate() {
    if (id_ > 0) ::kill(id_, SIGTERM);
}

std::string Child::output() const { return read_file(folder_ + "/out"); }
std::string Child::errors() const { return read_file(folder_ + "/err"); }

}  // namespace margay::process
