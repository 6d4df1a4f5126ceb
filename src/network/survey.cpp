#include "network/survey.hpp"

#include "network/expectation.hpp"
#include "station/sii_contents.hpp"

#include <algorithm>

namespace margay {
namespace {

namespace reg = wire::reg;
using wire::Command;
using wire::DatagramAddress;

void store_dl_information(Slave& slave, Bytes dl) {
    const auto at = [&](wire::Register r) { return std::to_integer<std::uint8_t>(dl[r.address]); };
    slave.dl = {.type = at(reg::kType),
                .revision = at(reg::kRevision),
                .build = load_le<std::uint16_t>(dl, reg::kBuild.address),
                .fmmus = at(reg::kFmmuCount),
                .sync_managers = at(reg::kSyncManagerCount),
                .ram_kib = at(reg::kRamSize),
                .features = load_le<std::uint16_t>(dl, reg::kFeatures.address)};
    slave.dl.dc = (slave.dl.features & wire::features::kDistributedClocks) != 0;
    slave.dl.dc_64bit = (slave.dl.features & wire::features::kDistributedClocks64Bit) != 0;
    for (unsigned p = 0; p < 4; ++p)
        slave.ports[p].type = static_cast<PortType>((at(reg::kPortDescriptor) >> (2 * p)) & 3);
}

// Reads the properties of the ESC, in one frame.
Task<Result<>> read_esc(Network& network, Slave& slave) {
    const Station station = network.station(slave);
    Link& link = network.engine.link();
    std::array<std::byte, reg::kDlInformation.length> dl{};
    std::array<std::byte, 2> alias{};
    std::array<std::byte, 2> dl_status{};
    std::array<std::byte, 1> configuration{};
    const auto at = [&](wire::Register r) { return DatagramAddress(slave.station_address, r.address); };
    Datagram read_dl(link, Command::FPRD, at(reg::kDlInformation), MutableBytes(dl));
    Datagram read_alias(link, Command::FPRD, at(reg::kStationAlias), MutableBytes(alias));
    Datagram read_status(link, Command::FPRD, at(reg::kDlStatus), MutableBytes(dl_status));
    Datagram read_configuration(link, Command::FPRD, at(reg::kEscConfiguration), MutableBytes(configuration));
    co_await together(read_dl, read_alias, read_status, read_configuration);
    for (const Datagram* datagram : {&read_dl, &read_alias, &read_status, &read_configuration}) {
        const Error error =
            error_of_reply(station, datagram->reply(), Step::read_dl_information, reg::kDlInformation.address);
        if (error.code != Errc::none) co_return error;
    }
    store_dl_information(slave, dl);
    slave.alias = load_le<std::uint16_t>(alias);
    slave.dl_status = load_le<std::uint16_t>(dl_status);
    slave.device_emulation =
        (std::to_integer<std::uint8_t>(configuration[0]) & wire::esc_configuration::kDeviceEmulation) != 0;
    co_return Nothing{};
}

}  // namespace

Task<Result<>> survey(Network& network, Slave& slave, bool again) {
    slave.sm_count = 0;
    slave.fmmu_count = 0;
    slave.name_bytes = 0;
    slave.mailbox = {};
    slave.boot_mailbox = {};
    slave.device_id_source = DeviceIdSource::none;
    slave.device_id.reset();
    auto esc = co_await read_esc(network, slave);
    Result<> read = esc;
    if (esc) read = co_await read_sii_contents(network.station(slave), slave);
    const bool parsed = !read && read.error().step == Step::parse_sii;
    if (again) slave.error = read || parsed ? Error{} : read.error();
    if (!read && (!again || parsed)) network.note(slave, read.error());
    slave.seen = read || parsed;
    if (!slave.seen) co_return read;
    if (network.expected.empty()) co_return Nothing{};
    co_return co_await required(network.expectation->read_id(network, slave));
}

}  // namespace margay
