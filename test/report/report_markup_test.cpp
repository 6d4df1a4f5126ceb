// Pieces of the page: escaping, tables, curves.
#include "segment_report/differences.hpp"
#include "segment_report/markup.hpp"
#include "segment_report/plot.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace margay::segment_report {
namespace {

TEST(ReportMarkup, TextIsEscaped) {
    EXPECT_EQ(Markup("<script>alert('a' & \"b\")</script>").html(),
              "&lt;script&gt;alert(&#39;a&#39; &amp; &quot;b&quot;)&lt;/script&gt;");
    EXPECT_EQ((Markup("a<") + "b>").html(), "a&lt;b&gt;");
    EXPECT_EQ(tag("td", "class=\"n\"", "<i>").html(), "<td class=\"n\">&lt;i&gt;</td>");
    EXPECT_EQ(attribute("title", "\" onclick=\"x"), " title=\"&quot; onclick=&quot;x\"");
}

TEST(ReportMarkup, UmlautsStayAndWhatIsNoTextIsReplaced) {
    constexpr const char* kBad = "\xEF\xBF\xBD";
    EXPECT_EQ(Markup("Klemme für 24 V, 温度 \xF0\x9F\x94\x8C").html(), "Klemme für 24 V, 温度 \xF0\x9F\x94\x8C");
    EXPECT_EQ(Markup("a\x01"
                     "b\x7F")
                  .html(),
              std::string("a") + kBad + "b" + kBad);
    EXPECT_EQ(Markup("\xFF\xFE").html(), std::string(kBad) + kBad) << "no UTF-8";
    EXPECT_EQ(Markup("f\xFCr").html(), std::string("f") + kBad + "r") << "Latin-1";
    EXPECT_EQ(Markup("\xC0\xAF").html(), std::string(kBad) + kBad) << "an overlong slash";
    EXPECT_EQ(Markup("\xED\xA0\x80").html(), std::string(kBad) + kBad + kBad) << "half of a surrogate";
    EXPECT_EQ(Markup("\xE2\x82").html(), std::string(kBad) + kBad) << "cut";
    EXPECT_EQ(Markup("a\xE2\x80\xAE"
                     "b")
                  .html(),
              std::string("a") + kBad + "b")
        << "right to left";
    EXPECT_EQ(Markup(std::string_view("a\0b", 3)).html(), std::string("a") + kBad + "b");
    EXPECT_EQ(Markup("line\n\ttab").html(), "line\n\ttab");
}

TEST(ReportMarkup, ATableLeavesEmptyColumnsOut) {
    Table table({{"A"}, {"B", true}, {"C"}});
    table.add({"1", {}, "x"});
    table.add({"2", {}, {}}, "fault");
    const auto html = table.markup("t").html();
    EXPECT_NE(html.find("<table id=\"t\"><thead><tr><th scope=\"col\">A</th><th scope=\"col\">C</th></tr>"),
              std::string::npos)
        << html;
    EXPECT_NE(html.find("<tr class=\"fault\"><td>2</td><td></td></tr>"), std::string::npos) << html;
}

TEST(ReportMarkup, ACurveStaysInItsFrameAndKeepsItsPeaks) {
    std::vector<double> times, values;
    for (int n = 0; n < 100'000; ++n) {
        times.push_back(n * 1e-3);
        values.push_back(n == 54'321 ? 1e6 : std::sin(n * 0.01));
    }
    values[7] = std::numeric_limits<double>::quiet_NaN();
    const auto html = curve_picture("Error <of> the phase", "ns", times, values).html();
    EXPECT_NE(html.find("Error &lt;of&gt; the phase, ns"), std::string::npos);
    EXPECT_NE(html.find("1e+06"), std::string::npos);
    EXPECT_NE(html.find("V26.0"), std::string::npos) << "the peak reaches the top of the frame";
    EXPECT_EQ(html.find("nan"), std::string::npos);
    EXPECT_LT(html.size(), 40'000U);
    EXPECT_NE(curve_picture("nothing", "", {}, {}).html().find("</svg>"), std::string::npos);
    EXPECT_NE(curve_picture("flat", "", {0, 1}, {3, 3}).html().find("class=\"curve\""), std::string::npos);
}

TEST(ReportMarkup, SlavesInWords) {
    EXPECT_EQ(slaves_text({3}), "slave 3");
    EXPECT_EQ(slaves_text({1, 2, 3, 4, 5, 8}), "slaves 1-5, 8");
    EXPECT_EQ(slaves_text({1, 2, 9, 10, 11}), "slaves 1, 2, 9-11");
}

}  // namespace
}  // namespace margay::segment_report
