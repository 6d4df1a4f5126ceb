// A context for tests that fill its arena. Coroutine frames need several times as much memory in sanitized builds,
// which the sizes in the library do not include. Therefore the arena is larger in these builds, and full at about the
// same moments.
#pragma once

#include <margay/context.hpp>

#include <memory>

namespace margay::storm {

class RoomyContext : public Context {
  public:
    explicit RoomyContext(const Limits& limits) : RoomyContext(std::make_unique<std::byte[]>(bytes(limits)), limits) {}
    ~RoomyContext() { close(); }

  private:
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    static constexpr std::size_t kTimes = 4;
#else
    static constexpr std::size_t kTimes = 1;
#endif
    // The memory that the tables do not use is the arena.
    static constexpr std::size_t bytes(const Limits& limits) { return kTimes * context_bytes(limits); }

    RoomyContext(std::unique_ptr<std::byte[]> memory, const Limits& limits)
        : Context({memory.get(), bytes(limits)}, limits), owned_(std::move(memory)) {}
    std::unique_ptr<std::byte[]> owned_;
};

}  // namespace margay::storm
