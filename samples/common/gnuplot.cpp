#include "common/gnuplot.hpp"

#include <fmt/format.h>

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

namespace margay::samples {
namespace {

// A gnuplot string in single quotes. Only the quote itself is a special character in it.
std::string gnuplot_string(const std::string& text) {
    std::string out = "'";
    for (const char c : text) {
        if (c == '\'') out += '\'';
        if (c != '\n' && c != '\r') out += c;
    }
    return out + "'";
}

std::string gnuplot_script(const std::string& path, const std::vector<double>& times_s,
                           const std::vector<Diagram>& diagrams) {
    std::string text = "$rows << END_OF_ROWS\n";
    for (std::size_t row = 0; row < times_s.size(); ++row) {
        text += fmt::format("{:.6f}", times_s[row]);
        for (const Diagram& diagram : diagrams)
            for (const Diagram::Curve& curve : diagram.curves) text += fmt::format(" {}", curve.values[row]);
        text += '\n';
    }
    text += fmt::format("END_OF_ROWS\nset terminal svg size 1000,{} background rgb 'white'\nset output {}\n",
                        260 * diagrams.size(), gnuplot_string(path));
    text += fmt::format("set multiplot layout {},1\nset grid\nset xlabel 's'\n", diagrams.size());
    std::size_t column = 2;
    for (const Diagram& diagram : diagrams) {
        text += fmt::format("set title {} noenhanced\nset ylabel {} noenhanced\nplot ", gnuplot_string(diagram.title),
                            gnuplot_string(diagram.unit));
        for (std::size_t n = 0; n < diagram.curves.size(); ++n, ++column)
            text += fmt::format("{}$rows using 1:{} with lines title {} noenhanced", n == 0 ? "" : ", ", column,
                                gnuplot_string(diagram.curves[n].name));
        text += '\n';
    }
    return text + "unset multiplot\nset output\n";
}

// A file with a unique name that exists as long as the object.
class TemporaryFile {
  public:
    TemporaryFile() {
        std::error_code failed;
        path_ = (std::filesystem::temp_directory_path(failed) / "margay-XXXXXX").string();
        const int handle = ::mkstemp(path_.data());
        exists_ = handle >= 0 && ::close(handle) == 0;
    }
    TemporaryFile(const TemporaryFile&) = delete;
    TemporaryFile& operator=(const TemporaryFile&) = delete;
    ~TemporaryFile() {
        if (exists_) (void)std::remove(path_.c_str());
    }
    [[nodiscard]] bool exists() const { return exists_; }
    [[nodiscard]] const std::string& path() const { return path_; }
    [[nodiscard]] std::string content() const {
        std::ifstream file(path_, std::ios::binary);
        return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
    }

  private:
    std::string path_;
    bool exists_ = false;
};

// Writes to the file, device or pipe that the path names. Returns a sentence about the failure, or an empty text.
std::string write_drawing(const std::string& path, const std::string& content) {
    std::FILE* file = std::fopen(path.c_str(), "wb");
    bool well = file != nullptr && std::fwrite(content.data(), 1, content.size(), file) == content.size();
    int reason = errno;
    if (file != nullptr && std::fclose(file) != 0) {
        if (well) reason = errno;
        well = false;
    }
    return well ? std::string() : fmt::format("{}: cannot be written: {}", path, std::strerror(reason));
}

}  // namespace

std::string draw_svg(const std::string& path, const std::vector<double>& times_s,
                     const std::vector<Diagram>& diagrams) {
    constexpr const char* kMissing = "gnuplot could not draw; is the package gnuplot-nox installed?";
    if (times_s.empty()) return "there is nothing to draw";
    // gnuplot does not report that a disk is full. The drawing is complete in a temporary file before `path` is
    // touched.
    const TemporaryFile drawing;
    if (!drawing.exists()) return "there is no place for a temporary file";
    std::FILE* pipe = ::popen("gnuplot 2>/dev/null", "w");
    if (pipe == nullptr) return kMissing;
    const std::string text = gnuplot_script(drawing.path(), times_s, diagrams);
    const bool written = std::fwrite(text.data(), 1, text.size(), pipe) == text.size();
    const bool ended = ::pclose(pipe) == 0;
    if (!written || !ended) return kMissing;
    const std::string content = drawing.content();
    if (content.find("</svg>") == std::string::npos) return "the drawing is not complete; is the disk full?";
    return write_drawing(path, content);
}

}  // namespace margay::samples
