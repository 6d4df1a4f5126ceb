// Writes mailbox messages to a recording for tshark and reads the output of tshark.
#pragma once

#include "wire/mailbox.hpp"

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

namespace margay::testing_tshark {

[[nodiscard]] inline bool installed() { return std::system("command -v tshark >/dev/null 2>&1") == 0; }

[[nodiscard]] inline std::string number(std::uint64_t value, int bytes) {
    std::string out;
    for (int i = 0; i < bytes; ++i) out += static_cast<char>(value >> (8 * i));
    return out;
}

class MailboxPcap {
  public:
    explicit MailboxPcap(const std::string& path) : file_(path, std::ios::binary) {
        file_ << number(0xA1B2C3D4, 4) << number(2, 2) << number(4, 2) << number(0, 8) << number(65535, 4)
              << number(1, 4);
    }
    // The message in a frame on its way back, as a master reads it.
    void add(const std::vector<std::byte>& message) {
        std::string frame(6, '\xFF');
        frame += std::string("\x02\x01\x01\x01\x01\x01\x88\xA4", 8);
        frame += number(0x1000 | (message.size() + 12), 2);
        frame += number(4, 1) + number(0, 1) + number(0x1001, 2) + number(0x1100, 2) + number(message.size(), 2) +
                 number(0, 2);
        frame.append(reinterpret_cast<const char*>(message.data()), message.size());
        frame += number(1, 2);
        file_ << number(++count_, 4) << number(0, 4) << number(frame.size(), 4) << number(frame.size(), 4) << frame;
    }

  private:
    std::ofstream file_;
    std::uint32_t count_ = 0;
};

// The output of a command, line by line; tabs separate the columns.
[[nodiscard]] inline std::vector<std::vector<std::string>> table_of(const std::string& command) {
    std::vector<std::vector<std::string>> lines;
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(::popen(command.c_str(), "r"), ::pclose);
    if (!pipe) return lines;
    lines.emplace_back(1);
    for (int c = 0; (c = std::fgetc(pipe.get())) != EOF;) {
        if (c == '\n')
            lines.emplace_back(1);
        else if (c == '\t')
            lines.back().emplace_back();
        else
            lines.back().back() += static_cast<char>(c);
    }
    lines.pop_back();  // behind the end of the last line
    return lines;
}

// The given fields of each packet.
[[nodiscard]] inline std::vector<std::vector<std::string>> fields_of(const std::string& file,
                                                                     std::initializer_list<const char*> fields) {
    std::string command = "tshark -n -r '" + file + "' -T fields -E separator=/t";
    for (const char* field : fields) command += std::string(" -e ") + field;
    return table_of(command + " 2>/dev/null");
}

}  // namespace margay::testing_tshark
