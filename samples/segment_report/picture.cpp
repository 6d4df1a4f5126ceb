#include "segment_report/picture.hpp"

#include "common/slave_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>

namespace margay::segment_report {
namespace {

constexpr int kColumns = 7;   // of a row, unless a branch begins far to the right
constexpr int kShortest = 3;  // columns of a branch that begins far to the right
constexpr double kBoxWidth = 138, kBoxHeight = 54;
constexpr double kStepX = 175, kStepY = 88;
constexpr double kLeft = 14, kTop = 12;
constexpr double kLane = 8;  // between vertical lines in the right margin
constexpr std::size_t kNameLength = 17;

struct Place {
    int column = 0;
    int row = 0;
    [[nodiscard]] double x() const { return kLeft + column * kStepX; }
    [[nodiscard]] double y() const { return kTop + row * kStepY; }
    [[nodiscard]] double middle() const { return y() + kBoxHeight / 2; }
};

struct Point {
    double x = 0, y = 0;
};

// Boxes have numbers: the number of a slave is its place in Report::slaves, the numbers of the master's NICs follow.
struct Link {
    std::size_t from = 0;
    std::size_t to = 0;
    const Cable* cable = nullptr;
    int depth = 0;  // of runs within runs, for the lane of a line to the next row
};

// The beginning of a text, cut between characters.
std::string shortened(std::string_view text) {
    std::size_t characters = 0;
    for (std::size_t n = 0; n < text.size(); ++n) {
        if ((static_cast<unsigned char>(text[n]) & 0xC0) == 0x80) continue;
        if (++characters == kNameLength && text.size() - n > 1) return std::string(text.substr(0, n)) + "…";
    }
    return std::string(text);
}

class Picture {
  public:
    Picture(const Report& report, const std::vector<Cable>& cables) : report_(report), cables_(cables) {
        find_children();
        for (const std::size_t root : roots_) {
            place_run(root, 0, 0);
            ++next_row_;
        }
    }

    [[nodiscard]] Markup markup() const {
        Markup lines, boxes;
        for (const Link& link : links_) lines += line(link);
        for (const auto& [box, place] : places_) boxes += draw_box(box, place);
        const double width = right_edge() + kLane * (most_depth_ + 2);
        const double height = kTop + (last_row_ + 1) * kStepY - (kStepY - kBoxHeight) + kTop;
        return tag(
            "svg",
            fmt::format("xmlns=\"http://www.w3.org/2000/svg\" id=\"topology\" class=\"topology\" role=\"img\" "
                        "aria-label=\"Topology\" viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" height=\"{1:.0f}\"",
                        width, height),
            lines + boxes);
    }

  private:
    [[nodiscard]] std::size_t slaves() const { return report_.slaves.size(); }
    // The box at an end of a cable.
    [[nodiscard]] std::size_t box_of(const CableEnd& end) const {
        if (!end.slave) return slaves() + end.port;
        const auto at =
            std::ranges::find(report_.slaves, *end.slave, [](const SlaveState& s) { return s.facts.position; });
        return static_cast<std::size_t>(at - report_.slaves.begin());
    }

    void find_children() {
        for (const Cable& cable : cables_) {
            const std::size_t from = box_of(cable.near), to = box_of(cable.far);
            if (from >= slaves() && std::ranges::find(roots_, from) == roots_.end()) roots_.push_back(from);
            children_[from].push_back({.from = from, .to = to, .cable = &cable});
        }
        // Children follow their parents in the list, so that one pass from the end counts all slaves behind a box.
        for (std::size_t n = cables_.size(); n-- > 0;)
            weight_[box_of(cables_[n].near)] += 1 + weight_[box_of(cables_[n].far)];
    }

    // The first child continues the row: that on E-bus, because it is in the same station, or else the one with the
    // most slaves behind it.
    [[nodiscard]] std::vector<Link> ordered_children(std::size_t box) const {
        const auto at = children_.find(box);
        if (at == children_.end()) return {};
        auto all = at->second;
        const auto rank = [&](const Link& link) {
            const auto known = weight_.find(link.to);
            return std::pair(link.cable->medium == PortType::ebus, known == weight_.end() ? 0 : known->second);
        };
        std::ranges::rotate(all, std::ranges::max_element(all, {}, rank));
        return all;
    }

    // The branches of a box, in rows of their own: to the right of the box, and the last one straight below it.
    void place_branches(const std::vector<Link>& branches, int depth) {
        for (const Link& link : branches) {
            const int column = places_[link.from].column;
            links_.push_back(link);
            place_run(link.to, &link == &branches.back() ? column : column + 1, depth);
        }
    }

    // A run begins in a new row, and continues in further rows. The branches of a row follow below it, the branches of
    // the box on the right first, so that no line crosses a box. The branches of the first slave are below the whole
    // run, which is indented then.
    void place_run(std::size_t first, int column, int depth) {
        std::size_t box = first;
        std::optional<std::size_t> head;
        std::vector<Link> below;
        most_depth_ = std::max(most_depth_, depth);
        for (bool more = true; more;) {
            more = false;
            const int begin = below.empty() ? column : places_[*head].column + 1;
            const int limit = std::max(kColumns, begin + kShortest);
            const int row = next_row_++;
            last_row_ = std::max(last_row_, row);
            std::vector<std::vector<Link>> branches;
            for (int at = begin; !places_.contains(box); ++at) {
                places_[box] = {at, row};
                auto children = ordered_children(box);
                if (children.empty()) break;
                std::vector<Link> others(children.begin() + 1, children.end());
                if (box < slaves() && !head) {
                    head = box;
                    below = std::move(others);
                } else {
                    branches.push_back(std::move(others));
                }
                children.front().depth = depth;
                through_[box] = children.front().cable;
                links_.push_back(children.front());
                box = children.front().to;
                more = at + 1 == limit;
                if (more) break;
            }
            for (std::size_t n = branches.size(); n-- > 0;) place_branches(branches[n], depth + 1);
        }
        place_branches(below, depth);
    }

    [[nodiscard]] double right_edge() const {
        int most = 0;
        for (const auto& [box, place] : places_) most = std::max(most, place.column);
        return Place{most, 0}.x() + kBoxWidth + kLeft;
    }

    [[nodiscard]] static std::string_view style_of(Health health) {
        return health == Health::bad ? "bad" : health == Health::doubtful ? "doubtful" : "good";
    }

    [[nodiscard]] static Markup label(double x, double y, std::string_view style, std::string_view text) {
        return tag("text", fmt::format("x=\"{:.1f}\" y=\"{:.1f}\" class=\"{}\"", x, y, style), text);
    }

    [[nodiscard]] Markup line(const Link& link) const {
        const Place from = places_.at(link.from), to = places_.at(link.to);
        const Cable& cable = *link.cable;
        std::string path;
        Point out{from.x() + kBoxWidth + 3, from.middle() - 4}, in{to.x() - 9, to.middle() - 4}, mark{};
        if (from.row == to.row) {
            path = fmt::format("M{:.1f} {:.1f}H{:.1f}", from.x() + kBoxWidth, from.middle(), to.x());
            mark = {(from.x() + kBoxWidth + to.x()) / 2, from.middle() + 15};
        } else if (to.column == from.column) {  // straight down
            const double x = from.x() + kBoxWidth / 2;
            path = fmt::format("M{:.1f} {:.1f}V{:.1f}", x, from.y() + kBoxHeight, to.y());
            out = {x + 5, from.y() + kBoxHeight + 11};
            in = {x + 5, to.y() - 4};
            mark = {x + 30, to.y() - 12};
        } else if (&cable != through_.at(link.from)) {  // a branch: down from the box, then to the right
            const double x = from.x() + kBoxWidth / 2;
            path = fmt::format("M{:.1f} {:.1f}V{:.1f}H{:.1f}", x, from.y() + kBoxHeight, to.middle(), to.x());
            out = {x + 5, to.middle() - 4};
            mark = {to.x() - 50, to.middle() + 15};
        } else {  // to the next row of the run, by the right margin
            const double lane = right_edge() + kLane * (most_depth_ - link.depth);
            const double above = to.y() - (kStepY - kBoxHeight) / 2 - 4;
            path = fmt::format("M{:.1f} {:.1f}H{:.1f}V{:.1f}H{:.1f}V{:.1f}H{:.1f}", from.x() + kBoxWidth, from.middle(),
                               lane, above, to.x() - 14, to.middle(), to.x());
            mark = {to.x() + 24, above + 13};
        }
        const auto style = style_of(cable.health);
        Markup content =
            tag("title", cable_text(cable) + (findings_text(cable).empty() ? "" : ": " + findings_text(cable)));
        content +=
            tag("path", fmt::format("d=\"{}\"{}", path, cable.medium == PortType::ebus ? " class=\"ebus\"" : ""), {});
        if (cable.near.slave) content += label(out.x, out.y, "port", fmt::to_string(cable.near.port));
        if (cable.far.slave) content += label(in.x, in.y, "port", fmt::to_string(cable.far.port));
        if (cable.broken || cable.damaged() + cable.symbols() + cable.interruptions() != 0)
            content += label(mark.x, mark.y, "count", badge(cable));
        return tag("g", fmt::format("class=\"cable {}\"", style), content) + Markup::raw("\n");
    }

    [[nodiscard]] static std::string badge(const Cable& cable) {
        if (cable.broken) return "broken";
        if (cable.damaged() != 0) return fmt::format("✕{}", cable.damaged());
        if (cable.symbols() != 0) return fmt::format("~{}", cable.symbols());
        return fmt::format("⚡{}", cable.interruptions());
    }

    [[nodiscard]] Markup draw_box(std::size_t box, const Place& place) const {
        const auto frame = [&](std::string_view style) {
            return tag("rect",
                       fmt::format("x=\"{:.1f}\" y=\"{:.1f}\" width=\"{}\" height=\"{}\" rx=\"5\" class=\"{}\"",
                                   place.x(), place.y(), kBoxWidth, kBoxHeight, style),
                       {});
        };
        if (box >= slaves()) {
            const std::size_t nic = box - slaves();
            const auto& devices = report_.master.devices;
            if (nic == kUnknownEnd)
                return tag("g", "class=\"unknown\"",
                           frame("box") + label(place.x() + 8, place.y() + 20, "name", "Not known") +
                               label(place.x() + 8, place.y() + 40, "small", "slave before break")) +
                       Markup::raw("\n");
            const auto name = nic < devices.size() ? devices[nic].name : report_.source;
            return tag("g", "class=\"master\"",
                       frame("box") + label(place.x() + 8, place.y() + 20, "name", nic == 0 ? "Master" : "Second NIC") +
                           label(place.x() + 8, place.y() + 40, "small", shortened(name))) +
                   Markup::raw("\n");
        }
        const SlaveState& slave = report_.slaves[box];
        const bool bad = slave.now.error || !slave.facts.problem.empty();
        const auto state = samples::al_text(slave.now);
        const Markup content =
            tag("title", fmt::format("slave {}: {}, {}", slave.facts.position, slave.facts.name, state)) +
            frame(bad ? "box faulty" : "box") +
            label(place.x() + 8, place.y() + 17, "name", fmt::to_string(slave.facts.position)) +
            tag("text",
                fmt::format("x=\"{:.1f}\" y=\"{:.1f}\" class=\"small right\"", place.x() + kBoxWidth - 8,
                            place.y() + 17),
                state) +
            label(place.x() + 8, place.y() + 33, "title", shortened(title_of(slave))) +
            label(place.x() + 8, place.y() + 47, "small", shortened(detail_of(slave)));
        return tag("a", fmt::format("href=\"#slave{}\" class=\"slave\"", slave.facts.position), content) +
               Markup::raw("\n");
    }

    [[nodiscard]] static std::string title_of(const SlaveState& slave) {
        return slave.facts.name.empty() ? std::string("(no name)") : slave.facts.name;
    }
    [[nodiscard]] static std::string detail_of(const SlaveState& slave) {
        if (slave.facts.alias != 0) return fmt::format("alias {}", slave.facts.alias);
        return slave.texts.order == slave.facts.name ? std::string() : slave.texts.order;
    }

    const Report& report_;
    const std::vector<Cable>& cables_;
    std::vector<std::size_t> roots_{};
    std::map<std::size_t, std::vector<Link>> children_{};
    std::map<std::size_t, std::size_t> weight_{};
    std::map<std::size_t, Place> places_{};
    std::map<std::size_t, const Cable*> through_{};  // the cable by which the row goes on
    std::vector<Link> links_{};
    int next_row_ = 0;
    int last_row_ = 0;
    int most_depth_ = 0;
};

}  // namespace

Markup topology_picture(const Report& report, const std::vector<Cable>& cables) {
    if (report.slaves.empty()) return {};
    return tag("div", "class=\"wide picture\"", Picture(report, cables).markup());
}

}  // namespace margay::segment_report
