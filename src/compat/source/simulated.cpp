// Simulated segments in real time.
#include "compat/source/source.hpp"

#include "osal/linux/linux_osal.hpp"
#include "oshw/simulated/simulated_nic.hpp"
#include "sim/devices.hpp"
#include "wire/sii.hpp"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

namespace margay::compat {
namespace {

constexpr const char* kDemo = "coupler,digital_in_8,digital_out_8,analog_in_4,analog_out_2";

// A slave that is switched on later.
struct Late {
    std::uint32_t slave = 0;
    Time at{};
};

// Switches slaves on when their time has come, before the NIC is used.
class SwitchingNic final : public Nic {
  public:
    SwitchingNic(sim::Segment& segment, Osal& osal)
        : segment_(segment), osal_(osal), nic_(segment, osal, SimulatedNic::Options{.wire_time = true}) {}
    void switch_on_later(Late late) {
        segment_.set_power(late.slave, false, osal_.now());
        late_.push_back(late);
    }

    SendStatus send(std::span<const std::byte> frame) noexcept override {
        if (!late_.empty()) switch_on();
        return nic_.send(frame);
    }
    std::size_t receive(std::span<std::byte> into) noexcept override { return nic_.receive(into); }
    LinkState link_state() noexcept override { return nic_.link_state(); }
    MacAddress source_mac() const noexcept override { return nic_.source_mac(); }
    Time next_arrival() const noexcept override { return nic_.next_arrival(); }

  private:
    void switch_on() noexcept {
        const Time now = osal_.now();
        std::erase_if(late_, [&](const Late& late) {
            if (now < late.at) return false;
            segment_.set_power(late.slave, true, now);
            return true;
        });
    }

    sim::Segment& segment_;
    Osal& osal_;
    SimulatedNic nic_;
    std::vector<Late> late_;
};

class SimulatedSource final : public Source {
  public:
    // Adds the slave behind the last one; returns the fault, or an empty text.
    std::string add(const std::string& text) {
        std::string name = text;
        std::optional<Duration> delay;
        if (const auto at = text.find('@'); at != std::string::npos) {
            name = text.substr(0, at);
            delay = delay_from(text.substr(at + 1));
            if (!delay) return "'" + text + "': behind @ is a time, for example 3s or 500ms";
        }
        std::optional<std::uint16_t> alias;
        if (const auto hash = name.find('#'); hash != std::string::npos) {
            alias = alias_from(name.substr(hash + 1));
            if (!alias) return "'" + text + "': behind # is an alias, 1 to 65535";
            name.resize(hash);
        }
        auto device = device_by(name);
        if (!device) return "'" + name + "' is neither a simulated device nor a file; devices: " + known_devices();
        if (alias) set_alias(device->sii, *alias);
        const sim::EscDescription chip = device->chip;
        const std::uint32_t number = segment_.add(std::move(*device).assemble());
        if (!connect(number, chip)) return "'" + name + "' cannot be connected: the slave before it has no free port";
        before_ = chip;
        if (delay) late_.push_back({number, osal_.now() + *delay});
        return {};
    }
    void switch_on() {
        segment_.power_up(osal_.now());
        nic_.emplace(segment_, osal_);
        for (const Late& late : late_) nic_->switch_on_later(late);
    }
    Nic& nic() override { return *nic_; }
    Osal& osal() override { return osal_; }

  private:
    bool connect(std::uint32_t number, const sim::EscDescription& chip) {
        if (number == 0) return segment_.connect_master({0, 0});
        constexpr std::uint8_t kOrder[] = {1, 2, 3};
        for (const bool same_kind : {true, false})
            for (const std::uint8_t port : kOrder) {
                const auto kind = before_.ports[port].kind;
                if (kind < wire::PortKind::ebus || (same_kind && kind != chip.ports[0].kind)) continue;
                if (segment_.connect({number - 1, port}, {number, 0})) return true;
            }
        return false;
    }
    static std::optional<std::uint16_t> alias_from(const std::string& text) {
        if (text.empty() || text.size() > 5 || text.find_first_not_of("0123456789") != std::string::npos)
            return std::nullopt;
        const int alias = std::stoi(text);
        if (alias < 1 || alias > 0xFFFF) return std::nullopt;
        return static_cast<std::uint16_t>(alias);
    }
    static void set_alias(std::vector<std::byte>& image, std::uint16_t alias) {
        namespace sii = wire::sii;
        if (image.size() < sii::kConfigurationBytes) return;
        auto configuration = sii::load_configuration(image);
        configuration.alias = alias;
        sii::store_configuration(image, configuration);
    }
    static std::optional<Duration> delay_from(const std::string& text) {
        std::size_t digits = 0;
        while (digits < text.size() && text[digits] >= '0' && text[digits] <= '9') ++digits;
        if (digits == 0 || digits > 6) return std::nullopt;
        const int number = std::stoi(text.substr(0, digits));
        const std::string unit = text.substr(digits);
        if (unit == "s") return std::chrono::seconds(number);
        if (unit == "ms") return std::chrono::milliseconds(number);
        return std::nullopt;
    }
    static std::optional<sim::Device> device_by(const std::string& name) {
        if (auto device = sim::make_device(name)) return device;
        std::ifstream file(name, std::ios::binary);
        if (!file) return std::nullopt;
        std::vector<std::byte> image;
        std::transform(std::istreambuf_iterator<char>(file), {}, std::back_inserter(image),
                       [](char c) { return static_cast<std::byte>(c); });
        if (image.empty()) return std::nullopt;
        return sim::device_from_sii(std::move(image));
    }
    static std::string known_devices() {
        std::string all;
        for (const auto name : sim::device_names()) all.append(all.empty() ? "" : ", ").append(name);
        return all;
    }

    LinuxOsal osal_;
    sim::Segment segment_;
    sim::EscDescription before_;
    std::optional<SwitchingNic> nic_;
    std::vector<Late> late_;
};

}  // namespace

OpenedSource open_simulated(const std::string& what) {
    const std::string line = what == "demo" ? kDemo : what;
    auto source = std::make_unique<SimulatedSource>();
    for (std::size_t begin = 0; begin <= line.size();) {
        const std::size_t end = std::min(line.find(',', begin), line.size());
        if (const std::string fault = source->add(line.substr(begin, end - begin)); !fault.empty())
            return {nullptr, "sim:" + what + ": " + fault};
        begin = end + 1;
    }
    source->switch_on();
    return {std::move(source), {}};
}

}  // namespace margay::compat
