// The checks of subdevice_check: faults of one device, made between its firmware and its ESC, are found by name.
#include "samples/conformance_faults.hpp"

#include <set>

namespace margay::samples::conformance {
namespace {

std::vector<Fault> all_faults() {
    std::vector<Fault> all;
    for (const auto faults : {machine_faults(), mail_faults(), object_faults()})
        all.insert(all.end(), faults.begin(), faults.end());
    return all;
}

TEST(SubdeviceCheck, FaultsBetweenFirmwareAndEscAreFoundByName) {
    for (const auto& fault : all_faults()) {
        auto device = sim::make_device(fault.device).value();
        if (fault.prepare != nullptr) fault.prepare(device);
        device.firmware = std::make_unique<FaultyFirmware>(std::move(device.firmware), fault);
        const auto checked = check_it(std::move(device), {.only = only(fault.check)});
        EXPECT_TRUE(has(checked.report, fault.check, fault.severity)) << fault.check << ": " << fault.what << "\n"
                                                                      << report_text(checked.report, true);
    }
}

TEST(SubdeviceCheck, ADeviceThatNeedsSync1PassesTheChecksOfTheClock) {
    static constexpr Fault kNeedsSync1{
        .check = "clock", .what = "needs SYNC1", .read = need_sync1, .prepare = announce_sync1};
    auto device = sim::make_device("odd_device").value();
    announce_sync1(device);
    device.firmware = std::make_unique<FaultyFirmware>(std::move(device.firmware), kNeedsSync1);
    const auto checked = check_it(std::move(device), {.only = "clock."});
    for (const auto& check : checked.report.checks)
        EXPECT_TRUE(check.findings.empty()) << check.name << "\n" << report_text(checked.report, true);
    const auto* const sync1 = find(checked.report, "clock.sync1");
    ASSERT_NE(sync1, nullptr);
    EXPECT_EQ(sync1->outcome, Outcome::passed) << sync1->reason;
}

std::string text_of(std::string_view device_name, const Fault& fault, std::string_view only_checks) {
    auto device = sim::make_device(device_name).value();
    device.firmware = std::make_unique<FaultyFirmware>(std::move(device.firmware), fault);
    return report_text(check_it(std::move(device), {.only = std::string(only_checks)}).report, true);
}

// The reported cause is the message that is not a reply to the request, and not the missing reply.
TEST(SubdeviceCheck, AReplyThatIsNotTakenIsNamed) {
    static constexpr Fault kOtherSubindex{.check = "sdo",
                                          .what = "downloads are answered with subindex 9",
                                          .write = [](std::uint16_t address, Octets& data) {
                                              if (is_service(address, data, coe::Service::sdo_response) &&
                                                  data.size() >= 16 && data[8] == std::byte{0x60})
                                                  data[11] = std::byte{9};
                                              return true;
                                          }};
    const auto text = text_of("odd_device", kOtherSubindex, "sdo.write");
    EXPECT_NE(text.find("got no valid reply, but a message of protocol CoE"), std::string::npos) << text;
    static constexpr Fault kOtherStation{
        .check = "sdo", .what = "the address is 0x1234", .write = [](std::uint16_t address, Octets& data) {
            if (is_mail(address, data)) store_le<std::uint16_t>(data, 2, 0x1234);
            return true;
        }};
    const auto other = text_of("odd_device", kOtherStation, "mailbox.answers");
    EXPECT_NE(other.find("with the address 0x1234"), std::string::npos) << other;
}

// The SII announces only VoE, so the check has no message of a protocol of the slave.
TEST(SubdeviceCheck, ASlaveWithoutCoEMayRefuseTheProtocolBeforeTheLength) {
    auto device = sim::make_device("odd_device").value();
    constexpr std::size_t kProtocols = 0x1C * 2;
    store_le<std::uint16_t>(device.sii, kProtocols, mailbox_protocol::kVoE);
    const auto report = check_it(std::move(device), {.only = "mailbox.length"}).report;
    EXPECT_TRUE(report.conforms()) << report_text(report, false);
    EXPECT_EQ(find(report, "mailbox.length")->outcome, Outcome::passed);
}

// A check that no fault makes fail proves nothing.
TEST(SubdeviceCheck, EveryCheckHasAFaultThatItFinds) {
    std::set<std::string_view> found;
    for (const auto& row : kQuirks) found.insert(row.check);
    for (const auto& fault : all_faults()) found.insert(fault.check);
    std::set<std::string> without;
    for (const auto& check : all_checks())
        if (!found.contains(check.name)) without.emplace(check.name);
    EXPECT_EQ(without, std::set<std::string>{});
}

}  // namespace
}  // namespace margay::samples::conformance
