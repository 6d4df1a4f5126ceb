#include "common/monitor_view.hpp"

#include "common/counted.hpp"
#include "common/slave_report.hpp"
#include "common/visible_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

namespace margay::samples {
namespace {

constexpr std::size_t kEvents = 6;

// Cuts a line to `width` columns. A UTF-8 character counts as one column.
std::string cut(const std::string& line, std::size_t width) {
    std::size_t columns = 0;
    for (std::size_t i = 0; i < line.size(); ++i) {
        const bool starts = (static_cast<unsigned char>(line[i]) & 0xC0) != 0x80;
        if (starts && columns++ == width) return line.substr(0, i);
    }
    return line;
}

std::string states_text(std::span<const Slave> slaves) {
    const auto in = [&](AlState state) {
        return std::count_if(slaves.begin(), slaves.end(), [&](const Slave& s) { return s.al.state == state; });
    };
    const auto errors = std::count_if(slaves.begin(), slaves.end(), [](const Slave& s) { return s.al.error; });
    std::string text = counted(slaves.size(), "slave") + ":";
    for (const auto state : {AlState::op, AlState::safeop, AlState::preop, AlState::init, AlState::boot})
        if (const auto count = in(state); count != 0) text += fmt::format("  {} in {}", count, to_text(state));
    if (const auto lost = in(AlState::none); lost != 0) text += fmt::format("  {} lost", lost);
    if (errors != 0) text += fmt::format("  {} with an error", errors);
    return text;
}

std::string cycle_line(const MonitorModel& model) {
    const auto& f = model.figures;
    auto text = fmt::format("cycle {}  working counter ", f.cycles);
    if (model.last)
        text += fmt::format("{} of {}", *model.last, model.expected_wkc);
    else if (model.last.error().code == Errc::working_counter)
        text += fmt::format("{} of {}", model.last.error().actual, model.expected_wkc);
    else
        text += fmt::format("- of {}", model.expected_wkc);
    return text + fmt::format("  wrong wkc {}  incomplete {}  overruns {}", f.wrong_wkc, f.no_frame, f.overruns);
}

std::string times_line(std::string_view name, const DurationHistogram& h) {
    const auto us = [](Duration d) { return static_cast<double>(d.count()) / 1000; };
    return fmt::format("{:<11} median {:>8.1f}  99 % {:>8.1f}  max {:>8.1f} µs  64 ns|{}|16 ms", name,
                       us(h.quantile(0.5)), us(h.quantile(0.99)), us(h.max()), spark_line(h));
}

std::string slave_line(const Slave& slave, const LineErrors* errors) {
    auto text = fmt::format("{:>5}  {:<16} {}", slave.number,
                            slave.al.state == AlState::none ? std::string("lost") : al_text(slave.al), slave.name());
    if (errors == nullptr) return text;
    for (std::size_t port = 0; port < errors->ports.size(); ++port) {
        const auto& e = errors->ports[port];
        if (e.invalid_frames + e.rx_errors + e.forwarded + e.lost_links == 0) continue;
        text += fmt::format("   port {}: {} damaged, {} forwarded, {} lost links", port, e.invalid_frames + e.rx_errors,
                            e.forwarded, e.lost_links);
    }
    return text;
}

}  // namespace

bool CableReports::repeats(const Event& event) {
    if (event.kind != EventKind::link_lost) return false;
    const auto same = std::ranges::find_if(last_, [&](const Event& e) {
        return e.slave == event.slave && e.port == event.port && e.other == event.other;
    });
    if (same == last_.end()) {
        last_.push_back(event);
        return false;
    }
    const bool other_end = event.other != 0 && event.at - same->at < window_ && event.actual == same->actual;
    *same = event;
    if (other_end) last_.erase(same);  // both ends have reported, so the next report is a new interruption
    return other_end;
}

std::string spark_line(const DurationHistogram& histogram) {
    constexpr std::string_view kHeights = " .:-=+*#";
    constexpr unsigned kFirst = 6;
    constexpr unsigned kLast = 23;
    std::vector<std::uint64_t> counts(kLast - kFirst + 1);
    for (std::size_t i = 0; i < DurationHistogram::kBuckets; ++i) {
        const auto bucket = histogram.bucket(i);
        if (bucket.count == 0) continue;
        const auto power =
            static_cast<unsigned>(std::bit_width(static_cast<std::uint64_t>(bucket.from.count()) | 1)) - 1;
        counts[std::clamp(power, kFirst, kLast) - kFirst] += bucket.count;
    }
    const auto most = std::max<std::uint64_t>(1, *std::max_element(counts.begin(), counts.end()));
    const double full = std::log2(static_cast<double>(most) + 1);
    std::string line;
    for (const auto count : counts) {
        const auto part = std::log2(static_cast<double>(count) + 1) / full * static_cast<double>(kHeights.size() - 1);
        line += kHeights[static_cast<std::size_t>(std::ceil(part))];
    }
    return line;
}

std::vector<std::string> monitor_lines(const MonitorModel& model, std::size_t width, std::size_t height,
                                       std::size_t scroll) {
    std::vector<std::string> lines{fmt::format("{}   {}", model.source, states_text(model.slaves)), cycle_line(model),
                                   times_line("wake-up", model.figures.lateness),
                                   times_line("round trip", model.figures.round_trip), "slave  state            name"};
    const std::size_t events = std::min(kEvents, model.events.size());
    const std::size_t rows = height > lines.size() + kEvents ? height - lines.size() - kEvents : 0;
    const std::size_t first = std::min(scroll, model.slaves.size() > rows ? model.slaves.size() - rows : 0);
    for (std::size_t i = first; i < std::min(first + rows, model.slaves.size()); ++i)
        lines.push_back(slave_line(model.slaves[i], i < model.line_errors.size() ? &model.line_errors[i] : nullptr));
    lines.resize(std::max(lines.size(), height > events ? height - events : 0));
    lines.insert(lines.end(), model.events.end() - static_cast<std::ptrdiff_t>(events), model.events.end());
    lines.resize(height);
    for (auto& line : lines) line = cut(visible(line), width);
    return lines;
}

}  // namespace margay::samples
