// An operation of each mailbox protocol is ended at each of its steps: by cancel(), by INIT, or by a loss of power of
// the slave. It ends in time and with an error text, and afterwards the same operation succeeds.
#include "mailbox/all_protocols.hpp"

#include <functional>

namespace margay {
namespace {

namespace all = all_protocols;

// A request with the memory that it uses.
struct Attempt {
    std::shared_ptr<Request> request;  // with the destructor of its own type
    std::vector<std::byte> memory;
    std::function<bool()> right = [] { return true; };  // the check after success
};

struct Protocol {
    const char* name;
    std::unique_ptr<Attempt> (*make)(Context& ctx);
    std::unique_ptr<Attempt> (*before)(Context& ctx) = nullptr;  // the operation that must have succeeded before
};

void PrintTo(const Protocol& protocol, std::ostream* out) { *out << protocol.name; }

template <class R>
std::pair<std::unique_ptr<Attempt>, R*> attempt() {
    auto one = std::make_unique<Attempt>();
    auto request = std::make_shared<R>();
    R* const it = request.get();
    it->slave = 1;
    one->request = std::move(request);
    return {std::move(one), it};
}

std::unique_ptr<Attempt> submitted(Context& ctx, std::unique_ptr<Attempt> one) {
    const auto done = submit(ctx, *one->request);
    EXPECT_TRUE(done.ok()) << MailboxBus::words(done.error());
    return one;
}

std::unique_ptr<Attempt> sdo_download(Context& ctx) {
    auto [one, it] = attempt<SdoDownload>();
    one->memory = pattern(all::kObjectBytes);
    it->index = all::kObject;
    it->data = Bytes(one->memory);
    return submitted(ctx, std::move(one));
}
std::unique_ptr<Attempt> sdo_upload(Context& ctx) {
    auto [one, it] = attempt<SdoUpload>();
    one->memory.resize(all::kObjectBytes);
    it->index = all::kObject;
    it->data = one->memory;
    one->right = [&got = one->memory] { return got == pattern(all::kObjectBytes); };
    return submitted(ctx, std::move(one));
}
std::unique_ptr<Attempt> foe_write(Context& ctx) {
    auto [one, it] = attempt<FoeWrite>();
    one->memory = pattern(1500);
    it->name = "file";
    it->data = Bytes(one->memory);
    return submitted(ctx, std::move(one));
}
std::unique_ptr<Attempt> foe_read(Context& ctx) {
    auto [one, it] = attempt<FoeRead>();
    one->memory.resize(4000);
    it->name = "file";
    it->data = one->memory;
    one->right = [&got = one->memory, it = it] {
        got.resize(it->bytes());
        return got == pattern(1500);
    };
    return submitted(ctx, std::move(one));
}
std::unique_ptr<Attempt> soe_write(Context& ctx) {
    auto [one, it] = attempt<SoeWrite>();
    one->memory = pattern(4);
    it->idn = all::kIdn;
    it->data = Bytes(one->memory);
    return submitted(ctx, std::move(one));
}
std::unique_ptr<Attempt> soe_read(Context& ctx) {
    auto [one, it] = attempt<SoeRead>();
    one->memory.resize(4);
    it->idn = all::kIdn;
    it->data = one->memory;
    one->right = [&got = one->memory] { return got == pattern(4); };
    return submitted(ctx, std::move(one));
}
std::unique_ptr<Attempt> aoe_net_id(Context& ctx) {
    auto [one, it] = attempt<AoeSetNetId>();
    it->net_id = all::kAoeTarget.net_id;
    return submitted(ctx, std::move(one));
}
std::unique_ptr<Attempt> aoe_read(Context& ctx) {
    auto [one, it] = attempt<AoeRead>();
    one->memory.resize(16);
    it->target = all::kAoeTarget;
    it->data = one->memory;
    return submitted(ctx, std::move(one));
}
std::unique_ptr<Attempt> aoe_write(Context& ctx) {
    auto [one, it] = attempt<AoeWrite>();
    one->memory = pattern(16);
    it->target = all::kAoeTarget;
    it->data = Bytes(one->memory);
    return submitted(ctx, std::move(one));
}
std::unique_ptr<Attempt> voe_send(Context& ctx) {
    auto [one, it] = attempt<VoeSend>();
    one->memory = pattern(40);
    it->header = {0x4D47, 1};
    it->data = Bytes(one->memory);
    return submitted(ctx, std::move(one));
}
std::unique_ptr<Attempt> eoe_set_ip(Context& ctx) {
    auto [one, it] = attempt<EoeSetIp>();
    it->ip.address = {192, 168, 5, 2};
    return submitted(ctx, std::move(one));
}
std::unique_ptr<Attempt> eoe_get_ip(Context& ctx) {
    auto [one, it] = attempt<EoeGetIp>();
    one->right = [it = it] { return it->ip.address == Ipv4Address{192, 168, 5, 2}; };
    return submitted(ctx, std::move(one));
}
std::unique_ptr<Attempt> object_list(Context& ctx) {
    auto [one, it] = attempt<ObjectListRequest>();
    (void)it;
    return submitted(ctx, std::move(one));
}

constexpr Protocol kProtocols[] = {
    {"SDO download", sdo_download},
    {"SDO upload", sdo_upload, sdo_download},
    {"FoE write", foe_write},
    {"FoE read", foe_read, foe_write},
    {"SoE write", soe_write},
    {"SoE read", soe_read, soe_write},
    {"AoE read", aoe_read, aoe_net_id},
    {"AoE write", aoe_write, aoe_net_id},
    {"VoE", voe_send},
    {"EoE parameters set", eoe_set_ip},
    {"EoE parameters read", eoe_get_ip, eoe_set_ip},
    {"object list", object_list},
};

class Interrupted : public testing::TestWithParam<Protocol> {
  protected:
    MailboxBus bus;
    void SetUp() override {
        bus.add_device(all::make());
        bus.start();
    }
    // Executes the operation without a disturbance. Returns the number of its steps.
    unsigned whole(std::unique_ptr<Attempt> (*make)(Context&), const std::string& when) {
        const auto one = make(*bus.ctx);
        unsigned steps = 0;
        for (; one->request->busy() && steps < 5000; ++steps) bus.step();
        EXPECT_EQ(one->request->state(), RequestState::success) << when << ": " << bus.words(one->request->error());
        EXPECT_TRUE(one->right()) << when;
        return steps;
    }
    unsigned whole(const std::string& when) {
        if (GetParam().before != nullptr) (void)whole(GetParam().before, when);
        return whole(GetParam().make, when);
    }
    // Ends the operation by `end` at each of its steps, and brings the slave back by `mend`.
    void at_each_step(const std::function<void(Request&)>& end, const std::function<void()>& mend) {
        const unsigned steps = whole("before");
        ASSERT_GT(steps, 0U);
        for (unsigned step = 0; step <= steps && !HasFailure(); ++step) {
            const auto when = std::string(GetParam().name) + ", step " + std::to_string(step);
            const auto one = GetParam().make(*bus.ctx);
            for (unsigned n = 0; n < step && one->request->busy(); ++n) bus.step();
            end(*one->request);
            bus.run(*one->request, 60s);
            const Error& error = one->request->error();
            if (one->request->state() == RequestState::success) {
                EXPECT_TRUE(one->right()) << when;
            } else {
                EXPECT_NE(error.code, Errc::none) << when;
            }
            mend();
            (void)whole(when);
        }
    }
    void to(AlState state) {
        StateRequest request;
        request.slave = 1;
        request.wanted = state;
        ASSERT_TRUE(submit(*bus.ctx, request).ok());
        bus.run(request);
        ASSERT_EQ(request.state(), RequestState::success) << bus.words(request.error());
    }
};
INSTANTIATE_TEST_SUITE_P(EachProtocol, Interrupted, testing::ValuesIn(kProtocols), [](const auto& one) {
    std::string name = one.param.name;
    std::erase(name, ' ');
    return name;
});

TEST_P(Interrupted, ByCancel) {
    at_each_step(
        [](Request& request) {
            request.cancel();
            EXPECT_FALSE(request.busy());
        },
        [] {});
}

TEST_P(Interrupted, ByInit) {
    at_each_step([this](Request&) { to(AlState::init); }, [this] { to(AlState::preop); });
}

TEST_P(Interrupted, ByALossOfPower) {
    at_each_step(
        [this](Request&) {
            bus.segment.set_power(0, false, bus.osal.now());
            bus.idle(2ms);
            bus.segment.set_power(0, true, bus.osal.now());
        },
        [this] {
            bus.idle(100ms);
            const auto found = config_init(*bus.ctx);
            ASSERT_TRUE(found.ok()) << bus.words(found.error());
        });
}

// A new scan during the operation closes all mailboxes.
TEST_P(Interrupted, ByAScan) {
    at_each_step(
        [this](Request&) {
            const auto found = config_init(*bus.ctx);
            ASSERT_TRUE(found.ok()) << bus.words(found.error());
        },
        [] {});
}

}  // namespace
}  // namespace margay
