#include "layers/summary_check.hpp"

#include <algorithm>
#include <optional>

namespace margay::layers {
namespace {

// The cells of a row of a table, without the spaces around them.
std::vector<std::string> cells_of(std::string_view line) {
    std::vector<std::string> cells;
    if (line.substr(0, 2) != "| ") return cells;
    for (auto rest = line.substr(1); !rest.empty();) {
        const auto end = rest.find('|');
        if (end == std::string_view::npos) break;
        auto cell = rest.substr(0, end);
        while (!cell.empty() && cell.front() == ' ') cell.remove_prefix(1);
        while (!cell.empty() && cell.back() == ' ') cell.remove_suffix(1);
        cells.emplace_back(cell);
        rest.remove_prefix(end + 1);
    }
    return cells;
}

// The parts of `text` between the separators. Separators in brackets and in code are part of the text.
std::vector<std::string> items_of(const std::string& text, std::string_view separators) {
    std::vector<std::string> items;
    std::string item;
    int depth = 0;
    bool code = false;
    const auto end = [&] {
        if (item.rfind("and ", 0) == 0) item.erase(0, 4);
        if (!item.empty()) items.push_back(item);
        item.clear();
    };
    for (std::size_t i = 0; i < text.size(); ++i) {
        const char c = text[i];
        if (c == '`') code = !code;
        if (c == '(') ++depth;
        if (c == ')') --depth;
        const bool space = i + 1 < text.size() && text[i + 1] == ' ';
        if (space && !code && depth == 0 && separators.find(c) != std::string_view::npos) {
            end();
            ++i;
        } else {
            item += c;
        }
    }
    end();
    return items;
}

struct Row {
    std::string what;
    std::string status;
};

std::vector<Row> rows_of(const std::string& matrix) {
    std::vector<Row> rows;
    for (const auto line : lines_of(matrix))
        if (const auto cells = cells_of(line); cells.size() >= 3 && !cells[1].empty())
            rows.push_back({cells[0], cells[1]});
    return rows;
}

struct Item {
    std::string area;
    bool last = false;  // of the last column
    std::string text;
};

std::vector<Item> summary_of(const std::string& readme) {
    std::vector<Item> items;
    const auto begin = readme.find("## What works\n");
    if (begin == std::string::npos) return items;
    const auto section = readme.substr(begin, readme.find("\n## ", begin) - begin);
    for (const auto line : lines_of(section)) {
        const auto cells = cells_of(line);
        if (cells.size() != 3 || cells[0] == "area") continue;
        for (const auto& text : items_of(cells[1], ",;")) items.push_back({cells[0], false, text});
        for (const auto& text : items_of(cells[2], ".;")) items.push_back({cells[0], true, text});
    }
    return items;
}

bool begins(const std::string& text, std::string_view with) { return text.rfind(with, 0) == 0; }

bool open(const Row& row) { return row.status == "partly" || row.status == "planned"; }

class Comparison {
  public:
    Comparison(const std::string& readme, const std::string& matrix, std::span<const SummaryProof> proofs)
        : rows_(rows_of(matrix)), items_(summary_of(readme)), proofs_(proofs) {}

    Faults faults() {
        if (items_.empty()) faults_.push_back("README.md: no table below \"What works\"");
        for (const auto& item : items_) check(item);
        for (const auto& row : rows_)
            if (open(row) && !named(row, {})) add("\"" + row.what + "\" is " + row.status + ": not in the last column");
        for (const auto& proof : proofs_) {
            if (std::none_of(items_.begin(), items_.end(), [&](const auto& item) { return of(proof, item); }))
                add("no such item: " + std::string(proof.area) + ": " + std::string(proof.item));
            if (row_of(proof) == nullptr) add("test/matrix.md has no such row: " + std::string(proof.row));
        }
        return faults_;
    }

  private:
    void add(const std::string& fault) { faults_.push_back("README.md, What works: " + fault); }

    static bool of(const SummaryProof& proof, const Item& item) {
        if (item.area != proof.area) return false;
        const auto open_end = proof.item.find("…");
        return open_end == std::string_view::npos ? item.text == proof.item
                                                  : begins(item.text, proof.item.substr(0, open_end));
    }

    const Row* row_of(const SummaryProof& proof) const {
        const auto found =
            std::find_if(rows_.begin(), rows_.end(), [&](const auto& row) { return begins(row.what, proof.row); });
        return found != rows_.end() ? &*found : nullptr;
    }

    // Returns whether an item of the last column has the row. `area`, if given, restricts the items.
    bool named(const Row& row, const std::optional<std::string>& area) const {
        return std::any_of(items_.begin(), items_.end(), [&](const auto& item) {
            return item.last && (!area || item.area == *area) &&
                   std::any_of(proofs_.begin(), proofs_.end(),
                               [&](const auto& proof) { return of(proof, item) && row_of(proof) == &row; });
        });
    }

    void check(const Item& item) {
        bool proved = false;
        for (const auto& proof : proofs_) {
            if (!of(proof, item)) continue;
            proved = true;
            const auto* row = row_of(proof);
            if (row == nullptr) continue;
            if (!item.last && row->status != "works" && !(open(*row) && named(*row, item.area)))
                add("\"" + item.text + "\" works, and \"" + row->what + "\" is " + row->status);
            if (item.last && item.text.find(": planned") != std::string::npos && !open(*row))
                add("\"" + item.text + "\", and \"" + row->what + "\" " + row->status);
        }
        if (!proved) add("no row of test/matrix.md for \"" + item.text + "\"");
    }

    std::vector<Row> rows_;
    std::vector<Item> items_;
    std::span<const SummaryProof> proofs_;
    Faults faults_;
};

}  // namespace

Faults summary_faults(const std::string& readme, const std::string& matrix, std::span<const SummaryProof> proofs) {
    return Comparison(readme, matrix, proofs).faults();
}

}  // namespace margay::layers
