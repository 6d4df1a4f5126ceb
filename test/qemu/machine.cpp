#include "qemu/machine.hpp"

#include <places.hpp>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <thread>

namespace margay::qemu {
namespace {

const std::string kVirtualSegment = std::string(MARGAY_BIN_DIR) + "/virtual_segment";
const std::string kSegment = MARGAY_SOURCE_DIR "/samples/mps2_an386/segment.toml";
constexpr const char* kTap = "ecat-tap";

std::string content_of(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

int open_pipe(const std::string& path) {
    EXPECT_EQ(::mkfifo(path.c_str(), 0600), 0);
    return ::open(path.c_str(), O_RDWR | O_CLOEXEC);
}

void write_line(int to, const std::string& text) {
    const auto line = text + "\n";
    EXPECT_EQ(::write(to, line.data(), line.size()), static_cast<ssize_t>(line.size()));
}

}  // namespace

std::filesystem::path image(const std::string& name) {
    return std::filesystem::path(MARGAY_BIN_DIR) / "../nested" / (name + ".elf");
}

Machine::Machine(const std::string& image_name, const std::string& more) {
    const auto path = image(image_name);
    std::string said;
    if (!process::run("qemu-system-arm --version", &said))
        missing_ = "there is no qemu-system-arm";
    else if (!std::filesystem::exists(path))
        missing_ = "there is no " + path.lexically_normal().string() +
                   ": the tests embedded/… make it, with the ARM compiler and, for FreeRTOS, MARGAY_FREERTOS_DIR";
    else if (!std::filesystem::exists(kVirtualSegment))
        missing_ = kVirtualSegment + " is not built";
    else if (!cable_.missing().empty())
        missing_ = cable_.missing();
    else
        start(path, more);
}

void Machine::start(const std::filesystem::path& image_path, const std::string& more) {
    const auto& home = cable_.master_namespace();
    std::string said;
    if (!process::run("ip -n " + home + " tuntap add dev " + kTap + " mode tap", &said) ||
        !process::run("ip -n " + home + " link set " + kTap + " up", &said)) {
        missing_ = "no TAP device here: " + said;
        return;
    }
    auto name = (std::filesystem::temp_directory_path() / "margay-qemu-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
    segment_commands_ = open_pipe(file("segment"));
    qemu_commands_ = open_pipe(file("monitor"));
    segment_ = std::make_unique<process::Child>(
        home, std::vector<std::string>{
                  "/bin/sh", "-c", "exec " + kVirtualSegment + " " + kTap + " " + kSegment + " < " + file("segment")});
    if (!segment_->says("serving 4 slaves on", std::chrono::seconds(30))) {
        missing_ = "the segment does not start: " + segment_->errors();
        return;
    }
    qemu_ = std::make_unique<process::Child>(
        home, std::vector<std::string>{
                  "/bin/sh", "-c",
                  "exec qemu-system-arm -M mps2-an386 -display none -monitor stdio -serial file:" + file("uart") +
                      " -nic tap,id=net0,script=no,downscript=no,model=lan9118,ifname=" + kTap + " -kernel " +
                      image_path.string() + " " + more + " < " + file("monitor")});
}

Machine::~Machine() {
    qemu_.reset();
    segment_.reset();
    for (const int end : {segment_commands_, qemu_commands_})
        if (end >= 0) ::close(end);
    std::error_code ignored;
    if (!folder_.empty()) std::filesystem::remove_all(folder_, ignored);
}

std::string Machine::uart() const { return content_of(file("uart")); }

bool Machine::says(const std::string& text, std::chrono::seconds limit) {
    const auto until = std::chrono::steady_clock::now() + limit;
    for (;;) {
        // Whether a program has ended is checked before the UART is read. So the output of an ended program is
        // complete.
        const bool over = qemu_->ended() || segment_->ended();
        if (const auto at = uart().find(text, seen_); at != std::string::npos) {
            seen_ = at + text.size();
            return true;
        }
        if (over || std::chrono::steady_clock::now() > until) return false;
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
}

std::string Machine::report() const {
    return "UART:\n" + uart() + "\nsegment:\n" + segment_->output() + segment_->errors() + "\nQEMU:\n" +
           qemu_->errors();
}

std::string Machine::memory(std::uint32_t address, std::uint32_t octets) const {
    const auto path = file("memory");
    std::filesystem::remove(path);
    tell_qemu("pmemsave " + std::to_string(address) + " " + std::to_string(octets) + " \"" + path + "\"");
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    std::string all;
    while (all.size() != octets && std::chrono::steady_clock::now() < until) {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        all = content_of(path);
    }
    return all;
}

void Machine::tell_segment(const std::string& command) const { write_line(segment_commands_, command); }
void Machine::tell_qemu(const std::string& command) const { write_line(qemu_commands_, command); }

}  // namespace margay::qemu
