#include "hand.hpp"

#include "sim/segment.hpp"

#include <algorithm>

namespace margay::sim::test {

namespace coe = wire::coe;
using coe::SdoLayout;

Hand::Hand(Device device) {
    model = read_sii_model(device.sii);
    rig.segment.add(std::move(device).assemble());
    EXPECT_TRUE(rig.segment.connect_master({0, 0}));
    rig.on();
    wait(5ms);
    rig.put<std::uint16_t>(0, reg::kStationAddress.address, 0x1001);
}

void Hand::set_sync_manager(unsigned n, std::uint16_t start, std::uint16_t length, std::uint8_t control) {
    // The settings of an enabled SyncManager are not writable.
    rig.put<std::uint8_t>(0, static_cast<std::uint16_t>(reg::sync_manager(n).address + 6), 0);
    std::vector<std::byte> octets(8);
    store_le<std::uint16_t>(octets, 0, start);
    store_le<std::uint16_t>(octets, 2, length);
    octets[4] = std::byte{control};
    octets[6] = std::byte{static_cast<std::uint8_t>(length != 0 ? 1 : 0)};
    EXPECT_EQ(rig.write(0, reg::sync_manager(n).address, octets).wkc, 1);
}

void Hand::configure_mailboxes(bool boot) {
    const auto& box = boot ? model.fixed.mailboxes.boot : model.fixed.mailboxes.standard;
    if (box.out_bytes == 0) return;
    set_sync_manager(0, box.out_start, box.out_bytes, 0x26);
    set_sync_manager(1, box.in_start, box.in_bytes, 0x22);
    write_mailbox_ = box.out_start;
    read_mailbox_ = box.in_start;
    mailbox_bytes = box.out_bytes;
    read_bytes_ = box.in_bytes;
    counter_ = 0;
}

void Hand::configure_process_data() {
    for (const auto& area : model.areas) {
        const bool out = area.info.type == SmType::outputs;
        auto& image = out ? outputs : inputs;
        const auto length = image.empty() ? std::max<std::uint32_t>(area.info.length_bytes, (area.pdo_bits + 7) / 8)
                                          : static_cast<std::uint32_t>(image.size());
        image.resize(length);
        set_sync_manager(area.sync_manager, area.info.start, static_cast<std::uint16_t>(length), area.info.control);
    }
}

AlStatus Hand::status() {
    const auto raw = rig.read(0, reg::kAlStatus.address, 6);
    const auto word = raw.as<std::uint16_t>();
    return {static_cast<AlState>(word & 0x0F), (word & 0x10) != 0, raw.as<std::uint16_t>(4)};
}

AlStatus Hand::ask(AlState state, Duration patience, unsigned control_bits) {
    rig.put<std::uint16_t>(0, reg::kAlControl.address,
                           static_cast<std::uint16_t>(static_cast<unsigned>(state) | control_bits));
    const auto until = rig.now + patience;
    auto reached = status();
    while (rig.now < until && reached.state != state && !reached.error) {
        tick();
        reached = status();
    }
    return reached;
}

AlStatus Hand::to(AlState state) {
    auto now = status();
    if (state <= now.state || state == AlState::boot) {
        if (state == AlState::boot) configure_mailboxes(true);
        return ask(state);
    }
    if (now.state == AlState::init) {
        configure_mailboxes();
        now = ask(AlState::preop);
    }
    if (state >= AlState::safeop && now.state == AlState::preop && !now.error) {
        configure_process_data();
        now = ask(AlState::safeop);
    }
    if (state == AlState::op && now.state == AlState::safeop && !now.error) {
        keep_cycling = true;
        cycle();
        now = ask(AlState::op);
    }
    return now;
}

void Hand::tick() {
    if (keep_cycling) return cycle();
    wait(1ms);
}

void Hand::wait(Duration how_long) {
    rig.now += how_long;
    (void)rig.read(0, reg::kAlStatus.address, 2);  // a frame advances the time of the segment
}

void Hand::cycle(unsigned n) {
    const auto* out = static_cast<const SiiModel::Area*>(nullptr);
    const auto* in = out;
    for (const auto& area : model.areas) (area.info.type == SmType::outputs ? out : in) = &area;
    for (; n > 0; --n) {
        rig.now += 1ms - rig.step;
        std::vector<Rig::Request> requests;
        if (out != nullptr) requests.push_back({Command::APWR, {RingPosition{0}, out->info.start}, outputs});
        if (in != nullptr)
            requests.push_back(
                {Command::APRD, {RingPosition{0}, in->info.start}, std::vector<std::byte>(inputs.size())});
        const auto replies = rig.frame(requests);
        if (in != nullptr && replies.back().wkc == 1) inputs = replies.back().data;
    }
}

bool Hand::put(wire::MailboxType type, std::vector<std::byte> data) {
    std::vector<std::byte> message(mailbox_bytes);
    counter_ = wire::next_mailbox_counter(counter_);
    wire::store_mailbox_header(message,
                               {.length = static_cast<std::uint16_t>(data.size()), .type = type, .counter = counter_});
    std::copy(data.begin(), data.end(), message.begin() + wire::kMailboxHeaderBytes);
    return rig.write(0, write_mailbox_, message).wkc == 1;
}

std::optional<Hand::Mail> Hand::take(Duration patience) {
    const auto until = rig.now + patience;
    while (true) {
        const auto reply = rig.read(0, read_mailbox_, read_bytes_);
        if (reply.wkc == 1) {
            const auto header = wire::load_mailbox_header(reply.data);
            const auto length = std::min<std::size_t>(header.length, read_bytes_ - wire::kMailboxHeaderBytes);
            const auto from = reply.data.begin() + wire::kMailboxHeaderBytes;
            return Mail{header, {from, from + static_cast<std::ptrdiff_t>(length)}};
        }
        if (rig.now >= until) return std::nullopt;
        tick();
    }
}

std::vector<std::byte> Hand::exchange(wire::MailboxType type, std::vector<std::byte> data) {
    EXPECT_TRUE(put(type, std::move(data))) << "the mailbox is full";
    while (const auto mail = take()) {
        if (mail->header.type == type &&
            (type != wire::MailboxType::coe || coe::load_header(mail->data).service != coe::Service::emergency))
            return mail->data;
    }
    ADD_FAILURE() << "no reply";
    return std::vector<std::byte>(coe::kSdoBytes);
}

std::vector<std::byte> Hand::upload(unsigned index, unsigned subindex, bool complete) {
    std::vector<std::byte> request(coe::kSdoBytes);
    coe::store_header(request, {0, coe::Service::sdo_request});
    request[2] = std::byte{static_cast<std::uint8_t>(complete ? 0x50 : 0x40)};
    SdoLayout::index::store(request, static_cast<std::uint16_t>(index));
    SdoLayout::subindex::store(request, static_cast<std::uint8_t>(subindex));
    auto reply = exchange(wire::MailboxType::coe, request);
    last_abort = Abort::none;
    const auto command = std::to_integer<unsigned>(reply[2]);
    if (command == 0x80) {
        last_abort = static_cast<Abort>(SdoLayout::complete_size::load(reply));
        return {};
    }
    if ((command & 2) != 0) return {reply.begin() + 6, reply.begin() + 10 - (command >> 2 & 3)};
    const auto size = SdoLayout::complete_size::load(reply);
    std::vector<std::byte> data(reply.begin() + 10, reply.end());
    for (unsigned toggle = 0; data.size() < size; toggle ^= 0x10) {
        std::vector<std::byte> segment(coe::kSdoBytes);
        coe::store_header(segment, {0, coe::Service::sdo_request});
        segment[2] = static_cast<std::byte>(0x60 | toggle);
        reply = exchange(wire::MailboxType::coe, segment);
        const auto answer = std::to_integer<unsigned>(reply[2]);
        if (answer == 0x80) {
            last_abort = static_cast<Abort>(SdoLayout::complete_size::load(reply));
            return data;
        }
        EXPECT_EQ(answer & 0x10, toggle);
        const auto unused = reply.size() == 10 ? answer >> 1 & 7u : 0u;
        data.insert(data.end(), reply.begin() + 3, reply.end() - unused);
    }
    return data;
}

std::int64_t Hand::number(unsigned index, unsigned subindex) {
    const auto data = upload(index, subindex);
    switch (data.size()) {
        case 1: return load_le<std::int8_t>(data);
        case 2: return load_le<std::int16_t>(data);
        case 4: return load_le<std::int32_t>(data);
        default: ADD_FAILURE() << "object 0x" << std::hex << index << ": no number"; return 0;
    }
}

void Hand::download(unsigned index, unsigned subindex, std::int64_t value, std::size_t size) {
    std::vector<std::byte> request(coe::kSdoBytes);
    coe::store_header(request, {0, coe::Service::sdo_request});
    request[2] = static_cast<std::byte>(0x23 | (4 - size) << 2);
    SdoLayout::index::store(request, static_cast<std::uint16_t>(index));
    SdoLayout::subindex::store(request, static_cast<std::uint8_t>(subindex));
    store_le<std::uint32_t>(request, 6, static_cast<std::uint32_t>(value));
    const auto reply = exchange(wire::MailboxType::coe, request);
    last_abort = reply[2] == std::byte{0x80} ? static_cast<Abort>(SdoLayout::complete_size::load(reply)) : Abort::none;
}

}  // namespace margay::sim::test
