#include "source/source.hpp"

#include "oshw/filter_nic.hpp"
#include "source/interface_nic.hpp"

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <string_view>

namespace margay::hosted {

void Source::StandardError::line(std::string_view text) noexcept {
    std::fprintf(stderr, "%.*s\n", static_cast<int>(text.size()), text.data());
}

// Switches on the late slaves when the first frame after their time is sent.
class Source::SwitchingNic final : public FilterNic {
  public:
    SwitchingNic(SimulatedNic& nic, SimulatedSegment& simulated, Osal& osal)
        : FilterNic(nic), simulated_(simulated), osal_(osal) {}

    SendStatus send(std::span<const std::byte> frame) noexcept override {
        if (!simulated_.late.empty()) simulated_.switch_on_late(osal_.now());
        return inner().send(frame);
    }
    // Also called here, because a program may wait for the link without sending.
    LinkState link_state() noexcept override {
        if (!simulated_.late.empty()) simulated_.switch_on_late(osal_.now());
        return inner().link_state();
    }

  private:
    SimulatedSegment& simulated_;
    Osal& osal_;
};

Source::Source() = default;
Source::~Source() = default;

std::string Source::finish() {
    std::string said;
    const auto say = [&](std::string_view text) {
        if (!text.empty()) said.append(said.empty() ? "" : "; ").append(text);
    };
    if (ring_recorder_ && !ring_recorder_->close()) {
        recording_lost_ = true;
        say(ring_recorder_->problem());
    }
    if (recorder_ && !recorder_->close()) {
        recording_lost_ = true;
        say(recorder_->problem());
    }
    const auto* problem = replay_ ? &replay_->problem() : nullptr;
    if (second_replay_ && problem->empty()) problem = &second_replay_->problem();
    if (problem != nullptr && !problem->empty())
        say(*problem +
            " (a recording answers only what the recorded master asked: replay one that this program made itself by "
            "--record with the same arguments; ethercat analyse FILE shows what the recording of any master contains)");
    return said;
}

std::string Source::repeated_answers() const {
    std::uint64_t datagrams = 0;
    for (const auto* replay : {&replay_, &second_replay_})
        if (*replay) datagrams += (*replay)->counters().repeated;
    if (datagrams == 0) return {};
    return "datagrams that were sent more often than in the recording, and got the last recorded answer again: " +
           std::to_string(datagrams);
}

std::string Source::look_for_interfaces() {
    std::string problem;
    for (const auto& nic : hotplug_) {
        nic->look();
        if (problem.empty()) problem = nic->problem();
    }
    return problem;
}

// Builds a Source in this order: operating system layer, NIC, recorder, trace.
class SourceOpener {
  public:
    OpenedSource open(const std::string& text, const SourceOptions& options) {
        times_ = options.times;
        constexpr std::string_view kSimulated = "sim:";
        constexpr std::string_view kRecorded = "pcap:";
        std::string problem;
        if (text.starts_with(kSimulated))
            problem = open_simulated(text.substr(kSimulated.size()), options.real_time);
        else if (text.starts_with(kRecorded))
            problem = open_recording(text.substr(kRecorded.size()), options.record);
        else
            problem = open_interface(text, options.wait_for_interfaces);
        if (problem.empty() && !options.record.empty())
            problem =
                source_->second_outermost_ != nullptr ? record_ring_to(options.record) : record_to(options.record);
        if (!problem.empty()) return OpenedSource(problem);
        if (options.trace)
            source_->outermost_ =
                &source_->trace_.emplace(*source_->outermost_, *source_->osal_, source_->standard_error_);
        if (options.trace && source_->second_outermost_ != nullptr)
            source_->second_outermost_ =
                &source_->second_trace_.emplace(*source_->second_outermost_, *source_->osal_, source_->standard_error_);
        join_timed_ends();
        return OpenedSource(std::move(source_));
    }

  private:
    void join_timed_ends() {
        if (source_->second_outermost_ == nullptr) return;
        const FrameTiming first = source_->outermost_->timing();
        const FrameTiming second = source_->second_outermost_->timing();
        if (first.send_at != nullptr && second.send_at != nullptr)
            source_->timed_pair_.emplace(*first.send_at, *second.send_at);
        if (first.received != nullptr && second.received != nullptr)
            source_->received_.emplace(*first.received, *second.received);
    }

    // One interface, or two with '+' between their names.
    std::string open_interface(const std::string& names, bool wait) {
        const auto plus = names.find('+');
        const bool ring = plus != std::string::npos;
        if (ring && names.find('+', plus + 1) != std::string::npos)
            return "'" + names + "': a ring has two ends, and these are more than two interfaces";
        const auto first = parse_interface(names.substr(0, plus));
        const auto other = ring ? parse_interface(names.substr(plus + 1)) : InterfaceText();
        if (ring && (first.name.empty() || other.name.empty()))
            return "'" + names + "': the name of an interface is missing beside '+'";
        if (ring && other.name == first.name) return "'" + names + "': both interfaces are the same, a ring needs two";
        if (first.name.empty() && !names.empty()) return "'" + names + "': the name of the interface is missing";
        source_->osal_ = &source_->linux_osal_.emplace();
        if (wait) return await_ends(first, ring ? &other : nullptr);
        auto problem = open_end(first, times_, source_->interface_, source_->outermost_);
        if (problem.empty() && ring)
            problem = open_end(other, times_, source_->second_interface_, source_->second_outermost_);
        const bool hardware = times_.stamps == WantedTimes::Stamps::hardware;
        if (problem.empty() && ring && hardware && !share_a_clock(first.name, other.name))
            return "'" + names + "': the hardware of each interface has a clock of its own, and the frames of one " +
                   "come back at the other; software time stamps have one clock";
        return problem;
    }

    static void remark(const std::string& text) {
        if (!text.empty()) std::fprintf(stderr, "%s: %s\n", program_invocation_short_name, text.c_str());
    }

    std::string await_ends(const InterfaceText& first, const InterfaceText* other) {
        for (const InterfaceText* end : {&first, other}) {
            if (end == nullptr) continue;
            const bool is_second = end == other;
            const auto& nic = source_->hotplug_.emplace_back(std::make_shared<HotplugNic>(*end, is_second ? 1U : 0U));
            (is_second ? source_->second_outermost_ : source_->outermost_) = nic.get();
            remark(nic->remark());
            if (!nic->may_come()) return nic->problem();
        }
        return {};
    }

    static std::string open_end(const InterfaceText& wanted, const WantedTimes& times, std::shared_ptr<Nic>& nic,
                                Nic*& outermost) {
        auto opened = open_interface_nic(wanted, times);
        remark(opened.remark);
        nic = std::move(opened.nic);
        outermost = nic.get();
        return opened.error;
    }

    std::string open_recording(const std::string& file, const std::string& record) {
        if (times_.any()) return "pcap:" + file + ": a recording has no times of frames";
        if (file.empty()) return "'pcap:': the name of the recording is missing";
        std::error_code ignored;
        if (!record.empty() && std::filesystem::equivalent(file, record, ignored))
            return "recording " + file + ": it cannot be replayed and written at the same time";
        auto& osal = source_->virtual_osal_.emplace();
        source_->osal_ = &osal;
        auto& nic = source_->replay_.emplace(osal);
        source_->outermost_ = &nic;
        if (!nic.load(file)) return with_two_files(file, nic.problem());
        std::array<MacAddress, 2> macs{};
        if (!nic.capture().is_of_ring(macs)) return {};
        auto& second = source_->second_replay_.emplace(osal);
        source_->second_outermost_ = &second;
        if (nic.load_ring(file, second)) return {};
        return nic.problem().empty() ? second.problem() : nic.problem();
    }

    // A ring is recorded in one file. For two files, the message names the command that puts them together.
    static std::string with_two_files(const std::string& file, const std::string& problem) {
        const auto plus = file.find('+');
        std::error_code ignored;
        if (plus == std::string::npos || std::filesystem::exists(file, ignored)) return problem;
        const auto other = file.substr(plus + (file.substr(plus + 1).starts_with("pcap:") ? 6 : 1));
        return "'pcap:" + file +
               "': a ring is one recording with two interfaces; join two files by: mergecap -I none -w " +
               "ring.pcapng " + file.substr(0, plus) + " " + other;
    }

    std::string open_simulated(const std::string& what, bool real_time) {
        if (real_time)
            source_->osal_ = &source_->linux_osal_.emplace();
        else
            source_->osal_ = &source_->virtual_osal_.emplace();
        Osal& osal = *source_->osal_;
        auto loaded = load_segment(what, osal.now());
        if (!loaded) return loaded.error();
        source_->simulated_ = loaded.take();
        source_->outermost_ = &source_->simulated_nic_.emplace(source_->simulated_->segment, osal, nic_options(0));
        switch_later(*source_->simulated_nic_, source_->switching_, source_->outermost_);
        if (!source_->simulated_->segment.master_link(1)) return {};
        auto& second = source_->second_simulated_nic_.emplace(source_->simulated_->segment, osal, nic_options(1));
        source_->simulated_nic_->set_other_end(&second);
        second.set_other_end(&*source_->simulated_nic_);
        source_->second_outermost_ = &second;
        switch_later(second, source_->second_switching_, source_->second_outermost_);
        return {};
    }

    [[nodiscard]] SimulatedNic::Options nic_options(unsigned end) const {
        constexpr std::size_t kHeld = 256;
        return {.round_trip = source_->simulated_->round_trip,
                .wire_time = true,
                .master_port = end,
                .time_stamps = times_.stamps != WantedTimes::Stamps::off,
                .timed_frames = times_.send_at ? kHeld : 0};
    }

    void switch_later(SimulatedNic& nic, std::unique_ptr<Source::SwitchingNic>& around, Nic*& outermost) {
        if (source_->simulated_->late.empty()) return;
        around = std::make_unique<Source::SwitchingNic>(nic, *source_->simulated_, *source_->osal_);
        outermost = around.get();
    }

    // Recordings of hardware use the wall-clock time. Recordings in virtual time do not, so that equal runs write equal
    // files.
    [[nodiscard]] Duration epoch() const {
        if (source_->virtual_time()) return {};
        return std::chrono::system_clock::now().time_since_epoch() - source_->osal_->now().time_since_epoch();
    }

    std::string record_ring_to(const std::string& file) {
        auto& recorder =
            source_->ring_recorder_.emplace(*source_->outermost_, *source_->second_outermost_, *source_->osal_);
        source_->outermost_ = &recorder.first();
        source_->second_outermost_ = &recorder.second();
        return recorder.open(file, epoch()) ? std::string() : recorder.problem();
    }

    std::string record_to(const std::string& file) {
        auto& recorder = source_->recorder_.emplace(*source_->outermost_, *source_->osal_);
        source_->outermost_ = &recorder;
        return recorder.open(file, epoch()) ? std::string() : recorder.problem();
    }

    WantedTimes times_{};
    std::unique_ptr<Source> source_ = std::make_unique<Source>();
};

OpenedSource open_source(const std::string& text, const SourceOptions& options) {
    return SourceOpener().open(text, options);
}

}  // namespace margay::hosted
