// Executes a command through the shell and returns its output.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace margay::process {

struct Ran {
    int status = -1;  // exit code; -1: ended by a signal
    std::string out{};
    std::string err{};
};

inline std::string content_of(const std::filesystem::path& path) {
    std::ifstream in(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
}

inline bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

// A temporary folder for each test, removed at the end.
class ShellFolder {
  public:
    ShellFolder() {
        auto name = (std::filesystem::temp_directory_path() / "margay-shell-XXXXXX").string();
        path_ = ::mkdtemp(name.data());
    }
    ~ShellFolder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    ShellFolder(const ShellFolder&) = delete;
    ShellFolder& operator=(const ShellFolder&) = delete;

    [[nodiscard]] const std::filesystem::path& path() const { return path_; }
    void write(const std::string& name, const std::string& text) const { std::ofstream(path_ / name) << text; }
    // A test program that replaces a program of the system.
    void write_script(const std::string& name, const std::string& text) const {
        std::filesystem::create_directories((path_ / name).parent_path());
        write(name, "#!/bin/sh\n" + text);
        std::filesystem::permissions(path_ / name, std::filesystem::perms::owner_all);
    }

    // Executes the command in the folder. Redirections in the command replace the ones that capture the output.
    [[nodiscard]] Ran run(const std::string& command) const {
        const auto whole = "cd '" + path_.string() + "' && exec >.out 2>.err </dev/null || exit 99\n" + command;
        const int status = std::system(whole.c_str());
        return {WIFEXITED(status) && WEXITSTATUS(status) < 128 ? WEXITSTATUS(status) : -1, content_of(path_ / ".out"),
                content_of(path_ / ".err")};
    }

  private:
    std::filesystem::path path_;
};

}  // namespace margay::process
