// The arena memory that the sequences of a mailbox need; see test/engine/frame_sizes_test.cpp.
#include "api/master.hpp"
#include "mailbox/coe_complete.hpp"
#include "mailbox/coe_information.hpp"
#include "mailbox/coe_mail_pdo.hpp"
#include "mailbox/coe_pdo.hpp"
#include "mailbox/coe_pdo_write.hpp"
#include "mailbox/mailbox_bus.hpp"
#include "mailbox/soe_pdo.hpp"

namespace margay {
namespace {

TEST(MailboxFrameSizes, OfEachSequence) {
#if defined(__SANITIZE_ADDRESS__) || !defined(__OPTIMIZE__)
    GTEST_SKIP() << "sizes are those of an optimized build";
#endif
    MailboxBus bus;
    bus.add_stack(128);
    bus.start();
    Network& network = master_of(*bus.ctx)->network;
    MailboxChannel& channel = network.mailboxes.channel(1);
    const auto expect = [&](const char* name, std::size_t bytes, auto task) {
        EXPECT_TRUE(static_cast<bool>(task));
        EXPECT_EQ(network.arena().used_bytes(), bytes) << name;
        TaskAccess::end(task);
        EXPECT_EQ(network.arena().used_bytes(), 0U) << name;
    };
    std::array<std::byte, 4> memory{};
    ObjectQuery query(0x1000);
    expect("sdo_upload", 512, sdo_upload(channel, {}, memory, {}));
    expect("sdo_upload_once", 512, sdo_upload_once(channel, {}, memory, {}));
    expect("sdo_download", 512, sdo_download(channel, {}, memory, {}));
    expect("sdo_upload_singly", 256, sdo_upload_singly(channel, {}, memory, {}));
    expect("ask_information", 1024, ask_information(channel, query, {}, {}));
    expect("fetch_tx_pdo", 1024, fetch_tx_pdo(channel, 1, memory, {}));
    expect("soe_read", 512, soe_read(channel, {}, memory, {}));
    expect("soe_write", 512, soe_write(channel, {}, memory, {}));
    expect("soe_execute", 512, soe_execute(channel, {}, {}));
    FoundSms found{};
    CheckValue content;
    expect("find_sms_by_soe", 256, find_sms_by_soe(channel, bus.ctx->slave(1), found, content));
    UndescribedPdos undescribed{};
    expect("find_sms_by_coe", 256, find_sms_by_coe(channel, bus.ctx->slave(1), {}, found, undescribed, {}));
    expect("write_sm_pdos", 512, write_sm_pdos(channel, {}, {}));
    // One started read: its sequences, the pump and the mailbox.
    SdoUpload request;
    request.slave = 1;
    request.index = 0x1000;
    request.data = memory;
    ASSERT_TRUE(submit(*bus.ctx, request).ok());
    bus.step();
    EXPECT_LE(network.arena().used_bytes(), 4096U);
    bus.run(request);
    bus.idle(1ms);
    EXPECT_EQ(network.arena().used_bytes(), 0U);
}

}  // namespace
}  // namespace margay
