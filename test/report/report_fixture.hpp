// Reports that this process makes and reports that the program makes. Their pages are read as XML.
#pragma once

#include <places.hpp>

#include "common/eeprom.hpp"
#include "ethercat/session_eeprom.hpp"
#include "ethercat/standalone.hpp"
#include "process/shell.hpp"
#include "segment_report/collect.hpp"
#include "segment_report/page.hpp"

#include <gtest/gtest.h>
#include <pugixml.hpp>

#include <functional>
#include <memory>
#include <string>

namespace margay::segment_report {

// A page, read by an XML parser that accepts no open tag and no unescaped text.
class ReadPage {
  public:
    explicit ReadPage(const std::string& html) : document_(std::make_unique<pugi::xml_document>()) {
        const auto result =
            document_->load_buffer(html.data(), html.size(), pugi::parse_default | pugi::parse_ws_pcdata);
        EXPECT_TRUE(result) << result.description() << " at "
                            << html.substr(static_cast<std::size_t>(result.offset), 80);
        EXPECT_TRUE(html.starts_with("<!DOCTYPE html>\n<html lang=\"en\">"));
    }
    // The text of an XPath expression.
    [[nodiscard]] std::string text(const std::string& path) const {
        return pugi::xpath_query(("string(" + path + ")").c_str()).evaluate_string(*document_);
    }
    [[nodiscard]] std::size_t count(const std::string& path) const {
        return static_cast<std::size_t>(pugi::xpath_query(("count(" + path + ")").c_str()).evaluate_number(*document_));
    }
    [[nodiscard]] std::string headline() const { return text("//p[@id='headline']"); }
    // The texts of all verdicts with this word ("fault", "look at it", "good").
    [[nodiscard]] std::vector<std::string> verdicts(const std::string& word) const {
        std::vector<std::string> all;
        for (const auto& node : document_->select_nodes("//ul[@class='verdicts']/li"))
            if (node.node().child("span").text().get() == word)
                all.emplace_back(node.node().child("span").next_sibling("span").text().get());
        return all;
    }
    // A cell of a table: the row (from 1), and the title of the column.
    [[nodiscard]] std::string cell(const std::string& table, std::size_t row, const std::string& column) const {
        const auto at = "//table[@id='" + table + "']";
        const auto place = count(at + "/thead/tr/th[.='" + column + "']/preceding-sibling::th") + 1;
        EXPECT_EQ(count(at + "/thead/tr/th[.='" + column + "']"), 1U) << table << " " << column;
        return text(at + "/tbody/tr[" + std::to_string(row) + "]/td[" + std::to_string(place) + "]");
    }
    [[nodiscard]] std::size_t rows(const std::string& table) const {
        return count("//table[@id='" + table + "']/tbody/tr");
    }
    [[nodiscard]] bool has(const std::string& words) const {
        return text("/html/body").find(words) != std::string::npos;
    }

  private:
    std::unique_ptr<pugi::xml_document> document_;
};

class ReportTest : public testing::Test {
  protected:
    process::ShellFolder folder;
    const std::string program = std::string(MARGAY_BIN_DIR) + "/segment_report";

    [[nodiscard]] process::Ran run(const std::string& arguments) const { return folder.run(program + " " + arguments); }
    [[nodiscard]] ReadPage page(const std::string& name = "report.html") const {
        return ReadPage(process::content_of(folder.path() / name));
    }

    // The segment in a file of the folder, or a ready-made one.
    [[nodiscard]] ethercat::StandaloneSettings source(const std::string& text) const {
        const bool file = text.find('.') != std::string::npos;
        return {.source = "sim:" + (file ? (folder.path() / text).string() : text)};
    }

    // A report of a session. `before` changes the segment before it is read.
    struct Made {
        Report report{};
        Page page{};
    };
    [[nodiscard]] Made made(const std::string& text, const std::function<void(ethercat::Session&)>& before = {},
                            CollectSettings settings = {}) const {
        ethercat::StandaloneSession session(source(text));
        if (before) before(session);
        Made out;
        out.report.source = session.master() ? session.master()->source : "";
        collect(session, settings, out.report);
        out.page = write_page(out.report);
        return out;
    }

    // The SII image of a device of the library, with a change, as a file in the folder.
    void write_image(const std::string& device, const std::string& name,
                     const std::function<void(std::string& octets)>& change) const {
        ethercat::StandaloneSession session({.source = "sim:" + device});
        ethercat::SessionEeprom eeprom(session, 0);
        const auto size = samples::eeprom_size(eeprom);
        const auto content = samples::read_eeprom(eeprom, size.octets, samples::no_progress());
        ASSERT_EQ(content.error, "");
        std::string octets(reinterpret_cast<const char*>(content.octets.data()), content.octets.size());
        change(octets);
        folder.write(name, octets);
    }
};

}  // namespace margay::segment_report
