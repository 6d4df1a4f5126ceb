// For systems with a heap: a context that owns its memory. Nothing of the library includes this.
#pragma once

#include <margay/context.hpp>

#include <memory>
#include <utility>

namespace margay {

// A context that allocates its memory once, when it is made.
class HostContext : public Context {
  public:
    explicit HostContext(const Limits& limits = {})
        : HostContext(std::make_unique<std::byte[]>(context_bytes(limits)), limits) {}
    ~HostContext() { close(); }

  private:
    HostContext(std::unique_ptr<std::byte[]> memory, const Limits& limits)
        : Context({memory.get(), context_bytes(limits)}, limits), owned_(std::move(memory)) {}
    std::unique_ptr<std::byte[]> owned_;
};

}  // namespace margay
