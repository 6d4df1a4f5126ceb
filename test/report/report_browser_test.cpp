// The page in Chromium: no message in its console, nothing wider than the window, light and dark, as a printed page.
#include "report/report_fixture.hpp"

#include <fmt/format.h>

#include <cstdlib>

namespace margay::segment_report {
namespace {

using process::contains;
using process::content_of;

class ReportBrowser : public ReportTest {
  protected:
    void SetUp() override {
        if (std::system("command -v chromium >/dev/null 2>&1") != 0) GTEST_SKIP() << "chromium is not installed";
    }

    [[nodiscard]] process::Ran chromium(const std::string& arguments, const std::string& file) const {
        return folder.run(
            "timeout 100 chromium --headless --no-sandbox --disable-gpu --hide-scrollbars --user-data-dir=profile "
            "--enable-logging=stderr --v=0 " +
            arguments + " file://" + (folder.path() / file).string());
    }

    // A copy of the page with a script that measures the page, and writes the result into an attribute of body.
    void write_measured(const std::string& html) const {
        auto copy = html;
        const auto policy = copy.find("<meta http-equiv=\"Content-Security-Policy\"");
        copy.erase(policy, copy.find("/>", policy) + 2 - policy);
        copy.insert(copy.rfind("</body>"), R"(<script>
            const wide = document.documentElement.scrollWidth - document.documentElement.clientWidth;
            let long = 0;
            for (const slave of document.querySelectorAll('svg.topology a.slave'))
                for (const text of slave.querySelectorAll('text'))
                    if (text.getBBox().width > slave.querySelector('rect').getBBox().width - 12) ++long;
            const colour = getComputedStyle(document.body).backgroundColor;
            document.body.setAttribute('data-measured', wide + ' ' + long + ' ' + colour);
            </script>)");
        folder.write("measured.html", copy);
    }
    [[nodiscard]] std::string measured(const std::string& arguments) const {
        const auto ran = chromium(arguments + " --dump-dom", "measured.html");
        const std::string mark = "data-measured=\"";
        const auto at = ran.out.find(mark);
        if (at == std::string::npos) return "not measured: " + ran.err;
        const auto from = at + mark.size();
        return ran.out.substr(from, ran.out.find('"', from) - from);
    }
};

// Width and height in the head of a PNG file.
std::pair<unsigned, unsigned> size_of_png(const std::string& png) {
    if (png.size() < 24 || !png.starts_with("\x89PNG\r\n")) return {};
    const auto number = [&](std::size_t at) {
        unsigned value = 0;
        for (std::size_t n = 0; n < 4; ++n) value = value << 8 | static_cast<unsigned char>(png[at + n]);
        return value;
    };
    return {number(16), number(20)};
}

TEST_F(ReportBrowser, RendersWithoutAMessageInTheConsole) {
    folder.write("a.toml",
                 "[[slave]]\ndevice = \"coupler\"\n[[slave]]\ndevice = \"digital_in_8\"\nerrors = [[0, 14, "
                 "1]]\n[[slave]]\ndevice = \"drive\"\nparent = \"slave1\"\ncount = 2\n");
    ASSERT_EQ(run("sim:a.toml --cycles 100 --record").status, 1);
    const auto shot = chromium("--window-size=1200,2000 --screenshot=shot.png", "report.html");
    EXPECT_EQ(shot.status, 0) << shot.err;
    EXPECT_FALSE(contains(shot.err, "CONSOLE")) << shot.err;
    const auto png = content_of(folder.path() / "shot.png");
    EXPECT_EQ(size_of_png(png), (std::pair{1200U, 2000U}));
    folder.write("empty.html", "<!DOCTYPE html><html><body></body></html>");
    ASSERT_EQ(chromium("--window-size=1200,2000 --screenshot=empty.png", "empty.html").status, 0);
    EXPECT_GT(png.size(), 5 * content_of(folder.path() / "empty.png").size()) << "there is something to see";
    // A broken policy or a script would cause a message in the console.
    folder.write("noisy.html", "<!DOCTYPE html><html><body><script>console.error('heard')</script></body></html>");
    EXPECT_TRUE(contains(chromium("--screenshot=noisy.png", "noisy.html").err, "CONSOLE"))
        << "this test hears the console";
    // The document in the browser has the headline and the picture.
    const auto dom = chromium("--dump-dom", "report.html").out;
    EXPECT_TRUE(contains(dom, page().headline().substr(0, 20))) << dom.substr(0, 400);
    EXPECT_TRUE(contains(dom, "</svg>"));
    ASSERT_EQ(chromium("--print-to-pdf=page.pdf", "report.html").status, 0);
    EXPECT_TRUE(content_of(folder.path() / "page.pdf").starts_with("%PDF-"));
}

TEST_F(ReportBrowser, NothingIsWiderThanTheWindow) {
    for (const auto& [segment, widths] : {std::pair<std::string, std::vector<unsigned>>{"tree", {500, 1300}},
                                          std::pair<std::string, std::vector<unsigned>>{"mixed200", {820}}}) {
        ASSERT_EQ(run("sim:" + segment + " -o page.html").status, 0);
        write_measured(content_of(folder.path() / "page.html"));
        for (const unsigned width : widths) {
            const auto result = measured(fmt::format("--window-size={},1000", width));
            EXPECT_TRUE(result.starts_with("0 0 ")) << segment << ", " << width << ": " << result;
        }
    }
}

TEST_F(ReportBrowser, FollowsTheWishForDark) {
    write_measured(made("demo").page.html);
    EXPECT_TRUE(contains(measured(""), "rgb(255, 255, 255)")) << measured("");
    const auto dark = measured("--blink-settings=preferredColorScheme=0");
    EXPECT_TRUE(contains(dark, "rgb(20, 24, 29)")) << dark;
}

}  // namespace
}  // namespace margay::segment_report
