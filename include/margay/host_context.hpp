// For systems with a heap: a context that owns its memory. The library itself does not include this header.
#pragma once

#include <margay/context.hpp>

#include <memory>
#include <utility>

namespace margay {

// A context that allocates its memory once, in its constructor.
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
