#include "common/cycle_log_file.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <utility>
#include <vector>

namespace margay::samples {
namespace {

using nlohmann::json;

class CycleLogReader {
  public:
    explicit CycleLogReader(std::string_view text)
        : root_(json::parse(text.begin(), text.end(), nullptr, /* allow_exceptions */ false)),
          begins_(text.find_first_not_of(" \t\r\n") != std::string_view::npos &&
                  text[text.find_first_not_of(" \t\r\n")] == '{') {}

    CycleLog read() {
        if (root_.is_discarded() && begins_)
            return {.fault = "the file has an error in its JSON object, or its end is missing"};
        if (!root_.is_object())
            return {.fault = "the file has no JSON object: figures of cycles are written by --histogram FILE.json"};
        CycleFigures& f = log_.figures;
        f.cycles = number(root_, "cycles", "");
        f.overruns = number(root_, "overruns", "");
        f.skipped = number(root_, "skipped", "");
        f.caught_up = number(root_, "caught_up", "");
        f.no_frame = number(root_, "without_all_frames", "");
        f.wrong_wkc = number(root_, "wrong_working_counter", "");
        for (const auto& [key, into] :
             {std::pair{"lateness_ns", &f.lateness}, std::pair{"period_ns", &f.period}, std::pair{"sent_ns", &f.sent},
              std::pair{"received_ns", &f.received}, std::pair{"round_trip_ns", &f.round_trip}})
            histogram(key, *into);
        // Programs with --stamps or --send-at write these.
        for (const auto& [key, into] :
             {std::pair{"not_sent_at_their_time", &f.missed}, std::pair{"without_stamps", &f.wire.unstamped}})
            if (root_.contains(key)) *into = number(root_, key, "");
        for (const auto& [key, into] :
             {std::pair{"wire_period_ns", &f.wire.period}, std::pair{"wire_round_trip_ns", &f.wire.round_trip}})
            if (root_.contains(key)) histogram(key, *into);
        return std::move(log_);
    }

  private:
    void fail(std::string text) {
        if (log_.fault.empty()) log_.fault = std::move(text);
    }

    std::uint64_t number(const json& object, const char* key, const std::string& where) {
        const auto at = object.find(key);
        if (at != object.end() && at->is_number_unsigned() && at->get<std::uint64_t>() <= INT64_MAX)
            return at->get<std::uint64_t>();
        fail(fmt::format("\"{}{}\" is {}", where, key,
                         at == object.end() ? "missing" : "no whole number of 0 or above"));
        return 0;
    }
    Duration time(const json& object, const char* key, const std::string& where) {
        return Duration(static_cast<Duration::rep>(number(object, key, where)));
    }

    void histogram(const char* key, DurationHistogram& into) {
        const auto at = root_.find(key);
        const auto buckets = at != root_.end() && at->is_object() ? at->find("buckets") : root_.end();
        if (at == root_.end() || !at->is_object() || buckets == at->end() || !buckets->is_array())
            return fail(fmt::format("\"{}\" has no buckets", key));
        std::vector<DurationHistogram::Bucket> all;
        for (const json& one : *buckets) {
            const auto where = fmt::format("{}.buckets[{}].", key, all.size());
            if (!one.is_object()) return fail(fmt::format("\"{}\" is no object", where));
            all.push_back({time(one, "from", where), time(one, "to", where), number(one, "count", where)});
        }
        const std::string where = std::string(key) + ".";
        if (all.empty() && number(*at, "count", where) == 0) return;
        const bool right =
            into.restore(all, time(*at, "min", where), time(*at, "mean", where), time(*at, "max", where));
        if (!right || into.count() != number(*at, "count", where))
            fail(fmt::format("\"{}\": its buckets, count and times contradict each other", key));
    }

    json root_;
    bool begins_ = false;  // the text begins an object
    CycleLog log_{};
};

}  // namespace

CycleLog parse_cycle_log(std::string_view text) { return CycleLogReader(text).read(); }

}  // namespace margay::samples
