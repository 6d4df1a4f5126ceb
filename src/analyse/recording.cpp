#include "analyse/recording.hpp"

#include "analyse/analyser.hpp"
#include "analyse/ethercat_frame.hpp"
#include "analyse/masters.hpp"
#include "analyse/reply_clock.hpp"
#include "analyse/ring_copies.hpp"
#include "analyse/ring_evidence.hpp"
#include "analyse/ring_signs.hpp"
#include "analyse/twins.hpp"
#include "oshw/pcap/packet_reader.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>

#include <unistd.h>

namespace margay::analyse {
namespace {

// A packet of the recording.
struct Taken {
    Moment when{};
    PacketOrigin origin{};
    Bytes bytes{};
    std::size_t length_on_wire = 0;
};

// Copies the octets of a pipe to a file without a name, because a recording is read more than once.
class PipeCopy {
  public:
    // There is no copy if the path is a regular file, or if it cannot be opened; then the reader reports the reason.
    // "-" is the standard input.
    explicit PipeCopy(const std::string& path) {
        std::error_code ignored;
        const bool standard = path == "-";
        if (!standard && !std::filesystem::is_other(std::filesystem::status(path, ignored))) return;
        const File from(standard ? ::fdopen(::dup(STDIN_FILENO), "rb") : std::fopen(path.c_str(), "rbe"), &std::fclose);
        if (!from) return;
        file_ = File(std::tmpfile(), &std::fclose);
        std::array<char, 65536> block{};
        bool is_first = true;
        while (file_) {
            const auto got = std::fread(block.data(), 1, block.size(), from.get());
            whole_ = whole_ && std::fwrite(block.data(), 1, got, file_.get()) == got;
            // A source that is no recording may have no end.
            const bool odd = is_first && !begins_a_recording(std::as_bytes(std::span(block.data(), got)));
            is_first = false;
            if (got != block.size() || odd || !whole_) break;
        }
        whole_ = whole_ && file_ && std::fflush(file_.get()) == 0;
    }
    [[nodiscard]] std::string path() const {
        return file_ ? "/proc/self/fd/" + std::to_string(::fileno(file_.get())) : std::string();
    }
    [[nodiscard]] bool whole() const { return whole_; }

  private:
    using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;
    static bool begins_a_recording(Bytes octets) {
        constexpr std::array<std::uint32_t, 5> kBegins{0xA1B2C3D4, 0xD4C3B2A1, 0xA1B23C4D, 0x4D3CB2A1, 0x0A0D0D0A};
        return octets.size() >= 4 && std::ranges::count(kBegins, load_le<std::uint32_t>(octets)) != 0;
    }
    File file_{nullptr, &std::fclose};
    bool whole_ = true;
};

// Counts the packets that are earlier than the previous one.
struct Order {
    std::optional<Duration> last{};
    std::uint64_t steps_back = 0, first = 0;
    void look(const Moment& when) {
        if (last && when.at < *last && steps_back++ == 0) first = when.frame;
        last = when.at;
    }
};

class Recording {
  public:
    explicit Recording(const std::string& path) : path_(path) {}

    Analysis analyse() {
        if (!survey()) return said(Analysis());
        if (is_ring_) return said(analyse_ring());
        if (sight_ == RingSigns::Sight::whole || sight_ == RingSigns::Sight::sent) {
            if (auto analysis = analyse_ring_of_taps()) return said(std::move(*analysis));
            sight_ = RingSigns::Sight::part;
            too_many_ = true;
        }
        std::vector<std::unique_ptr<Analyser>> analysers;
        for (std::size_t n = 0; n < std::max<std::size_t>(masters_.count(), 1); ++n)
            analysers.push_back(std::make_unique<Analyser>());
        read([&](const Taken& t, std::optional<std::size_t> master) {
            const auto n = master.value_or(0);
            if (n < analysers.size())
                analysers[n]->packet(t.when, t.bytes, t.length_on_wire);
            else
                ++left_out_;
        });
        auto all = finished(analysers);
        auto first = std::move(all.front());
        first.others.assign(std::make_move_iterator(all.begin() + 1), std::make_move_iterator(all.end()));
        if (sight_ == RingSigns::Sight::part) {
            forget_losses(first);
            for (auto& other : first.others) forget_losses(other);
        }
        return said(std::move(first));
    }

  private:
    using Reader = std::function<void(const Taken&, std::optional<std::size_t> master)>;

    // Finds copies and the masters. False: the file cannot be opened.
    bool survey() {
        PacketReader reader;
        if (!reader.open(path_)) {
            problem_ = reader.problem().empty() ? "it cannot be read" : reader.problem();
            return false;
        }
        std::vector<PacketOrigin> origins;
        while (const auto packet = reader.next()) {
            origins.push_back(packet->origin);
            const auto frame = finder_.find(packet->bytes);
            if (!frame || packet->bytes.size() < packet->length_on_wire) continue;
            twins_.look(packet->number, packet->at, frame->bytes, packet->origin.interface);
        }
        twins_.decide();
        problem_ = reader.problem();
        note(reader);
        find_masters();
        is_ring_ = is_ring_ && RingCopies::is_ring(origins);
        return true;
    }

    // Notes the information of the file beside its packets.
    void note(const PacketReader& reader) {
        packets_ = reader.packets();
        dropped_ = reader.dropped();
        cut_off_ = reader.cut_off();
        left_out_interfaces_ = reader.left_out();
        untimed_ = reader.untimed();
        interfaces_ = reader.interfaces();
    }

    void find_masters() {
        RingEvidence ring;
        read_packets([&](const Taken& t, Bytes frame) {
            if (frame.empty()) return;
            order_.look(t.when);
            masters_.look(frame, twins_.common(t.origin.interface));
            ring.look(t.origin, t.when.at, t.bytes);
            signs_.look(t.origin, t.when.at, t.bytes);
        });
        masters_.decide();
        sight_ = signs_.decide();
        const auto evidence = ring.decide();
        is_ring_ = evidence == RingSigns::Sight::whole;
        if (!is_ring_ && sight_ == RingSigns::Sight::none) sight_ = evidence;
    }

    // Reads the packets that survey() has seen, without the copies: a file may grow. `frame` is empty where the packet
    // is no EtherCAT frame, or was cut.
    template <class Take>
    void read_packets(Take take) {
        PacketReader reader;
        if (!reader.open(path_)) return;
        for (auto packet = reader.next(); packet && packet->number <= packets_; packet = reader.next()) {
            if (twins_.is_left_out(packet->number)) continue;
            const Taken t{{packet->number, packet->at}, packet->origin, packet->bytes, packet->length_on_wire};
            const auto found = finder_.find(packet->bytes);
            const auto frame = found && t.bytes.size() >= t.length_on_wire ? found->bytes : Bytes();
            take(t, frame);
        }
    }

    void read(const Reader& take) {
        read_packets([&](const Taken& t, Bytes frame) {
            take(t, frame.empty() ? std::nullopt : masters_.of(frame, twins_.common(t.origin.interface)));
        });
    }

    Analysis analyse_ring() {
        Analyser analyser;
        RingCopies ring([&](Moment when, Bytes packet, std::size_t length) { analyser.packet(when, packet, length); });
        const auto take = [&](const Taken& t) { ring.packet(t.origin, t.when, t.bytes, t.length_on_wire); };
        const auto every = [](const Taken&, std::optional<std::size_t>) { return true; };
        const bool in_order = order_.steps_back == 0;
        const bool sorted = !in_order && read_sorted(every, take);
        if (!sorted) read([&](const Taken& t, std::optional<std::size_t>) { take(t); });
        ring.finish();
        auto analysis = analyser.finish();
        analysis.ring = true;
        if (!in_order)
            analysis.remark = order_text(order_.steps_back, order_.first) + (sorted ? sorted_text() : unsorted_text());
        return analysis;
    }

    // Analyses a recording of both NICs of a ring without directions. nullopt: there are too many packets to sort.
    std::optional<Analysis> analyse_ring_of_taps() {
        Analyser analyser;
        RingCopies ring([&](Moment when, Bytes packet, std::size_t length) { analyser.packet(when, packet, length); },
                        signs_);
        Order order;
        const auto every = [&](const Taken& t, std::optional<std::size_t>) {
            order.look(t.when);
            return true;
        };
        const bool fits =
            read_sorted(every, [&](const Taken& t) { ring.packet(t.origin, t.when, t.bytes, t.length_on_wire); });
        if (!fits) return std::nullopt;
        ring.finish();
        auto analysis = analyser.finish();
        analysis.ring = sight_ == RingSigns::Sight::whole;
        if (!analysis.ring) forget_losses(analysis);
        constexpr std::uint64_t kFew = 16;  // copies that a recorder has delayed
        if (ring.seen_late() >= kFew)
            analysis.remark =
                std::to_string(ring.seen_late()) +
                " packets were counted as late copies of other packets; if the master uses an index again "
                "so soon, they are frames that are missing here: record a pcapng file with an interface "
                "for each place";
        if (ring.seen_twice() >= kFew)
            analysis.remark += (analysis.remark.empty() ? "" : "; ") + std::to_string(ring.seen_twice()) +
                               " packets were there again soon at their interface: if it shows several places of the "
                               "ring, requests, losses and working counters are wrong; record a pcapng file with an "
                               "interface for each place";
        if (order.steps_back != 0)
            analysis.remark +=
                (analysis.remark.empty() ? "" : "; ") + order_text(order.steps_back, order.first) + sorted_text();
        return analysis;
    }

    static std::string order_text(std::uint64_t steps_back, std::uint64_t first) {
        return "the packets are not in order of time (" + std::to_string(steps_back) +
               (steps_back == 1 ? " time" : " times") + ", first at packet #" + std::to_string(first) + ")";
    }
    static std::string unsorted_text() {
        return " and too many to sort: replies and times may be wrong; put them in order, as reordercap does";
    }
    static std::string sorted_text() {
        return " and were sorted; if the clock of the recorder was set back, replies and times near there are wrong";
    }

    std::vector<Analysis> finished(std::vector<std::unique_ptr<Analyser>>& analysers) {
        std::vector<Analysis> all;
        for (std::size_t n = 0; n < analysers.size(); ++n) {
            const auto& analyser = *analysers[n];
            auto analysis = analysers[n]->finish();
            std::string remark;
            const bool in_order = analyser.steps_back() == 0;
            if (!in_order) {
                const auto text = order_text(analyser.steps_back(), analyser.first_step_back());
                if (auto sorted = analyse_sorted(n)) {
                    analysis = std::move(*sorted);
                    remark = text + sorted_text();
                } else {
                    remark = text + unsorted_text();
                }
            }
            if (auto moved = with_later_replies(n, analysis, in_order)) {
                analysis = std::move(*moved);
                remark = analysis.remark + (remark.empty() ? remark : "; " + remark);
            }
            if (analysis.passes_twice)
                remark =
                    "each frame passes by twice: this is a tap between slaves; cycle times, working counters and "
                    "slaves without an answer are not told, and other counts are of both passes" +
                    (remark.empty() ? remark : "; " + remark);
            analysis.remark = std::move(remark);
            analysis.interface = masters_.interface_of(n);
            if (analysis.interface && *analysis.interface < interfaces_.size())
                analysis.interface = interfaces_[*analysis.interface];
            all.push_back(std::move(analysis));
        }
        return all;
    }

    // Analyses the packets of one master in order of time. nullopt: there are too many packets to sort.
    std::optional<Analysis> analyse_sorted(std::size_t master) {
        Analyser analyser;
        const bool fits =
            read_sorted([&](const Taken&, std::optional<std::size_t> of) { return of.value_or(0) == master; },
                        [&](const Taken& t) { analyser.packet(t.when, t.bytes, t.length_on_wire); });
        if (!fits) return std::nullopt;
        return analyser.finish();
    }

    // Analyses the packets of a master whose replies have a clock that is behind. nullopt: there is no sign of such a
    // clock.
    std::optional<Analysis> with_later_replies(std::size_t master, const Analysis& as_recorded, bool in_order) {
        constexpr std::uint64_t kFew = 8;
        constexpr std::uint64_t kFewer = 4;  // the faults must decrease by this factor
        if (as_recorded.directions != Directions::marked || unmatched(as_recorded.frames) < kFew) return std::nullopt;
        ReplyClock clock;
        read([&](const Taken& t, std::optional<std::size_t> of) {
            if (of == master) clock.look(t.when.at, finder_.find(t.bytes)->bytes);
        });
        const auto behind = clock.behind();
        if (!behind) return std::nullopt;
        Analyser analyser;
        LaterReplies later(analyser, *behind);
        const auto is_one = [&](const Taken&, std::optional<std::size_t> of) { return of.value_or(0) == master; };
        const auto take = [&](const Taken& t) {
            const auto frame = finder_.find(t.bytes);
            const bool reply = frame && has_datagrams(frame->bytes) && is_marked(frame->bytes);
            later.packet(t.when, t.bytes, t.length_on_wire, reply);
        };
        if (in_order)
            read([&](const Taken& t, std::optional<std::size_t> of) {
                if (is_one(t, of)) take(t);
            });
        else if (!read_sorted(is_one, take))
            return std::nullopt;
        later.finish();
        auto analysis = analyser.finish();
        auto& frames = analysis.frames;
        if (unmatched(frames) * kFewer > unmatched(as_recorded.frames)) return std::nullopt;
        frames.shortest_trip = frames.longest_trip = {};
        frames.longest_trip_at = {};
        analysis.remark =
            "replies are stamped before their requests, as by a clock that is behind or not exact: the replies were "
            "moved by " +
            std::to_string(*behind / std::chrono::microseconds(1)) +
            " us, so that they follow their requests; round trips are not known";
        return analysis;
    }

    // Reads the EtherCAT packets that `is_one` chooses, in order of time. False: there are too many packets to sort.
    template <class IsOne, class Take>
    bool read_sorted(IsOne is_one, Take take) {
        struct Kept {
            Moment when{};
            PacketOrigin origin{};
            std::size_t begin = 0, size = 0, length_on_wire = 0;
        };
        std::vector<Kept> kept;
        std::vector<std::byte> octets;
        bool fits = true;
        read([&](const Taken& t, std::optional<std::size_t> of) {
            if (!is_one(t, of) || !finder_.find(t.bytes)) return;
            fits = fits && octets.size() + kept.size() * sizeof(Kept) + t.bytes.size() <= kMostSorted;
            if (!fits) return;
            kept.push_back({t.when, t.origin, octets.size(), t.bytes.size(), t.length_on_wire});
            octets.insert(octets.end(), t.bytes.begin(), t.bytes.end());
        });
        if (!fits) return false;
        std::ranges::stable_sort(kept, {}, [](const Kept& k) { return k.when.at; });
        for (const auto& k : kept) take({k.when, k.origin, Bytes(octets).subspan(k.begin, k.size), k.length_on_wire});
        return true;
    }

    // Adds the remarks about the whole file.
    Analysis said(Analysis analysis) {
        const auto add = [&](const std::string& text) {
            if (!text.empty()) analysis.remark = text + (analysis.remark.empty() ? "" : "; ") + analysis.remark;
        };
        if (left_out_ != 0)
            add("frames of more than " + std::to_string(kMostMasters) + " masters: " + std::to_string(left_out_) +
                " are not analysed");
        if (twins_.missed() != 0)
            add("the packets are too many to look for copies of " + std::to_string(twins_.missed()) +
                " that are not in order of time; put them in order, as reordercap does");
        if (twins_.most_times() > 2)
            add(std::to_string(twins_.copies()) + " copies of " + std::to_string(twins_.repeated()) +
                " frames, which were recorded up to " + std::to_string(twins_.most_times()) + " times, are left out");
        else if (twins_.copies() != 0)
            add((twins_.each() ? "each frame was" : std::to_string(twins_.copies()) + " frames were") +
                std::string(" recorded twice: the second one is left out"));
        add(words_of_sight());
        add(cut_off_);
        if (untimed_ != 0)
            add(std::to_string(untimed_) + (untimed_ == 1 ? " packet has" : " packets have") +
                " no time in the file and got that of the packet before: times and losses near there are wrong");
        if (!left_out_interfaces_.empty()) add("left out is what is not Ethernet: " + left_out_interfaces_);
        if (dropped_ != 0)
            add("the recorder has dropped " + std::to_string(dropped_) + (dropped_ == 1 ? " packet" : " packets") +
                ": what seems to be lost may have been on the wire");
        const auto of_file = [this](FrameCounts& frames) {
            frames.packets = packets_;
            frames.dropped = dropped_;
        };
        of_file(analysis.frames);
        for (auto& other : analysis.others) of_file(other.frames);
        if (!problem_.empty())
            analysis.problem = problem_;
        else if (analysis.frames.ethercat == 0)
            analysis.problem = analysis.frames.cut != 0
                                   ? "every EtherCAT frame was cut by the recorder; record with full length"
                                   : "it holds no EtherCAT frame" +
                                         (left_out_interfaces_.empty()
                                              ? std::string()
                                              : "; left out is what is not Ethernet: " + left_out_interfaces_);
        return analysis;
    }

    [[nodiscard]] std::string words_of_sight() const {
        switch (sight_) {
            case RingSigns::Sight::none: return {};
            case RingSigns::Sight::whole:
                return "the file has no directions of packets; frames that come by twice show that it is of both NICs "
                       "of a ring";
            case RingSigns::Sight::sent:
                return "two source addresses send the same frames: this looks like a part of a ring, and is counted as "
                       "one master; losses are not known, and a working counter may be that of one part of the ring; "
                       "record both NICs in both directions";
            case RingSigns::Sight::part:
                if (too_many_)
                    return "the packets of a ring without directions are too many to be put in order, so its NICs are "
                           "shown as masters of their own, and losses are not known: analyse parts of the file, as "
                           "editcap makes them";
                return "this looks like a part of a ring, and its NICs are shown as masters of their own: two source "
                       "addresses send the same frames; losses are not known, and late replies, replies without a "
                       "request and working counters are those of one part; record both NICs in both directions";
            case RingSigns::Sight::like:
                return "two masters send the same frames at the same time: if they are the NICs of a broken ring, they "
                       "are one master, and each working counter is that of one part of the ring";
        }
        return {};
    }

    std::string path_;
    std::vector<std::uint32_t> interfaces_{};  // the numbers of the interfaces in the file, by PacketOrigin::interface
    FrameFinder finder_{};
    Masters masters_{};
    bool is_ring_ = false;
    Order order_{};  // of the EtherCAT packets
    RingSigns signs_{};
    RingSigns::Sight sight_ = RingSigns::Sight::none;
    bool too_many_ = false;  // a ring without directions has too many packets to sort
    Twins twins_{};
    std::uint64_t packets_ = 0;
    std::uint64_t left_out_ = 0;
    std::uint64_t dropped_ = 0;  // packets that the recorder has dropped
    std::uint64_t untimed_ = 0;
    std::string left_out_interfaces_{};
    std::string problem_{}, cut_off_{};
};

}  // namespace

Analysis analyse_file(const std::string& path) {
    const PipeCopy copy(path);
    if (!copy.whole()) {
        Analysis analysis;
        analysis.problem = "it is a pipe, and its copy in the folder for temporary files cannot be written";
        return analysis;
    }
    return Recording(copy.path().empty() ? path : copy.path()).analyse();
}

}  // namespace margay::analyse
